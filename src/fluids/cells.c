// SPDX-License-Identifier: Apache-2.0
// A power diagram gives a point to the site with the least |p - c|^2 - r^2; its walls are straight, and its cells
// follow the radii. (Aurenhammer. Power diagrams. 1987.) The distance of a point in cell a to the wall towards b is
//
//   (power_b(p) - power_a(p)) / (2 |c_a - c_b|).
//
// Sites are thrown at random, large ones first, and kept where there is room; the number of throws
// fills the torus but for gaps of a cell or two. A table of bins holds, for each, the sites of least power at its
// middle: 24 of them, which is twice what a cell and its neighbours need.
#include "fluids/cells.h"

#include "core/memory.h"
#include "core/parallel.h"

enum
{
    NEAR = 24,
    MAX_CELLS = 1 << 17,
    /// Throws for each radius, and radii tried from large to small.
    THROWS = 70,
    SIZES = 24
};

// A cell's corners are rounded over this part of its radius at the most: it would lose its middle.
static const float most_rounding = 0.22f;

/// The sites of least power at a bin's middle; places without one have no radius that could reach.
typedef struct Bin
{
    int site[NEAR];
    float x[NEAR], y[NEAR], square[NEAR];
} Bin;

struct RfCells
{
    RfTorus torus;
    RfCell *cells;
    int count;
    /// Chains of sites by coarse squares, at least two of the largest radii wide: first of a square, then the next.
    int square_columns, square_rows;
    int *first, *next;
    int columns, rows;
    Bin *bins;
};

/// The squares round a point, each once: at most three by three.
typedef struct Around
{
    int count, squares[9];
} Around;

/// x - c the short way round, for points at most half a turn outside.
static inline float short_way(float d, float span)
{
    return d - span * (float)((d > 0.5f * span) - (d < -0.5f * span));
}

static int square_of(float x, float span, int count)
{
    return rf_clamp_int((int)(x / span * (float)count), 0, count - 1);
}

static Around squares_around(const RfCells *cells, float x, float y)
{
    int columns = cells->square_columns, rows = cells->square_rows;
    int i = square_of(x, cells->torus.span_x, columns), j = square_of(y, cells->torus.span_y, rows);
    int across = rf_min_int(columns, 3), down = rf_min_int(rows, 3);
    Around around = {0};
    for (int b = 0; b < down; ++b)
        for (int a = 0; a < across; ++a)
            around.squares[around.count++] = rf_wrap_int(j + b - 1, rows) * columns + rf_wrap_int(i + a - 1, columns);
    return around;
}

