// SPDX-License-Identifier: Apache-2.0
// Directional moving texture.
//
// Wang, Wang, Yong, Sun. Synthesizing 2D directional moving texture. 2005. The exemplar's main direction is found after
// Tamura, Mori, Yamawaki. Textural features corresponding to visual perception. 1978.
//
// The first frame is laid cell by cell from turned copies of the exemplar. Then, frame by frame:
//
//     move      cells of like velocity, by whole pixels; what lies off the flow is left out (moving.c)
//     fill      holes, with the patch of the right copy that fits best round them (filling.c)
//     renew     cells that were blended too often, with the patch that is most like them (filling.c)
//
// Deviations. The flow may be unsteady. Pieces that continue each other to a pixel are joined, not blended, cracks of
// two pixels are continued from beside them, and what is below a pixel is kept at every speed: all of it so that less
// is blended. Pixels are blended with what the exemplar says between its own (kernels/sampler.h), not with a copy's.
#include "methods/directional/directional.h"
#include "core/clock.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/directionality.h"

#include <string.h>

// Below this much directionality an exemplar has no direction to be seen.
static const float ISOTROPIC = 0.1f;
// Edges that count, of the exemplar's range: 12 of 256 levels (Tamura et al.).
static const float EDGE = 12.0f / 256;

enum
{
    /// Of what the options allow.
    LEAST_CELL = 2
};

static void free_frame(RfDirectional *d)
{
    rf_release(d->texels);
    rf_release(d->next_texels);
    rf_release(d->picture);
    rf_release(d->next_picture);
    rf_release(d->blended);
    rf_release(d->next_blended);
    rf_release(d->velocity);
    rf_release(d->direction_at);
    rf_release(d->inside);
    rf_release(d->first);
    rf_release(d->second);
    rf_release(d->stack);
    rf_release(d->loose);
    rf_release(d->prices);
    rf_release(d->cells.cells);
    rf_release(d->holes.cells);
    rf_release(d->moves);
    rf_release(d->scratch);
    rf_turned_copies_free(&d->copies);
    rf_sampler_free(&d->sampler);
    RfDirectional fresh = {.options = d->options,
                           .exemplar = d->exemplar,
                           .comparison = d->comparison,
                           .direction = d->direction,
                           .directionality = d->directionality,
                           .cell_max = d->cell_max};
    *d = fresh;
}

void rf_directional_destroy(RfDirectional *d)
{
    if (!d)
        return;
    free_frame(d);
    rf_release(d);
}

// The mean of the compared channels is looked at, in parts of their range.
static RfResult find_direction(RfDirectional *d)
{
    const RfExemplar *e = d->exemplar;
    const RfComparison *k = &d->comparison;
    size_t pixels = (size_t)e->width * (size_t)e->height;
    float *grey = rf_allocate_zero(pixels, sizeof *grey);
    if (!grey)
        return RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < pixels; ++i)
        for (int c = 0; c < k->channels; ++c)
            grey[i] += rf_comparison_value(k, c, e->pixels + i * (size_t)e->channels) / (float)k->channels;
    RfDirectionality found = rf_directionality(grey, e->width, e->height, e->tiles, EDGE * k->widest);
    rf_release(grey);
    d->directionality = found.strength;
    // A line points either way. Taken is the way right or down, and what is next to it.
    float angle = found.angle * (180 / RF_PI);
    angle = angle < 120 ? angle : angle + 180;
    d->direction = d->options.direction >= 0 ? d->options.direction : angle;
    return RF_OK;
}

// Turned by 45 degrees a square takes the most room.
static RfResult find_largest_cell(RfDirectional *d)
{
    const RfExemplar *e = d->exemplar;
    int side = rf_min_int(e->width, e->height), around = 2 * d->options.mask_width;
    int room = e->tiles ? d->options.cell_max : (int)floorf((float)side * sqrtf(0.5f)) - around - 1;
    if (room < LEAST_CELL)
        return rf_fail(RF_BAD_INPUT, NULL, NULL,
                       "%d x %d pixels that do not tile have no room for patches of %d x %d, however turned: they need "
                       "sides of %d",
                       e->width, e->height, LEAST_CELL + around, LEAST_CELL + around,
                       (int)ceilf((float)(LEAST_CELL + around + 1) * sqrtf(2)));
    d->cell_max = rf_min_int(d->options.cell_max, room);
    return RF_OK;
}

