// SPDX-License-Identifier: Apache-2.0
// A moving texture by texture optimisation, guided by a flow.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005 (section 5, flow-guided
// synthesis). Kwatra, Adalsteinsson, Kim, Kwatra, Carlson, Lin. Texturing fluids. 2007 (coordinates carried in place of
// colours, orientation carried and turned by the flow).
//
// The first frame is a still texture. Then, frame by frame:
//
//     carry    markers, each with its place in the exemplar, move with the flow, which turns and strains what is seen
//     judge    where the texture is stretched too much, or comes from beyond the exemplar, it is worn
//     renew    patches of the exemplar that fit what is there best are laid over worn places (renewing.c)
//     draw     every pixel from the markers round it, and from what fades
//
// Deviations. Kwatra et al. match small windows everywhere in every frame, held to the carried picture. Here what is
// sound is left alone, so that it follows the flow exactly and does not flicker, and what is worn is replaced by pieces
// larger than what they are to keep whole; why, renewing.c tells. New texture fades in over some frames where it is
// unlike what it replaces.
#include "methods/optimize/moving.h"
#include "core/clock.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"

#include <string.h>

enum
{
    /// Exemplars are searched on the first level that has no longer sides than this, but not on the finest, unless it
    /// is the only one.
    SEARCHED_SIDE = 128,
    MAX_PATCHES = 4096
};

// Of a patch's reach, so much is laid in every direction. The less, the better the cut: over its floor, lava in
// turbulence flickers by 0.175, 0.146, 0.131 with 0.4, 0.25, 0.15, of which the last lays pieces too small for stones.
static const float CORE = 0.25f;

RfResult rf_optimize_create(const RfExemplar *exemplar, const RfOptimizeOptions *options, RfOptimize **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_optimize_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_optimize_check(options));
    RF_TRY(rf_refuse_guide(exemplar));
    RfOptimize *o = rf_allocate_zero(1, sizeof *o);
    if (!o)
        return RF_OUT_OF_MEMORY;
    o->options = *options;
    o->exemplar = exemplar;
    *out = o;
    return RF_OK;
}

// Everything that depends on the first frame.
static void clear(RfOptimize *o)
{
    rf_synthesis_material_free(&o->material);
    rf_markers_free(&o->markers);
    rf_markers_free(&o->fading);
    rf_windows_destroy(o->windows);
    rf_release(o->wear);
    rf_release(o->turns);
    rf_release(o->smoothed);
    rf_release(o->variations);
    rf_release(o->penalties);
    rf_release(o->prices);
    rf_release(o->patches);
    rf_release(o->worn);
    rf_release(o->taken);
    rf_release(o->queries);
    rf_release(o->matches);
    rf_release(o->scratch);
    *o = (RfOptimize){.options = o->options, .exemplar = o->exemplar};
}

void rf_optimize_destroy(RfOptimize *o)
{
    if (!o)
        return;
    clear(o);
    rf_release(o);
}

// ---- the first frame

RfVec2 rf_optimize_downstream(const RfFlowView *flow, int width, int height, RfVec2 at)
{
    RfVec2 v = rf_flow_sample(flow, (at.x + 0.5f) * (float)flow->width / (float)width,
                              (at.y + 0.5f) * (float)flow->height / (float)height, rf_flow_blend(flow, flow->time));
    // In double, where the square of no float overflows.
    double x = (double)v.x * width / flow->width, y = (double)v.y * height / flow->height, length = sqrt(x * x + y * y);
    return length > 1e-6 ? (RfVec2){(float)(x / length), (float)(-y / length)} : (RfVec2){1, 0};
}

static RfResult start_turned(const RfOptimize *o, const RfFlowView *flow, int width, int height, RfOptimizeStart *start)
{
    float *degrees = rf_allocate((size_t)width * (size_t)height, sizeof *degrees);
    if (!degrees)
        return RF_OUT_OF_MEMORY;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            RfVec2 turn = rf_optimize_downstream(flow, width, height, (RfVec2){(float)x, (float)y});
            degrees[(ptrdiff_t)y * width + x] = atan2f(-turn.y, turn.x) * (180 / RF_PI);
        }
    RfOptimizeConstraints constraints = {.orientation = {degrees, width, height, 1, width}};
    RfResult result = rf_optimize_start(o->exemplar, &o->options, &constraints, width, height, start);
    rf_release(degrees);
    return result;
}

