// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. INRIA RR-6810, 2009,
// section 3.3.
//
// A grid is 2 (n - 1)^2 triangles; over a triangle the exemplar coordinates and the vertex weights are linear. A
// triangle is walked row by row, and a row of it is a *run* of pixels:
//
//     run:   first pixel, length                  the row clipped by the triangle's edges, the kernel's circle and the
//     tile
//            u, v, K_g, K_d at the first pixel    and their slopes along x
//
// Each run is done in two passes. The first is plain arithmetic on short arrays, which the compiler makes as wide as
// the machine: weight, texel index and fractions for all pixels. The second takes one pixel at a time, but four
// channels of two neighbouring texels at once: with a = the pair in the upper row, b = in the lower one,
//
//     r = a + fy (b - a),      sum += (w (1 - fx), w fx) * r      (the halves are added up)
//
// which is two loads and three operations a sample, with no gathers and no unpacking.
//
// Edges: rows and pixels are half-open intervals of pixel centres and an edge's crossing is computed from its ends in
// one order, so two triangles that share an edge never both draw a pixel and never both miss it.
//
// Minification: J maps exemplar to frame. The level follows sqrt |det J|; what remains along the compressed axis is
// averaged by up to four taps, whose variance is that of a box as wide as the footprint, less what one bilinear sample
// already averages. Both are constant over a triangle: neighbours differ a little in blur, which did not show.

#include "kernels/blending.h"
#include "core/maths.h"
#include "core/simd.h"

#include <assert.h>
#include <string.h>

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef float Vec8 __attribute__((vector_size(32), aligned(4), may_alias));

// A footprint is left to one sample up to this compression: the top of the band is mostly empty.
#define FREE_COMPRESSION 1.25f

enum
{
    MAX_TAPS = 4
};

typedef struct Triangle
{
    // Corners in tile pixels, sorted by y, then x.
    RfVec2 a, b, c;
    // Value at pixel centre (0.5, 0.5) of the tile and slopes, for u, v, K_g, K_d.
    float base[4], dx[4], dy[4];
    int level, taps;
    // From tap to tap, in exemplar pixels.
    RfVec2 tap_step;
} Triangle;

typedef struct Run
{
    const RfDrawJob *job;
    const RfDrawGrid *grid;
    const Triangle *triangle;
    int first, y, count;
    float u, v, border, quality;
    float centre_x, dy2, inverse_radius;
} Run;

void rf_tile_clear(RfTileSums *sums, int quads)
{
    size_t pixels = (size_t)RF_TILE_SPAN * RF_TILE_SPAN;
    memset(sums->colour, 0, (size_t)quads * pixels * 4 * sizeof(float));
    memset(sums->weight, 0, pixels * sizeof(float));
    memset(sums->weight2, 0, pixels * sizeof(float));
    memset(sums->level, 0, pixels * sizeof(float));
}

// log2 and exp2 to about 1e-4, in operations that go wide: only weights are made of them.
RF_WIDE_BODY float fast_log2(float x)
{
    union
    {
        float f;
        int32_t i;
    } bits = {x};
    float exponent = (float)((bits.i >> 23) - 127);
    bits.i = (bits.i & 0x007fffff) | 0x3f800000;
    float m = bits.f - 1;
    return exponent + m * (1.4418255f + m * (-0.7059243f + m * (0.4116079f + m * (-0.1936709f + m * 0.0461617f))));
}

RF_WIDE_BODY float fast_exp2(float x)
{
    x = x < -126 ? -126 : x;
    float whole = floorf(x), t = x - whole;
    union
    {
        int32_t i;
        float f;
    } bits = {((int32_t)whole + 127) << 23};
    return bits.f * (1 + t * (0.6951786f + t * (0.2276141f + t * 0.0772073f)));
}

// Crossing of the edge p-q (p above q) with the row's centre line.
RF_WIDE_BODY float edge_x(RfVec2 p, RfVec2 q, float y)
{
    return p.x + (y - p.y) * ((q.x - p.x) / (q.y - p.y));
}

