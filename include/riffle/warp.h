// SPDX-License-Identifier: Apache-2.0
// The plain rival: texture coordinates carried by the flow for ever. Follows exactly, and stretches without end.
//
// Max, Becker. Flow visualization using moving textures. 1995.
#pragma once

#include "data.h"

typedef struct RfWarpOptions
{
    /// Set by rf_warp_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Where the exemplar starts in the frame is drawn from it. Default 1.
    uint64_t seed;
} RfWarpOptions;

RF_API RfWarpOptions rf_warp_defaults(void);
RF_API const RfOption *rf_warp_option_table(int *count);

typedef struct RfWarp RfWarp;

/// The exemplar is borrowed; one that does not tile is mirrored at its borders.
RF_API RF_MUST_USE RfResult rf_warp_create(const RfExemplar *exemplar, const RfWarpOptions *options, RfWarp **out);
/// As rf_lagrangian_step.
RF_API RF_MUST_USE RfResult rf_warp_step(RfWarp *warp, const RfFlowView *flow, const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_warp_advance(RfWarp *warp, const RfFlowView *flow, int width, int height);
RF_API RF_MUST_USE RfResult rf_warp_save(const RfWarp *warp, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_warp_load(const RfExemplar *exemplar, const RfWarpOptions *options, const void *block,
                                         size_t size, RfWarp **out);
RF_API void rf_warp_destroy(RfWarp *warp);
