// SPDX-License-Identifier: Apache-2.0
// An exemplar as a picture without end, sampled where carried coordinates point: tiled, or mirrored at its borders, and
// filtered as far as the coordinates are stretched.
#pragma once

#include "data/exemplar.h"
#include "kernels/texture.h"

/// d(u, v) / d(x, y): how the exemplar's coordinates change from pixel to pixel, row by row.
typedef struct RfJacobian
{
    float xx, xy, yx, yy;
} RfJacobian;

enum
{
    /// Channels of a sample, rounded up to whole quads.
    RF_SAMPLE_CHANNELS = (RF_MAX_EXEMPLAR_CHANNELS + 3) / 4 * 4
};

typedef struct RfSampler
{
    /// Borrowed.
    const RfExemplar *exemplar;
    RfTexture texture;
    /// Some map is of directions, which turn with the texture.
    bool turns;
} RfSampler;

RfResult rf_sampler_create(const RfExemplar *exemplar, RfSampler *out);
void rf_sampler_free(RfSampler *sampler);

/// All channels of the exemplar at coordinates (u, v) of a pixel whose coordinates change by j, directions turned into
/// the frame's axes. values: the exemplar's channels; those up to RF_SAMPLE_CHANNELS are 0.
void rf_sampler_at(const RfSampler *sampler, RfVec2 point, RfJacobian j, float values[RF_SAMPLE_CHANNELS]);