RF_WIDE_BODY void sort_corners(Triangle *t)
{
#define RF_ABOVE(p, q) ((p).y < (q).y || ((p).y == (q).y && (p).x < (q).x))
#define RF_SWAP(p, q)                                                                                                  \
    do                                                                                                                 \
    {                                                                                                                  \
        RfVec2 swap_ = p;                                                                                              \
        p = q;                                                                                                         \
        q = swap_;                                                                                                     \
    } while (0)
    if (RF_ABOVE(t->b, t->a))
        RF_SWAP(t->a, t->b);
    if (RF_ABOVE(t->c, t->b))
        RF_SWAP(t->b, t->c);
    if (RF_ABOVE(t->b, t->a))
        RF_SWAP(t->a, t->b);
#undef RF_SWAP
#undef RF_ABOVE
}

// d(u, v)/d(x, y), its singular values and what they ask of the sampler.
RF_WIDE_BODY void choose_filter(Triangle *t, const RfDrawJob *job, float spacing)
{
    // Exemplar pixels a frame pixel.
    float a = t->dx[0] / spacing, b = t->dy[0] / spacing, c = t->dx[1] / spacing, d = t->dy[1] / spacing;
    float det = fabsf(a * d - b * c), sum = a * a + b * b + c * c + d * d;
    float root = sqrtf(fmaxf(sum * sum - 4 * det * det, 0));
    float largest = sqrtf(0.5f * (sum + root));
    int level = 0;
    for (float area = det; area > 2 && level < RF_TEXTURE_LEVELS;
         area *= 0.25f) // sqrt(det) past sqrt(2): the next level
        ++level;
    t->level = rf_min_int(level + job->level_bias, job->texture->level_count - 1);
    float footprint = largest / (float)(1 << level);
    t->taps = 1;
    t->tap_step = (RfVec2){0, 0};
    if (footprint <= FREE_COMPRESSION)
        return;
    // Taps at (k - (n - 1) / 2) s have the variance s^2 (n^2 - 1) / 12.
    float variance = (footprint * footprint - FREE_COMPRESSION * FREE_COMPRESSION) / 12;
    t->taps = footprint < 2 ? 2 : footprint < 3 ? 3 : MAX_TAPS;
    float step = sqrtf(12 * variance / (float)(t->taps * t->taps - 1)) * (float)(1 << level) * spacing;
    // The long axis in the exemplar: eigenvector of J J^T to the eigenvalue largest^2.
    float xx = a * a + b * b, xy = a * c + b * d, yy = c * c + d * d;
    float ex = xx >= yy ? largest * largest - yy : xy, ey = xx >= yy ? xy : largest * largest - xx;
    float length = sqrtf(ex * ex + ey * ey);
    t->tap_step = length > 0 ? (RfVec2){step * ex / length, step * ey / length} : (RfVec2){step, 0};
}

// False if the triangle has no area or lies outside the tile.
RF_WIDE_BODY bool set_up_triangle(const RfDrawJob *job, const RfDrawGrid *grid, const int corner[3], Triangle *t)
{
    float inverse = 1 / job->spacing;
    RfVec2 p[3];
    float value[4][3];
    for (int k = 0; k < 3; ++k)
    {
        int i = corner[k] % grid->n, j = corner[k] / grid->n;
        p[k] = (RfVec2){(grid->x[corner[k]] - job->origin.x) * inverse, (grid->y[corner[k]] - job->origin.y) * inverse};
        value[0][k] = grid->u0 + (float)i * grid->cell;
        value[1][k] = grid->v0 + (float)j * grid->cell;
        value[2][k] = i == 0 || j == 0 || i == grid->n - 1 || j == grid->n - 1 ? 0.0f : 1.0f;
        value[3][k] = grid->quality[corner[k]];
    }
    float x0 = fminf(p[0].x, fminf(p[1].x, p[2].x)), x1 = fmaxf(p[0].x, fmaxf(p[1].x, p[2].x));
    float y0 = fminf(p[0].y, fminf(p[1].y, p[2].y)), y1 = fmaxf(p[0].y, fmaxf(p[1].y, p[2].y));
    if (!(x1 > 0 && y1 > 0 && x0 < (float)job->width && y0 < (float)job->height))
        return false;
    float ax = p[1].x - p[0].x, ay = p[1].y - p[0].y, bx = p[2].x - p[0].x, by = p[2].y - p[0].y;
    float det = ax * by - ay * bx;
    if (!(fabsf(det) > 1e-6f))
        return false;
    for (int k = 0; k < 4; ++k)
    {
        float da = value[k][1] - value[k][0], db = value[k][2] - value[k][0];
        t->dx[k] = (da * by - db * ay) / det;
        t->dy[k] = (db * ax - da * bx) / det;
        t->base[k] = value[k][0] + (0.5f - p[0].x) * t->dx[k] + (0.5f - p[0].y) * t->dy[k];
    }
    t->a = p[0];
    t->b = p[1];
    t->c = p[2];
    sort_corners(t);
    choose_filter(t, job, job->spacing);
    return true;
}