static RfResult open_exemplar(RfOptimize *o)
{
    const RfSynthesisMaterial *m = &o->material;
    int reach = o->options.windows[0], wanted = 1;
    while (o->level + 1 < m->level_count &&
           (o->level == 0 || rf_max_int(m->levels[o->level].width, m->levels[o->level].height) > SEARCHED_SIDE))
        ++o->level;
    do
    {
        wanted = (2 * reach >> o->level) | 1;
        wanted = rf_clamp_int(wanted, 5, RF_FIXED_SIDE);
        o->side = rf_synthesis_side(m, o->level, wanted, RF_MAX_SIZE, RF_MAX_SIZE);
    } while (o->side == 0 && o->level-- > 0);
    if (o->side == 0)
        return rf_fail(RF_BAD_INPUT, NULL, NULL, "an exemplar of %d x %d pixels is too small", m->levels[0].width,
                       m->levels[0].height);
    o->outer = rf_clamp_int((o->side << o->level) / 2, 2, rf_min_int(reach, RF_RING_RADII - 1));
    o->inner = rf_max_int((int)(CORE * (float)o->outer), 1);
    const RfSynthesisExemplar *e = &m->levels[o->level];
    RfWindowSource source = {.image = {e->pixels, e->width, e->height, e->channels, (ptrdiff_t)e->width * e->channels}};
    RfWindowOptions options = {.side = o->side, .tiles = e->tiles};
    RF_TRY(rf_windows_create(&source, 1, &options, &o->windows));
    size_t count = (size_t)rf_windows_count(o->windows);
    o->variations = rf_allocate(count, sizeof *o->variations);
    o->penalties = rf_allocate(count, sizeof *o->penalties);
    o->prices = rf_allocate((size_t)e->width * (size_t)e->height, sizeof *o->prices);
    if (!o->variations || !o->penalties || !o->prices)
        return RF_OUT_OF_MEMORY;
    rf_windows_vary(o->windows, e->channels, o->variations);
    o->variation = 0;
    for (size_t i = 0; i < count; ++i)
        o->variation += (double)o->variations[i] / (double)count;
    return RF_OK;
}

RfResult rf_optimize_make_room(RfOptimize *o, int width, int height)
{
    RF_TRY(rf_markers_create(width, height, o->options.tile, &o->markers));
    RF_TRY(rf_markers_create(width, height, o->options.tile, &o->fading));
    RF_TRY(open_exemplar(o));
    o->columns = (width + RF_WEAR_GRAIN - 1) / RF_WEAR_GRAIN;
    o->rows = (height + RF_WEAR_GRAIN - 1) / RF_WEAR_GRAIN;
    size_t cells = (size_t)o->columns * (size_t)o->rows;
    int64_t area = (int64_t)o->outer * o->outer * 2;
    o->max_patches =
        (int)((int64_t)width * height / area < MAX_PATCHES ? (int64_t)width * height / area + 1 : MAX_PATCHES);
    size_t patches = (size_t)o->max_patches;
    o->wear = rf_allocate(cells, sizeof *o->wear);
    o->turns = rf_allocate(cells, sizeof *o->turns);
    o->smoothed = rf_allocate(cells, sizeof *o->smoothed);
    o->worn = rf_allocate(cells, sizeof *o->worn);
    o->taken = rf_allocate(cells, 1);
    o->patches = rf_allocate(patches, sizeof *o->patches);
    o->queries = rf_allocate(patches * (size_t)rf_windows_numbers(o->windows), sizeof *o->queries);
    o->matches = rf_allocate(patches, sizeof *o->matches);
    o->scratch = rf_allocate(RF_MAX_THREADS, sizeof *o->scratch);
    bool enough = o->wear && o->turns && o->smoothed && o->worn && o->taken && o->patches && o->queries && o->matches &&
                  o->scratch;
    return enough ? RF_OK : RF_OUT_OF_MEMORY;
}

static void set_markers(RfOptimize *o, const RfFlowView *flow, const RfSynthesisFrame *frame)
{
    RfMarkers *m = &o->markers;
    for (int i = 0; i < m->width * m->height; ++i)
    {
        RfVec2 at = {(float)(i % m->width), (float)(i / m->width)}, turn = {1, 0};
        if (o->options.orient == RF_ORIENT_FLOW)
            turn = rf_optimize_downstream(flow, m->width, m->height, at);
        m->pixels[i] = (RfMarker){at, frame->sources[i], rf_bend_of(turn), 1, 0};
    }
}

static RfResult begin(RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    RfOptimizeStart start = {0};
    RF_TRY(o->options.orient == RF_ORIENT_FLOW
               ? start_turned(o, flow, width, height, &start)
               : rf_optimize_start(o->exemplar, &o->options, NULL, width, height, &start));
    o->material = start.material;
    RfResult result = rf_optimize_make_room(o, width, height);
    if (result == RF_OK)
        set_markers(o, flow, &start.frame);
    rf_synthesis_frame_free(&start.frame);
    o->placed = result == RF_OK;
    if (!o->placed)
        clear(o);
    return result;
}

// ---- a step

