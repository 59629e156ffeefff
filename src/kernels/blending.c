// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. INRIA RR-6810, 2009,
// section 3.3.
//
// A grid is 2 (n - 1)^2 triangles; over a triangle the exemplar coordinates and the vertex weights are linear. A grid
// is drawn into a tile in three passes, each as wide as it can be:
//
//   1. Rasterise. Triangle by triangle and row by row, u, v and K_g K_d are written into three planes of the tile. Rows
//   are short (a dozen pixels),
//      so nothing else is done here.
//   2. Weigh. Whole rows of the tile: w = K_p K_g K_d F, texel index and fractions.
//   3. Sample. One pixel at a time, but four channels of two neighbouring texels at once: with a = the pair in the
//   upper row, b = in the lower one,
//
//          r = a + fy (b - a),      sum += (w (1 - fx), w fx) * r      (the halves are added up),
//
//      which is two loads and three operations a sample, with no gathers and no unpacking.
//
// Edges: rows and pixels are half-open intervals of pixel centres and an edge's crossing is computed from its ends in
// one order, so two triangles that share an edge leave no gap between them. Where a grid folds over itself the later
// triangle shows; its quality is 0 there.
//
// Minification: the mean deformation of the grid chooses the texture level (by area) and, along its compressed axis, up
// to four taps, whose variance is that of a box as wide as the footprint, less what a sample already averages. One
// filter a grid: a filter a triangle would change sharpness at inner edges, and grids are retired long before their
// parts differ much.

#include "kernels/blending.h"
#include "core/maths.h"
#include "core/result.h"
#include "core/simd.h"
#include "kernels/extrapolation.h"

#include <string.h>

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef float Vec8 __attribute__((vector_size(32), aligned(4), may_alias));

// A footprint is left to one sample up to this compression: the top of the band is mostly empty.
#define FREE_COMPRESSION 1.5f

// A row's ends are not drawn where others outweigh the grid by this: half a grey level at the most.
#define NEGLIGIBLE (1.0f / 256)

// Tile pixels.
#define FARTHEST 1e6f

enum
{
    MAX_TAPS = 4,
    WIDE = 16,
    TILE_PIXELS = RF_TILE_ROWS * RF_TILE_COLUMNS
};

RfResult rf_tile_create(int quads, int rows, RfArena *arena, RfTileSums *out)
{
    out->colour = rf_arena_push(arena, (size_t)quads * TILE_PIXELS * 4, sizeof(float));
    out->weight = rf_arena_push(arena, TILE_PIXELS, sizeof(float));
    out->weight2 = rf_arena_push(arena, TILE_PIXELS, sizeof(float));
    out->level = rf_arena_push(arena, TILE_PIXELS, sizeof(float));
    out->planes = rf_arena_push(arena, 1, sizeof *out->planes);
    if (!out->colour || !out->weight || !out->weight2 || !out->level || !out->planes)
        return RF_OUT_OF_MEMORY;
    memset(out->planes->weight, 0, (size_t)rows * RF_TILE_PITCH * sizeof(float));
    rf_tile_clear(out, quads, rows);
    return RF_OK;
}

void rf_tile_clear(RfTileSums *sums, int quads, int rows)
{
    size_t pixels = (size_t)rows * RF_TILE_COLUMNS;
    for (int q = 0; q < quads; ++q)
        memset(sums->colour + (size_t)q * TILE_PIXELS * 4, 0, pixels * 4 * sizeof(float));
    memset(sums->weight, 0, pixels * sizeof(float));
    memset(sums->weight2, 0, pixels * sizeof(float));
    memset(sums->level, 0, pixels * sizeof(float));
}

// Columns of each row that a grid has written to.
typedef struct Extent
{
    // Padded, so that whole vectors of rows can be updated.
    int first[RF_TILE_ROWS + WIDE], end[RF_TILE_ROWS + WIDE];
} Extent;

