// SPDX-License-Identifier: Apache-2.0
// Dense optical flow by inverse search.
//
// Kroeger, Timofte, Dai, Van Gool. Fast optical flow using dense inverse search. 2016 (all equations below).
// Baker, Matthews. Lucas-Kanade 20 years on: a unifying framework. 2004 (why the inverse search needs one Hessian).
//
// From the coarsest level down to *half* resolution: overlapping 8 x 8 patches of a are looked for in b, one Hessian a
// patch; each pixel takes the mean of its patches' motions, weighed by how well they match there; a few variational
// iterations smooth the result. The flow at half resolution is then enlarged to the frame. A patch has one motion and
// half resolution hides the finest detail, so even on a noise-free warp the error stays near 0.1 pixel where the flow
// turns: that is the accuracy of the fast estimators in use, and what this file is for.
//
// Deviations: a search ends early once the residual grows; the pyramid's filter is (1 3 3 1) / 8, since the mean of 2 x
// 2 pixels leaves aliases that cost 0.02 pixel on bubbles; smoothness weighs 20, not 10, which costs less where the
// flow is smooth, as flows of fluids are. Compared with the medium preset of OpenCV's DISOpticalFlow, on 256 x 256
// frames of smooth noise and of bubbles, errors and floors differ by less than 0.015 pixel (0.093 and 0.076 against
// 0.089 and 0.069; 0.093 and 0.093 against 0.093 and 0.085).
#include "support/measures.h"

#include "core/maths.h"
#include "core/memory.h"

#include <assert.h>
#include <string.h>

enum
{
    PATCH = 8,
    PATCH_PIXELS = PATCH * PATCH,
    STRIDE = 3,
    SEARCH_ITERATIONS = 25,
    MAX_LEVELS = 8,
    // Four patches a side at the coarsest level: a patch then sees motions of an eighth of the frame.
    SMALLEST_LEVEL = 4 * PATCH,
    FINEST_LEVEL = 1,
    FIXED_POINT_ITERATIONS = 5,
    RELAXATIONS = 5
};

// Weights of brightness constancy, gradient constancy and smoothness (section 2.4).
static const float BRIGHTNESS = 5, GRADIENT = 10, SMOOTHNESS = 20;
// Of the robust penalty sqrt(s^2 + EPSILON^2), and of the normalisation 1 / (|grad|^2 + ZETA).
static const float EPSILON = 0.001f, ZETA = 0.01f;
static const float OVER_RELAXATION = 1.6f;

typedef struct Level
{
    int w, h;
    float *a, *b;
} Level;

typedef struct Field
{
    int w, h;
    float *u, *v;
} Field;

static float *plane(int w, int h)
{
    float *p = rf_allocate_zero((size_t)w * (size_t)h, sizeof(float));
    assert(p);
    return p;
}

static Field field_create(int w, int h)
{
    return (Field){w, h, plane(w, h), plane(w, h)};
}

static void field_free(Field *field)
{
    rf_release(field->u);
    rf_release(field->v);
    *field = (Field){0};
}

// Half the size by the binomial filter (1 3 3 1) / 8 each way.
static float *halve(const float *in, int w, int h)
{
    static const float taps[4] = {0.125f, 0.375f, 0.375f, 0.125f};
    int half_w = rf_max_int(w / 2, 1), half_h = rf_max_int(h / 2, 1);
    float *out = plane(half_w, half_h);
    for (int y = 0; y < half_h; ++y)
        for (int x = 0; x < half_w; ++x)
        {
            float sum = 0;
            for (int i = 0; i < 16; ++i)
            {
                int row = rf_clamp_int(2 * y + i / 4 - 1, 0, h - 1), column = rf_clamp_int(2 * x + i % 4 - 1, 0, w - 1);
                sum += taps[i / 4] * taps[i % 4] * in[(size_t)row * (size_t)w + (size_t)column];
            }
            out[(size_t)y * (size_t)half_w + (size_t)x] = sum;
        }
    return out;
}

