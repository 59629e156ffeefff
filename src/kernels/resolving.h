// SPDX-License-Identifier: Apache-2.0
// Turns a tile's sums into blended values.
#pragma once

#include "kernels/blending.h"

/// What one quad's lanes are divided by, and what is added back.
typedef struct RfResolveQuad
{
    float mean[4], low[4], high[4];
    /// 1 where a lane is blended plainly: divided by sum w.
    float plain[4];
    /// Lanes 0 to 2 are red, green and blue: contrast is put back into their luma, the hue stays that of the plain
    /// blend.
    bool colour;
} RfResolveQuad;

/// One row of a tile, `count` pixels from the sums' pixel `first`: values[count][4] = clamp(mean + colour * scale).
/// inverse_sum and inverse_norm: [count], from rf_resolve_scales.
void rf_resolve_row(const float *colour, const float *inverse_sum, const float *inverse_norm, const RfResolveQuad *quad,
                    int count, float *values);

/// 1 / sum w, and 1 / sqrt(sum w^2 + rho ((sum w)^2 - sum w^2)), for a row of pixels; both 0 where no weight is. rho:
/// [count], the mean correlation of the grids that overlap there.
void rf_resolve_scales(const float *weight, const float *weight2, const float *rho, int count, float *inverse_sum,
                       float *inverse_norm);

/// rf_resolve_row for the three lanes of a colour, packed: values[count][3]. For a plain blend give inverse_sum twice.
void rf_resolve_rgb(const float *colour, const float *inverse_sum, const float *inverse_norm, const RfResolveQuad *quad,
                    int count, float *values);
