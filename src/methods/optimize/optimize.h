// SPDX-License-Identifier: Apache-2.0
// What the still and the moving form of texture optimisation share.
#pragma once

#include "kernels/synthesis_material.h"
#include "riffle/optimize.h"

RfResult rf_optimize_check(const RfOptimizeOptions *options);

/// What a still picture leaves for a moving one to start from. Owned by whoever gets it.
typedef struct RfOptimizeStart
{
    RfSynthesisMaterial material;
    RfSynthesisFrame frame;
} RfOptimizeStart;

RfResult rf_optimize_start(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                           const RfOptimizeConstraints *constraints, int width, int height, RfOptimizeStart *out);

/// Samples all made channels of the exemplar: the pixel at whole places, between them by a cubic that meets the pixels.
/// turn: how directions lie in the frame, as in RfSynthesisWindow; NULL: as in the exemplar. mean: a pixel of the frame
/// on the finest level, which stands in for the channels that are compared; NULL: none.
void rf_optimize_sample(const RfSynthesisMaterial *material, RfVec2 source, const RfVec2 *turn, const int16_t *mean,
                        float *values);
