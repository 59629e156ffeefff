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
#include "support/measures.h"

#include "core/maths.h"
#include "core/memory.h"
#include "kernels/cubic_spline.h"

#include <assert.h>
#include <string.h>

enum
{
    MAX_LEVELS = 6,
    SMALLEST_LEVEL = 20,
    ITERATIONS = 4,
    LAST_ITERATIONS = 6,
    RADIUS = 6,
    TAPS = 2 * RADIUS + 1
};

// Of the window, in pixels of the level.
static const float SIGMA = 2.4f;
// Of the squared gradient in grey levels: under it a window says nothing and the coarser level's motion stays.
static const float DAMPING = 0.5f;

typedef struct Level
{
    int w, h;
    float *a, *b;
} Level;

typedef struct Solver
{
    int w, h;
    const float *a;
    /// b as spline coefficients.
    float *spline;
    float *u, *v;
    float *warped, *weight, *scratch;
    /// xx, xy, yy, xt, yt of the structure tensor.
    float *tensor[5];
    float taps[TAPS];
} Solver;

static float *plane(int w, int h)
{
    float *p = rf_allocate_zero((size_t)w * (size_t)h, sizeof(float));
    assert(p);
    return p;
}

static void gaussian_taps(float taps[TAPS], float sigma)
{
    float sum = 0;
    for (int k = -RADIUS; k <= RADIUS; ++k)
        sum += taps[k + RADIUS] = expf(-0.5f * (float)(k * k) / (sigma * sigma));
    for (int k = 0; k < TAPS; ++k)
        taps[k] /= sum;
}

// Row filtered with mirrored ends; `padded` holds w + 2 RADIUS floats.
static void blur_row(const float *in, float *out, int w, const float taps[TAPS], float *padded)
{
    for (int k = -RADIUS; k < w + RADIUS; ++k)
        padded[k + RADIUS] = in[rf_mirror_int(k, w)];
    memset(out, 0, (size_t)w * sizeof(float));
    for (int k = 0; k < TAPS; ++k)
#pragma omp simd
        for (int x = 0; x < w; ++x)
            out[x] += taps[k] * padded[x + k];
}

static void blur(float *p, int w, int h, const float taps[TAPS], float *scratch)
{
    float *padded = plane(w + 2 * RADIUS, 1);
    for (int y = 0; y < h; ++y)
        blur_row(p + (size_t)y * (size_t)w, scratch + (size_t)y * (size_t)w, w, taps, padded);
    for (int y = 0; y < h; ++y)
    {
        float *out = p + (size_t)y * (size_t)w;
        memset(out, 0, (size_t)w * sizeof(float));
        for (int k = 0; k < TAPS; ++k)
        {
            const float *in = scratch + (size_t)rf_mirror_int(y + k - RADIUS, h) * (size_t)w;
            float tap = taps[k];
#pragma omp simd
            for (int x = 0; x < w; ++x)
                out[x] += tap * in[x];
        }
    }
    rf_release(padded);
}

// Half the size, after a blur that leaves little above the new Nyquist frequency.
static float *halve(const float *in, int w, int h)
{
    float taps[TAPS], *smooth = plane(w, h), *scratch = plane(w, h);
    float *out = plane((w + 1) / 2, (h + 1) / 2);
    gaussian_taps(taps, 1.0f);
    memcpy(smooth, in, (size_t)w * (size_t)h * sizeof(float));
    blur(smooth, w, h, taps, scratch);
    for (int y = 0; y < (h + 1) / 2; ++y)
        for (int x = 0; x < (w + 1) / 2; ++x)
            out[(size_t)y * (size_t)((w + 1) / 2) + (size_t)x] = smooth[(size_t)(2 * y) * (size_t)w + (size_t)(2 * x)];
    rf_release(smooth);
    rf_release(scratch);
    return out;
}

// Slopes of a row's neighbourhood: (-1, 8, 0, -8, 1) / 12, exact for cubics.
static float slope(const float *p, int i, int n, ptrdiff_t step)
{
    if (i >= 2 && i < n - 2)
        return (8 * (p[step] - p[-step]) - (p[2 * step] - p[-2 * step])) * (1.0f / 12.0f);
    float before = i > 0 ? p[-step] : p[0], after = i < n - 1 ? p[step] : p[0];
    return (after - before) * (i > 0 && i < n - 1 ? 0.5f : 1.0f);
}

static void warp_b(Solver *s)
{
    for (int y = 0; y < s->h; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x;
            float px = (float)x + s->u[k], py = (float)y + s->v[k];
            bool inside = px >= 0 && py >= 0 && px <= (float)(s->w - 1) && py <= (float)(s->h - 1);
            s->weight[k] = inside ? 1.0f : 0.0f;
            rf_spline_sample(s->spline, s->w, s->h, 1, 1, px, py, &s->warped[k]);
        }
}

static void gather_tensor(Solver *s)
{
    for (int y = 0; y < s->h; ++y)
        for (int x = 0; x < s->w; ++x)
        {
            size_t k = (size_t)y * (size_t)s->w + (size_t)x;
            float gx = 0.5f * (slope(s->a + k, x, s->w, 1) + slope(s->warped + k, x, s->w, 1));
            float gy = 0.5f * (slope(s->a + k, y, s->h, s->w) + slope(s->warped + k, y, s->h, s->w));
            float t = s->a[k] - s->warped[k], m = s->weight[k];
            s->tensor[0][k] = m * gx * gx;
            s->tensor[1][k] = m * gx * gy;
            s->tensor[2][k] = m * gy * gy;
            s->tensor[3][k] = m * gx * t;
            s->tensor[4][k] = m * gy * t;
        }
    for (int t = 0; t < 5; ++t)
        blur(s->tensor[t], s->w, s->h, s->taps, s->scratch);
}