static RfResult check_step(const RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(width >= 8 && width <= RF_MAX_SIZE && height >= 8 && height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be 8 to %d", width, height, RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(flow));
    const RfMarkers *m = &o->markers;
    RF_REQUIRE(!o->placed || (width == m->width && height == m->height),
               "frame: %d x %d after frames of %d x %d: the size must stay", width, height, m->width, m->height);
    RF_REQUIRE(!o->placed || flow->time >= o->time, "flow: time %g after %g: times must not decrease", flow->time,
               o->time);
    return RF_OK;
}

static void carry(RfOptimize *o, const RfFlowView *flow)
{
    rf_markers_carry(&o->markers, flow, o->time);
    rf_markers_fill(&o->markers);
    rf_markers_carry(&o->fading, flow, o->time);
    float faded = (float)(flow->time - o->time) / RF_FADING_FRAMES;
    for (int i = 0; i < o->fading.width * o->fading.height; ++i)
        o->fading.pixels[i].share = rf_max(o->fading.pixels[i].share - faded, 0);
}

RfResult rf_optimize_advance(RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(o && flow, "rf_optimize_advance: optimize or flow is NULL");
    RF_TRY(check_step(o, flow, width, height));
    double start = rf_seconds(), carried = start;
    o->laid = 0;
    if (!o->placed)
        RF_TRY(begin(o, flow, width, height));
    else if (flow->time > o->time)
    {
        RF_TRY(rf_progress("carrying", 0)); // at the door: a step, once begun, is ended
        carry(o, flow);
        carried = rf_seconds();
        RF_TRY(rf_optimize_renew(o, flow));
    }
    o->time = flow->time;
    o->seconds[0] = carried - start;
    o->seconds[1] = rf_seconds() - carried;
    o->seconds[2] = 0;
    return RF_OK;
}

typedef struct Drawing
{
    const RfOptimize *o;
    const RfFlowView *flow;
    const RfImageView *frame;
    /// The exemplar has maps of directions, which turn.
    bool directions;
} Drawing;

// Absurd flows carry places so far that their indices would be none.
static RfVec2 within_reach(RfVec2 place)
{
    return (RfVec2){rf_clamp(place.x, -1e6f, 1e6f), rf_clamp(place.y, -1e6f, 1e6f)};
}

static void sample_voice(const Drawing *d, const RfVoices *voices, int g, float *values)
{
    RfVec2 lies = d->directions ? rf_bend_parts(voices->markers[g]->bend).turn : (RfVec2){1, 0};
    rf_optimize_sample(&d->o->material, within_reach(voices->places[g]), d->directions ? &lies : NULL, NULL, values);
}

// The mean of what all voices say. False: nobody says anything.
static bool draw_pixel(const Drawing *d, const RfMarkers *m, int x, int y, float *values)
{
    RfVoices voices;
    rf_markers_hear(m, x, y, &voices);
    if (voices.count == 0)
        return false;
    sample_voice(d, &voices, 0, values);
    for (int c = 0; c < d->frame->channels && voices.count > 1; ++c)
        values[c] *= voices.shares[0];
    for (int g = 1; g < voices.count; ++g)
    {
        float other[RF_MAX_EXEMPLAR_CHANNELS];
        sample_voice(d, &voices, g, other);
        for (int c = 0; c < d->frame->channels; ++c)
            values[c] += voices.shares[g] * other[c];
    }
    return true;
}

static void draw_row(void *context, int y, int worker)
{
    (void)worker;
    const Drawing *d = context;
    const RfMarkers *m = &d->o->markers;
    for (int x = 0; x < m->width; ++x)
    {
        float *values = d->frame->pixels + y * d->frame->row_stride + (ptrdiff_t)x * d->frame->channels;
        float share = rf_markers_share(&d->o->fading, x, y), other[RF_MAX_EXEMPLAR_CHANNELS];
        memset(values, 0, (size_t)d->frame->channels * sizeof *values);
        if (d->flow->mask && !rf_pixel_inside(d->flow, m->width, m->height, x, y))
            continue;
        draw_pixel(d, m, x, y, values);
        if (share > 0 && draw_pixel(d, &d->o->fading, x, y, other))
            for (int c = 0; c < d->frame->channels; ++c)
                values[c] += share * (other[c] - values[c]);
    }
}

RfResult rf_optimize_step(RfOptimize *o, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(o && flow && frame && frame->pixels, "rf_optimize_step: optimize, flow or frame is NULL");
    RF_REQUIRE(frame->channels == rf_optimize_channels(o->exemplar), "frame: %d channels, the exemplar has %d",
               frame->channels, rf_optimize_channels(o->exemplar));
    RF_TRY(rf_optimize_advance(o, flow, frame->width, frame->height));
    double start = rf_seconds();
    Drawing drawing = {o, flow, frame, false};
    for (int i = 0; i < o->exemplar->map_count; ++i)
        drawing.directions |= o->exemplar->maps[i].kind == RF_MAP_VECTOR || o->exemplar->maps[i].kind == RF_MAP_NORMAL;
    rf_parallel_for(frame->height, draw_row, &drawing);
    o->seconds[2] = rf_seconds() - start;
    return RF_OK;
}

RfOptimizeStats rf_optimize_stats(const RfOptimize *o)
{
    RfOptimizeStats stats = {0};
    if (!o || !o->placed)
        return stats;
    double numbers = (double)o->side * o->side * o->material.comparison.channels;
    stats.patches = o->laid;
    stats.energy = sqrt(o->distance / numbers) / (double)o->material.comparison.widest;
    stats.carry_seconds = o->seconds[0];
    stats.search_seconds = o->seconds[1];
    stats.draw_seconds = o->seconds[2];
    return stats;
}