typedef struct Filter
{
    int level, taps;
    // From tap to tap, in exemplar pixels.
    RfVec2 step;
} Filter;

// A tile's pixels of one row, ready to be sampled.
typedef struct Row
{
    int first, end;
    float weight[RF_TILE_PITCH];
    // One tap: shares of the left and right texel pair in the weight, fraction from the upper to the lower pair.
    float left[RF_TILE_PITCH], right[RF_TILE_PITCH], fy[RF_TILE_PITCH];
    int index[RF_TILE_PITCH];
} Row;

// The part of the tile that the kernel's circle can reach, in tile pixels.
typedef struct Region
{
    float x0, y0, x1, y1;
    // The circle itself.
    float cx, cy, radius;
} Region;

RF_WIDE_BODY Region region_of(const RfDrawJob *job, const RfDrawGrid *grid)
{
    float inverse = 1 / job->spacing, radius = grid->radius * inverse;
    float cx = (grid->centre.x - job->origin.x) * inverse, cy = (grid->centre.y - job->origin.y) * inverse;
    return (Region){rf_max(cx - radius, 0),
                    rf_max(cy - radius, 0),
                    rf_min(cx + radius, (float)job->width),
                    rf_min(cy + radius, (float)job->height),
                    cx,
                    cy,
                    radius};
}

// ---- rasterising

typedef struct Corner
{
    float x, y;
    Vec4 value; // u, v, K_g K_d, nothing
} Corner;

