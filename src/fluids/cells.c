// SPDX-License-Identifier: Apache-2.0
// A power diagram gives a point to the site with the least |p - c|^2 - r^2; its walls are straight, and its cells
// follow the radii. (Aurenhammer. Power diagrams. 1987.) The distance of a point in cell a to the wall towards b is
//
//   (power_b(p) - power_a(p)) / (2 |c_a - c_b|).
//
// Sites are thrown at random, large ones first, and kept where there is room, until hundreds of throws in a row found
// none. A table of bins holds, for each, the sites of least power at its middle: 24 of them, which is twice
// what a cell and its neighbours need.
#include "fluids/cells.h"

#include "core/memory.h"
#include "core/parallel.h"

enum
{
    NEAR = 24,
    MAX_CELLS = 8192,
    /// Throws for each radius, and radii tried from large to small.
    THROWS = 70,
    SIZES = 24
};

// A cell's corners are rounded over this part of its radius at the most: it would lose its middle.
static const float most_rounding = 0.22f;

struct RfCells
{
    RfTorus torus;
    RfCell *cells;
    int count;
    int columns, rows;
    int (*near)[NEAR];
};

/// x - c the short way round, for points at most half a turn outside.
static inline float short_way(float d, float span)
{
    return d - span * (float)((d > 0.5f * span) - (d < -0.5f * span));
}

static bool has_room(const RfCells *cells, const RfCell *cell, float packing)
{
    for (int i = 0; i < cells->count; ++i)
    {
        const RfCell *other = &cells->cells[i];
        float dx = short_way(cell->x - other->x, cells->torus.span_x);
        float dy = short_way(cell->y - other->y, cells->torus.span_y);
        float room = packing * (cell->radius + other->radius);
        if (dx * dx + dy * dy < room * room)
            return false;
    }
    return true;
}

static void throw_sites(RfCells *cells, float large, float small, float evenness, float packing, uint64_t stream)
{
    float area = cells->torus.span_x * cells->torus.span_y;
    uint64_t seed = cells->torus.seed;
    for (int size = 0; size < SIZES; ++size)
    {
        float t = (float)size / (SIZES - 1), radius = large * powf(small / large, t);
        // A share of the area for each size; the last fills what is left.
        int throws = (int)((float)THROWS * area * 0.06f / (radius * radius));
        int wanted =
            size + 1 == SIZES ? MAX_CELLS : (int)(area / (SIZES * radius * radius * 4) * expf(-evenness * t)) + 1;
        for (int k = 0; k < throws && wanted > 0 && cells->count < MAX_CELLS; ++k)
        {
            uint64_t item = ((uint64_t)size << 32) + (uint64_t)k;
            RfCell cell = {cells->torus.span_x * rf_random_float(seed, stream, item, 0),
                           cells->torus.span_y * rf_random_float(seed, stream, item, 1), radius};
            if (!has_room(cells, &cell, packing))
                continue;
            cells->cells[cells->count++] = cell;
            --wanted;
        }
    }
}

static float power_of(const RfCells *cells, int site, float x, float y)
{
    const RfCell *cell = &cells->cells[site];
    float dx = short_way(x - cell->x, cells->torus.span_x), dy = short_way(y - cell->y, cells->torus.span_y);
    return dx * dx + dy * dy - cell->radius * cell->radius;
}

/// Keeps the NEAR least powers in order.
static void fill_bin(const RfCells *cells, int bin)
{
    float x = ((float)(bin % cells->columns) + 0.5f) / (float)cells->columns * cells->torus.span_x;
    float y = ((float)(bin / cells->columns) + 0.5f) / (float)cells->rows * cells->torus.span_y;
    float best[NEAR];
    int *near = cells->near[bin], found = 0;
    for (int site = 0; site < cells->count; ++site)
    {
        float power = power_of(cells, site, x, y);
        if (found == NEAR && power >= best[NEAR - 1])
            continue;
        int place = found < NEAR ? found++ : NEAR - 1;
        for (; place > 0 && best[place - 1] > power; --place)
        {
            best[place] = best[place - 1];
            near[place] = near[place - 1];
        }
        best[place] = power;
        near[place] = site;
    }
    for (; found < NEAR; ++found)
        near[found] = -1;
}

static void fill_bins(void *context, int item, int worker)
{
    (void)worker;
    const RfCells *cells = context;
    for (int i = 0; i < cells->columns; ++i)
        fill_bin(cells, item * cells->columns + i);
}

RfResult rf_cells_create(const RfTorus *torus, float large, float small, float evenness, float packing, uint64_t stream,
                         RfCells **out)
{
    RfCells *cells = rf_allocate_zero(1, sizeof *cells);
    if (!cells)
        return RF_OUT_OF_MEMORY;
    cells->torus = *torus;
    cells->cells = rf_allocate(MAX_CELLS, sizeof *cells->cells);
    if (cells->cells)
        throw_sites(cells, large, small, evenness, packing, stream);
    float density = sqrtf(3 * (float)cells->count / (torus->span_x * torus->span_y));
    cells->columns = rf_max_int(1, (int)(density * torus->span_x));
    cells->rows = rf_max_int(1, (int)(density * torus->span_y));
    cells->near = rf_allocate((size_t)cells->columns * (size_t)cells->rows, sizeof *cells->near);
    if (!cells->cells || !cells->near)
    {
        rf_cells_destroy(cells);
        return RF_OUT_OF_MEMORY;
    }
    rf_parallel_for(cells->rows, fill_bins, cells);
    *out = cells;
    return RF_OK;
}

void rf_cells_destroy(RfCells *cells)
{
    if (!cells)
        return;
    rf_release(cells->cells);
    rf_release(cells->near);
    rf_release(cells);
}

RfCellHit rf_cells_at(const RfCells *cells, float x, float y, float rounding)
{
    float u = x / cells->torus.span_x, v = y / cells->torus.span_y;
    int i = rf_min_int((int)((u - floorf(u)) * (float)cells->columns), cells->columns - 1);
    int j = rf_min_int((int)((v - floorf(v)) * (float)cells->rows), cells->rows - 1);
    const int *near = cells->near[j * cells->columns + i];
    float power[NEAR], dx[NEAR], dy[NEAR];
    int count = 0, best = 0;
    for (; count < NEAR && near[count] >= 0; ++count)
    {
        const RfCell *cell = &cells->cells[near[count]];
        dx[count] = short_way(x - cell->x, cells->torus.span_x);
        dy[count] = short_way(y - cell->y, cells->torus.span_y);
        power[count] = dx[count] * dx[count] + dy[count] * dy[count] - cell->radius * cell->radius;
        if (power[count] < power[best])
            best = count;
    }
    RfCellHit hit = {near[best], -1, dx[best], dy[best], cells->cells[near[best]].radius, 1e9f, 0};
    float sum = 0;
    rounding = fminf(rounding, most_rounding * hit.radius);
    for (int k = 0; k < count; ++k)
    {
        float ax = dx[k] - dx[best], ay = dy[k] - dy[best], apart = sqrtf(ax * ax + ay * ay);
        if (k == best || apart < 1e-6f)
            continue;
        float wall = (power[k] - power[best]) / (2 * apart);
        if (wall < 6 * rounding)
            sum += expf(-wall / rounding);
        if (wall < hit.wall)
        {
            hit.wall = wall;
            hit.neighbour = near[k];
        }
    }
    hit.round = sum > 0 ? -rounding * logf(sum) : hit.wall;
    return hit;
}
