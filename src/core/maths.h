// SPDX-License-Identifier: Apache-2.0
// Small arithmetic that everything shares.
#pragma once

#include "riffle/data.h"

#include <math.h>

#define RF_PI 3.14159265358979323846f

static inline int rf_min_int(int a, int b)
{
    return a < b ? a : b;
}

static inline int rf_max_int(int a, int b)
{
    return a > b ? a : b;
}

static inline int rf_clamp_int(int x, int low, int high)
{
    return x < low ? low : x > high ? high : x;
}

/// fminf and fmaxf are calls, for the sake of NaN; these go wide. NaN in a gives b.
static inline float rf_min(float a, float b)
{
    return a < b ? a : b;
}

static inline float rf_max(float a, float b)
{
    return a > b ? a : b;
}

/// NaN gives low.
static inline float rf_clamp(float x, float low, float high)
{
    return x > low ? (x < high ? x : high) : low;
}

static inline float rf_lerp(float a, float b, float t)
{
    return a + t * (b - a);
}

/// With the weights of Rec. 709.
static inline float rf_luma(float r, float g, float b)
{
    return 0.2126f * r + 0.7152f * g + 0.0722f * b;
}

/// x modulo n in 0 .. n - 1, for negative x too.
static inline int rf_wrap_int(int x, int n)
{
    int r = x % n;
    return r < 0 ? r + n : r;
}

/// Index reflected at both ends without repeating the end samples' neighbours twice: -1 gives 0, n gives n - 1.
static inline int rf_mirror_int(int x, int n)
{
    int r = rf_wrap_int(x, 2 * n);
    return r < n ? r : 2 * n - 1 - r;
}

/// Index brought into 0 .. n - 1: round the border of what tiles, else to the nearest end.
static inline int rf_border_int(int x, int n, bool tiles)
{
    if (x >= 0 && x < n)
        return x;
    return tiles ? rf_wrap_int(x, n) : rf_clamp_int(x, 0, n - 1);
}

/// The nearest whole number; of what is absurdly far, or NaN, one that is a million off: casts stay defined.
static inline int rf_nearest_int(float x)
{
    return (int)floorf(rf_clamp(x, -1e6f, 1e6f) + 0.5f);
}

static inline RfVec2 rf_vec2_add(RfVec2 a, RfVec2 b)
{
    return (RfVec2){a.x + b.x, a.y + b.y};
}

static inline RfVec2 rf_vec2_sub(RfVec2 a, RfVec2 b)
{
    return (RfVec2){a.x - b.x, a.y - b.y};
}

static inline float rf_vec2_length(RfVec2 a)
{
    return sqrtf(a.x * a.x + a.y * a.y);
}