static bool has_room(const RfCells *cells, const RfCell *cell, const Around *around, float packing)
{
    for (int k = 0; k < around->count; ++k)
        for (int i = cells->first[around->squares[k]]; i >= 0; i = cells->next[i])
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

static void add_site(RfCells *cells, RfCell cell)
{
    int square = square_of(cell.y, cells->torus.span_y, cells->square_rows) * cells->square_columns +
                 square_of(cell.x, cells->torus.span_x, cells->square_columns);
    cells->cells[cells->count] = cell;
    cells->next[cells->count] = cells->first[square];
    cells->first[square] = cells->count++;
}

static void throw_sites(RfCells *cells, float large, float small, float packing, uint64_t stream)
{
    float area = cells->torus.span_x * cells->torus.span_y;
    uint64_t seed = cells->torus.seed;
    for (int size = 0; size < SIZES; ++size)
    {
        float t = (float)size / (SIZES - 1), radius = large * powf(small / large, t);
        // A share of the area for each size; the last fills what is left.
        int throws = (int)((float)THROWS * area * 0.06f / (radius * radius));
        int wanted = size + 1 == SIZES ? MAX_CELLS : (int)(area / (SIZES * radius * radius * 4)) + 1;
        for (int k = 0; k < throws && wanted > 0 && cells->count < MAX_CELLS; ++k)
        {
            uint64_t item = ((uint64_t)size << 32) + (uint64_t)k;
            RfCell cell = {cells->torus.span_x * rf_random_float(seed, stream, item, 0),
                           cells->torus.span_y * rf_random_float(seed, stream, item, 1), radius};
            Around around = squares_around(cells, cell.x, cell.y);
            if (!has_room(cells, &cell, &around, packing))
                continue;
            add_site(cells, cell);
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
static void fill_bin(const RfCells *cells, int index)
{
    float x = ((float)(index % cells->columns) + 0.5f) / (float)cells->columns * cells->torus.span_x;
    float y = ((float)(index / cells->columns) + 0.5f) / (float)cells->rows * cells->torus.span_y;
    float best[NEAR];
    Bin *bin = &cells->bins[index];
    int found = 0;
    Around around = squares_around(cells, x, y);
    for (int s = 0; s < around.count; ++s)
        for (int site = cells->first[around.squares[s]]; site >= 0; site = cells->next[site])
        {
            float power = power_of(cells, site, x, y);
            if (found == NEAR && power >= best[NEAR - 1])
                continue;
            int place = found < NEAR ? found++ : NEAR - 1;
            for (; place > 0 && best[place - 1] > power; --place)
            {
                best[place] = best[place - 1];
                bin->site[place] = bin->site[place - 1];
            }
            best[place] = power;
            bin->site[place] = site;
        }
    for (int k = 0; k < NEAR; ++k)
    {
        const RfCell *cell = &cells->cells[k < found ? bin->site[k] : 0];
        bin->x[k] = cell->x;
        bin->y[k] = cell->y;
        bin->square[k] = k < found ? cell->radius * cell->radius : -1e18f;
    }
}

static void fill_bins(void *context, int item, int worker)
{
    (void)worker;
    const RfCells *cells = context;
    for (int i = 0; i < cells->columns; ++i)
        fill_bin(cells, item * cells->columns + i);
}

static RfResult make(RfCells *cells, float large, float small, float packing, uint64_t stream)
{
    const RfTorus *torus = &cells->torus;
    cells->square_columns = rf_max_int(1, (int)(torus->span_x / (2 * large)));
    cells->square_rows = rf_max_int(1, (int)(torus->span_y / (2 * large)));
    size_t squares = (size_t)cells->square_columns * (size_t)cells->square_rows;
    cells->cells = rf_allocate(MAX_CELLS, sizeof *cells->cells);
    cells->next = rf_allocate(MAX_CELLS, sizeof *cells->next);
    cells->first = rf_allocate(squares, sizeof *cells->first);
    if (!cells->cells || !cells->next || !cells->first)
        return RF_OUT_OF_MEMORY;
    for (size_t k = 0; k < squares; ++k)
        cells->first[k] = -1;
    throw_sites(cells, large, small, packing, stream);
    float density = sqrtf(3 * (float)cells->count / (torus->span_x * torus->span_y));
    cells->columns = rf_max_int(1, (int)(density * torus->span_x));
    cells->rows = rf_max_int(1, (int)(density * torus->span_y));
    cells->bins = rf_allocate((size_t)cells->columns * (size_t)cells->rows, sizeof *cells->bins);
    if (!cells->bins)
        return RF_OUT_OF_MEMORY;
    rf_parallel_for(cells->rows, fill_bins, cells);
    return RF_OK;
}

RfResult rf_cells_create(const RfTorus *torus, float large, float small, float packing, uint64_t stream, RfCells **out)
{
    RfCells *cells = rf_allocate_zero(1, sizeof *cells);
    if (!cells)
        return RF_OUT_OF_MEMORY;
    cells->torus = *torus;
    RfResult result = make(cells, large, small, packing, stream);
    if (result == RF_OK)
        *out = cells;
    else
        rf_cells_destroy(cells);
    return result;
}

void rf_cells_destroy(RfCells *cells)
{
    if (!cells)
        return;
    rf_release(cells->cells);
    rf_release(cells->first);
    rf_release(cells->next);
    rf_release(cells->bins);
    rf_release(cells);
}

RfCellHit rf_cells_at(const RfCells *cells, float x, float y, float rounding)
{
    float u = x / cells->torus.span_x, v = y / cells->torus.span_y;
    int i = rf_min_int((int)((u - floorf(u)) * (float)cells->columns), cells->columns - 1);
    int j = rf_min_int((int)((v - floorf(v)) * (float)cells->rows), cells->rows - 1);
    const Bin *bin = &cells->bins[j * cells->columns + i];
    float power[NEAR], dx[NEAR], dy[NEAR], span_x = cells->torus.span_x, span_y = cells->torus.span_y;
#pragma omp simd
    for (int k = 0; k < NEAR; ++k)
    {
        dx[k] = short_way(x - bin->x[k], span_x);
        dy[k] = short_way(y - bin->y[k], span_y);
        power[k] = dx[k] * dx[k] + dy[k] * dy[k] - bin->square[k];
    }
    int best = 0;
    for (int k = 1; k < NEAR; ++k)
        best = power[k] < power[best] ? k : best;
    RfCellHit hit = {bin->site[best], -1, dx[best], dy[best], sqrtf(bin->square[best]), 1e9f, 0};
    rounding = fminf(rounding, most_rounding * hit.radius);
    float sum = 0;
    for (int k = 0; k < NEAR; ++k)
    {
        // Walls neither nearest nor near enough to round a corner are passed over before the root is taken.
        float ax = dx[k] - dx[best], ay = dy[k] - dy[best], apart = ax * ax + ay * ay;
        float ahead = power[k] - power[best], reach = 2 * fmaxf(hit.wall, 6 * rounding);
        if (k == best || apart < 1e-12f || ahead * ahead > reach * reach * apart)
            continue;
        float wall = ahead / (2 * sqrtf(apart));
        if (wall < 6 * rounding)
            sum += expf(-wall / rounding);
        if (wall < hit.wall)
        {
            hit.wall = wall;
            hit.neighbour = bin->site[k];
        }
    }
    hit.round = sum > 0 ? -rounding * logf(sum) : hit.wall;
    return hit;
}
