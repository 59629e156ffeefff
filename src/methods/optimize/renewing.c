// SPDX-License-Identifier: Apache-2.0
// Renewing worn texture: patches of the exemplar that fit what is there best.
//
//     choose   the most worn places, two patches apart
//     find     for each the window of the exemplar that is most like what is seen there, exactly, on a coarse level;
//              then its best place on the finest
//     cut      the closed line round the place along which the patch differs least from what it is laid on
//     lay      markers inside the line are replaced; the old ones fade
//
// again while anything is badly worn. What is worn less waits for the next frame: laid at once, more of the picture is
// new at a time, and more of it flickers (lava in turbulence 0.24 over its floor, not 0.18). A patch is large, and
// inside it the texture is the exemplar's own: what is bad in its surroundings is not passed on. Small windows that are
// matched one by one pass it on: within 30 frames of a vortex pebbles are shards, and lava is a dark field, since what
// is smooth is least unlike to anything. Against that the cost of a window is lowered by a part of its own variation
// (rf_synthesis_penalties).
#include "core/parallel.h"
#include "core/result.h"
#include "methods/optimize/moving.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

enum
{
    /// Times that places are chosen in a step.
    ROUNDS = 4,
    /// Pixels from one that is asked for where it comes from to the next, when the use of the exemplar is counted.
    SAMPLED = 4
};

// What a window's cost is lowered by, in parts of its variation, where the texture varies as the exemplar does; and by
// how much more or less for each part that it varies less or more.
static const float PART = 0.5f, STEERING = 2;
// What is worn by so much more than may be is renewed at once. Else it waits.
static const float URGENT = 3;
// What a place used twice as much as the mean costs, against the last patches' mean distance, for each unit of `spread`
// over rf_usage's step. With much less bright pebbles crowd out the others, with more patches fit badly.
static const float PRICE = 2;

static const float *pixel_at(const RfSynthesisExemplar *e, RfVec2 s)
{
    int x = rf_border_int(rf_nearest_int(s.x), e->width, e->tiles);
    int y = rf_border_int(rf_nearest_int(s.y), e->height, e->tiles);
    return e->pixels + ((ptrdiff_t)y * e->width + x) * e->channels;
}

static float difference(const float *a, const float *b, int channels)
{
    float sum = 0;
    for (int c = 0; c < channels; ++c)
        sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sum;
}

// ---- choose

static int by_wear(const void *a, const void *b)
{
    const RfWornPlace *p = a, *q = b;
    if (p->wear != q->wear)
        return p->wear > q->wear ? -1 : 1;
    return p->cell - q->cell;
}

// Nothing else is chosen within two patches' reach.
static void take(RfOptimize *o, RfVec2 at)
{
    int grain = RF_WEAR_GRAIN, apart = 2 * o->outer / grain, ci = (int)at.x / grain, cj = (int)at.y / grain;
    for (int j = -apart; j <= apart; ++j)
        for (int i = -apart; i <= apart; ++i)
        {
            bool outside = ci + i < 0 || cj + j < 0 || ci + i >= o->columns || cj + j >= o->rows;
            if (i * i + j * j <= apart * apart && (o->markers.tiles || !outside))
                o->taken[(ptrdiff_t)rf_wrap_int(cj + j, o->rows) * o->columns + rf_wrap_int(ci + i, o->columns)] = 1;
        }
}

static int choose(RfOptimize *o, float limit)
{
    int worn = 0, count = 0;
    size_t cells = (size_t)o->columns * (size_t)o->rows;
    for (int i = 0; i < (int)cells; ++i)
        if (o->wear[i] > limit)
            o->worn[worn++] = (RfWornPlace){o->wear[i], i};
    qsort(o->worn, (size_t)worn, sizeof *o->worn, by_wear);
    memset(o->taken, 0, cells);
    for (int i = 0; i < worn && count < o->max_patches; ++i)
    {
        int cell = o->worn[i].cell;
        if (o->taken[cell])
            continue;
        o->patches[count] = (RfPatch){.at = rf_optimize_cell_middle(o, cell), .turn = o->turns[cell]};
        take(o, o->patches[count++].at);
    }
    return count;
}