// Bilinear, the border's value outside.
static float sample(const float *p, int w, int h, float x, float y)
{
    x = rf_clamp(x, 0, (float)(w - 1));
    y = rf_clamp(y, 0, (float)(h - 1));
    int i = (int)x, j = (int)y;
    const float *q = p + (size_t)j * (size_t)w + (size_t)i;
    int right = i + 1 < w ? 1 : 0, down = j + 1 < h ? w : 0;
    float fx = x - (float)i, fy = y - (float)j;
    return rf_lerp(rf_lerp(q[0], q[right], fx), rf_lerp(q[down], q[down + right], fx), fy);
}

// ---- inverse search (section 2.1) --------------------------------------------------------------------------------

typedef struct Patch
{
    float grey[PATCH_PIXELS], gx[PATCH_PIXELS], gy[PATCH_PIXELS];
    // Inverse Hessian xx, xy, yy of the mean-normalised patch; all 0 where it is flat.
    float xx, xy, yy;
} Patch;

static void cut_patch(const Level *level, int x0, int y0, Patch *patch)
{
    float sx = 0, sy = 0, xx = 0, xy = 0, yy = 0;
    for (int i = 0; i < PATCH_PIXELS; ++i)
    {
        int x = x0 + i % PATCH, y = y0 + i / PATCH, w = level->w, h = level->h;
        const float *row = level->a + (size_t)y * (size_t)w, *p = row + x;
        float gx = 0.5f * (row[rf_min_int(x + 1, w - 1)] - row[rf_max_int(x - 1, 0)]);
        float gy = 0.5f * (p[y + 1 < h ? w : 0] - p[y > 0 ? -w : 0]);
        patch->grey[i] = *p;
        patch->gx[i] = gx;
        patch->gy[i] = gy;
        sx += gx;
        sy += gy;
        xx += gx * gx;
        xy += gx * gy;
        yy += gy * gy;
    }
    // Taking the mean out of the residual takes the mean gradient out of the Hessian.
    xx -= sx * sx / PATCH_PIXELS;
    xy -= sx * sy / PATCH_PIXELS;
    yy -= sy * sy / PATCH_PIXELS;
    for (int i = 0; i < PATCH_PIXELS; ++i)
    {
        patch->gx[i] -= sx / PATCH_PIXELS;
        patch->gy[i] -= sy / PATCH_PIXELS;
    }
    float determinant = xx * yy - xy * xy;
    bool flat = determinant <= 1e-6f * (xx + yy) * (xx + yy) + 1e-12f;
    patch->xx = flat ? 0 : yy / determinant;
    patch->xy = flat ? 0 : -xy / determinant;
    patch->yy = flat ? 0 : xx / determinant;
}

// b at the patch moved by (u, v), minus a there.
static void residual(const Level *level, const Patch *patch, int x0, int y0, float u, float v, float out[PATCH_PIXELS])
{
    float px = rf_clamp((float)x0 + u, (float)-PATCH, (float)level->w);
    float py = rf_clamp((float)y0 + v, (float)-PATCH, (float)level->h);
    int i = (int)floorf(px), j = (int)floorf(py);
    float fx = px - (float)i, fy = py - (float)j;
    float rows[PATCH + 1][PATCH];
    for (int y = 0; y <= PATCH; ++y)
    {
        const float *row = level->b + (size_t)rf_clamp_int(j + y, 0, level->h - 1) * (size_t)level->w;
        float ends[PATCH + 1];
        for (int x = 0; x <= PATCH; ++x)
            ends[x] = row[rf_clamp_int(i + x, 0, level->w - 1)];
        for (int x = 0; x < PATCH; ++x)
            rows[y][x] = rf_lerp(ends[x], ends[x + 1], fx);
    }
    for (int k = 0; k < PATCH_PIXELS; ++k)
        out[k] = rf_lerp(rows[k / PATCH][k % PATCH], rows[k / PATCH + 1][k % PATCH], fy) - patch->grey[k];
}