RfResult rf_directional_create(const RfExemplar *exemplar, const RfDirectionalOptions *options, RfDirectional **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_directional_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_directional_check(options));
    RF_TRY(rf_refuse_guide(exemplar));
    RfDirectional *d = rf_allocate_zero(1, sizeof *d);
    if (!d)
        return RF_OUT_OF_MEMORY;
    d->options = *options;
    d->exemplar = exemplar;
    RfResult result = rf_comparison_create(exemplar, &d->comparison);
    if (result == RF_OK)
        result = find_largest_cell(d);
    if (result == RF_OK)
        result = find_direction(d);
    if (result != RF_OK)
    {
        rf_directional_destroy(d);
        return result;
    }
    *out = d;
    return RF_OK;
}

RfResult rf_directional_make_room(RfDirectional *d, int width, int height)
{
    size_t pixels = (size_t)width * (size_t)height, numbers = pixels * (size_t)d->exemplar->channels;
    d->width = width;
    d->height = height;
    d->texels = rf_allocate_zero(pixels, sizeof *d->texels);
    d->next_texels = rf_allocate(pixels, sizeof *d->next_texels);
    d->picture = rf_allocate_zero(numbers, sizeof *d->picture);
    d->next_picture = rf_allocate_zero(numbers, sizeof *d->next_picture);
    d->blended = rf_allocate_zero(numbers, sizeof *d->blended);
    d->next_blended = rf_allocate_zero(numbers, sizeof *d->next_blended);
    d->velocity = rf_allocate_zero(pixels, sizeof *d->velocity);
    d->direction_at = rf_allocate(pixels, sizeof *d->direction_at);
    d->inside = rf_allocate(pixels, 1);
    d->first = rf_allocate(pixels, sizeof *d->first);
    d->second = rf_allocate(pixels, sizeof *d->second);
    d->stack = rf_allocate(pixels, sizeof *d->stack);
    d->loose = rf_allocate(pixels, 1);
    d->region_columns = (width + RF_DIRECTIONAL_REGION - 1) / RF_DIRECTIONAL_REGION;
    d->region_rows = (height + RF_DIRECTIONAL_REGION - 1) / RF_DIRECTIONAL_REGION;
    d->prices = rf_allocate_zero((size_t)d->region_columns * (size_t)d->region_rows, sizeof *d->prices);
    bool enough = d->texels && d->next_texels && d->picture && d->next_picture && d->blended && d->next_blended &&
                  d->velocity && d->direction_at && d->inside && d->first && d->second && d->stack && d->loose &&
                  d->prices;
    if (!enough)
        return RF_OUT_OF_MEMORY;
    RF_TRY(rf_progress("turning the exemplar", 0));
    RF_TRY(rf_sampler_create(d->exemplar, &d->sampler));
    return rf_turned_copies_create(&d->sampler, &d->comparison, d->direction * (RF_PI / 180), d->options.rotations,
                                   d->cell_max + 2 * d->options.mask_width, &d->copies);
}

// ---- a step

static RfResult begin(RfDirectional *d, const RfFlowView *flow, int width, int height)
{
    RfResult result = rf_directional_make_room(d, width, height);
    if (result == RF_OK)
    {
        rf_directional_read_flow(d, flow, flow->time);
        result = rf_directional_start(d);
    }
    d->placed = result == RF_OK;
    if (!d->placed)
        free_frame(d);
    return result;
}

