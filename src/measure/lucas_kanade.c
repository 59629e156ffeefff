// SPDX-License-Identifier: Apache-2.0
// Dense optical flow: the method of Lucas and Kanade at every pixel, on a pyramid.
//
// Lucas, Kanade. An iterative image registration technique with an application to stereo vision. 1981.
// Bouguet. Pyramidal implementation of the Lucas Kanade feature tracker. 2000.
// Sun, Roth, Black. Secrets of optical flow estimation and their principles. 2010 (median filtering, cubic warping).
//
// From the coarsest level down, b is warped by the flow so far, and the remaining motion d of each pixel is the least
// squares solution of grad . d = a - b over a Gaussian window. Warping uses each pixel's own flow, not one flow for a
// whole window, so the fixed point has no bias where the flow turns or shears: on noise-free frames the error goes on
// falling with the iterations far under what the window's size would allow. A median filter after each iteration drops
// the outliers that a repetitive texture makes.
//
// One iteration is four walks over the rows: warp b; products of gradients, blurred along x; blur along y and solve;
// median.
#include "measure/optical_flow.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "kernels/cubic_spline.h"

#include <string.h>

enum
{
    MAX_LEVELS = 6,
    SMALLEST_LEVEL = 20,
    ITERATIONS = 4,
    LAST_ITERATIONS = 6,
    RADIUS = 6,
    TAPS = 2 * RADIUS + 1,
    // Of the structure tensor: xx, xy, yy, xt, yt.
    TERMS = 5
};

// Of the window, in pixels of the level.
static const float SIGMA = 2.4f;
// Of the squared gradient in grey levels: under it a window says nothing and the coarser level's motion stays.
static const float DAMPING = 0.5f;

typedef struct Level
{
    int w, h;
    float *a, *b;
    /// What counts, 0 to 1; NULL: everything.
    float *weight_a, *weight_b;
} Level;

// Planes for the finest level; coarser ones use their beginning.
typedef struct Solver
{
    Level levels[MAX_LEVELS];
    int level_count, w, h;
    const Level *level;
    float *spline, *warped, *weight, *tensor[TERMS];
    /// The flow so far, and the next one before its median.
    float *u, *v, *next_u, *next_v;
    float taps[TAPS];
    /// For each worker: a row with RADIUS more at both ends, and TERMS rows.
    float *rows;
    size_t row_floats;
} Solver;

static void gaussian_taps(float taps[TAPS], float sigma)
{
    float sum = 0;
    for (int k = -RADIUS; k <= RADIUS; ++k)
        sum += taps[k + RADIUS] = expf(-0.5f * (float)(k * k) / (sigma * sigma));
    for (int k = 0; k < TAPS; ++k)
        taps[k] /= sum;
}

// `padded` holds the row from RADIUS on; its ends are mirrored here.
static void blur_row(float *padded, float *out, int w, const float taps[TAPS])
{
    for (int k = 1; k <= RADIUS; ++k)
    {
        padded[RADIUS - k] = padded[RADIUS + rf_mirror_int(-k, w)];
        padded[RADIUS + w - 1 + k] = padded[RADIUS + rf_mirror_int(w - 1 + k, w)];
    }
    memset(out, 0, (size_t)w * sizeof(float));
    for (int k = 0; k < TAPS; ++k)
#pragma omp simd
        for (int x = 0; x < w; ++x)
            out[x] += taps[k] * padded[x + k];
}

static void blur_column(const float *plane, int w, int h, int y, const float taps[TAPS], float *out)
{
    memset(out, 0, (size_t)w * sizeof(float));
    for (int k = 0; k < TAPS; ++k)
    {
        const float *in = plane + (size_t)rf_mirror_int(y + k - RADIUS, h) * (size_t)w, tap = taps[k];
#pragma omp simd
        for (int x = 0; x < w; ++x)
            out[x] += tap * in[x];
    }
}

// ---- pyramid -----------------------------------------------------------------------------------------------------

