// SPDX-License-Identifier: Apache-2.0
// The header of a NumPy array, shared by .npy and .npz.
#pragma once

#include "in/flow_format.h"
#include "in/samples.h"

enum
{
    RF_NPY_MAX_DIMENSIONS = 8
};

typedef struct RfNpyHeader
{
    RfNumberKind kind;
    bool big_endian, fortran_order;
    int dimension_count;
    uint64_t shape[RF_NPY_MAX_DIMENSIONS];
    /// Where the numbers begin.
    size_t data_offset;
} RfNpyHeader;

bool rf_npy_probe(const uint8_t *bytes, size_t size);

/// `place` says which member of an archive the bytes are; NULL for a plain .npy. Messages name it.
RfResult rf_npy_header(const RfFlowSource *source, const char *place, RfNpyHeader *out);

/// [height, width], [moments, height, width] or, with two components, one dimension of 2 more; as
/// [moments, height, width, components]. Checks sizes, and that the numbers are all there.
RfResult rf_npy_shape(const RfFlowSource *source, const char *place, const RfNpyHeader *header, int components,
                      uint64_t shape[4]);

/// One moment of an array of the shape above into every `step`-th float of `out`, its components side by side.
void rf_npy_copy(const RfFlowSource *source, const RfNpyHeader *header, const uint64_t shape[4], uint64_t moment,
                 size_t step, float *out);

/// [H, W, 2] or [T, H, W, 2] at one moment; source->bytes is the array's own .npy.
RfResult rf_npy_read(const RfFlowSource *source, int moment, RfFlowMoment *out);
