// SPDX-License-Identifier: Apache-2.0
// The moving form of texture optimisation, from inside.
#pragma once

#include "methods/optimize/optimize.h"

struct RfOptimize
{
    RfOptimizeOptions options;
    const RfExemplar *exemplar;
    bool placed;
    double time;
    RfOptimizeStart start;
    /// Windows as they are put into the cells of the next frame.
    RfSynthesisWindow *next;
    /// The carried picture and how strongly each pixel is held to it.
    RfFixedPicture held;
    float *hold;
    float *prices;
    /// Of each cell, the nearest one with a carried window.
    int32_t *nearest;
    /// 95th percentile of the exemplar's gradient, in fixed-point units.
    float gradient;
    /// Of the last step; 0 before the second.
    RfSynthesisEnergy energy;
    uint64_t round;
    double seconds[3];
};

/// Allocates what later frames need besides the start: cells without windows, the held picture, prices.
RfResult rf_optimize_make_room(RfOptimize *optimize);
