// SPDX-License-Identifier: Apache-2.0
// New grids: where, showing what, and how they come in.
//
// The paper gives a new grid a random area of the exemplar and names a smarter choice as future work. Ours takes the
// place that fits best what the other grids draw there now, so that a fade changes little: cells of foam stay cells,
// and the eye (and an optical-flow estimator) sees less of it. The search goes coarse to fine: a window over the new
// kernel is drawn at a spacing at which it has some 30 pixels across, compared at many places of the exemplar at the
// same spacing, and the best few are followed down to single pixels.
//
// Because old and new grid then resemble each other, blending them as if they were independent would overshoot
// (equation 3 assumes so). Their correlation is measured at birth, over the area that both draw, and drawing divides by
//
//     sqrt(sum_i w_i^2 + sum_(i != j) rho_ij w_i w_j).
//
// All grids are carried by one flow, so the two pictures keep their places on each other, and rho stays what it was at
// birth.
//
// Deviation: K_p ends at 1.1 d, not d. A particle is born where no other is nearer than d, and with the paper's radius
// all weights would be 0 there.

#include "methods/lagrangian/lagrangian.h"

#include "core/maths.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "kernels/best_match.h"
#include "kernels/poisson_disk.h"

#include <string.h>

enum
{
    // Pixels across a window at the coarsest spacing.
    WINDOW_PIXELS = 40,
    KEEP = 2,
    MAX_OVERLAPS = 96,
    // Of random numbers, apart from the placing's: in the first step a grid's id is the number of its pick.
    AREA_STREAM = 1 << 30
};

// Weights of others under this count as none. A new grid has it at least to start from, so that it shows at once where
// it is alone, and where it is not comes in beside the faintest.
#define UNCOVERED 1e-3f
// Resemblances under this are not worth a place.
#define LEAST_RESEMBLANCE 0.03f

/// A picture of what is drawn round a point, at some spacing.
typedef struct Patch
{
    RfDrawJob job;
    RfTileSums sums;
} Patch;

typedef struct Birth
{
    RfLagrangian *l;
    RfVec2 centre;
    /// The new grid, and the number of grids before it that it is matched to.
    int index, older;
    int overlaps[MAX_OVERLAPS], overlap_count;
} Birth;

int rf_lagrangian_coarsest_halvings(const RfLagrangian *l)
{
    int halvings = 0;
    while ((float)(WINDOW_PIXELS << halvings) < 2 * l->radius && halvings + 2 < l->material.texture.level_count)
        ++halvings;
    return halvings;
}

static RfResult patch_create(const RfLagrangian *l, RfVec2 centre, int halvings, float radius, RfArena *arena,
                             Patch *out)
{
    float spacing = (float)(1 << halvings);
    int side = rf_clamp_int((int)ceilf(2 * radius / spacing), 3, RF_TILE_ROWS);
    const Material *m = &l->material;
    out->job = (RfDrawJob){.texture = &m->texture,
                           .sharpness = l->options.sharpness,
                           .area = {{centre.x - 0.5f * (float)side * spacing, centre.y - 0.5f * (float)side * spacing},
                                    spacing,
                                    spacing,
                                    side,
                                    side},
                           .level_bias = halvings + 1};
    memcpy(out->job.turned, m->turned, sizeof m->turned);
    return rf_tile_create(m->texture.quads, side, arena, &out->sums);
}

static void find_overlaps(Birth *birth)
{
    const RfLagrangian *l = birth->l;
    float reach = KERNEL_RADIUS * l->radius;
    birth->overlap_count = 0;
    for (int i = 0; i < birth->older && birth->overlap_count < MAX_OVERLAPS; ++i)
        if (rf_vec2_length(rf_vec2_sub(l->grids[i].centre, birth->centre)) < 2 * reach)
            birth->overlaps[birth->overlap_count++] = i;
}

static void draw_overlaps(const Birth *birth, Patch *patch)
{
    int64_t pixels = 0;
    for (int i = 0; i < birth->overlap_count; ++i)
    {
        RfDrawGrid grid = rf_lagrangian_draw_grid_of(birth->l, birth->overlaps[i], birth->l->time);
        rf_tile_draw(&patch->job, &grid, &patch->sums, NULL, &pixels);
    }
}

// The others' summed weight at the centre.
static float weight_at_centre(const Patch *patch)
{
    int middle = patch->job.area.width / 2;
    return patch->sums.weight[middle * RF_TILE_COLUMNS + middle];
}

