// SPDX-License-Identifier: Apache-2.0
// What the drawn exemplars share: a torus to draw on, noise and cells that close on it, and supersampling.
//
// A picture covers [0, span_x) x [0, span_y), where the shorter side of the picture is 1 / scale: the same seed gives
// the same material at any number of pixels, and a larger scale larger features.
#pragma once

#include "core/maths.h"
#include "core/random.h"
#include "fluids/scene.h"

/// size, seed and scale.
extern const RfParameterRange rf_drawing_ranges[];

typedef struct RfVec3
{
    float x, y, z;
} RfVec3;

typedef struct RfTorus
{
    float span_x, span_y;
    uint64_t seed;
} RfTorus;

RfTorus rf_torus(const RfParameters *parameters);

/// Paints one point; `colour` takes the image's channels.
typedef void RfPaintFn(const void *context, float x, float y, float *colour);

/// Every pixel is the mean of 2 x 2 points, averaged as linear light (channels after the third as they are).
/// RF_CANCELLED where the progress says stop.
RfResult rf_paint(const RfTorus *torus, const RfImageView *image, RfPaintFn *paint, const void *context);

/// Gradient noise (Perlin 2002) in about -1..1, `cells` lattice cells a unit, closed on the torus.
float rf_torus_noise(const RfTorus *torus, float x, float y, float cells, uint64_t stream);
/// Sum of octaves, each twice as fine and half as strong; about -1..1.
float rf_torus_octaves(const RfTorus *torus, float x, float y, float cells, int octaves, uint64_t stream);

static inline float rf_smooth(float low, float high, float x)
{
    float t = rf_clamp((x - low) / (high - low), 0, 1);
    return t * t * (3 - 2 * t);
}

static inline RfVec3 rf_mix3(RfVec3 a, RfVec3 b, float t)
{
    return (RfVec3){a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), a.z + t * (b.z - a.z)};
}

static inline RfVec3 rf_scale3(RfVec3 a, float s)
{
    return (RfVec3){s * a.x, s * a.y, s * a.z};
}

static inline RfVec3 rf_add3(RfVec3 a, RfVec3 b)
{
    return (RfVec3){a.x + b.x, a.y + b.y, a.z + b.z};
}

static inline float rf_dot3(RfVec3 a, RfVec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline RfVec3 rf_unit3(RfVec3 a)
{
    return rf_scale3(a, 1 / sqrtf(fmaxf(rf_dot3(a, a), 1e-20f)));
}

/// Normal of the surface z = h(x, y) from its slopes.
static inline RfVec3 rf_normal3(float slope_x, float slope_y)
{
    return rf_unit3((RfVec3){-slope_x, -slope_y, 1});
}

/// Light reflected towards the viewer straight above, (2 z n - (0, 0, 1)) . light, to a power.
static inline float rf_glint(RfVec3 normal, RfVec3 light, float power)
{
    RfVec3 mirror = {2 * normal.z * normal.x, 2 * normal.z * normal.y, 2 * normal.z * normal.z - 1};
    return powf(fmaxf(rf_dot3(mirror, light), 0), power);
}
