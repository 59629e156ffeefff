// SPDX-License-Identifier: Apache-2.0
// The sRGB transfer curve (IEC 61966-2-1), continued as an odd function so that values outside 0..1 survive the way
// there and back.
#pragma once

#include <math.h>

static inline float rf_srgb_to_linear(float x)
{
    float a = fabsf(x);
    float y = a <= 0.04045f ? a / 12.92f : powf((a + 0.055f) / 1.055f, 2.4f);
    return copysignf(y, x);
}

static inline float rf_linear_to_srgb(float x)
{
    float a = fabsf(x);
    float y = a <= 0.0031308f ? a * 12.92f : 1.055f * powf(a, 1.0f / 2.4f) - 0.055f;
    return copysignf(y, x);
}