static float resemblance_of(const RfLagrangian *l, int a, int b)
{
    const Grid *young = &l->grids[a > b ? a : b];
    uint32_t old = l->grids[a > b ? b : a].id;
    for (int i = 0; i < young->resemblance_count; ++i)
        if (young->resemblances[i].id == old)
            return young->resemblances[i].correlation;
    return 0;
}

// Mean correlation of the grids that overlap here, weighted by how much they do.
static float mean_resemblance(const Birth *birth)
{
    const RfLagrangian *l = birth->l;
    float sum = 0, total = 0, reach = 2 * KERNEL_RADIUS * l->radius;
    for (int i = 0; i < birth->overlap_count; ++i)
        for (int j = 0; j < i; ++j)
        {
            const Grid *a = &l->grids[birth->overlaps[i]], *b = &l->grids[birth->overlaps[j]];
            float near = rf_max(1 - rf_vec2_length(rf_vec2_sub(a->centre, b->centre)) / reach, 0);
            float weight = near * near * rf_lagrangian_grid_fade(a, l->time) * rf_lagrangian_grid_fade(b, l->time);
            sum += weight * resemblance_of(l, birth->overlaps[i], birth->overlaps[j]);
            total += weight;
        }
    return total > 0 ? rf_clamp(sum / total, 0, 1) : 0;
}

// Turns a patch into a window to search for: colours blended as a frame's are, weighted by the new grid's kernel where
// something is drawn.
static RfResult window_create(const Birth *birth, const Patch *patch, int halvings, RfArena *arena, RfMatchWindow *out)
{
    const Material *m = &birth->l->material;
    int side = patch->job.area.width, quads = m->texture.quads;
    size_t numbers = (size_t)(side * side * quads) * 4;
    float *target = rf_arena_push(arena, numbers, sizeof(float)),
          *weight = rf_arena_push(arena, numbers, sizeof(float));
    if (!target || !weight)
        return RF_OUT_OF_MEMORY;
    float reach = KERNEL_RADIUS * birth->l->radius, spacing = patch->job.area.spacing;
    size_t k = 0;
    double energy = 0, mean_energy = 0;
    float rho = mean_resemblance(birth);
    for (int q = 0; q < quads; ++q)
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x)
            {
                size_t pixel = (size_t)y * RF_TILE_COLUMNS + (size_t)x;
                float w = patch->sums.weight[pixel], w2 = patch->sums.weight2[pixel];
                float scale = w2 > 0 ? 1 / sqrtf(w2 + rho * rf_max(w * w - w2, 0)) : 0;
                float dx = ((float)x + 0.5f - 0.5f * (float)side) * spacing,
                      dy = ((float)y + 0.5f - 0.5f * (float)side) * spacing;
                float kernel = w2 > 0 ? fmaxf(1 - sqrtf(dx * dx + dy * dy) / reach, 0) : 0;
                const float *colour = patch->sums.colour + ((size_t)q * RF_TILE_ROWS * RF_TILE_COLUMNS + pixel) * 4;
                for (int c = 0; c < 4; ++c, ++k)
                {
                    target[k] = colour[c] * scale;
                    weight[k] = kernel * (m->turned[q] ? 0 : m->match_weight[4 * q + c]);
                    energy += (double)(weight[k] * target[k] * target[k]);
                    mean_energy += (double)(weight[k] * m->variance[halvings + 1][4 * q + c]);
                }
            }
    float margin = 0.5f * GRID_SIDE * birth->l->radius - 0.5f * (float)side * spacing;
    *out = (RfMatchWindow){
        &m->texture,   halvings + 1,      side, side, rf_max_int((int)ceilf(margin / spacing), 0), target, weight,
        (float)energy, (float)mean_energy};
    return RF_OK;
}

// Exemplar minus frame coordinates for the window's first pixel on a texel, and back.
static float offset_of(float texel, float scale, float origin, float spacing)
{
    return texel / scale + 0.5f - (origin + 0.5f * spacing);
}

static float texel_of(float offset, float scale, float origin, float spacing)
{
    return (offset + origin + 0.5f * spacing - 0.5f) * scale;
}

static RfVec2 match_offset(const RfMatchWindow *window, const Patch *patch, const RfMatch *match)
{
    const RfTextureLevel *level = &window->texture->levels[window->level];
    return (RfVec2){offset_of((float)match->x, level->scale_x, patch->job.area.origin.x, patch->job.area.spacing),
                    offset_of((float)match->y, level->scale_y, patch->job.area.origin.y, patch->job.area.spacing)};
}