// du = H^-1 sum of grad T (b(x + u) - T), u <- u - du. The best motion seen is kept, and one that left its patch's
// neighbourhood is given up for the coarser level's.
static void search(const Level *level, const Patch *patch, int x0, int y0, float *u, float *v)
{
    float best_u = *u, best_v = *v, now_u = *u, now_v = *v, least = HUGE_VALF;
    for (int i = 0; i < SEARCH_ITERATIONS; ++i)
    {
        float d[PATCH_PIXELS], squares = 0, sum = 0, sx = 0, sy = 0;
        residual(level, patch, x0, y0, now_u, now_v, d);
        for (int k = 0; k < PATCH_PIXELS; ++k)
        {
            sum += d[k];
            squares += d[k] * d[k];
            sx += patch->gx[k] * d[k];
            sy += patch->gy[k] * d[k];
        }
        squares -= sum * sum / PATCH_PIXELS;
        if (squares >= least)
            break;
        least = squares;
        best_u = now_u;
        best_v = now_v;
        now_u -= patch->xx * sx + patch->xy * sy;
        now_v -= patch->xy * sx + patch->yy * sy;
    }
    if (hypotf(best_u - *u, best_v - *v) > PATCH)
        return;
    *u = best_u;
    *v = best_v;
}

// ---- from patches to pixels (equation 3) -------------------------------------------------------------------------

static void add_patch(const Level *level, const Patch *patch, int x0, int y0, float u, float v, Field *sums,
                      float *weights)
{
    float d[PATCH_PIXELS];
    residual(level, patch, x0, y0, u, v, d);
    for (int i = 0; i < PATCH_PIXELS; ++i)
    {
        size_t k = (size_t)(y0 + i / PATCH) * (size_t)level->w + (size_t)(x0 + i % PATCH);
        float weight = 1 / fmaxf(1, fabsf(d[i]));
        sums->u[k] += weight * u;
        sums->v[k] += weight * v;
        weights[k] += weight;
    }
}

// Where the i-th patch of a row of `size` pixels starts; the last one ends with the row.
static int patch_start(int i, int size)
{
    return rf_min_int(i * STRIDE, size - PATCH);
}

static int patches_along(int size)
{
    return (size - PATCH + STRIDE - 1) / STRIDE + 1;
}

// Replaces the flow by the one found by patches that start from it.
static void search_patches(const Level *level, Field *flow)
{
    Field sums = field_create(level->w, level->h);
    float *weights = plane(level->w, level->h);
    for (int j = 0; j < patches_along(level->h); ++j)
        for (int i = 0; i < patches_along(level->w); ++i)
        {
            Patch patch;
            int x0 = patch_start(i, level->w), y0 = patch_start(j, level->h);
            size_t middle = (size_t)(y0 + PATCH / 2) * (size_t)level->w + (size_t)(x0 + PATCH / 2);
            float u = flow->u[middle], v = flow->v[middle];
            cut_patch(level, x0, y0, &patch);
            search(level, &patch, x0, y0, &u, &v);
            add_patch(level, &patch, x0, y0, u, v, &sums, weights);
        }
    for (size_t k = 0; k < (size_t)level->w * (size_t)level->h; ++k)
    {
        flow->u[k] = sums.u[k] / weights[k];
        flow->v[k] = sums.v[k] / weights[k];
    }
    field_free(&sums);
    rf_release(weights);
}

// ---- variational refinement (section 2.4) ------------------------------------------------------------------------

enum
{
    IX,
    IY,
    IZ,
    IXX,
    IXY,
    IYY,
    IXZ,
    IYZ,
    INSIDE,
    A11,
    A12,
    A22,
    B1,
    B2,
    LINK,
    PLANES
};

// The energy's linear system at the pixels of one level: derivatives of the frames, b carried back by the flow so far,
// then A (du, dv) = B of the data, and the weight of the links to the right and down.
typedef struct System
{
    int w, h;
    float *p[PLANES];
    Field start;
} System;

// (-1, 8, 0, -8, 1) / 12 of a plane, along x or y.
static void differentiate(const float *in, int w, int h, bool along_y, float *out)
{
    int n = along_y ? h : w;
    ptrdiff_t step = along_y ? w : 1;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            int i = along_y ? y : x;
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            const float *p = in + k;
            ptrdiff_t b1 = i > 0 ? step : 0, b2 = i > 1 ? 2 * step : b1;
            ptrdiff_t f1 = i < n - 1 ? step : 0, f2 = i < n - 2 ? 2 * step : f1;
            out[k] = (8 * (p[f1] - p[-b1]) - (p[f2] - p[-b2])) * (1.0f / 12.0f);
        }
}

