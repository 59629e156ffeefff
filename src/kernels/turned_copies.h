// SPDX-License-Identifier: Apache-2.0
// Copies of an exemplar turned by equal steps, to look for patches in.
//
// Copy k of n shows the exemplar turned so that its main direction points to 2 pi k / n, sampled once with a filter
// (kernels/sampler.h). Boxes lie within an exemplar that does not tile; one that tiles is continued, and boxes have
// their middle in it. Compared are the channels' principal axes, so that most of a difference is seen in the first.
// Large exemplars are searched on a coarse level, where a pixel stands for `size` x `size` of them.
#pragma once

#include "kernels/comparison.h"
#include "kernels/looks.h"
#include "kernels/patch_search.h"
#include "kernels/sampler.h"

typedef struct RfTurnedCopies
{
    int count, size;
    /// The exemplar's main direction, radians.
    float direction;
    /// Borrowed.
    const RfSampler *sampler;
    const RfComparison *comparison;
    /// [comparison->channels][comparison->channels]: orthonormal, strongest first.
    float axes[RF_MAX_EXEMPLAR_CHANNELS * RF_MAX_EXEMPLAR_CHANNELS];
    /// [height][width] of the exemplar.
    uint8_t *looks;
    /// The sum of the compared channels' variances.
    float variance;
    /// Of each copy.
    RfJacobian *jacobians;
    RfPatchPicture *pictures;
} RfTurnedCopies;

/// box: the longest side of a query, in pixels of the exemplar.
RfResult rf_turned_copies_create(const RfSampler *sampler, const RfComparison *comparison, float direction, int count,
                                 int box, RfTurnedCopies *out);
/// What the exemplar looks like round a place (kernels/looks.h).
int rf_turned_copies_look(const RfTurnedCopies *copies, RfVec2 source);
void rf_turned_copies_free(RfTurnedCopies *copies);

/// What is compared of a pixel with all channels of the exemplar: values[comparison->channels].
void rf_turned_copies_compared(const RfTurnedCopies *copies, const float *pixel, float *values);
/// Of the flow's direction, radians, the copy that lies nearest to it.
int rf_turned_copy_of(const RfTurnedCopies *copies, float direction);
/// Where the main direction of a copy points to, radians.
float rf_turned_copy_direction(const RfTurnedCopies *copies, int copy);
/// How the exemplar's coordinates change from pixel to pixel of the frame where it lies as the copy does.
static inline RfJacobian rf_turned_copy_jacobian(const RfTurnedCopies *copies, int copy)
{
    return copies->jacobians[copy];
}
static inline RfVec2 rf_jacobian_step(RfJacobian j, RfVec2 step)
{
    return (RfVec2){j.xx * step.x + j.xy * step.y, j.yx * step.x + j.yy * step.y};
}
/// Exemplar coordinates (a pixel's centre is at i + 0.5) of a point of the copy (a pixel's centre is a whole number).
RfVec2 rf_turned_copy_source(const RfTurnedCopies *copies, int copy, RfVec2 point);
/// The point of the copy that shows an exemplar coordinate.
RfVec2 rf_turned_copy_point(const RfTurnedCopies *copies, int copy, RfVec2 source);