static RfResult check_step(const RfDirectional *d, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(width >= 8 && width <= RF_MAX_SIZE && height >= 8 && height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be 8 to %d", width, height, RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(flow));
    RF_REQUIRE(!d->placed || (width == d->width && height == d->height),
               "frame: %d x %d after frames of %d x %d: the size must stay", width, height, d->width, d->height);
    RF_REQUIRE(!d->placed || flow->time >= d->time, "flow: time %g after %g: times must not decrease", flow->time,
               d->time);
    return RF_OK;
}

static RfResult go_on(RfDirectional *d, const RfFlowView *flow)
{
    double start = rf_seconds();
    rf_directional_read_flow(d, flow, d->time);
    ++d->steps;
    RF_TRY(rf_directional_split_moves(d));
    rf_directional_move(d);
    double moved = rf_seconds();
    RF_TRY(rf_directional_fill(d));
    double filled = rf_seconds();
    RF_TRY(rf_directional_renew(d));
    d->seconds[0] = moved - start;
    d->seconds[1] = filled - moved;
    d->seconds[2] = rf_seconds() - filled;
    return RF_OK;
}

RfResult rf_directional_advance(RfDirectional *d, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(d && flow, "rf_directional_advance: directional or flow is NULL");
    RF_TRY(check_step(d, flow, width, height));
    d->filled = d->continued = d->renewed = 0;
    memset(d->seconds, 0, sizeof d->seconds);
    if (!d->placed)
        RF_TRY(begin(d, flow, width, height));
    else if (flow->time > d->time)
    {
        RF_TRY(rf_progress("moving", 0)); // at the door: a step, once begun, is ended
        RF_TRY(go_on(d, flow));
    }
    else
    {
        // After a saved state the flow is not known yet; and its mask may have grown.
        rf_directional_read_flow(d, flow, flow->time);
        RF_TRY(rf_directional_fill(d));
    }
    d->fluid = 0;
    for (int i = 0; i < width * height; ++i)
        d->fluid += d->inside[i];
    d->time = flow->time;
    return RF_OK;
}

typedef struct Drawing
{
    const RfDirectional *d;
    const RfImageView *frame;
} Drawing;

static void draw_row(void *context, int y, int worker)
{
    (void)worker;
    const Drawing *drawing = context;
    const RfDirectional *d = drawing->d;
    const RfExemplar *e = d->exemplar;
    for (int x = 0; x < d->width; ++x)
    {
        float *values = drawing->frame->pixels + y * drawing->frame->row_stride + (ptrdiff_t)x * e->channels;
        ptrdiff_t pixel = (ptrdiff_t)y * d->width + x;
        if (!d->inside[pixel])
        {
            memset(values, 0, (size_t)e->channels * sizeof *values);
            continue;
        }
        memcpy(values, d->picture + pixel * e->channels, (size_t)e->channels * sizeof *values);
    }
}

RfResult rf_directional_step(RfDirectional *d, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(d && flow && frame && frame->pixels, "rf_directional_step: directional, flow or frame is NULL");
    RF_REQUIRE(frame->channels == d->exemplar->channels, "frame: %d channels, the exemplar has %d", frame->channels,
               d->exemplar->channels);
    RF_TRY(rf_directional_advance(d, flow, frame->width, frame->height));
    Drawing drawing = {d, frame};
    rf_parallel_for(frame->height, draw_row, &drawing);
    return RF_OK;
}

RfDirectionalStats rf_directional_stats(const RfDirectional *d)
{
    RfDirectionalStats stats = {0};
    if (!d)
        return stats;
    stats.direction = d->direction;
    stats.directionality = d->directionality;
    stats.isotropic = d->directionality < ISOTROPIC && d->options.direction < 0;
    float part = d->fluid > 0 ? 1 / (float)d->fluid : 0;
    stats.filled = part * (float)d->filled;
    stats.continued = part * (float)d->continued;
    stats.renewed = part * (float)d->renewed;
    stats.move_seconds = d->seconds[0];
    stats.fill_seconds = d->seconds[1];
    stats.renew_seconds = d->seconds[2];
    return stats;
}
