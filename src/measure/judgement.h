// SPDX-License-Identifier: Apache-2.0
// The measures, one by one, over plain arrays; src/measure/measure.c feeds them frame by frame. Each fills the public
// header's struct, with NaN where nothing could be judged.
#pragma once

#include "measure/optical_flow.h"
#include "measure/picture.h"
#include "riffle/measure.h"

/// A grey picture.
typedef struct RfGrey
{
    const float *pixels;
    int w, h;
} RfGrey;

/// exemplar: NULL, or repeated by mirroring to fill the frame. error_map [h][w] and motion_map [h][w][2] may be NULL;
/// the first is NaN where a pixel does not count.
RfResult rf_measure_flow_error(RfMeasureEstimator estimator, const RfFramePair *pair, const float *displacement,
                               const RfGrey *exemplar, float *error_map, float *motion_map, RfMeasureFlow *out);

/// The maps [h][w] may be NULL: signed difference over the contrast, and the rms of it in the worst block of each
/// pixel.
RfResult rf_measure_flicker(const RfFramePair *pair, const float *displacement, float *difference_map, float *block_map,
                            RfMeasureFlicker *out);

/// Rms difference between b and a carried by the flow in each block of `block` x `block` pixels, in grey levels: [h /
/// block][w / block], row by row; -1 where less than half of a block counts. What pops stands out from the rest.
RfResult rf_measure_block_changes(const RfFramePair *pair, const float *displacement, int block, float *changes);

/// Only pixels in the mask count. Without floors.
void rf_measure_contrast(const RfImageView *frame, const uint8_t *mask, const RfImageView *exemplar,
                         RfMeasureContrast *out);
/// Of 32 random crops of the exemplar, half its side, against the whole: sets the floors alone.
void rf_measure_contrast_floor(const RfImageView *exemplar, uint64_t seed, RfMeasureContrast *out);

/// Clears in known[h][w] the pixels of `fluid` (NULL: all) that are holes, and those that are no fluid.
void rf_measure_coverage(const RfImageView *frame, const uint8_t *fluid, RfMeasureHoles holes, bool alpha,
                         uint8_t *known, RfMeasureCoverage *out);