// Half the size, after a blur that leaves little above the new Nyquist frequency. `scratch` is as large as `in`.
static void halve(const Solver *s, const float *in, int w, int h, float *scratch, float *out)
{
    float taps[TAPS], *padded = s->rows, *row = s->rows + w + 2 * RADIUS;
    int half_w = (w + 1) / 2;
    gaussian_taps(taps, 1.0f);
    for (int y = 0; y < h; ++y)
    {
        memcpy(padded + RADIUS, in + (size_t)y * (size_t)w, (size_t)w * sizeof(float));
        blur_row(padded, scratch + (size_t)y * (size_t)w, w, taps);
    }
    for (int y = 0; y < (h + 1) / 2; ++y)
    {
        blur_column(scratch, w, h, 2 * y, taps, row);
        for (int x = 0; x < half_w; ++x)
            out[(size_t)y * (size_t)half_w + (size_t)x] = row[2 * x];
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
                halve(s, from[i], fine->w, fine->h, s->warped, to[i]);
    }
}

// ---- one iteration -----------------------------------------------------------------------------------------------

// Slopes of a row's neighbourhood: (-1, 8, 0, -8, 1) / 12, exact for cubics.
static inline float slope(const float *p, int i, int n, ptrdiff_t step)
{
    if (i >= 2 && i < n - 2)
        return (8 * (p[step] - p[-step]) - (p[2 * step] - p[-2 * step])) * (1.0f / 12.0f);
    float before = i > 0 ? p[-step] : p[0], after = i < n - 1 ? p[step] : p[0];
    return (after - before) * (i > 0 && i < n - 1 ? 0.5f : 1.0f);
}

static void warp_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    Solver *s = context;
    const Level *level = s->level;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x;
            float px = (float)x + s->u[k], py = (float)y + s->v[k];
            bool inside = px >= 0 && py >= 0 && px <= (float)(s->w - 1) && py <= (float)(s->h - 1);
            float weight = inside ? 1.0f : 0.0f;
            if (inside && level->weight_a)
                weight = level->weight_a[k];
            if (inside && level->weight_b)
                weight *= level->weight_b[(size_t)(py + 0.5f) * (size_t)s->w + (size_t)(px + 0.5f)];
            s->weight[k] = weight;
            rf_spline_sample(s->spline, s->w, s->h, 1, 1, px, py, &s->warped[k]);
        }
}

static void tensor_rows(void *context, int y0, int y1, int worker)
{
    Solver *s = context;
    int w = s->w;
    float *padded = s->rows + (size_t)worker * s->row_floats, *raw = padded + w + 2 * RADIUS;
    for (int y = y0; y < y1; ++y)
    {
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            const float *a = s->level->a + k, *b = s->warped + k;
            float gx = 0.5f * (slope(a, x, w, 1) + slope(b, x, w, 1));
            float gy = 0.5f * (slope(a, y, s->h, w) + slope(b, y, s->h, w));
            float t = *a - *b, m = s->weight[k];
            raw[x] = m * gx * gx;
            raw[w + x] = m * gx * gy;
            raw[2 * w + x] = m * gy * gy;
            raw[3 * w + x] = m * gx * t;
            raw[4 * w + x] = m * gy * t;
        }
        for (int i = 0; i < TERMS; ++i)
        {
            memcpy(padded + RADIUS, raw + i * w, (size_t)w * sizeof(float));
            blur_row(padded, s->tensor[i] + (size_t)y * (size_t)w, w, s->taps);
        }
    }
}

static void solve_rows(void *context, int y0, int y1, int worker)
{
    Solver *s = context;
    int w = s->w;
    float *sums = s->rows + (size_t)worker * s->row_floats;
    for (int y = y0; y < y1; ++y)
    {
        for (int i = 0; i < TERMS; ++i)
            blur_column(s->tensor[i], w, s->h, y, s->taps, sums + i * w);
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            float xx = sums[x] + DAMPING, xy = sums[w + x], yy = sums[2 * w + x] + DAMPING;
            float xt = sums[3 * w + x], yt = sums[4 * w + x], determinant = xx * yy - xy * xy;
            // The linearisation holds for about a pixel.
            s->next_u[k] = s->u[k] + rf_clamp((yy * xt - xy * yt) / determinant, -1, 1);
            s->next_v[k] = s->v[k] + rf_clamp((xx * yt - xy * xt) / determinant, -1, 1);
        }
    }
}

