// SPDX-License-Identifier: Apache-2.0
// A moving texture by texture optimisation, guided by a flow.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005 (section 5, flow-guided
// synthesis). Kwatra, Adalsteinsson, Kim, Kwatra, Carlson, Lin. Texturing fluids. 2007 (coordinates carried in place of
// colours, the soft constraint by gradient).
//
// The windows themselves travel. Each keeps its place in the exemplar, as a real number, and moves with the flow at its
// centre, so that what it shows is never stretched and never interpolated twice. Where the flow deforms, neighbouring
// windows come to disagree: there, and only there, they are searched again.
//
//     carry    windows move; a cell that lost its window gets a new one that continues its nearest neighbour
//     draw     c: every pixel as the carried windows say
//     search   windows over pixels where windows disagree; one keeps its match unless another is a tenth better
//     draw     again, held to c where c has gradients
//
// Deviations. A contested pixel becomes what most windows over it say, not what is nearest to their mean as in a still:
// where windows disagree about where a thin line lies, the mean is nearly its ground, and within 60 frames of a vortex
// lava goes dark (contrast 0.65 of the exemplar's; by the most votes 0.9). Kwatra et al. carry colours and hold all
// pixels to them; carried colours blur, and are wrong by half a pixel where they are not interpolated. Windows whose
// places differ by less than a pixel are not at odds: their mean is drawn, so that a weak strain bends the texture
// smoothly before it breaks.
#include "methods/optimize/moving.h"
#include "core/clock.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/nearest_known.h"
#include "kernels/tracing.h"

#include <stdlib.h>
#include <string.h>

// A window is given another match where that costs less than this part of its own.
static const float KEEP = 0.9f;
// Offsets that differ by less, in exemplar pixels, are one.
static const float TOGETHER = 1.0f;
// How strongly pixels are held to the carried ones, where their gradient is large, against a weight of 1 of all
// windows.
static const float HOLD = 1.0f;

RfResult rf_optimize_create(const RfExemplar *exemplar, const RfOptimizeOptions *options, RfOptimize **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_optimize_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_optimize_check(options));
    if (rf_optimize_channels(exemplar) < rf_exemplar_channels(exemplar))
        return rf_fail(RF_BAD_INPUT, NULL, NULL, "a map named %s belongs to still textures: leave it out",
                       RF_GUIDE_MAP);
    RfOptimize *o = rf_allocate_zero(1, sizeof *o);
    if (!o)
        return RF_OUT_OF_MEMORY;
    o->options = *options;
    o->exemplar = exemplar;
    *out = o;
    return RF_OK;
}

void rf_optimize_destroy(RfOptimize *o)
{
    if (!o)
        return;
    rf_synthesis_material_free(&o->start.material);
    rf_synthesis_frame_free(&o->start.frame);
    rf_release(o->next);
    rf_fixed_free(&o->held);
    rf_release(o->hold);
    rf_release(o->prices);
    rf_release(o->nearest);
    rf_release(o);
}

// ---- the first frame

// How a picture's texture lies in the flow at a point of the frame: the exemplar's x axis points downstream. (1, 0)
// where the flow stands still.
static RfVec2 flow_turn(const RfFlowView *flow, int width, int height, RfVec2 at)
{
    RfVec2 v = rf_flow_sample(flow, (at.x + 0.5f) * (float)flow->width / (float)width,
                              (at.y + 0.5f) * (float)flow->height / (float)height, rf_flow_blend(flow, flow->time));
    v = (RfVec2){v.x * (float)width / (float)flow->width, v.y * (float)height / (float)flow->height};
    float length = rf_vec2_length(v);
    return length > 1e-6f ? (RfVec2){v.x / length, -v.y / length} : (RfVec2){1, 0};
}

static RfResult start_turned(RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    float *degrees = rf_allocate((size_t)width * (size_t)height, sizeof *degrees);
    if (!degrees)
        return RF_OUT_OF_MEMORY;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            RfVec2 turn = flow_turn(flow, width, height, (RfVec2){(float)x, (float)y});
            degrees[(ptrdiff_t)y * width + x] = atan2f(-turn.y, turn.x) * (180 / RF_PI);
        }
    RfOptimizeConstraints constraints = {.orientation = {degrees, width, height, 1, width}};
    RfResult result = rf_optimize_start(o->exemplar, &o->options, &constraints, width, height, &o->start);
    rf_release(degrees);
    return result;
}

