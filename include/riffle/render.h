// SPDX-License-Identifier: Apache-2.0
// Pictures of flows, and procedural shaders for blended parameters.
#pragma once

#include "data.h"

typedef enum RfFlowPicture
{
    /// Direction as hue, speed as saturation (the colour coding of Baker et al. 2011).
    RF_FLOW_WHEEL,
    /// Arrows over a dimmed wheel.
    RF_FLOW_ARROWS,
    /// Line integral convolution of noise, brightness along streamlines (Cabral and Leedom 1993). Where nothing moves
    /// faint noise stays.
    RF_FLOW_LIC
} RfFlowPicture;

typedef struct RfFlowPictureOptions
{
    /// Set by rf_flow_picture_defaults(); tells a program built against another version.
    uint32_t struct_size;
    uint64_t seed;
    RfFlowPicture picture;
    /// Speed that gets full saturation or the longest arrow, in cells a frame; 0 takes the greatest of the view.
    float full_speed;
} RfFlowPictureOptions;

RF_API RfFlowPictureOptions rf_flow_picture_defaults(void);

/// Draws the velocity at view->time into a frame of 3 channels (sRGB-encoded) and any size. Outside the fluid the frame
/// is dark grey. On failure `frame` holds its old pixels.
RF_API RF_MUST_USE RfResult rf_flow_picture(const RfFlowView *view, const RfFlowPictureOptions *options,
                                            const RfImageView *frame);

typedef enum RfShader
{
    RF_SHADER_NONE,
    /// A black body ramp over rising noise: dark smoke, red, orange, yellow, white.
    RF_SHADER_FIRE,
    /// White clouds over blue sky, lit from the side by the slope of the density.
    RF_SHADER_CLOUDS
} RfShader;

/// Shades a frame of blended noise (the mean of its first three channels, or its only one, 0 to 1) into 3 channels of
/// colour (sRGB-encoded). Both have one size; `parameters` and `colour` may share no memory.
RF_API RF_MUST_USE RfResult rf_shade(RfShader shader, const RfImageView *parameters, const RfImageView *colour);

/// Draws a height field (first channel, 0 to 1) with its colour as a lit surface in perspective, seen from the front
/// and above. `relief` is the height of 1 in widths of the field. Frame: 3 channels, any size. height and colour (3
/// channels) have one size. On failure `frame` holds its old pixels.
RF_API RF_MUST_USE RfResult rf_render_relief(const RfImageView *height, const RfImageView *colour, float relief,
                                             const RfImageView *frame);
