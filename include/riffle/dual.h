// SPDX-License-Identifier: Apache-2.0
// Two layers of texture coordinates that take turns: each is carried by the flow for a while, then starts afresh while
// the other one shows. What dual rest fields, the UV grids of smoke solvers and the flow maps of games do.
//
// Max, Becker. Flow visualization using moving textures. 1995.
#pragma once

#include "data.h"

typedef struct RfDualOptions
{
    /// Set by rf_dual_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Where in the exemplar a layer starts is drawn from it. Default 1.
    uint64_t seed;
    /// Frames from one start of a layer to its next, 2 to 100000; the two are half of it apart. Default 24. Fewer keep
    /// the exemplar's look, more follow the flow closer.
    int reset_every;
    /// How the two layers are summed: RF_BLEND_PLAIN or RF_BLEND_CONTRAST, the default.
    RfBlend blend;
    /// Every start is somewhere else in the exemplar. Default true. Otherwise all starts are in the same place: calm
    /// water stands still, and moving water pulses.
    bool scatter;
} RfDualOptions;

RF_API RfDualOptions rf_dual_defaults(void);
RF_API const RfOption *rf_dual_option_table(int *count);

typedef struct RfDual RfDual;

/// The exemplar is borrowed; one that does not tile is mirrored at its borders.
RF_API RF_MUST_USE RfResult rf_dual_create(const RfExemplar *exemplar, const RfDualOptions *options, RfDual **out);
/// As rf_lagrangian_step, and so are the others.
RF_API RF_MUST_USE RfResult rf_dual_step(RfDual *dual, const RfFlowView *flow, const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_dual_advance(RfDual *dual, const RfFlowView *flow, int width, int height);
RF_API RF_MUST_USE RfResult rf_dual_save(const RfDual *dual, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_dual_load(const RfExemplar *exemplar, const RfDualOptions *options, const void *block,
                                         size_t size, RfDual **out);
RF_API void rf_dual_destroy(RfDual *dual);
