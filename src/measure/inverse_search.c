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
#include "measure/optical_flow.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"

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
// A patch with fewer pixels that count keeps the coarser level's motion.
static const float LEAST_PIXELS = PATCH_PIXELS / 4;

typedef struct Level
{
    int w, h;
    float *a, *b;
    /// What counts, 0 to 1; NULL: everything.
    float *weight_a, *weight_b;
} Level;

// Planes of one size; smaller levels use their beginning.
typedef struct Field
{
    float *u, *v;
} Field;

typedef struct Patch
{
    float grey[PATCH_PIXELS], gx[PATCH_PIXELS], gy[PATCH_PIXELS], weight[PATCH_PIXELS];
    float total;
    // Inverse Hessian xx, xy, yy of the mean-normalised patch; all 0 where it is flat.
    float xx, xy, yy;
} Patch;

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
    MEAN,
    PLANES
};

// The flow so far, and what improving it needs: the patches' motions; and the energy's linear system at the pixels of
// one level: derivatives of the frames, b carried back by the flow at the start, then A (du, dv) = B of the data, and
// the weight of the links to the right and down.
typedef struct Solver
{
    Level levels[MAX_LEVELS];
    int level_count;
    const Level *level;
    Field flow, start;
    /// A motion a patch, row by row.
    Field patches;
    float *p[PLANES];
} Solver;

// Bilinear, the border's value outside.
static inline float sample(const float *p, int w, int h, float x, float y)
{
    x = rf_clamp(x, 0, (float)(w - 1));
    y = rf_clamp(y, 0, (float)(h - 1));
    int i = (int)x, j = (int)y;
    const float *q = p + (size_t)j * (size_t)w + (size_t)i;
    int right = i + 1 < w ? 1 : 0, down = j + 1 < h ? w : 0;
    float fx = x - (float)i, fy = y - (float)j;
    return rf_lerp(rf_lerp(q[0], q[right], fx), rf_lerp(q[down], q[down + right], fx), fy);
}

// ---- pyramid -----------------------------------------------------------------------------------------------------

// Half the size by the binomial filter (1 3 3 1) / 8 each way.
static void halve(const float *in, int w, int h, float *out)
{
    static const float taps[4] = {0.125f, 0.375f, 0.375f, 0.125f};
    int half_w = rf_max_int(w / 2, 1), half_h = rf_max_int(h / 2, 1);
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
}

static void build_pyramid(Solver *s)
{
    for (int l = 1; l < s->level_count; ++l)
    {
        const Level *fine = &s->levels[l - 1], *coarse = &s->levels[l];
        float *const from[] = {fine->a, fine->b, fine->weight_a, fine->weight_b};
        float *const to[] = {coarse->a, coarse->b, coarse->weight_a, coarse->weight_b};
        for (int i = 0; i < 4; ++i)
            if (from[i])
                halve(from[i], fine->w, fine->h, to[i]);
    }
}

// ---- inverse search (section 2.1) --------------------------------------------------------------------------------

static void cut_patch(const Level *level, int x0, int y0, Patch *patch)
{
    float sx = 0, sy = 0, xx = 0, xy = 0, yy = 0, total = 0;
    for (int i = 0; i < PATCH_PIXELS; ++i)
    {
        int x = x0 + i % PATCH, y = y0 + i / PATCH, w = level->w, h = level->h;
        const float *row = level->a + (size_t)y * (size_t)w, *p = row + x;
        float gx = 0.5f * (row[rf_min_int(x + 1, w - 1)] - row[rf_max_int(x - 1, 0)]);
        float gy = 0.5f * (p[y + 1 < h ? w : 0] - p[y > 0 ? -w : 0]);
        float m = level->weight_a ? level->weight_a[(size_t)y * (size_t)w + (size_t)x] : 1;
        patch->grey[i] = *p;
        patch->gx[i] = gx;
        patch->gy[i] = gy;
        patch->weight[i] = m;
        total += m;
        sx += m * gx;
        sy += m * gy;
        xx += m * gx * gx;
        xy += m * gx * gy;
        yy += m * gy * gy;
    }
    // Taking the mean out of the residual takes the mean gradient out of the Hessian.
    float share = 1 / rf_max(total, 1e-6f);
    xx -= sx * sx * share;
    xy -= sx * sy * share;
    yy -= sy * sy * share;
    for (int i = 0; i < PATCH_PIXELS; ++i)
    {
        patch->gx[i] = patch->weight[i] * (patch->gx[i] - sx * share);
        patch->gy[i] = patch->weight[i] * (patch->gy[i] - sy * share);
    }
    float determinant = xx * yy - xy * xy;
    bool flat = determinant <= 1e-6f * (xx + yy) * (xx + yy) + 1e-12f || total < LEAST_PIXELS;
    patch->total = rf_max(total, 1e-6f);
    patch->xx = flat ? 0 : yy / determinant;
    patch->xy = flat ? 0 : -xy / determinant;
    patch->yy = flat ? 0 : xx / determinant;
}

