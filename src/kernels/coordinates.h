// SPDX-License-Identifier: Apache-2.0
// Sets of texture coordinates, one a pixel, that a flow carries; each set can be started afresh on its own.
#pragma once

#include "data/flow_field.h"
#include "kernels/sampler.h"

enum
{
    RF_MAX_COORDINATE_SETS = 12
};

typedef struct RfCoordinates
{
    /// 1 to RF_MAX_COORDINATE_SETS, given by the owner. The rest starts as 0.
    int sets;
    int width, height;
    bool placed;
    /// Of the first move and of the last one, in frames.
    double start, time;
    /// Coordinate minus pixel, [height][width][sets][2].
    float *offset, *next;
    /// Index of the nearest fluid pixel, where there is a mask.
    int32_t *nearest;
} RfCoordinates;

/// Checks flow and size, then carries all sets to flow->time; the first time it places them, all offsets 0. `stage` is
/// told to the progress callback before anything changes.
RfResult rf_coordinates_move(RfCoordinates *coordinates, const char *stage, const RfFlowView *flow, int width,
                             int height);
/// All offsets of one set become 0.
void rf_coordinates_reset(RfCoordinates *coordinates, int set);
void rf_coordinates_free(RfCoordinates *coordinates);

static inline RfVec2 rf_coordinates_offset(const RfCoordinates *c, int set, int x, int y)
{
    const float *p = c->offset + 2 * (((size_t)y * (size_t)c->width + (size_t)x) * (size_t)c->sets + (size_t)set);
    return (RfVec2){p[0], p[1]};
}

/// Central differences, one-sided at the frame's border.
RfJacobian rf_coordinates_jacobian(const RfCoordinates *coordinates, int set, int x, int y);

/// One relocatable block. `method` is its name, `inputs` is a hash of all that the
/// coordinates depend on besides the flow.
RfResult rf_coordinates_save(const RfCoordinates *coordinates, const char *method, uint64_t inputs, void **block,
                             size_t *size);
/// `out` holds the number of sets and nothing else. RF_BAD_INPUT for a block of another method, version, instruction
/// set or inputs, and for a damaged one.
RfResult rf_coordinates_load(RfCoordinates *out, const char *method, uint64_t inputs, const void *block, size_t size);
