// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. INRIA RR-6810, 2009,
// section 3.3.
//
// A grid is drawn into a tile in three passes, each as wide as it can be:
//
//   1. Rasterise and weigh, on a lattice of every fourth pixel: exemplar coordinates u, v and w = K_p K_g K_d F. All
//      three are smooth over tens of pixels, so between the points they are interpolated; that bends the straight
//      edges between triangles by a fraction of a pixel, far less than what triangles make of the flow. Grids with
//      cells under COARSE_CELL pixels are rasterised at every pixel. Points of the lattice that the grid does not
//      reach have w = 0 and the coordinates of the grid's mean deformation.
//   2. Find texels. Whole rows of the tile: texel index and fractions.
//   3. Sample. One pixel at a time, but four channels of two neighbouring texels at once: with a = the pair in the
//      upper row, b = in the lower one,
//
//          r = a + fy (b - a),      sum += (w (1 - fx), w fx) * r      (the halves are added up),
//
//      which is two loads and three operations a sample, with no gathers and no unpacking.
//
// Minification: the mean deformation of the grid chooses the texture level (by area) and, along its compressed axis, up
// to four taps, whose variance is that of a box as wide as the footprint, less what a sample already averages. One
// filter a grid: a filter a triangle would change sharpness at inner edges, and grids are retired long before their
// parts differ much.

#include "kernels/blending.h"
#include "core/maths.h"
#include "core/result.h"
#include "core/simd.h"

#include <string.h>

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef float Vec8 __attribute__((vector_size(32), aligned(4), may_alias));

// A footprint is left to one sample up to this compression: the top of the band is mostly empty.
#define FREE_COMPRESSION 1.5f

// A row's ends are not drawn where others outweigh the grid by this: half a grey level at the most.
#define NEGLIGIBLE (1.0f / 256)

// Cells of a grid, in pixels, from which on every fourth pixel is enough: three points a cell.
#define COARSE_CELL 10.0f

enum
{
    MAX_TAPS = 4,
    COARSE_STEP = 4,
    TILE_PIXELS = RF_TILE_ROWS * RF_TILE_COLUMNS
};