// b at the patch moved by (u, v), minus a there.
static void residual(const Level *level, const float *grey, int x0, int y0, float u, float v, float out[PATCH_PIXELS])
{
    float px = rf_clamp((float)x0 + u, (float)-PATCH, (float)level->w);
    float py = rf_clamp((float)y0 + v, (float)-PATCH, (float)level->h);
    int i = (int)floorf(px), j = (int)floorf(py);
    float fx = px - (float)i, fy = py - (float)j;
    float rows[PATCH + 1][PATCH];
    bool inside = i >= 0 && i + PATCH < level->w;
    for (int y = 0; y <= PATCH; ++y)
    {
        const float *row = level->b + (size_t)rf_clamp_int(j + y, 0, level->h - 1) * (size_t)level->w;
        float ends[PATCH + 1];
        for (int x = 0; x <= PATCH; ++x)
            ends[x] = row[inside ? i + x : rf_clamp_int(i + x, 0, level->w - 1)];
        for (int x = 0; x < PATCH; ++x)
            rows[y][x] = rf_lerp(ends[x], ends[x + 1], fx);
    }
    for (int y = 0; y < PATCH; ++y)
        for (int x = 0; x < PATCH; ++x)
            out[y * PATCH + x] = rf_lerp(rows[y][x], rows[y + 1][x], fy) - grey[y * PATCH + x];
}

