// SPDX-License-Identifier: Apache-2.0
// Texture coordinates carried by the flow for ever.
//
// Max, Becker. Flow visualization using moving textures. 1995.
//
// Nothing is ever started afresh: the frame follows the flow exactly and is stretched without end. How coordinates are
// carried stands in kernels/coordinates.c, how they are looked up in kernels/sampler.c.
#include "riffle/warp.h"

#include "core/memory.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/crossfade.h"

struct RfWarp
{
    RfWarpOptions options;
    RfSampler sampler;
    RfCoordinates coordinates;
};

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfWarpOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where the exemplar starts in the frame is drawn from it."},
};

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_warp_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfWarpOptions rf_warp_defaults(void)
{
    return (RfWarpOptions){.struct_size = sizeof(RfWarpOptions), .seed = 1};
}

RfResult rf_warp_create(const RfExemplar *exemplar, const RfWarpOptions *options, RfWarp **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_warp_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(
        rf_options_check(options, options->struct_size, sizeof *options, "rf_warp_defaults", g_options, OPTION_COUNT));
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RfWarp *warp = rf_allocate_zero(1, sizeof *warp);
    if (!warp)
        return RF_OUT_OF_MEMORY;
    warp->options = *options;
    warp->coordinates.sets = 1;
    RfResult result = rf_sampler_create(exemplar, &warp->sampler);
    if (result != RF_OK)
    {
        rf_warp_destroy(warp);
        return result;
    }
    *out = warp;
    return RF_OK;
}

void rf_warp_destroy(RfWarp *warp)
{
    if (!warp)
        return;
    rf_sampler_free(&warp->sampler);
    rf_coordinates_free(&warp->coordinates);
    rf_release(warp);
}

RfResult rf_warp_advance(RfWarp *warp, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(warp, "rf_warp_advance: warp is NULL");
    return rf_coordinates_move(&warp->coordinates, "warping", flow, width, height);
}

RfResult rf_warp_step(RfWarp *warp, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(warp && frame && frame->pixels, "rf_warp_step: warp or frame is NULL");
    RF_TRY(rf_crossfade_check(&warp->sampler, frame));
    RF_TRY(rf_warp_advance(warp, flow, frame->width, frame->height));
    RfCrossfade single = {.sampler = &warp->sampler, .coordinates = &warp->coordinates};
    rf_crossfade_origins(&single, warp->options.seed, NULL);
    rf_crossfade_draw(&single, flow, frame);
    return RF_OK;
}

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfWarpOptions *options)
{
    return rf_options_hash(options, g_options, OPTION_COUNT, exemplar->hash);
}

RfResult rf_warp_save(const RfWarp *warp, void **block, size_t *size)
{
    RF_REQUIRE(warp && block && size, "rf_warp_save: warp, block or size is NULL");
    return rf_coordinates_save(&warp->coordinates, "warp", inputs_hash(warp->sampler.exemplar, &warp->options), block,
                               size);
}

RfResult rf_warp_load(const RfExemplar *exemplar, const RfWarpOptions *options, const void *block, size_t size,
                      RfWarp **out)
{
    RF_REQUIRE(block, "rf_warp_load: block is NULL");
    RF_TRY(rf_warp_create(exemplar, options, out));
    RfResult result = rf_coordinates_load(&(*out)->coordinates, "warp", inputs_hash(exemplar, options), block, size);
    if (result != RF_OK)
    {
        rf_warp_destroy(*out);
        *out = NULL;
    }
    return result;
}