// Clips row y of the triangle; count is 0 where nothing is left.
RF_WIDE_BODY void set_up_run(const Triangle *t, int y, Run *run)
{
    const RfDrawJob *job = run->job;
    const RfDrawGrid *grid = run->grid;
    float yc = (float)y + 0.5f;
    float long_x = edge_x(t->a, t->c, yc);
    float short_x = yc < t->b.y ? edge_x(t->a, t->b, yc) : edge_x(t->b, t->c, yc);
    float centre_x = (grid->centre.x - job->origin.x) / job->spacing,
          centre_y = (grid->centre.y - job->origin.y) / job->spacing;
    float radius = grid->radius / job->spacing, dy = yc - centre_y, chord2 = radius * radius - dy * dy;
    run->count = 0;
    if (!(chord2 > 0))
        return;
    float chord = sqrtf(chord2);
    float left = fmaxf(fminf(long_x, short_x), centre_x - chord),
          right = fminf(fmaxf(long_x, short_x), centre_x + chord);
    int first = (int)ceilf(fmaxf(left, 0) - 0.5f), end = (int)ceilf(fminf(right, (float)job->width) - 0.5f);
    if (end <= first)
        return;
    run->first = first;
    run->y = y;
    run->count = end - first;
    run->u = t->base[0] + (float)first * t->dx[0] + (float)y * t->dy[0];
    run->v = t->base[1] + (float)first * t->dx[1] + (float)y * t->dy[1];
    run->border = t->base[2] + (float)first * t->dx[2] + (float)y * t->dy[2];
    run->quality = t->base[3] + (float)first * t->dx[3] + (float)y * t->dy[3];
    run->centre_x = centre_x;
    run->dy2 = dy * dy;
    run->inverse_radius = 1 / radius;
}

// w = K_p K_g K_d F at the pixels of a run.
RF_WIDE_BODY void run_weights(const Run *run, float *restrict weight)
{
    float sharpness = run->job->sharpness, fade = run->grid->fade;
    float border_dx = run->triangle->dx[2], quality_dx = run->triangle->dx[3];
    float x0 = (float)run->first + 0.5f - run->centre_x, dy2 = run->dy2, inverse_radius = run->inverse_radius;
    float border = run->border, quality = run->quality;
    int count = run->count;
    if (sharpness == 1)
    {
#pragma omp simd
        for (int k = 0; k < count; ++k)
        {
            float dx = x0 + (float)k;
            weight[k] = fmaxf(1 - sqrtf(dx * dx + dy2) * inverse_radius, 0);
        }
    }
    else
    {
#pragma omp simd
        for (int k = 0; k < count; ++k)
        {
            float dx = x0 + (float)k, kernel = fmaxf(1 - sqrtf(dx * dx + dy2) * inverse_radius, 1e-6f);
            weight[k] = fast_exp2(sharpness * fast_log2(kernel));
        }
    }
#pragma omp simd
    for (int k = 0; k < count; ++k)
    {
        float g = fmaxf(border + (float)k * border_dx, 0), q = fmaxf(quality + (float)k * quality_dx, 0);
        weight[k] *= fminf(g, 1) * fminf(q, 1) * fade;
    }
}