// du = H^-1 sum of grad T (b(x + u) - T), u <- u - du. The best motion seen is kept, and one that left its patch's
// neighbourhood is given up for the coarser level's.
static void search(const Level *level, const Patch *patch, int x0, int y0, float *u, float *v)
{
    float best_u = *u, best_v = *v, now_u = *u, now_v = *v, least = HUGE_VALF;
    for (int i = 0; i < SEARCH_ITERATIONS; ++i)
    {
        float d[PATCH_PIXELS], squares = 0, sum = 0, sx = 0, sy = 0;
        residual(level, patch->grey, x0, y0, now_u, now_v, d);
        for (int k = 0; k < PATCH_PIXELS; ++k)
        {
            sum += patch->weight[k] * d[k];
            squares += patch->weight[k] * d[k] * d[k];
            sx += patch->gx[k] * d[k];
            sy += patch->gy[k] * d[k];
        }
        squares -= sum * sum / patch->total;
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

// Where the i-th patch of a row of `size` pixels starts; the last one ends with the row.
static int patch_start(int i, int size)
{
    return rf_min_int(i * STRIDE, size - PATCH);
}

static int patches_along(int size)
{
    return (size - PATCH + STRIDE - 1) / STRIDE + 1;
}

static void search_row(void *context, int j, int worker)
{
    (void)worker;
    Solver *s = context;
    const Level *level = s->level;
    int across = patches_along(level->w), y0 = patch_start(j, level->h);
    for (int i = 0; i < across; ++i)
    {
        Patch patch;
        int x0 = patch_start(i, level->w);
        size_t middle = (size_t)(y0 + PATCH / 2) * (size_t)level->w + (size_t)(x0 + PATCH / 2);
        size_t k = (size_t)j * (size_t)across + (size_t)i;
        s->patches.u[k] = s->flow.u[middle];
        s->patches.v[k] = s->flow.v[middle];
        cut_patch(level, x0, y0, &patch);
        search(level, &patch, x0, y0, &s->patches.u[k], &s->patches.v[k]);
    }
}

// ---- from patches to pixels (equation 3) -------------------------------------------------------------------------

// Adds what one patch says about rows y0 to y1 to the sums of motions and of weights.
static void add_patch(const Solver *s, int patch_x, int patch_y, size_t patch, int y0, int y1)
{
    const Level *level = s->level;
    float d[PATCH_PIXELS], grey[PATCH_PIXELS], u = s->patches.u[patch], v = s->patches.v[patch];
    for (int i = 0; i < PATCH_PIXELS; ++i)
        grey[i] = level->a[(size_t)(patch_y + i / PATCH) * (size_t)level->w + (size_t)(patch_x + i % PATCH)];
    residual(level, grey, patch_x, patch_y, u, v, d);
    for (int y = rf_max_int(y0, patch_y); y < rf_min_int(y1, patch_y + PATCH); ++y)
        for (int x = 0; x < PATCH; ++x)
        {
            size_t k = (size_t)y * (size_t)level->w + (size_t)(patch_x + x);
            float weight = 1 / rf_max(1, fabsf(d[(y - patch_y) * PATCH + x]));
            if (level->weight_a)
                weight *= rf_max(level->weight_a[k], 1e-3f);
            s->start.u[k] += weight * u;
            s->start.v[k] += weight * v;
            s->p[MEAN][k] += weight;
        }
}

// The new flow, in s->start.
static void gather_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    int w = s->level->w, h = s->level->h, across = patches_along(w);
    size_t first = (size_t)y0 * (size_t)w, count = (size_t)(y1 - y0) * (size_t)w;
    float *planes[] = {s->start.u, s->start.v, s->p[MEAN]};
    for (int i = 0; i < 3; ++i)
        memset(planes[i] + first, 0, count * sizeof(float));
    for (int j = 0; j < patches_along(h); ++j)
    {
        int patch_y = patch_start(j, h);
        if (patch_y + PATCH <= y0 || patch_y >= y1)
            continue;
        for (int i = 0; i < across; ++i)
            add_patch(s, patch_start(i, w), patch_y, (size_t)j * (size_t)across + (size_t)i, y0, y1);
    }
    for (size_t k = first; k < first + count; ++k)
    {
        s->start.u[k] /= s->p[MEAN][k];
        s->start.v[k] /= s->p[MEAN][k];
    }
}

// ---- variational refinement (section 2.4) ------------------------------------------------------------------------

// (-1, 8, 0, -8, 1) / 12 of row y of a plane, along x or y.
static void differentiate_row(const float *in, int w, int h, int y, bool along_y, float *out)
{
    int n = along_y ? h : w;
    ptrdiff_t step = along_y ? w : 1;
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

// b carried back, its difference from a, and the mean of both.
static void carry_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    const Level *level = s->level;
    int w = level->w, h = level->h;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            float px = (float)x + s->start.u[k], py = (float)y + s->start.v[k];
            float carried = sample(level->b, w, h, px, py);
            bool inside = px >= 0 && py >= 0 && px <= (float)(w - 1) && py <= (float)(h - 1);
            float weight = inside ? 1.0f : 0.0f;
            if (inside && level->weight_a)
                weight = level->weight_a[k];
            if (inside && level->weight_b)
                weight *= level->weight_b[(size_t)(py + 0.5f) * (size_t)w + (size_t)(px + 0.5f)];
            s->p[MEAN][k] = 0.5f * (level->a[k] + carried);
            s->p[IZ][k] = carried - level->a[k];
            s->p[INSIDE][k] = weight;
        }
}

typedef struct Derivative
{
    int from, to;
    bool along_y;
} Derivative;

static void first_derivative_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    static const Derivative derivatives[] = {{MEAN, IX, false}, {MEAN, IY, true}, {IZ, IXZ, false}, {IZ, IYZ, true}};
    for (int y = y0; y < y1; ++y)
        for (size_t i = 0; i < sizeof derivatives / sizeof *derivatives; ++i)
            differentiate_row(s->p[derivatives[i].from], s->level->w, s->level->h, y, derivatives[i].along_y,
                              s->p[derivatives[i].to]);
}

static void second_derivative_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    static const Derivative derivatives[] = {{IX, IXX, false}, {IX, IXY, true}, {IY, IYY, true}};
    for (int y = y0; y < y1; ++y)
        for (size_t i = 0; i < sizeof derivatives / sizeof *derivatives; ++i)
            differentiate_row(s->p[derivatives[i].from], s->level->w, s->level->h, y, derivatives[i].along_y,
                              s->p[derivatives[i].to]);
}

// Slope of the robust penalty, over its argument: what makes the next linear system of the last solution.
static inline float robust(float squared)
{
    return 1 / sqrtf(squared + EPSILON * EPSILON);
}

// One linearised constraint zx du + zy dv + z = 0, weighed.
static inline void add_constraint(float a[5], float weight, float zx, float zy, float z)
{
    a[0] += weight * zx * zx;
    a[1] += weight * zx * zy;
    a[2] += weight * zy * zy;
    a[3] -= weight * zx * z;
    a[4] -= weight * zy * z;
}

