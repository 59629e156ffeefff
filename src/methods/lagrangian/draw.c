// SPDX-License-Identifier: Apache-2.0
// The walk over tiles: bins grids, draws each tile into a worker's small buffers, resolves it into the frame.
//
// A tile's result depends on the tile alone, so the frame's bytes do not depend on the number of threads.
//
// The correlation of overlapping grids enters as one smooth number a pixel, the weighted mean
//
//     rho = sum_(i != j) rho_ij w_i w_j / sum_(i != j) w_i w_j,
//
// taken on a lattice of every eighth pixel and interpolated: pairs are many, weights are smooth.

#include "methods/lagrangian/lagrangian.h"

#include "core/maths.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "kernels/resolving.h"

#include <string.h>

enum
{
    // Grids of a tile whose correlations count; 31 is the most seen in the built-in scenes at the default radius. The
    // rest blend as independent.
    MAX_CORRELATED = 48,
    TILE_PIXELS = RF_TILE_ROWS * RF_TILE_COLUMNS
};

// Pictures that contradict each other are not pulled further apart than this.
#define LEAST_RHO -0.3f

RfDrawGrid rf_lagrangian_draw_grid_of(const RfLagrangian *l, int index, double time)
{
    const Grid *grid = &l->grids[index];
    int n = l->options.grid_vertices;
    size_t first = (size_t)index * (size_t)(n * n);
    RfDrawGrid draw = {.x = l->x + first,
                       .y = l->y + first,
                       .quality = l->quality + first,
                       .n = n,
                       .u0 = grid->u0,
                       .v0 = grid->v0,
                       .cell = l->cell,
                       .centre = grid->centre,
                       .radius = KERNEL_RADIUS * l->radius,
                       .fade = rf_lagrangian_grid_fade(grid, time),
                       .turn_cos = grid->turn_cos,
                       .turn_sin = grid->turn_sin,
                       .stretch = {grid->stretch[0], grid->stretch[1], grid->stretch[2], grid->stretch[3]},
                       .id = grid->id};
    draw.x0 = draw.y0 = INFINITY;
    draw.x1 = draw.y1 = -INFINITY;
    for (int k = 0; k < n * n; ++k)
    {
        draw.x0 = fminf(draw.x0, draw.x[k]);
        draw.x1 = fmaxf(draw.x1, draw.x[k]);
        draw.y0 = fminf(draw.y0, draw.y[k]);
        draw.y1 = fmaxf(draw.y1, draw.y[k]);
    }
    // Outside the kernel's circle nothing shows.
    draw.x0 = fmaxf(draw.x0, draw.centre.x - draw.radius);
    draw.x1 = fminf(draw.x1, draw.centre.x + draw.radius);
    draw.y0 = fmaxf(draw.y0, draw.centre.y - draw.radius);
    draw.y1 = fminf(draw.y1, draw.centre.y + draw.radius);
    return draw;
}

typedef struct Scratch
{
    RfTileSums sums;
    float *lattice;
    // Texture values of a row of the tile, [lanes / 4][RF_TILE_WIDTH][4].
    float *values;
    int *place;
} Scratch;

typedef struct FrameJob
{
    const RfLagrangian *l;
    const StepFlow *flow;
    RfImageView frame;
    RfDrawGrid *grids;
    int columns, rows;
    // Grids of tile t: order[first[t]] ... order[first[t + 1] - 1], the live ones first, each kind in order of birth.
    int *first, *order;
    Scratch scratch[RF_MAX_THREADS];
    int64_t *holes, *samples;
    RfResolveQuad quads[RF_TEXTURE_QUADS];
} FrameJob;

static bool visible_tiles(const FrameJob *job, const RfDrawGrid *grid, int range[4])
{
    if (!(grid->fade > 0) || !(grid->x1 > grid->x0) || !(grid->y1 > grid->y0))
        return false;
    // A tile reaches one pixel into the next.
    range[0] = rf_max_int((int)floorf((grid->x0 - 1) / RF_TILE_WIDTH), 0);
    range[1] = rf_min_int((int)floorf(grid->x1 / RF_TILE_WIDTH), job->columns - 1);
    range[2] = rf_max_int((int)floorf((grid->y0 - 1) / RF_TILE_HEIGHT), 0);
    range[3] = rf_min_int((int)floorf(grid->y1 / RF_TILE_HEIGHT), job->rows - 1);
    return grid->x1 > 0 && grid->y1 > 0;
}