static void add_motion(Solver *s)
{
    for (size_t k = 0; k < (size_t)s->w * (size_t)s->h; ++k)
    {
        float xx = s->tensor[0][k] + DAMPING, xy = s->tensor[1][k], yy = s->tensor[2][k] + DAMPING;
        float xt = s->tensor[3][k], yt = s->tensor[4][k], determinant = xx * yy - xy * xy;
        // The linearisation holds for about a pixel.
        s->u[k] += rf_clamp((yy * xt - xy * yt) / determinant, -1, 1);
        s->v[k] += rf_clamp((xx * yt - xy * xt) / determinant, -1, 1);
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
static float median9(const float *r0, const float *r1, const float *r2, int x0, int x1, int x2)
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

static void median(float *p, int w, int h, float *scratch)
{
    memcpy(scratch, p, (size_t)w * (size_t)h * sizeof(float));
    for (int y = 0; y < h; ++y)
    {
        const float *r1 = scratch + (size_t)y * (size_t)w;
        const float *r0 = y > 0 ? r1 - w : r1, *r2 = y < h - 1 ? r1 + w : r1;
        float *out = p + (size_t)y * (size_t)w;
        for (int x = 1; x < w - 1; ++x)
            out[x] = median9(r0, r1, r2, x - 1, x, x + 1);
        out[0] = median9(r0, r1, r2, 0, 0, rf_min_int(1, w - 1));
        out[w - 1] = median9(r0, r1, r2, rf_max_int(w - 2, 0), w - 1, w - 1);
    }
}

// Motion of the coarser level, at twice its size.
static void start_from(Solver *s, const float *u, const float *v, int w, int h)
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
            s->u[k] = 2 * rf_lerp(rf_lerp(u[c], u[c + right], fx), rf_lerp(u[c + down], u[c + down + right], fx), fy);
            s->v[k] = 2 * rf_lerp(rf_lerp(v[c], v[c + right], fx), rf_lerp(v[c + down], v[c + down + right], fx), fy);
        }
}

static Solver solver_create(const Level *level)
{
    int w = level->w, h = level->h;
    Solver s = {.w = w, .h = h, .a = level->a, .spline = plane(w, h), .u = plane(w, h), .v = plane(w, h)};
    s.warped = plane(w, h);
    s.weight = plane(w, h);
    s.scratch = plane(w, h);
    for (int t = 0; t < 5; ++t)
        s.tensor[t] = plane(w, h);
    memcpy(s.spline, level->b, (size_t)w * (size_t)h * sizeof(float));
    rf_spline_prefilter(s.spline, w, h, 1);
    gaussian_taps(s.taps, SIGMA);
    return s;
}

static void solver_free(Solver *s)
{
    float *planes[] = {s->spline, s->u, s->v, s->warped, s->weight, s->scratch};
    for (size_t i = 0; i < sizeof planes / sizeof *planes; ++i)
        rf_release(planes[i]);
    for (int t = 0; t < 5; ++t)
        rf_release(s->tensor[t]);
}

static void solve(Solver *s, int iterations)
{
    for (int i = 0; i < iterations; ++i)
    {
        warp_b(s);
        gather_tensor(s);
        add_motion(s);
        median(s->u, s->w, s->h, s->scratch);
        median(s->v, s->w, s->h, s->scratch);
    }
}

static int build_pyramid(const float *a, const float *b, int w, int h, Level levels[MAX_LEVELS])
{
    size_t bytes = (size_t)w * (size_t)h * sizeof(float);
    levels[0] = (Level){w, h, plane(w, h), plane(w, h)};
    memcpy(levels[0].a, a, bytes);
    memcpy(levels[0].b, b, bytes);
    int count = 1;
    for (; count < MAX_LEVELS && rf_min_int(levels[count - 1].w, levels[count - 1].h) >= 2 * SMALLEST_LEVEL; ++count)
    {
        const Level *fine = &levels[count - 1];
        levels[count] = (Level){(fine->w + 1) / 2, (fine->h + 1) / 2, halve(fine->a, fine->w, fine->h),
                                halve(fine->b, fine->w, fine->h)};
    }
    return count;
}

void measure_optical_flow(const float *a, const float *b, int w, int h, float *flow)
{
    Level levels[MAX_LEVELS];
    int count = build_pyramid(a, b, w, h, levels);
    Solver coarse = {0};
    for (int l = count - 1; l >= 0; --l)
    {
        Solver s = solver_create(&levels[l]);
        if (coarse.u)
            start_from(&s, coarse.u, coarse.v, coarse.w, coarse.h);
        solver_free(&coarse);
        solve(&s, l == 0 ? LAST_ITERATIONS : ITERATIONS);
        coarse = s;
        rf_release(levels[l].a);
        rf_release(levels[l].b);
    }
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
    {
        flow[2 * k] = coarse.u[k];
        flow[2 * k + 1] = coarse.v[k];
    }
    solver_free(&coarse);
}
