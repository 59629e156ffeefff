// SPDX-License-Identifier: Apache-2.0
// What the pictures of flows share: the flow resampled to the frame, and the colour of a velocity.
#pragma once

#include "data/flow_field.h"
#include "riffle/render.h"

typedef struct RfFlowCanvas
{
    const RfImageView *frame;
    int width, height;
    /// [height][width]: velocity in flow cells a frame, and 1 in the fluid, 0 on land.
    RfVec2 *velocity;
    uint8_t *fluid;
    /// Pixels a flow cell.
    float scale_x, scale_y;
    float full_speed;
    uint64_t seed;
} RfFlowCanvas;

typedef struct RfColour
{
    float r, g, b;
} RfColour;

static inline RfColour rf_colour_mix(RfColour a, RfColour b, float t)
{
    return (RfColour){a.r + t * (b.r - a.r), a.g + t * (b.g - a.g), a.b + t * (b.b - a.b)};
}

static inline RfColour rf_colour_scale(RfColour a, float s)
{
    return (RfColour){a.r * s, a.g * s, a.b * s};
}

static inline void rf_colour_put(const RfImageView *frame, int x, int y, RfColour colour)
{
    float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + 3 * (ptrdiff_t)x;
    p[0] = colour.r;
    p[1] = colour.g;
    p[2] = colour.b;
}

static inline float rf_smoothstep(float low, float high, float x)
{
    float t = (x - low) / (high - low);
    t = t > 0 ? (t < 1 ? t : 1) : 0;
    return t * t * (3 - 2 * t);
}

/// Of land.
static const RfColour RF_LAND = {0.17f, 0.17f, 0.18f};

/// White where nothing moves, the direction's hue fully saturated at full speed, darker beyond.
RfColour rf_flow_colour(RfVec2 velocity, float full_speed);

/// Fills a canvas's frame.
void rf_draw_arrows(const RfFlowCanvas *canvas);
/// `scratch`: [2][height][width]. Cancelled: the frame is untouched.
RfResult rf_draw_lic(const RfFlowCanvas *canvas, RfVec2 *scratch);