static int by_size(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static float gradient_at(const RfFixedPicture *picture, int x, int y, int channels)
{
    int left = rf_max_int(x - 1, 0), right = rf_min_int(x + 1, picture->width - 1);
    int above = rf_max_int(y - 1, 0), below = rf_min_int(y + 1, picture->height - 1);
    const int16_t *w = rf_fixed_at(picture, left, y), *e = rf_fixed_at(picture, right, y);
    const int16_t *n = rf_fixed_at(picture, x, above), *s = rf_fixed_at(picture, x, below);
    float sum = 0;
    for (int c = 0; c < channels; ++c)
    {
        float dx = 0.5f * (float)(e[c] - w[c]), dy = 0.5f * (float)(s[c] - n[c]);
        sum += dx * dx + dy * dy;
    }
    return sqrtf(sum);
}

static RfResult measure_gradient(RfOptimize *o)
{
    const RfFixedPicture *picture = &o->start.material.levels[0].fixed;
    int count = 0;
    float *all = rf_allocate((size_t)picture->width * (size_t)picture->height, sizeof *all);
    if (!all)
        return RF_OUT_OF_MEMORY;
    for (int y = 0; y < picture->height; ++y)
        for (int x = 0; x < picture->width; ++x)
            all[count++] = gradient_at(picture, x, y, picture->channels);
    qsort(all, (size_t)count, sizeof *all, by_size);
    o->gradient = rf_max(all[(size_t)count * 95 / 100], 1);
    rf_release(all);
    return RF_OK;
}

RfResult rf_optimize_make_room(RfOptimize *o)
{
    RfSynthesisFrame *f = &o->start.frame;
    const RfSynthesisExemplar *e = &o->start.material.levels[0];
    RF_TRY(rf_synthesis_cut(f, rf_max_int(o->start.side / 4, 1)));
    RF_TRY(rf_fixed_create(f->width, f->height, e->channels, 0, &o->held));
    o->next = rf_allocate((size_t)f->columns * (size_t)f->rows, sizeof *o->next);
    o->hold = rf_allocate((size_t)f->width * (size_t)f->height, sizeof *o->hold);
    o->prices = rf_allocate((size_t)e->width * (size_t)e->height, sizeof *o->prices);
    o->nearest = rf_allocate((size_t)f->columns * (size_t)f->rows, sizeof *o->nearest);
    if (!o->next || !o->hold || !o->prices || !o->nearest)
        return RF_OUT_OF_MEMORY;
    return measure_gradient(o);
}

static RfResult begin(RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    if (o->options.orient == RF_ORIENT_FLOW)
        RF_TRY(start_turned(o, flow, width, height));
    else
        RF_TRY(rf_optimize_start(o->exemplar, &o->options, NULL, width, height, &o->start));
    RF_TRY(rf_optimize_make_room(o));
    rf_synthesis_place(&o->start.frame, NULL);
    for (int i = 0; i < o->start.frame.columns * o->start.frame.rows && o->options.orient == RF_ORIENT_FLOW; ++i)
        o->start.frame.windows[i].turn = flow_turn(flow, width, height, o->start.frame.windows[i].at);
    o->placed = true;
    return RF_OK;
}

// ---- carry

typedef struct Carrying
{
    RfOptimize *o;
    const RfFlowView *flow;
    int steps;
} Carrying;

// Into -0.5 to n - 0.5.
static float wrap(float at, int n)
{
    return at - floorf((at + 0.5f) / (float)n) * (float)n;
}

static void carry_row(void *context, int row, int worker)
{
    (void)worker;
    const Carrying *k = context;
    RfSynthesisFrame *f = &k->o->start.frame;
    float scale_x = (float)k->flow->width / (float)f->width, scale_y = (float)k->flow->height / (float)f->height;
    for (int i = 0; i < f->columns; ++i)
    {
        RfSynthesisWindow *w = &f->windows[(ptrdiff_t)row * f->columns + i];
        RfVec2 p = {(w->at.x + 0.5f) * scale_x, (w->at.y + 0.5f) * scale_y};
        p = rf_trace(k->flow, p, k->o->time, k->flow->time, k->steps);
        w->at = (RfVec2){p.x / scale_x - 0.5f, p.y / scale_y - 0.5f};
        if (f->tiles)
            w->at = (RfVec2){wrap(w->at.x, f->width), wrap(w->at.y, f->height)};
        if (k->o->options.orient == RF_ORIENT_FLOW)
            w->turn = flow_turn(k->flow, f->width, f->height, w->at);
    }
}

// The cell of a point, -1 outside the frame.
static int cell_of(const RfSynthesisFrame *f, RfVec2 at)
{
    if (!(at.x >= -0.5f && at.y >= -0.5f && at.x < (float)f->width - 0.5f && at.y < (float)f->height - 0.5f))
        return -1;
    int column = rf_min_int((int)(at.x + 0.5f) / f->spacing, f->columns - 1);
    int row = rf_min_int((int)(at.y + 0.5f) / f->spacing, f->rows - 1);
    return row * f->columns + column;
}

// One window a cell: of two that meet the one that fits better stays.
static void put_into_cells(RfOptimize *o)
{
    RfSynthesisFrame *f = &o->start.frame;
    int cells = f->columns * f->rows;
    memset(o->next, 0, (size_t)cells * sizeof *o->next);
    for (int i = 0; i < cells; ++i)
    {
        RfSynthesisWindow *w = &f->windows[i];
        int cell = cell_of(f, w->at);
        if (cell < 0 || (o->next[cell].exists && o->next[cell].cost <= w->cost))
            continue;
        o->next[cell] = *w;
        o->next[cell].changed = false;
    }
    RfSynthesisWindow *swap = f->windows;
    f->windows = o->next;
    o->next = swap;
}

// Empty cells get a window that continues the nearest carried one: sound texture from the first, if not the best. Where
// the flow swept all windows out, the texture stays as it is.
static void fill_cells(RfOptimize *o)
{
    RfSynthesisFrame *f = &o->start.frame;
    int cells = f->columns * f->rows;
    for (int i = 0; i < cells; ++i)
        o->nearest[i] = f->windows[i].exists ? i : -1;
    rf_spread_nearest(o->nearest, f->columns, f->rows);
    if (o->nearest[0] < 0)
        rf_synthesis_place(f, NULL);
    for (int i = 0; i < cells; ++i)
    {
        if (o->nearest[i] < 0 || o->nearest[i] == i)
            continue;
        const RfSynthesisWindow *from = &f->windows[o->nearest[i]];
        RfVec2 at = rf_synthesis_cell_middle(f, i % f->columns, i / f->columns);
        f->windows[i] = *from;
        f->windows[i].at = at;
        f->windows[i].source = rf_vec2_add(from->source, rf_turn(from->turn, rf_vec2_sub(at, from->at)));
        f->windows[i].changed = true; // not carried
    }
}

static void carry(RfOptimize *o, const RfFlowView *flow)
{
    Carrying carrying = {o, flow, rf_path_steps(flow, flow->time - o->time)};
    rf_parallel_for(o->start.frame.rows, carry_row, &carrying);
    put_into_cells(o);
    fill_cells(o);
}

// ---- mend

static RfResult draw_windows(RfOptimize *o, bool held)
{
    RfSynthesisAssign assign = {
        .exemplar = &o->start.material.levels[0],
        .frame = &o->start.frame,
        .side = o->start.side,
        .mean = o->options.form == RF_FORM_MEAN,
        .strongest = true,
        .robust = true,
        .together = TOGETHER,
        .carried = true,
        .all = !held,
        .held = held ? &o->held : NULL,
        .hold = o->hold,
    };
    return rf_synthesis_assign(&assign);
}

static void hold_row(void *context, int y, int worker)
{
    (void)worker;
    RfOptimize *o = context;
    RfSynthesisFrame *f = &o->start.frame;
    for (int x = 0; x < f->width; ++x)
    {
        const RfSynthesisWindow *w = &f->windows[(ptrdiff_t)(y / f->spacing) * f->columns + x / f->spacing];
        float gradient = gradient_at(&f->picture, x, y, f->picture.channels);
        // What is new has nothing to be held to.
        o->hold[(ptrdiff_t)y * f->width + x] = w->changed ? 0 : HOLD * rf_min(1, gradient / o->gradient);
    }
    memcpy(rf_fixed_at(&o->held, 0, y), rf_fixed_at(&f->picture, 0, y),
           (size_t)f->width * (size_t)f->picture.channels * sizeof(int16_t));
}

static RfResult mend(RfOptimize *o)
{
    RfSynthesisFrame *f = &o->start.frame;
    const RfSynthesisExemplar *e = &o->start.material.levels[0];
    rf_synthesis_settle_prices(f, e, o->start.side, &o->start.usage);
    rf_synthesis_prices(e, o->start.side, &o->start.usage, o->options.spread * (float)o->energy.compared, o->prices);
    rf_parallel_for(f->height, hold_row, o);
    RfSynthesisSearch search = {
        .exemplar = e,
        .frame = f,
        .side = o->start.side,
        .prices = o->options.spread > 0 ? o->prices : NULL,
        .keep = KEEP,
        .plain = o->options.orient == RF_ORIENT_NONE,
        .seed = o->options.seed,
        .round = ++o->round + 1000000,
    };
    return rf_synthesis_search(&search, &o->energy);
}

static RfResult check_step(const RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(width >= 8 && width <= RF_MAX_SIZE && height >= 8 && height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be 8 to %d", width, height, RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(flow));
    const RfSynthesisFrame *f = &o->start.frame;
    RF_REQUIRE(!o->placed || (width == f->width && height == f->height),
               "frame: %d x %d after frames of %d x %d: the size must stay", width, height, f->width, f->height);
    RF_REQUIRE(!o->placed || flow->time >= o->time, "flow: time %g after %g: times must not decrease", flow->time,
               o->time);
    return RF_OK;
}

RfResult rf_optimize_advance(RfOptimize *o, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(o && flow, "rf_optimize_advance: optimize or flow is NULL");
    RF_TRY(check_step(o, flow, width, height));
    if (!o->placed)
        RF_TRY(begin(o, flow, width, height));
    else if (flow->time > o->time)
    {
        RF_TRY(rf_progress("carrying", 0)); // at the door: a step, once begun, is ended
        double start = rf_seconds(), carried, drawn, searched;
        carry(o, flow);
        carried = rf_seconds();
        RF_TRY(draw_windows(o, false));
        drawn = rf_seconds();
        RF_TRY(mend(o));
        searched = rf_seconds();
        RF_TRY(draw_windows(o, true));
        o->seconds[0] = carried - start;
        o->seconds[1] = searched - drawn;
        o->seconds[2] = drawn - carried + rf_seconds() - searched;
    }
    o->time = flow->time;
    return RF_OK;
}

typedef struct Drawing
{
    const RfOptimize *o;
    const RfFlowView *flow;
    const RfImageView *frame;
} Drawing;

static void draw_row(void *context, int y, int worker)
{
    (void)worker;
    const Drawing *d = context;
    const RfSynthesisFrame *f = &d->o->start.frame;
    const RfFlowView *flow = d->flow;
    bool turned = d->o->options.orient == RF_ORIENT_FLOW;
    for (int x = 0; x < f->width; ++x)
    {
        float *values = d->frame->pixels + y * d->frame->row_stride + (ptrdiff_t)x * d->frame->channels;
        if (flow->mask && !rf_pixel_inside(flow, f->width, f->height, x, y))
        {
            memset(values, 0, (size_t)d->frame->channels * sizeof *values);
            continue;
        }
        RfVec2 turn = turned ? flow_turn(flow, f->width, f->height, (RfVec2){(float)x, (float)y}) : (RfVec2){1, 0};
        const int16_t *mean = d->o->options.form == RF_FORM_MEAN ? rf_fixed_at(&f->picture, x, y) : NULL;
        rf_optimize_sample(&d->o->start.material, f->sources[(ptrdiff_t)y * f->width + x], turned ? &turn : NULL, mean,
                           values);
    }
}

RfResult rf_optimize_step(RfOptimize *o, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(o && flow && frame && frame->pixels, "rf_optimize_step: optimize, flow or frame is NULL");
    RF_REQUIRE(frame->channels == rf_optimize_channels(o->exemplar), "frame: %d channels, the exemplar has %d",
               frame->channels, rf_optimize_channels(o->exemplar));
    RF_TRY(rf_optimize_advance(o, flow, frame->width, frame->height));
    double start = rf_seconds();
    Drawing drawing = {o, flow, frame};
    rf_parallel_for(frame->height, draw_row, &drawing);
    o->seconds[2] += rf_seconds() - start;
    return RF_OK;
}

RfOptimizeStats rf_optimize_stats(const RfOptimize *o)
{
    RfOptimizeStats stats = {0};
    if (!o || !o->placed)
        return stats;
    const RfSynthesisFrame *f = &o->start.frame;
    for (int i = 0; i < f->columns * f->rows; ++i)
        stats.windows += f->windows[i].exists;
    double numbers = (double)o->start.side * o->start.side * o->start.material.channels;
    double unit = (double)o->start.material.levels[0].scale * (double)o->start.material.widest;
    stats.energy = sqrt(o->energy.mean / numbers) / unit;
    stats.carry_seconds = o->seconds[0];
    stats.search_seconds = o->seconds[1];
    stats.draw_seconds = o->seconds[2];
    return stats;
}
