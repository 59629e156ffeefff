// SPDX-License-Identifier: Apache-2.0
// Dense optical flow between two frames: a(x) = b(x + flow(x)).
#pragma once

#include "measure/picture.h"
#include "riffle/measure.h"

/// flow: [h][w][2]. Frames of 16 x 16 pixels or more, filled where the masks are 0 (rf_measure_fill); what is masked
/// says nothing, and its flow continues what is round it.
RfResult rf_measure_optical_flow(RfMeasureEstimator estimator, const RfFramePair *pair, float *flow);

/// The two estimators, one a file.
RfResult rf_measure_lucas_kanade(const RfFramePair *pair, float *flow);
RfResult rf_measure_inverse_search(const RfFramePair *pair, float *flow);
