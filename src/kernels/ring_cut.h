// SPDX-License-Identifier: Apache-2.0
// The closed line round a point along which two pictures differ least: the minimum error boundary cut of Efros and
// Freeman (Image quilting for texture synthesis and transfer, 2001) in polar coordinates.
#pragma once

#include "riffle/base.h"

enum
{
    RF_RING_ANGLES = 96,
    RF_RING_RADII = 64
};

/// How much the pictures differ where the line may run, by angle and radius; finite or INFINITY.
typedef struct RfRing
{
    int radii;
    float errors[RF_RING_ANGLES][RF_RING_RADII];
    /// Scratch.
    float sums[RF_RING_ANGLES][RF_RING_RADII];
    int8_t from[RF_RING_ANGLES][RF_RING_RADII];
} RfRing;

/// path[angle]: the radius' index. Neighbouring ones, the last and the first too, differ by 1 at most, and the sum of
/// the errors is the least of all such lines. Returns that sum.
float rf_ring_cut(RfRing *ring, int path[RF_RING_ANGLES]);