static void weigh_data(const Solver *s, size_t k)
{
    float du = s->flow.u[k] - s->start.u[k], dv = s->flow.v[k] - s->start.v[k], m = s->p[INSIDE][k];
    float ix = s->p[IX][k], iy = s->p[IY][k], iz = s->p[IZ][k];
    float ixx = s->p[IXX][k], ixy = s->p[IXY][k], iyy = s->p[IYY][k], ixz = s->p[IXZ][k], iyz = s->p[IYZ][k];
    float r = iz + ix * du + iy * dv, rx = ixz + ixx * du + ixy * dv, ry = iyz + ixy * du + iyy * dv;
    float beta = 1 / (ix * ix + iy * iy + ZETA);
    float beta_x = 1 / (ixx * ixx + ixy * ixy + ZETA), beta_y = 1 / (ixy * ixy + iyy * iyy + ZETA);
    float gradient = m * GRADIENT * robust(beta_x * rx * rx + beta_y * ry * ry), a[5] = {0};
    add_constraint(a, m * BRIGHTNESS * beta * robust(beta * r * r), ix, iy, iz);
    add_constraint(a, gradient * beta_x, ixx, ixy, ixz);
    add_constraint(a, gradient * beta_y, ixy, iyy, iyz);
    for (int i = 0; i < 5; ++i)
        s->p[A11 + i][k] = a[i];
}

static void weigh_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    int w = s->level->w, h = s->level->h;
    const float *u = s->flow.u, *v = s->flow.v;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            size_t right = x + 1 < w ? k + 1 : k, down = y + 1 < h ? k + (size_t)w : k;
            float ux = u[right] - u[k], uy = u[down] - u[k], vx = v[right] - v[k], vy = v[down] - v[k];
            s->p[LINK][k] = SMOOTHNESS * robust(ux * ux + uy * uy + vx * vx + vy * vy);
            weigh_data(s, k);
        }
}

// One sweep of successive over-relaxation, in order: its result depends on it.
static void relax(const Solver *s)
{
    const float *link = s->p[LINK];
    float *u = s->flow.u, *v = s->flow.v;
    int width = s->level->w, h = s->level->h;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < width; ++x)
        {
            size_t w = (size_t)width, k = (size_t)y * w + (size_t)x;
            float left = x > 0 ? link[k - 1] : 0, up = y > 0 ? link[k - w] : 0;
            float right = x + 1 < width ? link[k] : 0, down = y + 1 < h ? link[k] : 0;
            size_t l = x > 0 ? k - 1 : k, t = y > 0 ? k - w : k;
            size_t r = x + 1 < width ? k + 1 : k, b = y + 1 < h ? k + w : k;
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

// From s->start to s->flow.
static void refine(Solver *s)
{
    size_t bytes = (size_t)s->level->w * (size_t)s->level->h * sizeof(float);
    int w = s->level->w, h = s->level->h;
    memcpy(s->flow.u, s->start.u, bytes);
    memcpy(s->flow.v, s->start.v, bytes);
    rf_measure_rows(w, h, carry_rows, s);
    rf_measure_rows(w, h, first_derivative_rows, s);
    rf_measure_rows(w, h, second_derivative_rows, s);
    for (int i = 0; i < FIXED_POINT_ITERATIONS; ++i)
    {
        rf_measure_rows(w, h, weigh_rows, s);
        for (int j = 0; j < RELAXATIONS; ++j)
            relax(s);
    }
}

// ---- levels ------------------------------------------------------------------------------------------------------

// The flow of a level in s->start, twice its size, at the next one's pixels in s->flow; pixel centres of the two line
// up as areas do.
static void enlarge_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Solver *s = context;
    const Level *coarse = s->level + 1;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < s->level->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->level->w + (size_t)x;
            float px = 0.5f * ((float)x - 0.5f), py = 0.5f * ((float)y - 0.5f);
            s->flow.u[k] = 2 * sample(s->start.u, coarse->w, coarse->h, px, py);
            s->flow.v[k] = 2 * sample(s->start.v, coarse->w, coarse->h, px, py);
        }
}

static void enlarge(Solver *s)
{
    size_t bytes = (size_t)s->level[1].w * (size_t)s->level[1].h * sizeof(float);
    memcpy(s->start.u, s->flow.u, bytes);
    memcpy(s->start.v, s->flow.v, bytes);
    rf_measure_rows(s->level->w, s->level->h, enlarge_rows, s);
}

