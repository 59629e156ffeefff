// SPDX-License-Identifier: Apache-2.0
// The main direction of a picture.
//
// Tamura, Mori, Yamawaki. Textural features corresponding to visual perception. 1978 (section 3, directionality).
#pragma once

#include "riffle/data.h"

typedef struct RfDirectionality
{
    /// Along which lines run, radians in 0 to pi: 0 along x, then clockwise as it is seen (y points down).
    float angle;
    /// Tamura's directionality: 1, all edges have one direction; 0, all directions alike, or no edge at all.
    float strength;
} RfDirectionality;

/// Of [height][width] grey values. threshold: edges of less than this in a gradient's mean of both parts do not count
/// (12 levels of 256 in the paper).
RfDirectionality rf_directionality(const float *grey, int width, int height, bool tiles, float threshold);
