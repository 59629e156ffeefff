// SPDX-License-Identifier: Apache-2.0
// Is the local structure of a frame from the exemplar, all of it?
#pragma once

#include "riffle/measure.h"

typedef struct RfPatchJudge RfPatchJudge;

/// RF_UNSUPPORTED if the exemplar has more windows, in all its copies, than can be searched.
RfResult rf_patches_check(int width, int height, int size, int rotations, bool half_pixel);

/// Windows `size` pixels wide; for stride, rotations and half_pixel see RfMeasureOptions. The exemplar is 1 or 3
/// packed channels, 0 to 1, and copied; both sides are `size` or more; rf_patches_check has passed.
RfResult rf_patches_create(const RfImageView *exemplar, int size, int stride, int rotations, bool half_pixel,
                           RfPatchJudge **out);
void rf_patches_destroy(RfPatchJudge *judge);

/// Windows that lie wholly where known is not 0 (NULL: everywhere) are compared. The frame has the exemplar's
/// channels. residual_map [h][w] and source_map [h][w][2] as in RfMeasureMap; counts: see rf_measure_use.
RfResult rf_patches_measure(RfPatchJudge *judge, const RfImageView *frame, const uint8_t *known, float *residual_map,
                            float *source_map, int64_t *counts, RfMeasurePatch *out);