static RfResult bin_grids(RfLagrangian *l, FrameJob *job)
{
    int tiles = job->columns * job->rows, range[4];
    job->grids = rf_arena_push(&l->arena, (size_t)l->count, sizeof *job->grids);
    job->first = rf_arena_push(&l->arena, (size_t)tiles + 1, sizeof *job->first);
    if (!job->grids || !job->first)
        return RF_OUT_OF_MEMORY;
    memset(job->first, 0, ((size_t)tiles + 1) * sizeof *job->first);
    for (int g = 0; g < l->count; ++g)
    {
        job->grids[g] = rf_lagrangian_draw_grid_of(l, g, l->time);
        if (!visible_tiles(job, &job->grids[g], range))
            continue;
        for (int y = range[2]; y <= range[3]; ++y)
            for (int x = range[0]; x <= range[1]; ++x)
                ++job->first[y * job->columns + x + 1];
    }
    for (int t = 0; t < tiles; ++t)
        job->first[t + 1] += job->first[t];
    job->order = rf_arena_push(&l->arena, (size_t)job->first[tiles], sizeof *job->order);
    int *next = rf_arena_push(&l->arena, (size_t)tiles, sizeof *next);
    if (!job->order || !next)
        return RF_OUT_OF_MEMORY;
    memcpy(next, job->first, (size_t)tiles * sizeof *next);
    // Live grids first: what they outweigh of the fading ones need not be drawn.
    for (int fading = 0; fading < 2; ++fading)
        for (int g = 0; g < l->count; ++g)
            if (l->grids[g].retired == (fading == 1) && visible_tiles(job, &job->grids[g], range))
                for (int y = range[2]; y <= range[3]; ++y)
                    for (int x = range[0]; x <= range[1]; ++x)
                        job->order[next[y * job->columns + x]++] = g;
    return RF_OK;
}

static RfResult scratch_create(RfLagrangian *l, int worker, Scratch *out)
{
    RfArena *arena = &l->workers[worker];
    size_t lanes = (size_t)l->material.lane_count;
    RF_TRY(rf_tile_create(l->material.texture.quads, RF_TILE_ROWS, arena, &out->sums));
    out->lattice = rf_arena_push(arena, (size_t)MAX_CORRELATED * RF_LATTICE_POINTS, sizeof(float));
    out->values = rf_arena_push(arena, lanes * RF_TILE_WIDTH, sizeof(float));
    out->place = rf_arena_push(arena, (size_t)l->count, sizeof(int));
    if (!out->lattice || !out->values || !out->place)
        return RF_OUT_OF_MEMORY;
    // The place of a grid in the tile at hand, or -1.
    for (int g = 0; g < l->count; ++g)
        out->place[g] = -1;
    return RF_OK;
}

static void fill_quads(const RfLagrangian *l, RfResolveQuad *quads)
{
    const Material *m = &l->material;
    // The first map's lanes come first.
    quads[0].colour = l->exemplar->maps[0].kind == RF_MAP_COLOUR && l->exemplar->maps[0].image.channels == 3 &&
                      m->blend == RF_BLEND_CONTRAST && m->lane_of_channel[0] == 0;
    for (int lane = 0; lane < m->lane_count; ++lane)
    {
        RfResolveQuad *quad = &quads[lane / 4];
        quad->mean[lane % 4] = m->mean[lane];
        quad->low[lane % 4] = m->turned[lane / 4] ? -INFINITY : m->low[lane];
        quad->high[lane % 4] = m->turned[lane / 4] ? INFINITY : m->high[lane];
        quad->plain[lane % 4] = m->blend == RF_BLEND_PLAIN || m->plain[lane] ? 1 : 0;
    }
}