// The best of the 3 x 3 places round an offset.
static RfMatch refine(const RfMatchWindow *window, const Patch *patch, RfVec2 offset)
{
    const RfTextureLevel *level = &window->texture->levels[window->level];
    int x0 = (int)lrintf(texel_of(offset.x, level->scale_x, patch->job.area.origin.x, patch->job.area.spacing));
    int y0 = (int)lrintf(texel_of(offset.y, level->scale_y, patch->job.area.origin.y, patch->job.area.spacing));
    int places[2];
    rf_match_places(window, places);
    RfMatch best = {0, 0, INFINITY};
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
        {
            RfMatch match = {x0 + dx, y0 + dy, 0};
            if (window->texture->tiles)
                match = (RfMatch){rf_wrap_int(match.x, level->width), rf_wrap_int(match.y, level->height), 0};
            else
                match =
                    (RfMatch){rf_clamp_int(match.x, window->margin, window->margin + rf_max_int(places[0], 1) - 1),
                              rf_clamp_int(match.y, window->margin, window->margin + rf_max_int(places[1], 1) - 1), 0};
            if (match.x < 0 || match.y < 0 ||
                (!window->texture->tiles &&
                 (match.x + window->width > level->width || match.y + window->height > level->height)))
                continue;
            rf_match_cost(window, match.x, match.y, &match.cost);
            if (match.cost < best.cost)
                best = match;
        }
    return best;
}

// Follows the coarse matches down to single pixels, halving their number on the way.
static RfResult refine_down(const Birth *birth, int halvings, RfVec2 *offsets, int count, RfArena *arena)
{
    for (int h = halvings - 1; h >= 0; --h)
    {
        Patch patch;
        RfMatchWindow window;
        RF_TRY(patch_create(birth->l, birth->centre, h, birth->l->radius, arena, &patch));
        draw_overlaps(birth, &patch);
        RF_TRY(window_create(birth, &patch, h, arena, &window));
        float costs[KEEP];
        for (int i = 0; i < count; ++i)
        {
            RfMatch match = refine(&window, &patch, offsets[i]);
            RfVec2 offset = match.cost < INFINITY ? match_offset(&window, &patch, &match) : offsets[i];
            int slot = i;
            for (; slot > 0 && match.cost < costs[slot - 1]; --slot)
            {
                costs[slot] = costs[slot - 1];
                offsets[slot] = offsets[slot - 1];
            }
            costs[slot] = match.cost;
            offsets[slot] = offset;
        }
        count = rf_max_int(count / 2, 1);
    }
    return RF_OK;
}

static RfVec2 random_offset(const Birth *birth)
{
    const RfLagrangian *l = birth->l;
    const RfTexture *texture = &l->material.texture;
    float side = GRID_SIDE * l->radius;
    float r[2];
    for (int axis = 0; axis < 2; ++axis)
        r[axis] = rf_random_float(l->options.seed, l->step, l->grids[birth->index].id, AREA_STREAM + (uint64_t)axis);
    float room_x = texture->tiles ? (float)texture->width : fmaxf((float)texture->width - side, 0);
    float room_y = texture->tiles ? (float)texture->height : fmaxf((float)texture->height - side, 0);
    return (RfVec2){r[0] * room_x - (birth->centre.x - 0.5f * side), r[1] * room_y - (birth->centre.y - 0.5f * side)};
}

// Exemplar minus frame coordinates of the new grid.
static RfResult choose_area(Birth *birth, const Patch *coarse, int halvings, RfArena *arena, RfVec2 *offset)
{
    RfLagrangian *l = birth->l;
    *offset = random_offset(birth);
    if (l->options.candidates <= 1 || birth->overlap_count == 0)
        return RF_OK;
    RfMatchWindow window;
    RF_TRY(window_create(birth, coarse, halvings, arena, &window));
    RfMatch best[KEEP];
    int count = rf_match_search(&window, l->options.candidates, KEEP, l->options.seed, l->step,
                                l->grids[birth->index].id, best);
    if (count == 0 || best[0].cost == 0)
        return RF_OK; // Nothing fits, or nothing is drawn there: any place is as good.
    RfVec2 offsets[KEEP];
    for (int i = 0; i < count; ++i)
        offsets[i] = match_offset(&window, coarse, &best[i]);
    RF_TRY(refine_down(birth, halvings, offsets, count, arena));
    *offset = offsets[0];
    return RF_OK;
}

