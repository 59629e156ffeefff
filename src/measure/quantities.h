// SPDX-License-Identifier: Apache-2.0
// The doubles of RfMeasureFrame as a table, and their means over the frames.
#pragma once

#include "riffle/measure.h"

typedef struct RfMeasureTally
{
    int64_t count[RF_MEASURE_MAX_QUANTITIES], worst_frame[RF_MEASURE_MAX_QUANTITIES];
    double sum[RF_MEASURE_MAX_QUANTITIES], worst[RF_MEASURE_MAX_QUANTITIES];
} RfMeasureTally;

/// Everything NaN.
void rf_measure_clear(RfMeasureFrame *frame);
/// Numbers that are NaN are left out.
void rf_measure_tally(RfMeasureTally *tally, const RfMeasureFrame *frame);
void rf_measure_tally_summary(const RfMeasureTally *tally, RfMeasureSummary *out);
