// SPDX-License-Identifier: Apache-2.0
// Two sets of carried coordinates, reset in turn and cross-faded.
//
// Max, Becker. Flow visualization using moving textures. 1995.
// Vlachos. Water flow in Portal 2. SIGGRAPH course, 2010 (flow maps).
//
// A set's weight rises and falls as a triangle over its period, 0 at its reset, where the other one's is 1 (nearly 1 if
// the period is odd): the jump is never seen. Deviation from most tools: the phases are whole frames, so that a weight
// is exactly 0 in the frame of a reset, whatever the period.
#include "riffle/dual.h"

#include "core/memory.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/crossfade.h"

enum
{
    SETS = 2
};

struct RfDual
{
    RfDualOptions options;
    RfSampler sampler;
    RfCoordinates coordinates;
    RfTurn turns[SETS];
    RfResolveQuad quads[RF_SAMPLE_QUADS];
};

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfDualOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where in the exemplar a layer starts is drawn from it."},
    {"reset-every", RF_OPTION_INT, offsetof(RfDualOptions, reset_every), "frames", 2, 100000, 24, NULL,
     "Frames from one start of a layer to its next. Fewer keep the exemplar's look, more follow the flow closer."},
    {"blend", RF_OPTION_CHOICE, offsetof(RfDualOptions, blend), "", 0, 1, RF_BLEND_CONTRAST, "plain|contrast",
     "Weighted mean, or the same with mean and variance kept."},
    {"scatter", RF_OPTION_BOOL, offsetof(RfDualOptions, scatter), "", 0, 1, 1, NULL,
     "Every start is somewhere else in the exemplar; otherwise calm water stands still and moving water pulses."},
};

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_dual_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfDualOptions rf_dual_defaults(void)
{
    return (RfDualOptions){.struct_size = sizeof(RfDualOptions),
                           .seed = 1,
                           .reset_every = 24,
                           .blend = RF_BLEND_CONTRAST,
                           .scatter = true};
}

RfResult rf_dual_create(const RfExemplar *exemplar, const RfDualOptions *options, RfDual **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_dual_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(
        rf_options_check(options, options->struct_size, sizeof *options, "rf_dual_defaults", g_options, OPTION_COUNT));
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RfDual *dual = rf_allocate_zero(1, sizeof *dual);
    if (!dual)
        return RF_OUT_OF_MEMORY;
    dual->options = *options;
    dual->coordinates.sets = SETS;
    for (int set = 0; set < SETS; ++set)
        dual->turns[set] = (RfTurn){options->reset_every, set * (options->reset_every / SETS)};
    rf_crossfade_quads(exemplar, options->blend == RF_BLEND_CONTRAST, dual->quads);
    RfResult result = rf_sampler_create(exemplar, &dual->sampler);
    if (result != RF_OK)
    {
        rf_dual_destroy(dual);
        return result;
    }
    *out = dual;
    return RF_OK;
}

void rf_dual_destroy(RfDual *dual)
{
    if (!dual)
        return;
    rf_sampler_free(&dual->sampler);
    rf_coordinates_free(&dual->coordinates);
    rf_release(dual);
}

RfResult rf_dual_advance(RfDual *dual, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(dual, "rf_dual_advance: dual is NULL");
    return rf_crossfade_move(&dual->coordinates, dual->turns, "carrying", flow, width, height);
}

// A triangle over the set's period.
static void weigh(const void *context, int x, int y, int count, float (*weights)[RF_CROSSFADE_PIXELS])
{
    (void)x;
    (void)y;
    const RfDual *dual = context;
    for (int set = 0; set < SETS; ++set)
    {
        double age = rf_turn_age(dual->turns[set], dual->coordinates.time - dual->coordinates.start);
        float weight = (float)(1 - fabs(2 * age / dual->turns[set].period - 1));
        for (int i = 0; i < count; ++i)
            weights[set][i] = weight;
    }
}

RfResult rf_dual_step(RfDual *dual, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(dual && frame && frame->pixels, "rf_dual_step: dual or frame is NULL");
    RF_TRY(rf_crossfade_check(&dual->sampler, frame));
    RF_TRY(rf_dual_advance(dual, flow, frame->width, frame->height));
    RfCrossfade crossfade = {.sampler = &dual->sampler,
                             .coordinates = &dual->coordinates,
                             .weigh = weigh,
                             .context = dual,
                             .quads = dual->quads};
    rf_crossfade_origins(&crossfade, dual->options.seed, dual->options.scatter ? dual->turns : NULL);
    rf_crossfade_draw(&crossfade, flow, frame);
    return RF_OK;
}

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfDualOptions *options)
{
    return rf_options_hash(options, g_options, OPTION_COUNT, exemplar->hash);
}

RfResult rf_dual_save(const RfDual *dual, void **block, size_t *size)
{
    RF_REQUIRE(dual && block && size, "rf_dual_save: dual, block or size is NULL");
    return rf_coordinates_save(&dual->coordinates, "dual", inputs_hash(dual->sampler.exemplar, &dual->options), block,
                               size);
}

RfResult rf_dual_load(const RfExemplar *exemplar, const RfDualOptions *options, const void *block, size_t size,
                      RfDual **out)
{
    RF_REQUIRE(block, "rf_dual_load: block is NULL");
    RF_TRY(rf_dual_create(exemplar, options, out));
    RfResult result = rf_coordinates_load(&(*out)->coordinates, "dual", inputs_hash(exemplar, options), block, size);
    if (result != RF_OK)
    {
        rf_dual_destroy(*out);
        *out = NULL;
    }
    return result;
}