// ---- find

// A place on the finest level from one on the patches' level: pixels of the latter lie in the middle of those they are
// the mean of.
static RfVec2 to_finest(const RfOptimize *o, float x, float y)
{
    float size = (float)(1 << o->level), middle = 0.5f * (size - 1);
    return (RfVec2){x * size + middle, y * size + middle};
}

static RfVec2 to_level(const RfOptimize *o, RfVec2 s)
{
    float size = (float)(1 << o->level), middle = 0.5f * (size - 1);
    return (RfVec2){(s.x - middle) / size, (s.y - middle) / size};
}

// What is seen where the patch is to be laid, as it lies.
static void gather(void *context, int item, int worker)
{
    (void)worker;
    const RfOptimize *o = context;
    const RfSynthesisExemplar *e = &o->material.levels[o->level];
    const RfPatch *p = &o->patches[item];
    int half = o->side / 2;
    float size = (float)(1 << o->level);
    float *out = o->queries + (size_t)item * (size_t)rf_windows_numbers(o->windows);
    for (int j = -half; j <= half; ++j)
        for (int i = -half; i <= half; ++i, out += e->channels)
        {
            RfVec2 step = rf_turn_back(p->turn, (RfVec2){(float)i * size, (float)j * size});
            RfVec2 source = rf_markers_source(&o->markers, rf_vec2_add(p->at, step));
            memcpy(out, pixel_at(e, to_level(o, source)), (size_t)e->channels * sizeof *out);
        }
}

// Pixels round the patch's middle that it is compared at.
static void look(const RfOptimize *o, const RfPatch *p, RfPatchScratch *scratch)
{
    const RfSynthesisExemplar *e = &o->material.levels[0];
    int grain = rf_max_int(o->outer / 8, 1);
    scratch->count = 0;
    for (int j = -o->outer; j <= o->outer; j += grain)
        for (int i = -o->outer; i <= o->outer; i += grain)
        {
            RfVec2 step = {(float)i, (float)j};
            RfVec2 at = rf_vec2_add(p->at, rf_turn_back(p->turn, step));
            assert(scratch->count < RF_PATCH_SAMPLES);
            scratch->steps[scratch->count] = step;
            scratch->seen[scratch->count++] = pixel_at(e, rf_markers_source(&o->markers, at));
        }
}

static float cost_at(const RfOptimize *o, RfVec2 source, const RfPatchScratch *scratch, float limit)
{
    const RfSynthesisExemplar *e = &o->material.levels[0];
    float cost = 0;
    for (int i = 0; i < scratch->count && cost < limit; ++i)
        cost += difference(scratch->seen[i], pixel_at(e, rf_vec2_add(source, scratch->steps[i])), e->channels);
    return cost;
}

static void refine(const RfOptimize *o, RfPatch *p, RfPatchScratch *scratch)
{
    int reach = 1 << o->level >> 1;
    RfVec2 middle = {floorf(p->source.x + 0.5f), floorf(p->source.y + 0.5f)};
    float least = INFINITY;
    look(o, p, scratch);
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx)
        {
            RfVec2 source = {middle.x + (float)dx, middle.y + (float)dy};
            float cost = cost_at(o, source, scratch, least);
            if (cost < least)
            {
                least = cost;
                p->source = source;
            }
        }
}

// ---- cut