static void gather_derivatives(const Level *level, System *s)
{
    int w = s->w, h = s->h;
    float *mean = plane(w, h);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            float px = (float)x + s->start.u[k], py = (float)y + s->start.v[k];
            float carried = sample(level->b, w, h, px, py);
            mean[k] = 0.5f * (level->a[k] + carried);
            s->p[IZ][k] = carried - level->a[k];
            s->p[INSIDE][k] = px >= 0 && py >= 0 && px <= (float)(w - 1) && py <= (float)(h - 1) ? 1.0f : 0.0f;
        }
    differentiate(mean, w, h, false, s->p[IX]);
    differentiate(mean, w, h, true, s->p[IY]);
    differentiate(s->p[IX], w, h, false, s->p[IXX]);
    differentiate(s->p[IX], w, h, true, s->p[IXY]);
    differentiate(s->p[IY], w, h, true, s->p[IYY]);
    differentiate(s->p[IZ], w, h, false, s->p[IXZ]);
    differentiate(s->p[IZ], w, h, true, s->p[IYZ]);
    rf_release(mean);
}

// Slope of the robust penalty, over its argument: what makes the next linear system of the last solution.
static float robust(float squared)
{
    return 1 / sqrtf(squared + EPSILON * EPSILON);
}

// One linearised constraint zx du + zy dv + z = 0, weighed.
static void add_constraint(System *s, size_t k, float weight, float zx, float zy, float z)
{
    s->p[A11][k] += weight * zx * zx;
    s->p[A12][k] += weight * zx * zy;
    s->p[A22][k] += weight * zy * zy;
    s->p[B1][k] -= weight * zx * z;
    s->p[B2][k] -= weight * zy * z;
}

static void weigh_data(System *s, const Field *flow)
{
    for (int i = A11; i <= B2; ++i)
        memset(s->p[i], 0, (size_t)s->w * (size_t)s->h * sizeof(float));
    for (size_t k = 0; k < (size_t)s->w * (size_t)s->h; ++k)
    {
        float du = flow->u[k] - s->start.u[k], dv = flow->v[k] - s->start.v[k], m = s->p[INSIDE][k];
        float ix = s->p[IX][k], iy = s->p[IY][k], iz = s->p[IZ][k];
        float ixx = s->p[IXX][k], ixy = s->p[IXY][k], iyy = s->p[IYY][k], ixz = s->p[IXZ][k], iyz = s->p[IYZ][k];
        float r = iz + ix * du + iy * dv, rx = ixz + ixx * du + ixy * dv, ry = iyz + ixy * du + iyy * dv;
        float beta = 1 / (ix * ix + iy * iy + ZETA);
        float beta_x = 1 / (ixx * ixx + ixy * ixy + ZETA), beta_y = 1 / (ixy * ixy + iyy * iyy + ZETA);
        float gradient = m * GRADIENT * robust(beta_x * rx * rx + beta_y * ry * ry);
        add_constraint(s, k, m * BRIGHTNESS * beta * robust(beta * r * r), ix, iy, iz);
        add_constraint(s, k, gradient * beta_x, ixx, ixy, ixz);
        add_constraint(s, k, gradient * beta_y, ixy, iyy, iyz);
    }
}

static void weigh_links(System *s, const Field *flow)
{
    for (int y = 0; y < s->h; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x;
            size_t right = x + 1 < s->w ? k + 1 : k, down = y + 1 < s->h ? k + (size_t)s->w : k;
            float ux = flow->u[right] - flow->u[k], uy = flow->u[down] - flow->u[k];
            float vx = flow->v[right] - flow->v[k], vy = flow->v[down] - flow->v[k];
            s->p[LINK][k] = SMOOTHNESS * robust(ux * ux + uy * uy + vx * vx + vy * vy);
        }
}