#define SORT2(a, b)                                                                                                    \
    do                                                                                                                 \
    {                                                                                                                  \
        float low = (a) < (b) ? (a) : (b), high = (a) < (b) ? (b) : (a);                                               \
        (a) = low;                                                                                                     \
        (b) = high;                                                                                                    \
    } while (0)

// Middle of nine by 19 exchanges (Smith. Implementing median filters in XC4000E FPGAs. 1996).
static inline float median9(const float *r0, const float *r1, const float *r2, int x0, int x1, int x2)
{
    float p[9] = {r0[x0], r0[x1], r0[x2], r1[x0], r1[x1], r1[x2], r2[x0], r2[x1], r2[x2]};
    SORT2(p[1], p[2]);
    SORT2(p[4], p[5]);
    SORT2(p[7], p[8]);
    SORT2(p[0], p[1]);
    SORT2(p[3], p[4]);
    SORT2(p[6], p[7]);
    SORT2(p[1], p[2]);
    SORT2(p[4], p[5]);
    SORT2(p[7], p[8]);
    SORT2(p[0], p[3]);
    SORT2(p[5], p[8]);
    SORT2(p[4], p[7]);
    SORT2(p[3], p[6]);
    SORT2(p[1], p[4]);
    SORT2(p[2], p[5]);
    SORT2(p[4], p[7]);
    SORT2(p[4], p[2]);
    SORT2(p[6], p[4]);
    SORT2(p[4], p[2]);
    return p[4];
}

static void median_row(const float *plane, int w, int h, int y, float *out)
{
    const float *r1 = plane + (size_t)y * (size_t)w;
    const float *r0 = y > 0 ? r1 - w : r1, *r2 = y < h - 1 ? r1 + w : r1;
    for (int x = 1; x < w - 1; ++x)
        out[x] = median9(r0, r1, r2, x - 1, x, x + 1);
    out[0] = median9(r0, r1, r2, 0, 0, rf_min_int(1, w - 1));
    out[w - 1] = median9(r0, r1, r2, rf_max_int(w - 2, 0), w - 1, w - 1);
}

static void median_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    Solver *s = context;
    for (int y = y0; y < y1; ++y)
    {
        median_row(s->next_u, s->w, s->h, y, s->u + (size_t)y * (size_t)s->w);
        median_row(s->next_v, s->w, s->h, y, s->v + (size_t)y * (size_t)s->w);
    }
}

// ---- levels ------------------------------------------------------------------------------------------------------

// The motion of the coarser level in next_u, next_v, at twice its size, in u, v.
static void enlarge(Solver *s, int w, int h)
{
    for (int y = 0; y < s->h; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x;
            float px = rf_clamp(0.5f * (float)x, 0, (float)(w - 1)), py = rf_clamp(0.5f * (float)y, 0, (float)(h - 1));
            int i = rf_min_int((int)px, rf_max_int(w - 2, 0)), j = rf_min_int((int)py, rf_max_int(h - 2, 0));
            int right = i + 1 < w ? 1 : 0, down = j + 1 < h ? w : 0;
            float fx = px - (float)i, fy = py - (float)j;
            size_t c = (size_t)j * (size_t)w + (size_t)i;
            const float *u = s->next_u + c, *v = s->next_v + c;
            s->u[k] = 2 * rf_lerp(rf_lerp(u[0], u[right], fx), rf_lerp(u[down], u[down + right], fx), fy);
            s->v[k] = 2 * rf_lerp(rf_lerp(v[0], v[right], fx), rf_lerp(v[down], v[down + right], fx), fy);
        }
}