// Texel index and fractions at the pixels of a run, shifted by one tap's offset.
RF_WIDE_BODY void run_texels(const Run *run, const RfTextureLevel *level, bool tiles, RfVec2 shift, int *restrict index,
                             float *restrict fx, float *restrict fy)
{
    float u = (run->u + shift.x - 0.5f) * level->scale_x, v = (run->v + shift.y - 0.5f) * level->scale_y;
    float du = run->triangle->dx[0] * level->scale_x, dv = run->triangle->dx[1] * level->scale_y;
    float width = (float)level->width, height = (float)level->height;
    int stride = level->stride, count = run->count;
    if (tiles)
    {
        float inverse_width = 1 / width, inverse_height = 1 / height;
#pragma omp simd
        for (int k = 0; k < count; ++k)
        {
            float s = u + (float)k * du, t = v + (float)k * dv;
            s -= width * floorf(s * inverse_width);
            t -= height * floorf(t * inverse_height);
            // Rounding may give -0.0001 or width itself; the padding holds the texels there.
            s = fminf(fmaxf(s, 0), width);
            t = fminf(fmaxf(t, 0), height);
            int i = (int)s, j = (int)t;
            fx[k] = s - (float)i;
            fy[k] = t - (float)j;
            index[k] = j * stride + i;
        }
    }
    else
    {
#pragma omp simd
        for (int k = 0; k < count; ++k)
        {
            float s = fminf(fmaxf(u + (float)k * du, 0), width - 1), t = fminf(fmaxf(v + (float)k * dv, 0), height - 1);
            int i = (int)s, j = (int)t;
            fx[k] = s - (float)i;
            fy[k] = t - (float)j;
            index[k] = j * stride + i;
        }
    }
}

// Sums one tap of one quad. `turn` is a constant at every call, so the plain form pays nothing for it.
RF_WIDE_BODY void sum_samples(const Run *run, const float *restrict texels, int stride, const int *restrict index,
                              const float *restrict fx, const float *restrict fy, const float *restrict weight,
                              float *restrict sums, int turn)
{
    float c = run->grid->turn_cos, s = turn == 1 ? -run->grid->turn_sin : run->grid->turn_sin;
    const Vec8 along = {c, c, 1, 1, c, c, 1, 1}, across = {-s, s, 0, 0, -s, s, 0, 0};
    for (int k = 0; k < run->count; ++k)
    {
        const float *texel = texels + (size_t)index[k] * 4;
        Vec8 upper = *(const Vec8 *)texel, lower = *(const Vec8 *)(texel + (size_t)stride * 4);
        Vec8 r = upper + fy[k] * (lower - upper);
        if (turn)
        {
            Vec8 swapped = {r[1], r[0], r[2], r[3], r[5], r[4], r[6], r[7]};
            r = along * r + across * swapped;
        }
        float w1 = weight[k] * fx[k], w0 = weight[k] - w1;
        r *= (Vec8){w0, w0, w0, w0, w1, w1, w1, w1};
        Vec4 *sum = (Vec4 *)(sums + (size_t)k * 4);
        Vec4 low = {r[0], r[1], r[2], r[3]}, high = {r[4], r[5], r[6], r[7]};
        *sum += low + high;
    }
}

RF_WIDE_BODY void sum_run(const Run *run, const float *restrict weight, RfTileSums *sums)
{
    const RfDrawJob *job = run->job;
    const Triangle *t = run->triangle;
    const RfTextureLevel *level = &job->texture->levels[t->level];
    int index[RF_TILE_SPAN];
    float fx[RF_TILE_SPAN], fy[RF_TILE_SPAN], part[RF_TILE_SPAN];
    float share = 1 / (float)t->taps;
    for (int k = 0; k < run->count; ++k)
        part[k] = weight[k] * share;
    size_t place = (size_t)run->y * RF_TILE_SPAN + (size_t)run->first;
    for (int tap = 0; tap < t->taps; ++tap)
    {
        float along = (float)tap - 0.5f * (float)(t->taps - 1);
        run_texels(run, level, job->texture->tiles, (RfVec2){along * t->tap_step.x, along * t->tap_step.y}, index, fx,
                   fy);
        for (int q = 0; q < job->texture->quads; ++q)
        {
            const float *texels = level->texels + (size_t)q * rf_texture_plane(level);
            float *colour = sums->colour + ((size_t)q * RF_TILE_SPAN * RF_TILE_SPAN + place) * 4;
            if (job->turned[q] == 0)
                sum_samples(run, texels, level->stride, index, fx, fy, part, colour, 0);
            else if (job->turned[q] == 1)
                sum_samples(run, texels, level->stride, index, fx, fy, part, colour, 1);
            else
                sum_samples(run, texels, level->stride, index, fx, fy, part, colour, 2);
        }
    }
    float *restrict w1 = sums->weight + place, *restrict w2 = sums->weight2 + place,
                    *restrict levels = sums->level + place;
    float level_number = (float)t->level;
    for (int k = 0; k < run->count; ++k)
    {
        w1[k] += weight[k];
        w2[k] += weight[k] * weight[k];
        levels[k] += weight[k] * level_number;
    }
}