static bool add_level(Solver *s, const RfFramePair *pair, int w, int h, RfArena *arena)
{
    size_t pixels = (size_t)w * (size_t)h;
    Level *level = &s->levels[s->level_count++];
    *level = (Level){
        w, h, rf_arena_push(arena, pixels, sizeof(float)), rf_arena_push(arena, pixels, sizeof(float)), NULL, NULL};
    if (pair->mask_a)
        level->weight_a = rf_arena_push(arena, pixels, sizeof(float));
    if (pair->mask_b)
        level->weight_b = rf_arena_push(arena, pixels, sizeof(float));
    return level->a && level->b && (!pair->mask_a || level->weight_a) && (!pair->mask_b || level->weight_b);
}

static bool allocate(Solver *s, const RfFramePair *pair, RfArena *arena)
{
    int w = pair->w, h = pair->h;
    bool complete = add_level(s, pair, w, h, arena);
    while (complete && s->level_count < MAX_LEVELS &&
           (s->level_count <= FINEST_LEVEL || rf_min_int(w, h) >= 2 * SMALLEST_LEVEL))
    {
        w = rf_max_int(w / 2, 1);
        h = rf_max_int(h / 2, 1);
        complete = add_level(s, pair, w, h, arena);
    }
    // The frame's own resolution only takes the enlarged flow.
    size_t all = (size_t)pair->w * (size_t)pair->h;
    size_t pixels = (size_t)s->levels[FINEST_LEVEL].w * (size_t)s->levels[FINEST_LEVEL].h;
    float **flows[] = {&s->flow.u, &s->flow.v, &s->start.u, &s->start.v, &s->patches.u, &s->patches.v};
    for (int i = 0; complete && i < 6; ++i)
        complete = (*flows[i] = rf_arena_push(arena, i < 2 ? all : pixels, sizeof(float))) != NULL;
    for (int i = 0; complete && i < PLANES; ++i)
        complete = (s->p[i] = rf_arena_push(arena, pixels, sizeof(float))) != NULL;
    return complete;
}

static void fill_finest(Solver *s, const RfFramePair *pair)
{
    size_t count = (size_t)pair->w * (size_t)pair->h;
    const Level *finest = &s->levels[0];
    memcpy(finest->a, pair->a, count * sizeof(float));
    memcpy(finest->b, pair->b, count * sizeof(float));
    for (size_t k = 0; k < count && pair->mask_a; ++k)
        finest->weight_a[k] = pair->mask_a[k] ? 1.0f : 0.0f;
    for (size_t k = 0; k < count && pair->mask_b; ++k)
        finest->weight_b[k] = pair->mask_b[k] ? 1.0f : 0.0f;
}

RfResult rf_measure_inverse_search(const RfFramePair *pair, float *flow)
{
    assert(pair->w >= 2 * PATCH && pair->h >= 2 * PATCH);
    RfArena arena = {0};
    Solver s = {0};
    if (!allocate(&s, pair, &arena))
    {
        rf_arena_free(&arena);
        return RF_OUT_OF_MEMORY;
    }
    fill_finest(&s, pair);
    build_pyramid(&s);
    for (int l = s.level_count - 1; l >= 0; --l)
    {
        s.level = &s.levels[l];
        size_t bytes = (size_t)s.level->w * (size_t)s.level->h * sizeof(float);
        if (l < s.level_count - 1)
            enlarge(&s);
        else
        {
            memset(s.flow.u, 0, bytes);
            memset(s.flow.v, 0, bytes);
        }
        if (l < FINEST_LEVEL)
            continue;
        rf_parallel_for(patches_along(s.level->h), search_row, &s);
        rf_measure_rows(s.level->w, s.level->h, gather_rows, &s);
        refine(&s);
    }
    for (size_t k = 0; k < (size_t)pair->w * (size_t)pair->h; ++k)
    {
        flow[2 * k] = s.flow.u[k];
        flow[2 * k + 1] = s.flow.v[k];
    }
    rf_arena_free(&arena);
    return RF_OK;
}

RfResult rf_measure_optical_flow(RfMeasureEstimator estimator, const RfFramePair *pair, float *flow)
{
    return estimator == RF_MEASURE_LUCAS_KANADE ? rf_measure_lucas_kanade(pair, flow)
                                                : rf_measure_inverse_search(pair, flow);
}