RfResult rf_tile_create(int quads, int rows, RfArena *arena, RfTileSums *out)
{
    out->colour = rf_arena_push(arena, (size_t)quads * TILE_PIXELS * 4, sizeof(float));
    out->weight = rf_arena_push(arena, TILE_PIXELS + RF_WIDE_FLOATS, sizeof(float));
    out->weight2 = rf_arena_push(arena, TILE_PIXELS + RF_WIDE_FLOATS, sizeof(float));
    out->level = rf_arena_push(arena, TILE_PIXELS + RF_WIDE_FLOATS, sizeof(float));
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

typedef struct Filter
{
    int level, taps;
    // From tap to tap, in exemplar pixels.
    RfVec2 step;
    // From a pixel's exemplar coordinates to those of the pixel below, on average.
    RfVec2 below;
} Filter;

// A tile's pixels of one row, ready to be sampled.
typedef struct Row
{
    // Outside them the weights of a whole vector are 0.
    int first, end;
    float u[RF_TILE_PITCH], v[RF_TILE_PITCH], weight[RF_TILE_PITCH];
    // One tap: shares of the left and right texel pair in the weight, fraction from the upper to the lower pair.
    float left[RF_TILE_PITCH], right[RF_TILE_PITCH], fy[RF_TILE_PITCH];
    int index[RF_TILE_PITCH];
} Row;

// ---- weighing ----------------------------------------------------------------------------------------------------

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

// Turns K_g K_d into w = K_p K_g K_d F over a row of points. `power` is a constant at every call.
RF_WIDE_BODY void weigh_row_with(const RfRasterArea *area, const RfDrawGrid *grid, float sharpness, int y, int first,
                                 int end, int power, float *restrict weight)
{
    float cx = (grid->centre.x - area->origin.x) / area->spacing, inverse_radius = area->spacing / grid->radius;
    float dy = (((float)y + 0.5f) * area->row_spacing + area->origin.y - grid->centre.y) / area->spacing;
    float dy2 = dy * dy, fade = grid->fade;
    const int stop = rf_whole_vectors(end);
#pragma omp simd
    for (int k = first / RF_WIDE_FLOATS * RF_WIDE_FLOATS; k < stop; ++k)
    {
        float dx = (float)k + 0.5f - cx;
        float kernel = rf_max(1 - fast_root(dx * dx + dy2) * inverse_radius, 0);
        weight[k] *= kernel_power(kernel, sharpness, power) * fade;
    }
}

RF_WIDE_BODY void weigh_row(const RfRasterArea *area, const RfDrawGrid *grid, float sharpness, int y, int first,
                            int end, float *weight)
{
    if (sharpness == 1)
        weigh_row_with(area, grid, sharpness, y, first, end, 1, weight);
    else if (sharpness == 2)
        weigh_row_with(area, grid, sharpness, y, first, end, 2, weight);
    else if (sharpness == 1.5f)
        weigh_row_with(area, grid, sharpness, y, first, end, 3, weight);
    else
        weigh_row_with(area, grid, sharpness, y, first, end, 0, weight);
}

// ---- rows between ------------------------------------------------------------------------------------------------

// Where u, v and w of a grid are taken: at every step-th row of the tile.
typedef struct Rows
{
    int step;
    RfRasterArea area;
    RfRasterExtent extent;
} Rows;

RF_WIDE_BODY RfRasterArea coarse_area(const RfRasterArea *pixels)
{
    // The first row stays on the first pixels' centres.
    float shift = 0.5f * (float)(1 - COARSE_STEP) * pixels->spacing;
    return (RfRasterArea){{pixels->origin.x, pixels->origin.y + shift},
                          pixels->spacing,
                          pixels->spacing * COARSE_STEP,
                          pixels->width,
                          (pixels->height + COARSE_STEP - 2) / COARSE_STEP + 1};
}

// Coordinates of the grid's mean deformation.
RF_WIDE_BODY void fill_coordinates(const RfRasterArea *area, const RfDrawGrid *grid, RfRasterPlanes *planes)
{
    const float *s = grid->stretch;
    float det = s[0] * s[3] - s[1] * s[2], inverse = det > 1e-6f ? 1 / det : 0;
    float dux = s[3] * inverse * area->spacing, dvx = -s[2] * inverse * area->spacing;
    float x0 = area->origin.x - grid->centre.x + 0.5f * area->spacing, middle = 0.5f * (float)(grid->n - 1);
    for (int y = 0; y < area->height; ++y)
    {
        float dy = ((float)y + 0.5f) * area->row_spacing + area->origin.y - grid->centre.y;
        float u0 = grid->u0 + middle * grid->cell + (x0 * s[3] - dy * s[1]) * inverse;
        float v0 = grid->v0 + middle * grid->cell + (dy * s[0] - x0 * s[2]) * inverse;
        float *restrict u = planes->u + y * RF_TILE_PITCH, *restrict v = planes->v + y * RF_TILE_PITCH;
#pragma omp simd
        for (int x = 0; x < RF_TILE_PITCH; ++x)
        {
            u[x] = u0 + (float)x * dux;
            v[x] = v0 + (float)x * dvx;
        }
    }
}

RF_WIDE_BODY void make_rows(const RfDrawJob *job, const RfDrawGrid *grid, RfRasterPlanes *planes, Rows *rows)
{
    rows->step = grid->cell >= COARSE_CELL * job->area.spacing ? COARSE_STEP : 1;
    rows->area = rows->step == 1 ? job->area : coarse_area(&job->area);
    RfRasterExtent *extent = &rows->extent;
    fill_coordinates(&rows->area, grid, planes);
    // A point above or below the circle has a neighbour inside it.
    float reach = grid->radius + (rows->step > 1 ? rows->area.row_spacing : 0);
    rf_rasterise(&rows->area, grid, reach, planes, extent);
    for (int y = 0; y < rows->area.height; ++y)
        weigh_row(&rows->area, grid, job->sharpness, y, extent->first[y], extent->end[y],
                  planes->weight + y * RF_TILE_PITCH);
}

RF_WIDE_BODY void clear_rows(const Rows *rows, RfRasterPlanes *planes)
{
    for (int y = 0; y < rows->area.height; ++y)
        if (rows->extent.end[y] > rows->extent.first[y])
            memset(planes->weight + y * RF_TILE_PITCH + rows->extent.first[y], 0,
                   (size_t)(rows->extent.end[y] - rows->extent.first[y]) * sizeof(float));
}

// Row y of the tile, between two rows of the planes; false where the grid does not show. Left out are pixels where
// `others`, the summed weights of the grids drawn before, outweigh this grid.
RF_WIDE_BODY bool take_row(const Rows *rows, const RfRasterPlanes *planes, const float *restrict others, int y,
                           Row *row)
{
    int j = y / rows->step, next = j * rows->step == y ? j : j + 1;
    int start = rf_min_int(rows->extent.first[j], rows->extent.first[next]);
    int end = rf_max_int(rows->extent.end[j], rows->extent.end[next]);
    float t = (float)(y - j * rows->step) / (float)rows->step;
    size_t upper = (size_t)j * RF_TILE_PITCH, lower = (size_t)next * RF_TILE_PITCH;
    const float *restrict u0 = planes->u + upper, *restrict u1 = planes->u + lower;
    const float *restrict v0 = planes->v + upper, *restrict v1 = planes->v + lower;
    const float *restrict w0 = planes->weight + upper, *restrict w1 = planes->weight + lower;
    float *restrict u = row->u, *restrict v = row->v, *restrict weight = row->weight;
    int first = RF_TILE_COLUMNS, last = -1;
    const int stop = rf_whole_vectors(end);
#pragma omp simd reduction(min : first) reduction(max : last)
    for (int k = start / RF_WIDE_FLOATS * RF_WIDE_FLOATS; k < stop; ++k)
    {
        float w = w0[k] + t * (w1[k] - w0[k]);
        bool shows = w > NEGLIGIBLE * others[k];
        u[k] = u0[k] + t * (u1[k] - u0[k]);
        v[k] = v0[k] + t * (v1[k] - v0[k]);
        weight[k] = shows ? w : 0;
        first = shows && k < first ? k : first;
        last = shows && k > last ? k : last;
    }
    row->first = first;
    row->end = last + 1;
    return first <= last;
}

// ---- sampling ----------------------------------------------------------------------------------------------------

// Exemplar pixels that a frame pixel covers, along both axes of its footprint, and what they ask of the sampler.
RF_WIDE_BODY Filter choose_filter(const RfDrawJob *job, const RfDrawGrid *grid)
{
    const float *s = grid->stretch;
    float det = s[0] * s[3] - s[1] * s[2];
    Filter filter = {rf_min_int(job->level_bias, job->texture->level_count - 1), 1, {0, 0}, {0, 0}};
    if (!(det > 1e-6f))
        return filter;
    // d(u, v) / d(x, y)
    float a = s[3] / det, b = -s[1] / det, c = -s[2] / det, d = s[0] / det, area = 1 / det;
    filter.below = (RfVec2){b * job->area.spacing, d * job->area.spacing};
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
    float step =
        sqrtf(12 * variance / (float)(filter.taps * filter.taps - 1)) * (float)(1 << level) * job->area.spacing;
    // The long axis in the exemplar: the eigenvector of J J^T to largest^2.
    float xx = a * a + b * b, xy = a * c + b * d, yy = c * c + d * d;
    float ex = xx >= yy ? largest * largest - yy : xy, ey = xx >= yy ? xy : largest * largest - xx,
          length = sqrtf(ex * ex + ey * ey);
    filter.step = length > 0 ? (RfVec2){step * ex / length, step * ey / length} : (RfVec2){step, 0};
    return filter;
}

// Texel index and fractions over a row, shifted by one tap's offset.
RF_WIDE_BODY void find_texels(const RfTextureLevel *level, bool tiles, RfVec2 shift, float share, Row *row)
{
    float scale_x = level->scale_x, scale_y = level->scale_y, width = (float)level->width,
          height = (float)level->height;
    float shift_x = (shift.x - 0.5f) * scale_x, shift_y = (shift.y - 0.5f) * scale_y;
    float inverse_width = tiles ? 1 / width : 0, inverse_height = tiles ? 1 / height : 0;
    // Where it tiles, rounding may give width itself: the padding holds the texel there.
    float last_x = tiles ? width : width - 1, last_y = tiles ? height : height - 1;
    int stride = level->stride;
    const float *restrict u = row->u, *restrict v = row->v, *restrict weight = row->weight;
    float *restrict left = row->left, *restrict right = row->right, *restrict fy = row->fy;
    int *restrict index = row->index;
    const int stop = rf_whole_vectors(row->end);
#pragma omp simd
    for (int k = row->first / RF_WIDE_FLOATS * RF_WIDE_FLOATS; k < stop; ++k)
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
// `ahead`, in floats: where the next row will read, or near it. A texture is larger than the caches next to the
// processor, and rows are too short for it to guess: fetching early takes a seventh off the whole.
RF_WIDE_BODY void sum_samples(const RfDrawGrid *grid, const float *restrict texels, int stride, ptrdiff_t ahead,
                              const Row *row, float *restrict sums, int turn)
{
    float c = grid->turn_cos, s = turn == 1 ? -grid->turn_sin : grid->turn_sin;
    const Vec8 along = {c, c, 1, 1, c, c, 1, 1}, across = {-s, s, 0, 0, -s, s, 0, 0};
    for (int k = row->first; k < row->end; ++k)
    {
        const float *texel = texels + (size_t)row->index[k] * 4;
        Vec8 upper = *(const Vec8 *)texel, lower = *(const Vec8 *)(texel + (size_t)stride * 4);
        // Two pixels share the lines that they read, so one asks for the upper and one for the lower texels.
        __builtin_prefetch(texel + ahead + (k & 1 ? stride * 4 : 0));
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
    size_t place = (size_t)y * RF_TILE_COLUMNS;
    ptrdiff_t ahead =
        4 * (lrintf(filter->below.y * level->scale_y) * level->stride + lrintf(filter->below.x * level->scale_x));
    float share = 1 / (float)filter->taps;
    for (int tap = 0; tap < filter->taps; ++tap)
    {
        float along = (float)tap - 0.5f * (float)(filter->taps - 1);
        find_texels(level, job->texture->tiles, (RfVec2){along * filter->step.x, along * filter->step.y}, share, row);
        for (int q = 0; q < job->texture->quads; ++q)
        {
            const float *texels = level->texels + (size_t)q * rf_texture_plane(level);
            float *colour = sums->colour + ((size_t)q * TILE_PIXELS + place) * 4;
            if (job->turned[q] == 0)
                sum_samples(grid, texels, level->stride, ahead, row, colour, 0);
            else if (job->turned[q] == 1)
                sum_samples(grid, texels, level->stride, ahead, row, colour, 1);
            else
                sum_samples(grid, texels, level->stride, ahead, row, colour, 2);
        }
    }
    float *restrict w1 = sums->weight + place, *restrict w2 = sums->weight2 + place,
                    *restrict levels = sums->level + place;
    const float *restrict weight = row->weight;
    float level_number = (float)filter->level;
    const int stop = rf_whole_vectors(row->end);
#pragma omp simd
    for (int k = row->first / RF_WIDE_FLOATS * RF_WIDE_FLOATS; k < stop; ++k)
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
    Rows rows;
    Filter filter = choose_filter(job, grid);
    if (lattice)
        memset(lattice, 0, RF_LATTICE_POINTS * sizeof *lattice);
    make_rows(job, grid, sums->planes, &rows);
    for (int y = 0; y < job->area.height; ++y)
    {
        Row row;
        if (!take_row(&rows, sums->planes, sums->weight + y * RF_TILE_COLUMNS, y, &row))
            continue;
        sum_row(job, grid, &filter, y, &row, sums);
        *samples += (int64_t)(row.end - row.first) * filter.taps;
        if (lattice && y % RF_LATTICE_STEP == 0)
            keep_lattice(&row, y, lattice);
    }
    clear_rows(&rows, sums->planes);
}

RF_WIDE(rf_tile_draw,
        (const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice, int64_t *samples),
        (job, grid, sums, lattice, samples))

// ---- layers ------------------------------------------------------------------------------------------------------

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

RF_WIDE_BODY void rf_tile_layers_body(const RfDrawJob *job, const RfDrawGrid *grid, RfRasterPlanes *planes,
                                      RfTileLayer *layers)
{
    static const float none[RF_TILE_PITCH];
    Rows rows;
    make_rows(job, grid, planes, &rows);
    for (int y = 0; y < job->area.height; ++y)
    {
        Row row;
        if (!take_row(&rows, planes, none, y, &row))
            continue;
        for (int x = row.first; x < row.end; ++x)
            if (row.weight[x] > 0)
                insert_layer(&layers[y * RF_TILE_COLUMNS + x], row.u[x], row.v[x], row.weight[x], grid->id);
    }
    clear_rows(&rows, planes);
}

RF_WIDE(rf_tile_layers, (const RfDrawJob *job, const RfDrawGrid *grid, RfRasterPlanes *planes, RfTileLayer *layers),
        (job, grid, planes, layers))
