// SPDX-License-Identifier: Apache-2.0
// Does the texture follow the flow? End-point error of an estimated optical flow, as the field reports it
// (Baker, Scharstein, Lewis, Roth, Black, Szeliski. A database and evaluation methodology for optical flow. 2011).
//
// An estimate is never exact, so that the bare error says as much of the estimator and the texture as of the frames.
// Hence the floors, by the same estimator over the same pixels: one on frame n against itself warped by the true
// motion; one on a picture of the exemplar alone, where no method's artefacts help or hinder.
#include "measure/judgement.h"

#include "core/maths.h"
#include "core/memory.h"

// The true motion, the pixels that count, and who estimates.
typedef struct Judge
{
    RfMeasureEstimator estimator;
    const float *truth;
    const uint8_t *counted;
    float *flow;
} Judge;

static RfResult end_point_error(const Judge *judge, const RfFramePair *pair, double *mean, float *map)
{
    RfResult result = rf_measure_optical_flow(judge->estimator, pair, judge->flow);
    if (result != RF_OK)
        return result;
    double sum = 0, n = 0;
    for (size_t k = 0; k < (size_t)pair->w * (size_t)pair->h; ++k)
    {
        if (map)
            map[k] = NAN;
        if (!judge->counted[k])
            continue;
        float dx = judge->flow[2 * k] - judge->truth[2 * k], dy = judge->flow[2 * k + 1] - judge->truth[2 * k + 1];
        double error = hypot((double)dx, (double)dy);
        if (map)
            map[k] = (float)error;
        sum += error;
        n += 1;
    }
    *mean = n > 0 ? sum / n : (double)NAN;
    return RF_OK;
}

static void fill_by_mirroring(const RfGrey *exemplar, int w, int h, float *out)
{
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t row = (size_t)rf_mirror_int(y, exemplar->h), column = (size_t)rf_mirror_int(x, exemplar->w);
            out[(size_t)y * (size_t)w + (size_t)x] = exemplar->pixels[row * (size_t)exemplar->w + column];
        }
}

static void count_motion(const Judge *judge, size_t count, RfMeasureFlow *out)
{
    double motion = 0, n = 0;
    for (size_t k = 0; k < count; ++k)
        if (judge->counted[k])
        {
            motion += hypot((double)judge->truth[2 * k], (double)judge->truth[2 * k + 1]);
            n += 1;
        }
    out->pixels = n;
    out->motion = n > 0 ? motion / n : (double)NAN;
}

// Error and floors, with memory at hand: backward [h][w][2], warped and filled [h][w].
static RfResult judge_pair(const Judge *judge, const RfFramePair *pair, const RfGrey *exemplar, float *backward,
                           float *warped, float *filled, float *error_map, float *motion_map, RfMeasureFlow *out)
{
    RfResult result = end_point_error(judge, pair, &out->error, error_map);
    for (size_t k = 0; motion_map && k < 2 * (size_t)pair->w * (size_t)pair->h; ++k)
        motion_map[k] = judge->flow[k];
    RfFramePair carried = *pair;
    carried.b = warped;
    if (result == RF_OK)
        result = rf_measure_invert(judge->truth, pair->w, pair->h, backward);
    if (result == RF_OK)
        result = rf_measure_warp(pair->a, backward, pair->w, pair->h, warped);
    if (result == RF_OK)
        result = end_point_error(judge, &carried, &out->floor, NULL);
    if (result != RF_OK || !exemplar)
        return result;
    fill_by_mirroring(exemplar, pair->w, pair->h, filled);
    carried.a = filled;
    result = rf_measure_warp(filled, backward, pair->w, pair->h, warped);
    return result == RF_OK ? end_point_error(judge, &carried, &out->exemplar_floor, NULL) : result;
}

RfResult rf_measure_flow_error(RfMeasureEstimator estimator, const RfFramePair *pair, const float *displacement,
                               const RfGrey *exemplar, float *error_map, float *motion_map, RfMeasureFlow *out)
{
    size_t count = (size_t)pair->w * (size_t)pair->h;
    float *backward = rf_allocate(count, 2 * sizeof(float)), *flow = rf_allocate(count, 2 * sizeof(float));
    float *warped = rf_allocate(count, sizeof(float)), *filled = rf_allocate(count, sizeof(float));
    uint8_t *counted = rf_allocate(count, 1);
    *out = (RfMeasureFlow){NAN, NAN, NAN, NAN, NAN, NAN, 0};
    RfResult result = backward && flow && warped && filled && counted ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
        result = rf_measure_counted(pair, displacement, counted);
    if (result == RF_OK)
    {
        Judge judge = {estimator, displacement, counted, flow};
        count_motion(&judge, count, out);
        result = judge_pair(&judge, pair, exemplar, backward, warped, filled, error_map, motion_map, out);
    }
    if (out->floor > 0)
        out->ratio = out->error / out->floor;
    if (out->exemplar_floor > 0)
        out->exemplar_ratio = out->error / out->exemplar_floor;
    rf_release(counted);
    rf_release(filled);
    rf_release(warped);
    rf_release(flow);
    rf_release(backward);
    return result;
}