// Correlation of two solo drawings where both are: sum w_i w_j T_i T_j over the root of the like sums of T_i^2 and
// T_j^2.
static float correlation(const Material *m, const Patch *mine, const Patch *other)
{
    double cross = 0, own = 0, others = 0;
    int side = mine->job.area.width;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
        {
            size_t pixel = (size_t)y * RF_TILE_COLUMNS + (size_t)x;
            float wi = mine->sums.weight[pixel], wj = other->sums.weight[pixel];
            if (!(wi > 0) || !(wj > 0))
                continue;
            for (int q = 0; q < m->texture.quads; ++q)
                for (int c = 0; c < 4 && !m->turned[q]; ++c)
                {
                    size_t place = ((size_t)q * RF_TILE_ROWS * RF_TILE_COLUMNS + pixel) * 4 + (size_t)c;
                    float weight = m->match_weight[4 * q + c], a = mine->sums.colour[place],
                          b = other->sums.colour[place];
                    cross += (double)(weight * a * b);
                    own += (double)(weight * a * a * (wj / wi));
                    others += (double)(weight * b * b * (wi / wj));
                }
        }
    return own > 0 && others > 0 ? (float)(cross / sqrt(own * others)) : 0;
}

static void remember(Grid *grid, Resemblance resemblance)
{
    if (grid->resemblance_count < MAX_RESEMBLANCES)
    {
        grid->resemblances[grid->resemblance_count++] = resemblance;
        return;
    }
    int weakest = 0;
    for (int i = 1; i < MAX_RESEMBLANCES; ++i)
        if (fabsf(grid->resemblances[i].correlation) < fabsf(grid->resemblances[weakest].correlation))
            weakest = i;
    if (fabsf(resemblance.correlation) > fabsf(grid->resemblances[weakest].correlation))
        grid->resemblances[weakest] = resemblance;
}

static RfResult measure_resemblances(Birth *birth, int halvings, RfArena *arena)
{
    RfLagrangian *l = birth->l;
    Grid *grid = &l->grids[birth->index];
    int64_t pixels = 0;
    float reach = KERNEL_RADIUS * l->radius;
    Patch mine, other;
    RF_TRY(patch_create(l, birth->centre, halvings, reach, arena, &mine));
    RF_TRY(patch_create(l, birth->centre, halvings, reach, arena, &other));
    // Correlation is a matter of all frequencies, so the full texture is sampled, if at few places.
    mine.job.level_bias = other.job.level_bias = 0;
    mine.job.sharpness = other.job.sharpness = 1;
    RfDrawGrid solo = rf_lagrangian_draw_grid_of(l, birth->index, l->time);
    solo.fade = 1;
    rf_tile_draw(&mine.job, &solo, &mine.sums, NULL, &pixels);
    for (int i = 0; i < birth->overlap_count; ++i)
    {
        RfDrawGrid old = rf_lagrangian_draw_grid_of(l, birth->overlaps[i], l->time);
        if (!(old.fade > 0))
            continue;
        rf_tile_clear(&other.sums, l->material.texture.quads, other.job.area.height);
        rf_tile_draw(&other.job, &old, &other.sums, NULL, &pixels);
        float rho = correlation(&l->material, &mine, &other);
        if (fabsf(rho) > LEAST_RESEMBLANCE)
            remember(grid, (Resemblance){old.id, rf_clamp(rho, -1, 1)});
    }
    return RF_OK;
}

static void place_vertices(RfLagrangian *l, int index, RfVec2 centre)
{
    int n = l->options.grid_vertices;
    size_t first = (size_t)index * (size_t)(n * n);
    float half = 0.5f * GRID_SIDE * l->radius;
    for (int k = 0; k < n * n; ++k)
    {
        l->x[first + (size_t)k] = centre.x - half + (float)(k % n) * l->cell;
        l->y[first + (size_t)k] = centre.y - half + (float)(k / n) * l->cell;
        l->quality[first + (size_t)k] = 1;
    }
}

static RfResult give_birth(RfLagrangian *l, const StepFlow *flow, RfVec2 centre)
{
    RF_TRY(rf_lagrangian_grids_reserve(l, l->count + 1));
    l->grids[l->count] = (Grid){.id = l->next_id, .birth = l->time, .centre = centre};
    place_vertices(l, l->count, centre);
    rf_lagrangian_grids_measure_new(l, flow, l->count);
    ++l->count;
    ++l->next_id;
    ++l->stats.born;
    return RF_OK;
}