// A grid's vertices in tile pixels, and on which sides of the region they lie.
typedef struct Vertices
{
    float x[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES], y[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    uint8_t outside[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
} Vertices;

RF_WIDE_BODY void place_vertices(const RfDrawJob *job, const RfDrawGrid *grid, const Region *region, Vertices *vertices)
{
    float inverse = 1 / job->spacing;
    int count = grid->n * grid->n;
#pragma omp simd
    for (int k = 0; k < count; ++k)
    {
        // NaN and the absurdly far come to rest where integers still hold them.
        float x = rf_clamp((grid->x[k] - job->origin.x) * inverse, -FARTHEST, FARTHEST);
        float y = rf_clamp((grid->y[k] - job->origin.y) * inverse, -FARTHEST, FARTHEST);
        vertices->x[k] = x;
        vertices->y[k] = y;
        vertices->outside[k] = (uint8_t)((x < region->x0 ? 1 : 0) | (x > region->x1 ? 2 : 0) |
                                         (y < region->y0 ? 4 : 0) | (y > region->y1 ? 8 : 0));
    }
}

RF_WIDE_BODY Corner corner_of(const RfDrawGrid *grid, const Vertices *vertices, int i, int j)
{
    int k = j * grid->n + i;
    bool border = i == 0 || j == 0 || i == grid->n - 1 || j == grid->n - 1;
    return (Corner){
        vertices->x[k],
        vertices->y[k],
        {grid->u0 + (float)i * grid->cell, grid->v0 + (float)j * grid->cell, border ? 0.0f : grid->quality[k], 0}};
}

RF_WIDE_BODY bool is_above(const Corner *p, const Corner *q)
{
    return p->y < q->y || (p->y == q->y && p->x < q->x);
}

// Writes `count` pixels; u0, v0, w0 are the values at the first and dx their slopes along x.
RF_WIDE_BODY void write_pixels(RfTilePlanes *planes, int place, int count, float u0, float v0, float w0, Vec4 dx)
{
    float *restrict u = planes->u + place, *restrict v = planes->v + place, *restrict weight = planes->weight + place;
    float du = dx[0], dv = dx[1], dw = dx[2];
    for (int block = 0; block < count; block += WIDE)
#pragma omp simd
        for (int k = block; k < block + WIDE; ++k)
        {
            float along = (float)k;
            if (k < count)
            {
                u[k] = u0 + along * du;
                v[k] = v0 + along * dv;
                weight[k] = rf_max(w0 + along * dw, 0);
            }
        }
}

RF_WIDE_BODY float slope_of(const Corner *p, const Corner *q)
{
    return q->y > p->y ? (q->x - p->x) / (q->y - p->y) : 0;
}

// Pixels of a triangle's rows: [first, end), end <= first where there are none; and the values there.
typedef struct TriangleRows
{
    int first[RF_TILE_ROWS + WIDE], end[RF_TILE_ROWS + WIDE];
    // At the first pixel.
    float u[RF_TILE_ROWS + WIDE], v[RF_TILE_ROWS + WIDE], weight[RF_TILE_ROWS + WIDE];
} TriangleRows;

// All rows of the triangle a, b, c (from top to bottom) at once.
RF_WIDE_BODY void find_rows(const Region *region, const Corner *a, const Corner *b, const Corner *c, Vec4 start,
                            Vec4 dx, Vec4 dy, int first_row, int end_row, Extent *extent, TriangleRows *rows)
{
    float slope_ac = slope_of(a, c), slope_ab = slope_of(a, b), slope_bc = slope_of(b, c);
    float ax = a->x, ay = a->y, bx = b->x, by = b->y, x0 = region->x0, x1 = region->x1;
    float cx = region->cx, cy = region->cy, radius2 = region->radius * region->radius;
    float su = start[0], sv = start[1], sw = start[2], dxu = dx[0], dxv = dx[1], dxw = dx[2], dyu = dy[0], dyv = dy[1],
          dyw = dy[2];
    int count = end_row - first_row;
    int *restrict least = extent->first + first_row, *restrict most = extent->end + first_row;
    for (int block = 0; block < count; block += WIDE)
#pragma omp simd
        for (int k = block; k < block + WIDE; ++k)
        {
            float y = (float)(first_row + k) + 0.5f, along = ax + (y - ay) * slope_ac;
            float upper = ax + (y - ay) * slope_ab, lower = bx + (y - by) * slope_bc, other = y < by ? upper : lower;
            float chord = sqrtf(rf_max(radius2 - (y - cy) * (y - cy), 0));
            float left = rf_max(rf_min(along, other), rf_max(x0, cx - chord));
            float right = rf_min(rf_max(along, other), rf_min(x1, cx + chord));
            int first = (int)ceilf(left - 0.5f), end = (int)ceilf(right - 0.5f);
            bool some = k < count && end > first;
            rows->first[k] = first;
            rows->end[k] = end;
            rows->u[k] = su + (float)first * dxu + (y - 0.5f) * dyu;
            rows->v[k] = sv + (float)first * dxv + (y - 0.5f) * dyv;
            rows->weight[k] = sw + (float)first * dxw + (y - 0.5f) * dyw;
            least[k] = some && first < least[k] ? first : least[k];
            most[k] = some && end > most[k] ? end : most[k];
        }
}

RF_WIDE_BODY void rasterise_triangle(const Region *region, const Corner *p, const Corner *q, const Corner *r,
                                     RfTilePlanes *planes, Extent *extent)
{
    // a, b, c from top to bottom.
    const Corner *a = p, *b = q, *c = r, *swap;
    if (is_above(b, a))
        swap = a, a = b, b = swap;
    if (is_above(c, b))
        swap = b, b = c, c = swap;
    if (is_above(b, a))
        swap = a, a = b, b = swap;
    float abx = b->x - a->x, aby = b->y - a->y, acx = c->x - a->x, acy = c->y - a->y, det = abx * acy - aby * acx;
    if (!(det > 1e-6f || det < -1e-6f))
        return;
    float inverse = 1 / det;
    Vec4 ab = b->value - a->value, ac = c->value - a->value;
    Vec4 dx = (ab * acy - ac * aby) * inverse, dy = (ac * abx - ab * acx) * inverse;
    Vec4 start = a->value + (0.5f - a->x) * dx + (0.5f - a->y) * dy;
    int first_row = (int)ceilf(rf_max(a->y, region->y0) - 0.5f), end_row = (int)ceilf(rf_min(c->y, region->y1) - 0.5f);
    if (end_row <= first_row)
        return;
    TriangleRows rows;
    find_rows(region, a, b, c, start, dx, dy, first_row, end_row, extent, &rows);
    for (int k = 0; k < end_row - first_row; ++k)
        if (rows.end[k] > rows.first[k])
            write_pixels(planes, (first_row + k) * RF_TILE_PITCH + rows.first[k], rows.end[k] - rows.first[k],
                         rows.u[k], rows.v[k], rows.weight[k], dx);
}

RF_WIDE_BODY void rasterise(const RfDrawJob *job, const RfDrawGrid *grid, RfTilePlanes *planes, Extent *extent)
{
    assert(job->width <= RF_TILE_COLUMNS && job->height <= RF_TILE_ROWS);
    for (int y = 0; y < RF_TILE_ROWS; ++y)
    {
        extent->first[y] = RF_TILE_COLUMNS;
        extent->end[y] = 0;
    }
    Region region = region_of(job, grid);
    Vertices vertices;
    place_vertices(job, grid, &region, &vertices);
    const uint8_t *outside = vertices.outside;
    for (int j = 0; j + 1 < grid->n; ++j)
        for (int i = 0; i + 1 < grid->n; ++i)
        {
            int k = j * grid->n + i;
            if (outside[k] & outside[k + 1] & outside[k + grid->n] & outside[k + grid->n + 1])
                continue;
            Corner a = corner_of(grid, &vertices, i, j), b = corner_of(grid, &vertices, i + 1, j);
            Corner c = corner_of(grid, &vertices, i, j + 1), d = corner_of(grid, &vertices, i + 1, j + 1);
            rasterise_triangle(&region, &a, &b, &c, planes, extent);
            rasterise_triangle(&region, &d, &c, &b, planes, extent);
        }
}

// ---- weighing

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
    x = rf_max(x, -126);
    float whole = floorf(x), t = x - whole;
    union
    {
        int32_t i;
        float f;
    } bits = {((int32_t)whole + 127) << 23};
    return bits.f * (1 + t * (0.6951786f + t * (0.2276141f + t * 0.0772073f)));
}

// The root of x >= 0 to 5e-6 of itself: two of Newton's steps from an estimate by exponent. The machine's own takes
// twenty cycles a vector, and this is for weights.
RF_WIDE_BODY float fast_root(float x)
{
    union
    {
        float f;
        int32_t i;
    } bits = {x};
    bits.i = 0x5f3759df - (bits.i >> 1);
    float y = bits.f, half = 0.5f * x;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    return x * y;
}

// kernel ^ sharpness; power is 1, 2, or 3 for three halves, 0 for any other.
RF_WIDE_BODY float kernel_power(float kernel, float sharpness, int power)
{
    if (power == 1)
        return kernel;
    if (power == 2)
        return kernel * kernel;
    if (power == 3)
        return kernel * sqrtf(kernel);
    return kernel > 0 ? fast_exp2(sharpness * fast_log2(rf_max(kernel, 1e-6f))) : 0;
}

// w = K_p K_g K_d F over a row. `power` is a constant at every call.
RF_WIDE_BODY void weigh_row_with(const RfDrawJob *job, const RfDrawGrid *grid, float *restrict plane, int y, Row *row,
                                 int power)
{
    float inverse = 1 / job->spacing, cx = (grid->centre.x - job->origin.x) * inverse,
          cy = (grid->centre.y - job->origin.y) * inverse;
    float inverse_radius = job->spacing / grid->radius, dy = (float)y + 0.5f - cy, dy2 = dy * dy, fade = grid->fade,
          sharpness = job->sharpness;
    float *restrict weight = row->weight;
    for (int block = row->first / WIDE * WIDE; block < row->end; block += WIDE)
#pragma omp simd
        for (int k = block; k < block + WIDE; ++k)
        {
            float dx = (float)k + 0.5f - cx;
            float kernel = rf_max(1 - fast_root(dx * dx + dy2) * inverse_radius, 0);
            weight[k] = kernel_power(kernel, sharpness, power) * plane[k] * fade;
            plane[k] = 0;
        }
}

// `others`: summed weights of the grids drawn before, or NULL.
RF_WIDE_BODY void weigh_row(const RfDrawJob *job, const RfDrawGrid *grid, float *plane, const float *others, int y,
                            Row *row)
{
    if (job->sharpness == 1)
        weigh_row_with(job, grid, plane, y, row, 1);
    else if (job->sharpness == 2)
        weigh_row_with(job, grid, plane, y, row, 2);
    else if (job->sharpness == 1.5f)
        weigh_row_with(job, grid, plane, y, row, 3);
    else
        weigh_row_with(job, grid, plane, y, row, 0);
    while (row->first < row->end && !(row->weight[row->first] > (others ? NEGLIGIBLE * others[row->first] : 0)))
        ++row->first;
    while (row->first < row->end && !(row->weight[row->end - 1] > (others ? NEGLIGIBLE * others[row->end - 1] : 0)))
        --row->end;
}

// ---- sampling

// Exemplar pixels that a frame pixel covers, along both axes of its footprint, and what they ask of the sampler.
RF_WIDE_BODY Filter choose_filter(const RfDrawJob *job, const RfDrawGrid *grid)
{
    const float *s = grid->stretch;
    float det = s[0] * s[3] - s[1] * s[2];
    Filter filter = {rf_min_int(job->level_bias, job->texture->level_count - 1), 1, {0, 0}};
    if (!(det > 1e-6f))
        return filter;
    // d(u, v) / d(x, y)
    float a = s[3] / det, b = -s[1] / det, c = -s[2] / det, d = s[0] / det, area = 1 / det;
    float sum = a * a + b * b + c * c + d * d, root = sqrtf(rf_max(sum * sum - 4 * area * area, 0)),
          largest = sqrtf(0.5f * (sum + root));
    int level = 0;
    for (float left = area; left > 2 && level < RF_TEXTURE_LEVELS;
         left *= 0.25f) // the root of it past the root of 2: the next level
        ++level;
    filter.level = rf_min_int(level + job->level_bias, job->texture->level_count - 1);
    float footprint = largest / (float)(1 << level);
    if (footprint <= FREE_COMPRESSION)
        return filter;
    // Taps at (k - (n - 1) / 2) step have the variance step^2 (n^2 - 1) / 12.
    float variance = (footprint * footprint - FREE_COMPRESSION * FREE_COMPRESSION) / 12;
    filter.taps = footprint < 2 ? 2 : footprint < 3 ? 3 : MAX_TAPS;
    float step = sqrtf(12 * variance / (float)(filter.taps * filter.taps - 1)) * (float)(1 << level) * job->spacing;
    // The long axis in the exemplar: the eigenvector of J J^T to largest^2.
    float xx = a * a + b * b, xy = a * c + b * d, yy = c * c + d * d;
    float ex = xx >= yy ? largest * largest - yy : xy, ey = xx >= yy ? xy : largest * largest - xx,
          length = sqrtf(ex * ex + ey * ey);
    filter.step = length > 0 ? (RfVec2){step * ex / length, step * ey / length} : (RfVec2){step, 0};
    return filter;
}

// Texel index and fractions over a row, shifted by one tap's offset.
RF_WIDE_BODY void find_texels(const RfTextureLevel *level, bool tiles, const float *restrict u, const float *restrict v,
                              RfVec2 shift, float share, Row *row)
{
    float scale_x = level->scale_x, scale_y = level->scale_y, width = (float)level->width,
          height = (float)level->height;
    float shift_x = (shift.x - 0.5f) * scale_x, shift_y = (shift.y - 0.5f) * scale_y;
    float inverse_width = tiles ? 1 / width : 0, inverse_height = tiles ? 1 / height : 0;
    // Where it tiles, rounding may give width itself: the padding holds the texel there.
    float last_x = tiles ? width : width - 1, last_y = tiles ? height : height - 1;
    int stride = level->stride;
    const float *restrict weight = row->weight;
    float *restrict left = row->left, *restrict right = row->right, *restrict fy = row->fy;
    int *restrict index = row->index;
    for (int block = row->first / WIDE * WIDE; block < row->end; block += WIDE)
#pragma omp simd
        for (int k = block; k < block + WIDE; ++k)
        {
            float s = u[k] * scale_x + shift_x, t = v[k] * scale_y + shift_y;
            s -= width * floorf(s * inverse_width);
            t -= height * floorf(t * inverse_height);
            s = rf_min(rf_max(s, 0), last_x);
            t = rf_min(rf_max(t, 0), last_y);
            int i = (int)s, j = (int)t;
            float w = weight[k] * share, w1 = w * (s - (float)i);
            left[k] = w - w1;
            right[k] = w1;
            fy[k] = t - (float)j;
            index[k] = j * stride + i;
        }
}

// Sums one tap of one quad over a row. `turn` is a constant at every call, so the plain form pays nothing for it.
RF_WIDE_BODY void sum_samples(const RfDrawGrid *grid, const float *restrict texels, int stride, const Row *row,
                              float *restrict sums, int turn)
{
    float c = grid->turn_cos, s = turn == 1 ? -grid->turn_sin : grid->turn_sin;
    const Vec8 along = {c, c, 1, 1, c, c, 1, 1}, across = {-s, s, 0, 0, -s, s, 0, 0};
    for (int k = row->first; k < row->end; ++k)
    {
        const float *texel = texels + (size_t)row->index[k] * 4;
        Vec8 upper = *(const Vec8 *)texel, lower = *(const Vec8 *)(texel + (size_t)stride * 4);
        Vec8 r = upper + row->fy[k] * (lower - upper);
        if (turn)
        {
            Vec8 swapped = {r[1], r[0], r[2], r[3], r[5], r[4], r[6], r[7]};
            r = along * r + across * swapped;
        }
        float w0 = row->left[k], w1 = row->right[k];
        Vec8 left = {w0, w0, w0, w0, w0, w0, w0, w0}, right = {w1, w1, w1, w1, w1, w1, w1, w1};
        r *= __builtin_shufflevector(left, right, 0, 1, 2, 3, 12, 13, 14, 15);
        Vec4 *sum = (Vec4 *)(sums + (size_t)k * 4);
        Vec4 low = {r[0], r[1], r[2], r[3]}, high = {r[4], r[5], r[6], r[7]};
        *sum += low + high;
    }
}

RF_WIDE_BODY void sum_row(const RfDrawJob *job, const RfDrawGrid *grid, const Filter *filter, int y, Row *row,
                          RfTileSums *sums)
{
    const RfTextureLevel *level = &job->texture->levels[filter->level];
    const float *u = sums->planes->u + y * RF_TILE_PITCH, *v = sums->planes->v + y * RF_TILE_PITCH;
    size_t place = (size_t)y * RF_TILE_COLUMNS;
    float share = 1 / (float)filter->taps;
    for (int tap = 0; tap < filter->taps; ++tap)
    {
        float along = (float)tap - 0.5f * (float)(filter->taps - 1);
        find_texels(level, job->texture->tiles, u, v, (RfVec2){along * filter->step.x, along * filter->step.y}, share,
                    row);
        for (int q = 0; q < job->texture->quads; ++q)
        {
            const float *texels = level->texels + (size_t)q * rf_texture_plane(level);
            float *colour = sums->colour + ((size_t)q * TILE_PIXELS + place) * 4;
            if (job->turned[q] == 0)
                sum_samples(grid, texels, level->stride, row, colour, 0);
            else if (job->turned[q] == 1)
                sum_samples(grid, texels, level->stride, row, colour, 1);
            else
                sum_samples(grid, texels, level->stride, row, colour, 2);
        }
    }
    float *restrict w1 = sums->weight + place, *restrict w2 = sums->weight2 + place,
                    *restrict levels = sums->level + place;
    const float *restrict weight = row->weight;
    float level_number = (float)filter->level;
    for (int k = row->first; k < row->end; ++k)
    {
        w1[k] += weight[k];
        w2[k] += weight[k] * weight[k];
    }
    for (int k = row->first; k < row->end && level_number > 0; ++k)
        levels[k] += weight[k] * level_number;
}

RF_WIDE_BODY void keep_lattice(const Row *row, int y, float *lattice)
{
    float *to = lattice + y / RF_LATTICE_STEP * RF_LATTICE_COLUMNS;
    for (int x = (row->first + RF_LATTICE_STEP - 1) / RF_LATTICE_STEP * RF_LATTICE_STEP; x < row->end;
         x += RF_LATTICE_STEP)
        to[x / RF_LATTICE_STEP] = row->weight[x];
}

RF_WIDE_BODY void rf_tile_draw_body(const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice,
                                    int64_t *samples)
{
    Extent extent;
    Filter filter = choose_filter(job, grid);
    if (lattice)
        memset(lattice, 0, RF_LATTICE_POINTS * sizeof *lattice);
    rasterise(job, grid, sums->planes, &extent);
    for (int y = 0; y < job->height; ++y)
    {
        Row row;
        row.first = extent.first[y];
        row.end = extent.end[y];
        if (row.first >= row.end)
            continue;
        weigh_row(job, grid, sums->planes->weight + y * RF_TILE_PITCH, sums->weight + y * RF_TILE_COLUMNS, y, &row);
        if (row.first >= row.end)
            continue;
        sum_row(job, grid, &filter, y, &row, sums);
        *samples += (int64_t)(row.end - row.first) * filter.taps;
        if (lattice && y % RF_LATTICE_STEP == 0)
            keep_lattice(&row, y, lattice);
    }
}

RF_WIDE(rf_tile_draw,
        (const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice, int64_t *samples),
        (job, grid, sums, lattice, samples))

// ---- layers

RF_WIDE_BODY void insert_layer(RfTileLayer *layer, float u, float v, float weight, uint32_t id)
{
    layer->total += weight;
    int slot = 4;
    while (slot > 0 && weight > layer->weight[slot - 1])
        --slot;
    if (slot == 4)
        return;
    for (int i = 3; i > slot; --i)
    {
        layer->u[i] = layer->u[i - 1];
        layer->v[i] = layer->v[i - 1];
        layer->weight[i] = layer->weight[i - 1];
        layer->id[i] = layer->id[i - 1];
    }
    layer->u[slot] = u;
    layer->v[slot] = v;
    layer->weight[slot] = weight;
    layer->id[slot] = (int32_t)id;
}

RF_WIDE_BODY void rf_tile_layers_body(const RfDrawJob *job, const RfDrawGrid *grid, RfTilePlanes *planes,
                                      RfTileLayer *layers)
{
    Extent extent;
    rasterise(job, grid, planes, &extent);
    for (int y = 0; y < job->height; ++y)
    {
        Row row;
        row.first = extent.first[y];
        row.end = extent.end[y];
        if (row.first >= row.end)
            continue;
        weigh_row(job, grid, planes->weight + y * RF_TILE_PITCH, NULL, y, &row);
        for (int x = row.first; x < row.end; ++x)
            insert_layer(&layers[y * RF_TILE_COLUMNS + x], planes->u[y * RF_TILE_PITCH + x],
                         planes->v[y * RF_TILE_PITCH + x], row.weight[x], grid->id);
    }
}

RF_WIDE(rf_tile_layers, (const RfDrawJob *job, const RfDrawGrid *grid, RfTilePlanes *planes, RfTileLayer *layers),
        (job, grid, planes, layers))
