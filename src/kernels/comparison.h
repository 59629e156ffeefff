// SPDX-License-Identifier: Apache-2.0
// Which of an exemplar's channels are compared, and in which unit: each less its middle, times the root of its map's
// weight. Equal channels are compared once, with their weights' sum.
#pragma once

#include "data/exemplar.h"

/// The map of this name is compared with a guide, and not made.
#define RF_GUIDE_MAP "guide"

typedef struct RfComparison
{
    /// Borrowed.
    const RfExemplar *exemplar;
    /// Compared channels, the guides among them last.
    int channels, guides;
    /// Channel of the exemplar for each, what is subtracted and what it is multiplied by.
    int from[RF_MAX_EXEMPLAR_CHANNELS];
    float middle[RF_MAX_EXEMPLAR_CHANNELS], factor[RF_MAX_EXEMPLAR_CHANNELS];
    /// For each channel of the exemplar: 1 + the compared channel that equals it, 0 if there is none.
    int compared[RF_MAX_EXEMPLAR_CHANNELS];
    /// The widest range of a compared channel, in the unit of comparison.
    float widest;
} RfComparison;

RfResult rf_comparison_create(const RfExemplar *exemplar, RfComparison *out);

/// For what has no guide to compare with the exemplar's.
RfResult rf_refuse_guide(const RfExemplar *exemplar);

/// A compared channel of a pixel with all channels of the exemplar.
static inline float rf_comparison_value(const RfComparison *comparison, int channel, const float *pixel)
{
    return (pixel[comparison->from[channel]] - comparison->middle[channel]) * comparison->factor[channel];
}