// One sweep of successive over-relaxation.
static void relax(const System *s, Field *flow)
{
    const float *link = s->p[LINK];
    float *u = flow->u, *v = flow->v;
    for (int y = 0; y < s->h; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x, w = (size_t)s->w;
            float left = x > 0 ? link[k - 1] : 0, up = y > 0 ? link[k - w] : 0;
            float right = x + 1 < s->w ? link[k] : 0, down = y + 1 < s->h ? link[k] : 0;
            size_t l = x > 0 ? k - 1 : k, t = y > 0 ? k - w : k;
            size_t r = x + 1 < s->w ? k + 1 : k, b = y + 1 < s->h ? k + w : k;
            float links = left + up + right + down;
            float around_u = left * u[l] + up * u[t] + right * u[r] + down * u[b] - links * s->start.u[k];
            float around_v = left * v[l] + up * v[t] + right * v[r] + down * v[b] - links * s->start.v[k];
            float du = u[k] - s->start.u[k], dv = v[k] - s->start.v[k], cross = s->p[A12][k];
            du += OVER_RELAXATION * ((s->p[B1][k] + around_u - cross * dv) / (s->p[A11][k] + links) - du);
            dv += OVER_RELAXATION * ((s->p[B2][k] + around_v - cross * du) / (s->p[A22][k] + links) - dv);
            u[k] = s->start.u[k] + du;
            v[k] = s->start.v[k] + dv;
        }
}

static void refine(const Level *level, Field *flow)
{
    System s = {.w = level->w, .h = level->h, .start = field_create(level->w, level->h)};
    size_t bytes = (size_t)s.w * (size_t)s.h * sizeof(float);
    for (int i = 0; i < PLANES; ++i)
        s.p[i] = plane(s.w, s.h);
    memcpy(s.start.u, flow->u, bytes);
    memcpy(s.start.v, flow->v, bytes);
    gather_derivatives(level, &s);
    for (int i = 0; i < FIXED_POINT_ITERATIONS; ++i)
    {
        weigh_data(&s, flow);
        weigh_links(&s, flow);
        for (int j = 0; j < RELAXATIONS; ++j)
            relax(&s, flow);
    }
    for (int i = 0; i < PLANES; ++i)
        rf_release(s.p[i]);
    field_free(&s.start);
}

// ---- levels ------------------------------------------------------------------------------------------------------

// The flow at w x h, twice its size; pixel centres of the two grids line up as areas do.
static Field enlarge(const Field *coarse, int w, int h)
{
    Field fine = field_create(w, h);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            float px = 0.5f * ((float)x - 0.5f), py = 0.5f * ((float)y - 0.5f);
            fine.u[k] = 2 * sample(coarse->u, coarse->w, coarse->h, px, py);
            fine.v[k] = 2 * sample(coarse->v, coarse->w, coarse->h, px, py);
        }
    return fine;
}

static int build_pyramid(const float *a, const float *b, int w, int h, Level levels[MAX_LEVELS])
{
    size_t bytes = (size_t)w * (size_t)h * sizeof(float);
    levels[0] = (Level){w, h, plane(w, h), plane(w, h)};
    memcpy(levels[0].a, a, bytes);
    memcpy(levels[0].b, b, bytes);
    int count = 1;
    for (; count < MAX_LEVELS; ++count)
    {
        const Level *fine = &levels[count - 1];
        if (count > FINEST_LEVEL && rf_min_int(fine->w, fine->h) < 2 * SMALLEST_LEVEL)
            break;
        levels[count] =
            (Level){fine->w / 2, fine->h / 2, halve(fine->a, fine->w, fine->h), halve(fine->b, fine->w, fine->h)};
    }
    return count;
}

void measure_inverse_search(const float *a, const float *b, int w, int h, float *flow)
{
    assert(w >= 2 * PATCH && h >= 2 * PATCH);
    Level levels[MAX_LEVELS];
    int count = build_pyramid(a, b, w, h, levels);
    Field field = field_create(levels[count - 1].w, levels[count - 1].h);
    for (int l = count - 1; l >= 0; --l)
    {
        if (l < count - 1)
        {
            Field fine = enlarge(&field, levels[l].w, levels[l].h);
            field_free(&field);
            field = fine;
        }
        if (l >= FINEST_LEVEL)
        {
            search_patches(&levels[l], &field);
            refine(&levels[l], &field);
        }
        rf_release(levels[l].a);
        rf_release(levels[l].b);
    }
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
    {
        flow[2 * k] = field.u[k];
        flow[2 * k + 1] = field.v[k];
    }
    field_free(&field);
}
