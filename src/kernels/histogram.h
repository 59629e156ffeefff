// SPDX-License-Identifier: Apache-2.0
// Gaussianised channels and the way back, for blending that keeps the histogram.
#pragma once

#include "kernels/texture.h"

enum
{
    RF_INVERSE_SIZE = 1024,
    RF_HISTOGRAM_CHANNELS = 3
};

/// One map of 1 to 3 channels: rotated to its principal axes (3 channels), each made Gaussian by rank.
typedef struct RfHistogram
{
    int channels;
    /// Rows are the principal axes, largest variance first; the identity for fewer than 3 channels.
    float axes[3][3];
    /// Along each axis, before it was made Gaussian.
    float variance[3];
    /// Of the map's channels: what is mapped back stays within, since the axes' values need not belong together.
    float low[3], high[3];
    /// [RF_TEXTURE_LEVELS][channels][RF_INVERSE_SIZE]: value along an axis at g = -RF_INVERSE_REACH ...
    /// RF_INVERSE_REACH.
    float *inverse;
} RfHistogram;

#define RF_INVERSE_REACH 4.0f

/// Replaces pixels[count][stride] (the map's channels are the first ones at `pixels`) by numbers of mean 0 and
/// variance 1.
RfResult rf_histogram_create(float *pixels, size_t count, size_t stride, int channels, RfHistogram *out);
void rf_histogram_free(RfHistogram *histogram);

/// Widens the inverse tables of levels 1 and up by the variance that the level has lost: lanes[c] is channel c's place
/// in the texture.
void rf_histogram_fit_levels(RfHistogram *histogram, const RfTexture *texture, const int *lanes);

/// g (channels numbers, about N(0, 1)) back to the map's values, at a texture level.
void rf_histogram_invert(const RfHistogram *histogram, int level, const float *g, float *value);