static int find_grid(const RfLagrangian *l, uint32_t id)
{
    int low = 0, high = l->count;
    while (low < high)
    {
        int middle = (low + high) / 2;
        if (l->grids[middle].id < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low < l->count && l->grids[low].id == id ? low : -1;
}

// rho at the lattice points, from the weights that drawing left there.
static void mix_correlations(const FrameJob *job, Scratch *scratch, const int *order, int count,
                             float rho[RF_LATTICE_POINTS])
{
    const RfLagrangian *l = job->l;
    float sum[RF_LATTICE_POINTS] = {0}, squares[RF_LATTICE_POINTS] = {0}, cross[RF_LATTICE_POINTS] = {0};
    for (int i = 0; i < count; ++i)
        scratch->place[order[i]] = i;
    for (int i = 0; i < count; ++i)
    {
        const float *mine = scratch->lattice + (size_t)i * RF_LATTICE_POINTS;
        for (int k = 0; k < RF_LATTICE_POINTS; ++k)
        {
            sum[k] += mine[k];
            squares[k] += mine[k] * mine[k];
        }
        const Grid *grid = &l->grids[order[i]];
        for (int r = 0; r < grid->resemblance_count; ++r)
        {
            int other = find_grid(l, grid->resemblances[r].id), place = other < 0 ? -1 : scratch->place[other];
            if (place < 0)
                continue;
            const float *theirs = scratch->lattice + (size_t)place * RF_LATTICE_POINTS;
            float twice = 2 * grid->resemblances[r].correlation;
            for (int k = 0; k < RF_LATTICE_POINTS; ++k)
                cross[k] += twice * mine[k] * theirs[k];
        }
    }
    for (int i = 0; i < count; ++i)
        scratch->place[order[i]] = -1;
    for (int k = 0; k < RF_LATTICE_POINTS; ++k)
    {
        float pairs = sum[k] * sum[k] - squares[k];
        rho[k] = pairs > 1e-4f * squares[k] ? rf_clamp(cross[k] / pairs, LEAST_RHO, 1) : 0;
    }
}

static void interpolate_rho(const float *lattice, int y, float *row)
{
    const float *upper = lattice + y / RF_LATTICE_STEP * RF_LATTICE_COLUMNS, *lower = upper + RF_LATTICE_COLUMNS;
    float t = (float)(y % RF_LATTICE_STEP) / RF_LATTICE_STEP;
    for (int i = 0; i + 1 < RF_LATTICE_COLUMNS; ++i, row += RF_LATTICE_STEP)
    {
        float left = upper[i] + t * (lower[i] - upper[i]), right = upper[i + 1] + t * (lower[i + 1] - upper[i + 1]);
        for (int k = 0; k < RF_LATTICE_STEP; ++k)
            row[k] = left + (float)k * (1.0f / RF_LATTICE_STEP) * (right - left);
    }
}

static void normalise_direction(const RfMapView *map, float *value)
{
    if (map->kind != RF_MAP_NORMAL)
        return;
    float length = sqrtf(value[0] * value[0] + value[1] * value[1] + value[2] * value[2]);
    if (!(length > 0))
        value[2] = length = 1;
    for (int c = 0; c < 3; ++c)
        value[c] = 0.5f + 0.5f * value[c] / length;
}

// One pixel's channels from its lanes.
static void write_pixel(const RfLagrangian *l, const float *values, int x, int level, float *pixel)
{
    const Material *m = &l->material;
    for (int i = 0; i < l->exemplar->map_count; ++i)
    {
        const RfMapView *map = &l->exemplar->maps[i];
        int first = l->exemplar->first_channel[i];
        float *out = pixel + first;
        for (int c = 0; c < map->image.channels; ++c)
        {
            int lane = m->lane_of_channel[first + c];
            out[c] = values[((size_t)(lane / 4) * RF_TILE_WIDTH + (size_t)x) * 4 + (size_t)(lane % 4)];
        }
        if (m->histograms[i].channels > 0)
        {
            float g[RF_HISTOGRAM_CHANNELS] = {0};
            memcpy(g, out, (size_t)map->image.channels * sizeof *g);
            rf_histogram_invert(&m->histograms[i], level, g, out);
        }
        else
            normalise_direction(map, out);
    }
}

static bool pixel_in_fluid(const StepFlow *flow, int x, int y)
{
    return !flow->view->mask ||
           rf_flow_inside(flow->view, ((float)x + 0.5f) / flow->scale_x, ((float)y + 0.5f) / flow->scale_y);
}

// The common case: one colour map of three channels in quad 0, no tables to go through.
static bool is_simple(const RfLagrangian *l)
{
    return l->exemplar->map_count == 1 && l->exemplar->channels == 3 && l->exemplar->maps[0].kind == RF_MAP_COLOUR &&
           l->material.histograms[0].channels == 0 && !l->material.turned[0];
}

static int count_missing(const float *weight, int width)
{
    int missing = 0;
    for (int x = 0; x < width; ++x)
        missing += !(weight[x] > 0);
    return missing;
}

static void resolve_row(const FrameJob *job, Scratch *scratch, const float *rho, int x0, int y, int row, int width,
                        int64_t *holes)
{
    const RfLagrangian *l = job->l;
    int channels = job->frame.channels;
    float inverse_sum[RF_TILE_WIDTH], inverse_norm[RF_TILE_WIDTH];
    size_t place = (size_t)row * RF_TILE_COLUMNS;
    const float *weight = scratch->sums.weight + place;
    rf_resolve_scales(weight, scratch->sums.weight2 + place, rho, width, inverse_sum, inverse_norm);
    float *out = job->frame.pixels + y * job->frame.row_stride + (ptrdiff_t)x0 * channels;
    if (is_simple(l) && !job->flow->view->mask)
    {
        rf_resolve_rgb(scratch->sums.colour + place * 4, inverse_sum,
                       l->material.blend == RF_BLEND_PLAIN ? inverse_sum : inverse_norm, &job->quads[0], width, out);
        *holes += count_missing(weight, width);
        return;
    }
    for (int q = 0; q < l->material.texture.quads; ++q)
        rf_resolve_row(scratch->sums.colour + ((size_t)q * TILE_PIXELS + place) * 4, inverse_sum, inverse_norm,
                       &job->quads[q], width, scratch->values + (size_t)q * RF_TILE_WIDTH * 4);
    for (int x = 0; x < width; ++x, out += channels)
    {
        if (!pixel_in_fluid(job->flow, x0 + x, y))
        {
            memset(out, 0, (size_t)channels * sizeof *out);
            continue;
        }
        *holes += !(weight[x] > 0);
        int level = weight[x] > 0 ? (int)(scratch->sums.level[place + (size_t)x] / weight[x] + 0.5f) : 0;
        write_pixel(l, scratch->values, x, level, out);
    }
}

static void draw_tile(void *context, int tile, int worker)
{
    FrameJob *job = context;
    const RfLagrangian *l = job->l;
    Scratch *scratch = &job->scratch[worker];
    int x0 = tile % job->columns * RF_TILE_WIDTH, y0 = tile / job->columns * RF_TILE_HEIGHT;
    RfDrawJob draw = {.texture = &l->material.texture,
                      .sharpness = l->options.sharpness,
                      .area = {{(float)x0, (float)y0}, 1, 1, RF_TILE_COLUMNS, RF_TILE_ROWS}};
    memcpy(draw.turned, l->material.turned, sizeof draw.turned);
    const int *order = job->order + job->first[tile];
    int count = job->first[tile + 1] - job->first[tile], correlated = rf_min_int(count, MAX_CORRELATED);
    rf_tile_clear(&scratch->sums, l->material.texture.quads, RF_TILE_ROWS);
    int64_t samples = 0, holes = 0;
    for (int i = 0; i < count; ++i)
    {
        float *lattice = i < correlated ? scratch->lattice + (size_t)i * RF_LATTICE_POINTS : NULL;
        rf_tile_draw(&draw, &job->grids[order[i]], &scratch->sums, lattice, &samples);
    }
    float rho[RF_LATTICE_POINTS], row_rho[RF_TILE_WIDTH];
    mix_correlations(job, scratch, order, correlated, rho);
    int width = rf_min_int(RF_TILE_WIDTH, l->width - x0), height = rf_min_int(RF_TILE_HEIGHT, l->height - y0);
    for (int row = 0; row < height; ++row)
    {
        interpolate_rho(rho, row, row_rho);
        resolve_row(job, scratch, row_rho, x0, y0 + row, row, width, &holes);
    }
    job->holes[tile] = holes;
    job->samples[tile] = samples;
}

RfResult rf_lagrangian_frame_draw(RfLagrangian *l, const StepFlow *flow, const RfImageView *frame)
{
    FrameJob job = {.l = l,
                    .flow = flow,
                    .frame = *frame,
                    .columns = (l->width + RF_TILE_WIDTH - 1) / RF_TILE_WIDTH,
                    .rows = (l->height + RF_TILE_HEIGHT - 1) / RF_TILE_HEIGHT};
    int tiles = job.columns * job.rows;
    RF_TRY(bin_grids(l, &job));
    fill_quads(l, job.quads);
    job.holes = rf_arena_push(&l->arena, (size_t)tiles, sizeof *job.holes);
    job.samples = rf_arena_push(&l->arena, (size_t)tiles, sizeof *job.samples);
    if (!job.holes || !job.samples)
        return RF_OUT_OF_MEMORY;
    for (int worker = 0; worker < rf_threads(); ++worker)
        RF_TRY(scratch_create(l, worker, &job.scratch[worker]));
    rf_parallel_for(tiles, draw_tile, &job);
    int64_t samples = 0;
    for (int t = 0; t < tiles; ++t)
    {
        l->stats.holes += job.holes[t];
        samples += job.samples[t];
    }
    l->stats.layers = (float)((double)samples / ((double)l->width * (double)l->height));
    return RF_OK;
}

typedef struct LayersJob
{
    const RfLagrangian *l;
    RfImageView layers;
    RfTileLayer *tiles[RF_MAX_THREADS];
    RfRasterPlanes *planes;
    int columns;
} LayersJob;

static void write_layers(const LayersJob *job, const RfTileLayer *tile, int x0, int y0, int width, int height)
{
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            const RfTileLayer *layer = &tile[y * RF_TILE_COLUMNS + x];
            float *out = job->layers.pixels + (y0 + y) * job->layers.row_stride + (ptrdiff_t)(x0 + x) * 16;
            for (int k = 0; k < 4; ++k)
            {
                bool there = layer->weight[k] > 0;
                out[4 * k] = there ? layer->u[k] : 0;
                out[4 * k + 1] = there ? layer->v[k] : 0;
                out[4 * k + 2] = there ? layer->weight[k] / layer->total : 0;
                out[4 * k + 3] = there ? (float)layer->id[k] : -1;
            }
        }
}

static void layer_tile(void *context, int tile, int worker)
{
    LayersJob *job = context;
    const RfLagrangian *l = job->l;
    RfTileLayer *layers = job->tiles[worker];
    memset(layers, 0, TILE_PIXELS * sizeof *layers);
    int x0 = tile % job->columns * RF_TILE_WIDTH, y0 = tile / job->columns * RF_TILE_HEIGHT;
    RfDrawJob draw = {.texture = &l->material.texture,
                      .sharpness = l->options.sharpness,
                      .area = {{(float)x0, (float)y0},
                               1,
                               1,
                               rf_min_int(RF_TILE_WIDTH, l->width - x0),
                               rf_min_int(RF_TILE_HEIGHT, l->height - y0)}};
    for (int g = 0; g < l->count; ++g)
    {
        RfDrawGrid grid = rf_lagrangian_draw_grid_of(l, g, l->time);
        if (grid.fade > 0 && grid.x1 > (float)x0 && grid.y1 > (float)y0 && grid.x0 < (float)(x0 + draw.area.width) &&
            grid.y0 < (float)(y0 + draw.area.height))
            rf_tile_layers(&draw, &grid, &job->planes[worker], layers);
    }
    write_layers(job, layers, x0, y0, draw.area.width, draw.area.height);
}

RfResult rf_lagrangian_layers(const RfLagrangian *l, const RfImageView *layers)
{
    RF_REQUIRE(l && layers && layers->pixels, "rf_lagrangian_layers: lagrangian or layers is NULL");
    RF_REQUIRE(l->started, "rf_lagrangian_layers: no step has been made");
    RF_REQUIRE(layers->row_stride >= (ptrdiff_t)layers->width * layers->channels,
               "rf_lagrangian_layers: rows of %d pixels do not fit a stride of %td floats", layers->width,
               layers->row_stride);
    RF_REQUIRE(layers->channels == 16 && layers->width == l->width && layers->height == l->height,
               "rf_lagrangian_layers: %d x %d pixels of %d channels: must be %d x %d of 16", layers->width,
               layers->height, layers->channels, l->width, l->height);
    LayersJob job = {.l = l, .layers = *layers, .columns = (l->width + RF_TILE_WIDTH - 1) / RF_TILE_WIDTH};
    int workers = rf_threads();
    RfTileLayer *memory = rf_allocate((size_t)workers * TILE_PIXELS, sizeof *memory);
    job.planes = rf_allocate_zero((size_t)workers, sizeof *job.planes);
    if (!memory || !job.planes)
    {
        rf_release(memory);
        rf_release(job.planes);
        return RF_OUT_OF_MEMORY;
    }
    for (int i = 0; i < workers; ++i)
        job.tiles[i] = memory + (size_t)i * TILE_PIXELS;
    rf_parallel_for(job.columns * ((l->height + RF_TILE_HEIGHT - 1) / RF_TILE_HEIGHT), layer_tile, &job);
    rf_release(memory);
    rf_release(job.planes);
    return RF_OK;
}
