// SPDX-License-Identifier: Apache-2.0
// Eulerian texture advection: layers of carried texture coordinates that are regenerated at different latencies, mixed
// at every pixel by how fast the flow deforms the texture there.
//
// Neyret. Advected textures. 2003.
#pragma once

#include "data.h"

typedef struct RfEulerianOptions
{
    /// Set by rf_eulerian_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Where in the exemplar coordinates start is drawn from it. Default 1.
    uint64_t seed;
    /// Frames that the first layer's coordinates live, 4 to 100000. Default 24. Each further layer's live twice as
    /// long.
    int latency;
    /// 1 to 3. Default 3. With 1 the whole frame has one latency.
    int layers;
    /// Sets of coordinates a layer, started in turn, 2 or 3. Default 2. 3 pulse less and blend more.
    int phases;
    /// Stretch or squash that a layer may have on average, 1.01 to 100. Default 1.25. Where a layer has more, a shorter
    /// latency shows.
    float max_distortion;
    /// How pictures are summed: RF_BLEND_PLAIN or RF_BLEND_CONTRAST, the default.
    RfBlend blend;
} RfEulerianOptions;

RF_API RfEulerianOptions rf_eulerian_defaults(void);
RF_API const RfOption *rf_eulerian_option_table(int *count);

typedef struct RfEulerian RfEulerian;

/// The exemplar is borrowed; one that does not tile is mirrored at its borders.
RF_API RF_MUST_USE RfResult rf_eulerian_create(const RfExemplar *exemplar, const RfEulerianOptions *options,
                                               RfEulerian **out);
/// As rf_lagrangian_step, and so are the others.
RF_API RF_MUST_USE RfResult rf_eulerian_step(RfEulerian *eulerian, const RfFlowView *flow, const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_eulerian_advance(RfEulerian *eulerian, const RfFlowView *flow, int width, int height);
RF_API RF_MUST_USE RfResult rf_eulerian_save(const RfEulerian *eulerian, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_eulerian_load(const RfExemplar *exemplar, const RfEulerianOptions *options,
                                             const void *block, size_t size, RfEulerian **out);
RF_API void rf_eulerian_destroy(RfEulerian *eulerian);