RF_WIDE_BODY void keep_lattice(const Run *run, const float *weight, float *lattice)
{
    if (run->y % RF_LATTICE_STEP != 0)
        return;
    float *row = lattice + run->y / RF_LATTICE_STEP * RF_LATTICE_SPAN;
    for (int x = (run->first + RF_LATTICE_STEP - 1) / RF_LATTICE_STEP * RF_LATTICE_STEP; x < run->first + run->count;
         x += RF_LATTICE_STEP)
        row[x / RF_LATTICE_STEP] = weight[x - run->first];
}

RF_WIDE_BODY void insert_layers(const Run *run, const float *weight, RfTileLayer *layers)
{
    for (int k = 0; k < run->count; ++k)
    {
        RfTileLayer *layer = layers + (size_t)run->y * RF_TILE_SPAN + (size_t)(run->first + k);
        layer->total += weight[k];
        int slot = 4;
        while (slot > 0 && weight[k] > layer->weight[slot - 1])
            --slot;
        if (slot == 4)
            continue;
        for (int i = 3; i > slot; --i)
        {
            layer->u[i] = layer->u[i - 1];
            layer->v[i] = layer->v[i - 1];
            layer->weight[i] = layer->weight[i - 1];
            layer->id[i] = layer->id[i - 1];
        }
        layer->u[slot] = run->u + (float)k * run->triangle->dx[0];
        layer->v[slot] = run->v + (float)k * run->triangle->dx[1];
        layer->weight[slot] = weight[k];
        layer->id[slot] = (int32_t)run->grid->id;
    }
}

// Either sums or layers is NULL.
RF_WIDE_BODY void draw_triangle(const RfDrawJob *job, const RfDrawGrid *grid, const int corner[3], RfTileSums *sums,
                                float *lattice, int64_t *pixels_drawn, RfTileLayer *layers)
{
    Triangle t;
    if (!set_up_triangle(job, grid, corner, &t))
        return;
    Run run = {.job = job, .grid = grid, .triangle = &t};
    float weight[RF_TILE_SPAN];
    int first = (int)ceilf(fmaxf(t.a.y, 0) - 0.5f), end = (int)ceilf(fminf(t.c.y, (float)job->height) - 0.5f);
    for (int y = first; y < end; ++y)
    {
        set_up_run(&t, y, &run);
        if (run.count == 0)
            continue;
        run_weights(&run, weight);
        if (layers)
        {
            insert_layers(&run, weight, layers);
            continue;
        }
        sum_run(&run, weight, sums);
        *pixels_drawn += run.count * t.taps;
        if (lattice)
            keep_lattice(&run, weight, lattice);
    }
}

RF_WIDE_BODY void draw_grid(const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice,
                            int64_t *pixels_drawn, RfTileLayer *layers)
{
    assert(job->width <= RF_TILE_SPAN && job->height <= RF_TILE_SPAN);
    int n = grid->n;
    for (int j = 0; j + 1 < n; ++j)
        for (int i = 0; i + 1 < n; ++i)
        {
            int a = j * n + i;
            const int upper[3] = {a, a + 1, a + n}, lower[3] = {a + n + 1, a + n, a + 1};
            draw_triangle(job, grid, upper, sums, lattice, pixels_drawn, layers);
            draw_triangle(job, grid, lower, sums, lattice, pixels_drawn, layers);
        }
}

RF_WIDE_BODY void rf_tile_draw_body(const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice,
                                    int64_t *pixels_drawn)
{
    if (lattice)
        memset(lattice, 0, RF_LATTICE_POINTS * sizeof *lattice);
    draw_grid(job, grid, sums, lattice, pixels_drawn, NULL);
}

RF_WIDE(rf_tile_draw,
        (const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice, int64_t *pixels_drawn),
        (job, grid, sums, lattice, pixels_drawn))

RF_WIDE_BODY void rf_tile_layers_body(const RfDrawJob *job, const RfDrawGrid *grid, RfTileLayer *layers)
{
    draw_grid(job, grid, NULL, NULL, NULL, layers);
}

RF_WIDE(rf_tile_layers, (const RfDrawJob *job, const RfDrawGrid *grid, RfTileLayer *layers), (job, grid, layers))