// What a new grid shows, how it comes in and what it resembles.
static RfResult dress(Birth *birth, const StepFlow *flow, RfArena *arena)
{
    RfLagrangian *l = birth->l;
    Grid *grid = &l->grids[birth->index];
    birth->centre = grid->centre;
    find_overlaps(birth);
    int halvings = l->match_halvings;
    Patch patch;
    RfVec2 offset;
    RF_TRY(patch_create(l, birth->centre, halvings, l->radius, arena, &patch));
    draw_overlaps(birth, &patch);
    RF_TRY(choose_area(birth, &patch, halvings, arena, &offset));
    float half = 0.5f * GRID_SIDE * l->radius;
    grid->u0 = birth->centre.x - half + offset.x;
    grid->v0 = birth->centre.y - half + offset.y;
    grid->others = 1;
    if (l->started)
    {
        float others = weight_at_centre(&patch);
        grid->others = rf_clamp(others, UNCOVERED, 1);
        grid->fade_in = rf_lagrangian_fade_length(l, grid->strain, others > UNCOVERED ? grid->others : 0);
        // A step of no length would show nothing of it, and where it is alone leave a hole: there it is a frame old.
        grid->birth = flow->view->time > flow->from ? flow->from : flow->from - 1;
    }
    if (l->options.candidates > 1 && l->options.blend != RF_BLEND_PLAIN)
        RF_TRY(measure_resemblances(birth, halvings, arena));
    return RF_OK;
}

typedef struct DressJob
{
    RfLagrangian *l;
    const StepFlow *flow;
    int first;
    RfResult *results;
} DressJob;

static void dress_one(void *context, int item, int worker)
{
    DressJob *job = context;
    RfArena *arena = &job->l->workers[worker];
    // In the first step every grid sees those before it. Later ones see only those of earlier steps, so that they can
    // be dressed at the same time: what came in this very step has next to no weight yet.
    Birth birth = {.l = job->l, .index = job->first + item, .older = job->l->started ? job->first : job->first + item};
    job->results[item] = dress(&birth, job->flow, arena);
    rf_arena_reset(arena);
}

static RfResult dress_all(RfLagrangian *l, const StepFlow *flow, int first)
{
    int count = l->count - first;
    DressJob job = {l, flow, first, rf_arena_push(&l->arena, (size_t)count, sizeof *job.results)};
    if (!job.results)
        return RF_OUT_OF_MEMORY;
    if (l->started)
        rf_parallel_for(count, dress_one, &job);
    else
        for (int i = 0; i < count; ++i)
        {
            RF_TRY(rf_progress("placing grids", (double)i / count));
            dress_one(&job, i, 0);
        }
    for (int i = 0; i < count; ++i)
        RF_TRY(job.results[i]);
    return RF_OK;
}

// A point of the cell that is in the fluid.
static bool fluid_point(const RfDiskField *field, int cell, const RfLagrangian *l, const StepFlow *flow, RfVec2 *point)
{
    static const float places[5][2] = {{0, 0}, {-0.49f, -0.49f}, {0.49f, -0.49f}, {-0.49f, 0.49f}, {0.49f, 0.49f}};
    RfVec2 centre = rf_disk_field_centre(field, cell);
    for (int i = 0; i < 5; ++i)
    {
        *point = (RfVec2){centre.x + places[i][0] * field->spacing, centre.y + places[i][1] * field->spacing};
        if (point->x < (float)l->width && point->y < (float)l->height &&
            rf_flow_inside(flow->view, point->x / flow->scale_x, point->y / flow->scale_y))
            return true;
    }
    return false;
}

RfResult rf_lagrangian_grids_refill(RfLagrangian *l, const StepFlow *flow)
{
    RfDiskField field;
    RF_TRY(rf_disk_field_create(l->width, l->height, l->radius, &l->arena, &field));
    for (int i = 0; i < l->count; ++i)
        if (!l->grids[i].retired)
            rf_disk_field_mark(&field, l->grids[i].centre);
    RF_TRY(rf_disk_field_list(&field, &l->arena));
    int cell, first = l->count;
    for (uint64_t draw = 0; (cell = rf_disk_field_pick(&field, l->options.seed, l->step, draw)) >= 0; ++draw)
    {
        RfVec2 point;
        field.open[cell] = 0;
        if (!fluid_point(&field, cell, l, flow, &point))
            continue;
        RF_TRY(give_birth(l, flow, point));
        rf_disk_field_mark(&field, point);
    }
    return dress_all(l, flow, first);
}