static float error_at(const RfOptimize *o, const RfPatch *p, RfVec2 step)
{
    const RfSynthesisExemplar *e = &o->material.levels[0];
    const RfMarkers *m = &o->markers;
    RfVec2 at = rf_vec2_add(p->at, step);
    RfVec2 laid = rf_vec2_add(p->source, rf_turn(p->turn, step));
    // A patch ends where the exemplar does; and what lies beyond the exemplar's border is to be laid over.
    float widest = o->material.comparison.widest, beyond = widest * widest * (float)e->channels;
    if (!rf_optimize_inside(e, laid))
        return 16 * beyond;
    bool outside = at.x < -0.5f || at.y < -0.5f || at.x > (float)m->width - 0.5f || at.y > (float)m->height - 0.5f;
    if (outside && !m->tiles)
        return 0;
    RfVec2 seen = rf_markers_source(m, at);
    return difference(pixel_at(e, seen), pixel_at(e, laid), e->channels) + (rf_optimize_inside(e, seen) ? 0 : beyond);
}

static RfVec2 direction(int angle)
{
    float radians = 2 * RF_PI * (float)angle / RF_RING_ANGLES;
    return (RfVec2){cosf(radians), sinf(radians)};
}

static void cut(const RfOptimize *o, RfPatch *p, RfRing *ring)
{
    int path[RF_RING_ANGLES];
    ring->radii = o->outer - o->inner + 1;
    for (int a = 0; a < RF_RING_ANGLES; ++a)
    {
        RfVec2 d = direction(a);
        for (int r = 0; r < ring->radii; ++r)
        {
            float radius = (float)(o->inner + r);
            ring->errors[a][r] = error_at(o, p, (RfVec2){radius * d.x, radius * d.y});
        }
    }
    rf_ring_cut(ring, path);
    for (int a = 0; a < RF_RING_ANGLES; ++a)
        p->radius[a] = (float)(o->inner + path[a]);
}

static void fit(void *context, int item, int worker)
{
    RfOptimize *o = context;
    refine(o, &o->patches[item], &o->scratch[worker]);
    cut(o, &o->patches[item], &o->scratch[worker].ring);
}

// ---- lay

// Of what was laid over a moment ago: so much of it is seen.
static const float FRESH = 1 - 1.0f / RF_FADING_FRAMES;

static void replace(RfOptimize *o, const RfPatch *p, int x, int y, RfVec2 step)
{
    size_t pixel = (size_t)y * (size_t)o->markers.width + (size_t)x;
    RfMarker *marker = &o->markers.pixels[pixel], *fading = &o->fading.pixels[pixel];
    int cell = y / RF_WEAR_GRAIN * o->columns + x / RF_WEAR_GRAIN;
    RfVec2 middle = rf_optimize_cell_middle(o, cell);
    if (x == (int)middle.x && y == (int)middle.y)
        o->wear[cell] = 0;
    // Laid over once more in the same step: what lay here between was never seen, so that it cannot fade.
    if (fading->share < FRESH)
        *fading = *marker;
    fading->share = FRESH;
    RfVec2 at = {(float)x, (float)y}, source = rf_vec2_add(p->source, rf_turn(p->turn, step));
    *marker = (RfMarker){at, source, rf_bend_of(p->turn), 1, 0};
}

static void lay(RfOptimize *o, const RfPatch *p)
{
    const RfMarkers *m = &o->markers;
    int cx = (int)p->at.x, cy = (int)p->at.y;
    for (int y = cy - o->outer; y <= cy + o->outer; ++y)
        for (int x = cx - o->outer; x <= cx + o->outer; ++x)
        {
            RfVec2 step = {(float)x - p->at.x, (float)y - p->at.y};
            float turns = atan2f(step.y, step.x) / (2 * RF_PI);
            int angle = rf_wrap_int((int)floorf(turns * RF_RING_ANGLES + 0.5f), RF_RING_ANGLES);
            bool outside = x < 0 || y < 0 || x >= m->width || y >= m->height;
            if (rf_vec2_length(step) <= p->radius[angle] && (m->tiles || !outside))
                replace(o, p, rf_wrap_int(x, m->width), rf_wrap_int(y, m->height), step);
        }
}

// ---- all of it

