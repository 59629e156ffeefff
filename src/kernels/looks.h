// SPDX-License-Identifier: Apache-2.0
// Classes of an exemplar's pixels by what it looks like round them, so that it can be told whether a texture made of it
// shows too much of one look.
//
// Best-fit patches are drawn to what is plain: next to a blurred seam a flat patch fits best, and from then on only
// flat ones fit there. Prices that rise with use (kernels/usage.h) stop that where the plain looks lie together in the
// exemplar; here they follow the look, wherever in the exemplar it is.
#pragma once

#include "riffle/base.h"

enum
{
    /// Quantiles of brightness, and in each as many of contrast.
    RF_LOOK_QUANTILES = 8,
    RF_LOOKS = RF_LOOK_QUANTILES * RF_LOOK_QUANTILES
};

/// looks[height][width]: the class of each pixel, 0 to RF_LOOKS - 1, by the mean and the standard deviation of the
/// square of 2 radius + 1 pixels round it. Of each class there are about as many pixels. values[height][width]: what is
/// compared of the exemplar, as one number a pixel.
RfResult rf_looks_find(const float *values, int width, int height, bool tiles, int radius, uint8_t *looks);

/// How often each class is shown, in parts of the mean, but at most `most`; 1 where nothing is shown at all.
void rf_looks_shares(const int64_t count[RF_LOOKS], float most, float shares[RF_LOOKS]);
