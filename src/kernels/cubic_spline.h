// SPDX-License-Identifier: Apache-2.0
// Interpolation by cubic B-splines: the values are turned once into coefficients, then sampled anywhere. Four taps a
// direction, and far less blur than the usual four-tap cubics, which matters where the same field is resampled every
// frame.
//
// Unser. Splines: a perfect fit for signal and image processing. 1999. Borders are mirrored about the outermost
// samples.
#pragma once

#include "core/maths.h"

/// Replaces interleaved samples [height][width][channels] by spline coefficients.
void rf_spline_prefilter(float *samples, int width, int height, int channels);

/// Weights of the four coefficients round a point at fraction t in 0..1 after the second.
static inline void rf_spline_weights(float t, float weights[4])
{
    float s = 1 - t;
    weights[0] = s * s * s * (1.0f / 6.0f);
    weights[1] = (4 + t * t * (3 * t - 6)) * (1.0f / 6.0f);
    weights[2] = (4 + s * s * (3 * s - 6)) * (1.0f / 6.0f);
    weights[3] = t * t * t * (1.0f / 6.0f);
}

static inline int rf_spline_mirror(int i, int n)
{
    if (i < 0)
        i = -i;
    if (i >= n)
        i = 2 * n - 2 - i;
    return rf_clamp_int(i, 0, n - 1);
}

/// Where a point's four coefficients of one direction lie, and their weights. x in samples (sample i sits at i),
/// clamped to the outermost samples.
static inline void rf_spline_taps(float x, int n, int index[4], float weights[4])
{
    x = rf_clamp(x, 0, (float)(n - 1));
    int i = rf_min_int((int)x, rf_max_int(n - 2, 0));
    rf_spline_weights(x - (float)i, weights);
    for (int k = 0; k < 4; ++k)
        index[k] = rf_spline_mirror(i - 1 + k, n);
}

/// Value of one channel, or of `count` channels from there on.
static inline void rf_spline_sample(const float *coefficients, int width, int height, int channels, int count, float x,
                                    float y, float *values)
{
    int column[4], row[4];
    float wx[4], wy[4];
    rf_spline_taps(x, width, column, wx);
    rf_spline_taps(y, height, row, wy);
    for (int c = 0; c < count; ++c)
    {
        float sum = 0;
        for (int j = 0; j < 4; ++j)
        {
            const float *line = coefficients + (size_t)row[j] * (size_t)width * (size_t)channels + c;
            float across = 0;
            for (int i = 0; i < 4; ++i)
                across += wx[i] * line[(size_t)column[i] * (size_t)channels];
            sum += wy[j] * across;
        }
        values[c] = sum;
    }
}