// How much the exemplar varies where the texture comes from, over how much it does everywhere.
static float seen_variation(const RfOptimize *o)
{
    const RfSynthesisExemplar *e = &o->material.levels[o->level];
    const RfMarkers *m = &o->markers;
    int half = o->side / 2, samples = 0;
    double seen = 0;
    for (int y = SAMPLED / 2; y < m->height; y += SAMPLED)
        for (int x = SAMPLED / 2; x < m->width; x += SAMPLED, ++samples)
        {
            RfVec2 s = to_level(o, m->pixels[(ptrdiff_t)y * m->width + x].source);
            int u = rf_nearest_int(s.x) - half, v = rf_nearest_int(s.y) - half;
            u = e->tiles ? rf_wrap_int(u, e->width) : rf_clamp_int(u, 0, e->width - o->side);
            v = e->tiles ? rf_wrap_int(v, e->height) : rf_clamp_int(v, 0, e->height - o->side);
            int window = rf_windows_at(o->windows, (RfWindowPlace){0, u, v});
            seen += window >= 0 ? (double)o->variations[window] : 0;
        }
    return o->variation > 0 ? (float)(seen / rf_max_int(samples, 1) / o->variation) : 1;
}

// Part of its variation that a window's cost is lowered by: more where the texture has become smoother than the
// exemplar, less where it has become livelier. With one part for all lava goes dark (0.25: 0.67 of its contrast in
// turbulence) or pebbles bright (0.75: 1.3 times as bright).
static float variation_part(const RfOptimize *o)
{
    return rf_clamp(PART + STEERING * (1 - seen_variation(o)), 0, 1);
}

static void set_penalties(RfOptimize *o)
{
    const RfSynthesisExemplar *e = &o->material.levels[o->level], *finest = &o->material.levels[0];
    int margin = e->tiles ? 0 : o->side / 2;
    float part = variation_part(o);
    RfUsage usage = {0};
    for (int y = SAMPLED / 2; y < o->markers.height; y += SAMPLED)
        for (int x = SAMPLED / 2; x < o->markers.width; x += SAMPLED)
        {
            RfVec2 s = o->markers.pixels[(ptrdiff_t)y * o->markers.width + x].source;
            rf_usage_add(&usage, finest->width, finest->height, margin << o->level, rf_clamp(s.x, -1e6f, 1e6f),
                         rf_clamp(s.y, -1e6f, 1e6f));
        }
    rf_usage_settle(&usage);
    rf_usage_prices(&usage, e->width, e->height, margin, PRICE * o->options.spread * (float)o->distance, o->prices);
    rf_synthesis_penalties(e, o->windows, o->side, o->prices, 1, o->variations, part, o->penalties);
}

static RfResult lay_patches(RfOptimize *o, int count)
{
    RfWindowQueries queries = {.count = count, .windows = o->queries, .penalties = o->penalties};
    rf_parallel_for(count, gather, o);
    RF_TRY(rf_windows_search(o->windows, &queries, o->matches));
    double sum = 0;
    for (int i = 0; i < count; ++i)
    {
        RfWindowPlace place = o->matches[i].place;
        o->patches[i].source = to_finest(o, (float)(place.x + o->side / 2), (float)(place.y + o->side / 2));
        sum += (double)o->matches[i].distance;
    }
    o->distance = sum / count;
    o->laid += count;
    rf_parallel_for(count, fit, o);
    for (int i = 0; i < count; ++i)
        lay(o, &o->patches[i]);
    return RF_OK;
}

RfResult rf_optimize_renew(RfOptimize *o, const RfFlowView *flow)
{
    rf_optimize_judge(o, flow);
    for (int round = 0; round < ROUNDS; ++round)
    {
        int count = choose(o, round == 0 ? 1 : URGENT);
        if (count == 0)
            break;
        if (round == 0)
            set_penalties(o);
        RF_TRY(lay_patches(o, count));
    }
    return RF_OK;
}