static void solve_level(Solver *s, int l)
{
    const Level *level = &s->levels[l];
    size_t bytes = (size_t)level->w * (size_t)level->h * sizeof(float);
    s->level = level;
    s->w = level->w;
    s->h = level->h;
    memcpy(s->spline, level->b, bytes);
    rf_spline_prefilter(s->spline, s->w, s->h, 1);
    for (int i = 0; i < (l == 0 ? LAST_ITERATIONS : ITERATIONS); ++i)
    {
        rf_measure_rows(s->w, s->h, warp_rows, s);
        rf_measure_rows(s->w, s->h, tensor_rows, s);
        rf_measure_rows(s->w, s->h, solve_rows, s);
        rf_measure_rows(s->w, s->h, median_rows, s);
    }
    memcpy(s->next_u, s->u, bytes);
    memcpy(s->next_v, s->v, bytes);
}

static bool allocate(Solver *s, const RfFramePair *pair, RfArena *arena)
{
    size_t count = (size_t)pair->w * (size_t)pair->h;
    float **planes[] = {&s->spline,    &s->warped,    &s->weight, &s->tensor[0], &s->tensor[1], &s->tensor[2],
                        &s->tensor[3], &s->tensor[4], &s->u,      &s->v,         &s->next_u,    &s->next_v};
    bool complete = true;
    for (size_t i = 0; i < sizeof planes / sizeof *planes; ++i)
        complete &= (*planes[i] = rf_arena_push(arena, count, sizeof(float))) != NULL;
    s->row_floats = (size_t)(TERMS + 1) * (size_t)(pair->w + 2 * RADIUS);
    s->rows = rf_arena_push(arena, (size_t)rf_threads() * s->row_floats, sizeof(float));
    int w = pair->w, h = pair->h;
    for (s->level_count = 0; s->level_count < MAX_LEVELS; w = (w + 1) / 2, h = (h + 1) / 2)
    {
        Level *level = &s->levels[s->level_count++];
        size_t pixels = (size_t)w * (size_t)h;
        *level = (Level){
            w, h, rf_arena_push(arena, pixels, sizeof(float)), rf_arena_push(arena, pixels, sizeof(float)), NULL, NULL};
        complete &= level->a && level->b;
        if (pair->mask_a)
            complete &= (level->weight_a = rf_arena_push(arena, pixels, sizeof(float))) != NULL;
        if (pair->mask_b)
            complete &= (level->weight_b = rf_arena_push(arena, pixels, sizeof(float))) != NULL;
        if (rf_min_int(w, h) < 2 * SMALLEST_LEVEL)
            break;
    }
    return complete && s->rows;
}

RfResult rf_measure_lucas_kanade(const RfFramePair *pair, float *flow)
{
    size_t count = (size_t)pair->w * (size_t)pair->h;
    RfArena arena = {0};
    Solver s = {0};
    if (!allocate(&s, pair, &arena))
    {
        rf_arena_free(&arena);
        return RF_OUT_OF_MEMORY;
    }
    gaussian_taps(s.taps, SIGMA);
    memcpy(s.levels[0].a, pair->a, count * sizeof(float));
    memcpy(s.levels[0].b, pair->b, count * sizeof(float));
    for (size_t k = 0; k < count && pair->mask_a; ++k)
        s.levels[0].weight_a[k] = pair->mask_a[k] ? 1.0f : 0.0f;
    for (size_t k = 0; k < count && pair->mask_b; ++k)
        s.levels[0].weight_b[k] = pair->mask_b[k] ? 1.0f : 0.0f;
    build_pyramid(&s);
    memset(s.u, 0, count * sizeof(float));
    memset(s.v, 0, count * sizeof(float));
    for (int l = s.level_count - 1; l >= 0; --l)
    {
        if (l < s.level_count - 1)
        {
            int w = s.w, h = s.h;
            s.w = s.levels[l].w;
            s.h = s.levels[l].h;
            enlarge(&s, w, h);
        }
        solve_level(&s, l);
    }
    for (size_t k = 0; k < count; ++k)
    {
        flow[2 * k] = s.u[k];
        flow[2 * k + 1] = s.v[k];
    }
    rf_arena_free(&arena);
    return RF_OK;
}
