// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. INRIA RR-6810, 2009.
//
// The domain is covered by particles in a maximal Poisson-disk distribution; each carries a small grid of vertices that
// the flow moves, mapped to a fixed area of the exemplar. A step advects the grids, retires those that are worn,
// crowded or folded, refills the gaps, and draws all of them, blended by smooth weights w = K_p K_g K_d F_in F_out.
//
// What is ours: the choice of a new grid's area and the correlation in the blend (refill.c), fades that follow the
// local strain (grids.c), the exponent on K_p, the sampling (kernels/texture.c, kernels/blending.c).

#include "methods/lagrangian/lagrangian.h"

#include "core/clock.h"
#include "core/maths.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/result.h"
#include "data/flow_field.h"

#include <string.h>

// An exemplar that does not tile must measure 1.5 grids, so that there are areas to choose from.
#define LEAST_EXEMPLAR (1.5f * GRID_SIDE)
#define DEFAULT_RADIUS 64.0f
#define LEAST_RADIUS 2.0f

#define FIELD(name) offsetof(RfLagrangianOptions, name)

static const RfOption option_table[] = {
    {"seed", RF_OPTION_UINT64, FIELD(seed), "", 0, 0x1p64, 1, NULL,
     "Another seed, another picture with the same look."},
    {"particle-radius", RF_OPTION_FLOAT, FIELD(particle_radius), "px", 0, 4096, 0, NULL,
     "Poisson-disk radius d; 0 picks 64, or less for a small exemplar. Smaller follows finer motion; cost grows as 1 / "
     "d^2."},
    {"grid-vertices", RF_OPTION_INT, FIELD(grid_vertices), "", 4, 32, 8, NULL,
     "Vertices along a side of a grid. More bend with finer motion; cost grows as the square."},
    {"max-distortion", RF_OPTION_FLOAT, FIELD(max_distortion), "", 1.05, 100, 1.95, NULL,
     "Stretch or squash at which a texture is invisible. Smaller keeps the exemplar's look, larger follows the flow "
     "for longer."},
    {"relaxation", RF_OPTION_FLOAT, FIELD(relaxation), "", 0, 1000, 1.5, NULL,
     "How fast grids slip back to their rest shape, in units of the local rate of strain; 0 never. Larger keeps the "
     "look, smaller follows closer."},
    {"fade", RF_OPTION_FLOAT, FIELD(fade), "s", 0, 1000, 5, NULL, "Longest time a grid takes to fade in or out."},
    {"adapt", RF_OPTION_FLOAT, FIELD(adapt), "", 0, 1, 1, NULL,
     "How far fades shorten where the flow strains: 0 not at all, 1 to end before the distortion limit."},
    {"sharpness", RF_OPTION_FLOAT, FIELD(sharpness), "", 0.25, 12, 1.5, NULL,
     "Power of the kernel weight. 1 mixes several pictures everywhere, larger keeps the shapes of one."},
    {"candidates", RF_OPTION_INT, FIELD(candidates), "", 1, 1000000, 12, NULL,
     "Places in the exemplar tried for a new grid; the best fit to what is drawn there is taken. 1 takes any."},
    {"blend", RF_OPTION_CHOICE, FIELD(blend), "", 0, 2, RF_BLEND_CONTRAST, "plain|contrast|histogram",
     "Weighted mean; the same with mean and variance kept; or with the whole histogram kept."},
    {"fps", RF_OPTION_FLOAT, FIELD(fps), "1/s", 0.01, 10000, 24, NULL, "Frames a second: turns the fade into frames."},
};

enum
{
    OPTION_COUNT = sizeof option_table / sizeof option_table[0]
};

const RfOption *rf_lagrangian_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return option_table;
}

RfLagrangianOptions rf_lagrangian_defaults(void)
{
    return (RfLagrangianOptions){.struct_size = sizeof(RfLagrangianOptions),
                                 .seed = 1,
                                 .particle_radius = 0,
                                 .grid_vertices = 8,
                                 .max_distortion = 1.95f,
                                 .relaxation = 1.5f,
                                 .fade = 5,
                                 .adapt = 1,
                                 .sharpness = 1.5f,
                                 .candidates = 12,
                                 .blend = RF_BLEND_CONTRAST,
                                 .fps = 24};
}

RfLagrangianOptions rf_lagrangian_paper(void)
{
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.max_distortion = 5;
    options.relaxation = 0;
    options.fade = 5;
    options.adapt = 0;
    options.sharpness = 1;
    options.candidates = 1;
    return options;
}

// The radius in use: the one asked for, or the largest up to 64 that the exemplar has room for.
static RfResult choose_radius(const RfExemplar *exemplar, float wanted, float *radius)
{
    float side = (float)rf_min_int(exemplar->width, exemplar->height), fits = side / LEAST_EXEMPLAR;
    if (wanted > 0)
    {
        RF_REQUIRE(wanted >= LEAST_RADIUS, "particle-radius %g: must be %g or more", (double)wanted,
                   (double)LEAST_RADIUS);
        RF_REQUIRE(exemplar->tiles || wanted <= fits,
                   "particle-radius %g: an exemplar of %d x %d pixels that does not tile has room for %g at most",
                   (double)wanted, exemplar->width, exemplar->height, floor((double)fits * 10) / 10);
        *radius = wanted;
        return RF_OK;
    }
    // One that tiles has any room, but a grid wider than it would show it repeated.
    *radius = rf_clamp(exemplar->tiles ? side / GRID_SIDE : fits, LEAST_RADIUS, DEFAULT_RADIUS);
    return RF_OK;
}

