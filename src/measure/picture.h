// SPDX-License-Identifier: Apache-2.0
// What all measures look at: grey pictures [h][w] in levels 0 to 255, and displacements [h][w][2] in pixels: what
// stands at pixel (x, y) of one frame moves by it until the next. Masks are [h][w], 0 where nothing counts; NULL:
// everything counts.
#pragma once

#include "riffle/data.h"

/// Rec. 709 luma of 3 or more channels, or the first channel.
void rf_measure_grey(const RfImageView *frame, float *grey);

/// Integrates a flow from time `from` to view->time along the paths (Runge-Kutta, fourth order, two steps a frame), at
/// w x h pixels.
void rf_measure_displacement(const RfFlowView *view, double from, int w, int h, float *displacement);

/// The displacement seen from its end: backward(y) = -forward(y + backward(y)). Found by fixed-point iteration.
RfResult rf_measure_invert(const float *forward, int w, int h, float *backward);

/// out(y) = in(y + offset(y)) by cubic splines, the border's value outside.
RfResult rf_measure_warp(const float *in, const float *offset, int w, int h, float *out);

/// Replaces what does not count by what is round it, smoothly, so that shores are no edges (push-pull, Sander et al.
/// 2001); 0 if nothing counts.
RfResult rf_measure_fill(const uint8_t *mask, int w, int h, float *grey);

/// Two frames, one after the other. Each has its own mask.
typedef struct RfFramePair
{
    int w, h;
    const float *a, *b;
    const uint8_t *mask_a, *mask_b;
} RfFramePair;

enum
{
    /// Pixels nearer to border or land than this are not judged: what an estimator or a spline sees there is not
    /// texture alone.
    RF_MEASURE_BORDER = 8,
    /// Rows that one worker takes at a time.
    RF_MEASURE_BAND = 8
};

/// counted[k] = 1 where pixel k of a, and where it moves in b, are RF_MEASURE_BORDER pixels from border and mask.
RfResult rf_measure_counted(const RfFramePair *pair, const float *displacement, uint8_t *counted);

/// Calls function(context, y0, y1, worker) for bands of rows of w pixels, in parallel where that pays.
typedef void RfRowsFn(void *context, int y0, int y1, int worker);
void rf_measure_rows(int w, int h, RfRowsFn *function, void *context);