RfResult rf_lagrangian_create(const RfExemplar *exemplar, const RfLagrangianOptions *options, RfLagrangian **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_lagrangian_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_lagrangian_defaults", option_table,
                            OPTION_COUNT));
    float radius = 0;
    RF_TRY(choose_radius(exemplar, options->particle_radius, &radius));
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RfLagrangian *l = rf_allocate_zero(1, sizeof *l);
    if (!l)
        return RF_OUT_OF_MEMORY;
    l->exemplar = exemplar;
    l->options = *options;
    l->radius = radius;
    l->cell = GRID_SIDE * radius / (float)(options->grid_vertices - 1);
    RfResult result = rf_lagrangian_material_create(exemplar, options->blend, &l->material);
    if (result != RF_OK)
    {
        rf_lagrangian_destroy(l);
        return result;
    }
    l->match_halvings = rf_lagrangian_coarsest_halvings(l);
    *out = l;
    return RF_OK;
}

void rf_lagrangian_destroy(RfLagrangian *l)
{
    if (!l)
        return;
    rf_lagrangian_material_free(&l->material);
    rf_release(l->grids);
    rf_release(l->x);
    rf_release(l->y);
    rf_release(l->quality);
    rf_arena_free(&l->arena);
    for (int i = 0; i < RF_MAX_THREADS; ++i)
        rf_arena_free(&l->workers[i]);
    rf_release(l);
}

static RfResult check_step(const RfLagrangian *l, const RfFlowView *flow, int width, int height)
{
    RF_TRY(rf_flow_view_check(flow));
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "frame: %d x %d pixels: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    RF_REQUIRE(!l->started || (width == l->width && height == l->height),
               "frame: %d x %d pixels after %d x %d: the size cannot change", width, height, l->width, l->height);
    RF_REQUIRE(!l->started || flow->time >= l->time, "flow: time %g after %g: times must not decrease", flow->time,
               l->time);
    return RF_OK;
}

static void count_grids(RfLagrangian *l)
{
    l->stats.live = l->stats.fading = 0;
    for (int i = 0; i < l->count; ++i)
        l->grids[i].retired ? ++l->stats.fading : ++l->stats.live;
}

// Everything but the drawing.
static RfResult move_to(RfLagrangian *l, const RfFlowView *view, int width, int height, StepFlow *flow)
{
    *flow = (StepFlow){view, l->started ? l->time : view->time, (float)width / (float)view->width,
                       (float)height / (float)view->height};
    l->width = width;
    l->height = height;
    l->time = view->time;
    l->stats = (RfLagrangianStats){0};
    rf_arena_reset(&l->arena);
    for (int i = 0; i < RF_MAX_THREADS; ++i)
        rf_arena_reset(&l->workers[i]);

    double start = rf_seconds();
    rf_lagrangian_grids_advect(l, flow);
    double advected = rf_seconds();
    RF_TRY(rf_lagrangian_grids_retire(l, flow));
    rf_lagrangian_grids_drop(l);
    RfResult refilled = rf_lagrangian_grids_refill(l, flow);
    if (refilled != RF_OK)
    {
        // A first step that was stopped or failed leaves the stepper as new.
        if (!l->started)
            l->count = 0;
        return refilled;
    }
    l->stats.advect_seconds = advected - start;
    l->stats.distribute_seconds = rf_seconds() - advected;
    count_grids(l);
    l->started = true;
    ++l->step;
    return RF_OK;
}

RfResult rf_lagrangian_advance(RfLagrangian *l, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(l && flow, "rf_lagrangian_advance: lagrangian or flow is NULL");
    RF_TRY(check_step(l, flow, width, height));
    RF_TRY(rf_progress("advecting", 0));
    StepFlow step;
    return move_to(l, flow, width, height, &step);
}

RfResult rf_lagrangian_step(RfLagrangian *l, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(l && flow && frame && frame->pixels, "rf_lagrangian_step: lagrangian, flow or frame is NULL");
    RF_REQUIRE(frame->row_stride >= (ptrdiff_t)frame->width * frame->channels,
               "frame: rows of %d pixels do not fit a stride of %td floats", frame->width, frame->row_stride);
    RF_REQUIRE(frame->channels == l->exemplar->channels, "frame: %d channels: the exemplar has %d", frame->channels,
               l->exemplar->channels);
    RF_TRY(check_step(l, flow, frame->width, frame->height));
    RF_TRY(rf_progress("advecting", 0));
    StepFlow step;
    RF_TRY(move_to(l, flow, frame->width, frame->height, &step));
    double start = rf_seconds();
    RF_TRY(rf_lagrangian_frame_draw(l, &step, frame));
    l->stats.draw_seconds = rf_seconds() - start;
    return RF_OK;
}

RfLagrangianStats rf_lagrangian_stats(const RfLagrangian *l)
{
    return l->stats;
}

float rf_lagrangian_radius(const RfLagrangian *l)
{
    return l->radius;
}
