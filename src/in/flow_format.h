// SPDX-License-Identifier: Apache-2.0
// What a reader of 2D flows is: a constant table entry that decodes one moment from bytes in memory.
#pragma once

#include "data/flow_field.h"
#include "in/file.h"
#include "riffle/io.h"

/// A file that was read, before anything is known about it.
typedef struct RfFlowSource
{
    /// For messages; readers that need a neighbour file (a JSON beside a PNG) find it through this path.
    const char *path;
    const uint8_t *bytes;
    size_t size;
    const RfFlowReadOptions *options;
} RfFlowSource;

/// One decoded moment, before velocity_scale.
typedef struct RfFlowMoment
{
    /// Cells a frame, y down.
    RfFlowField field;
    /// How many moments the file has.
    int moment_count;
    int filled_vectors;
    char conventions[256];
} RfFlowMoment;

typedef struct RfFlowFormat
{
    const char *name;
    /// "vec" or "vec,piv": without dots, lower case.
    const char *extensions;
    /// Knows a file by its first bytes. NULL: only the extension tells.
    bool (*probe)(const uint8_t *bytes, size_t size);
    /// On failure `out` holds nothing that needs freeing. A moment past the last is the caller's mistake.
    RfResult (*read)(const RfFlowSource *source, int moment, RfFlowMoment *out);
    /// Where a moment lies packed with the others: unpacks them all into bytes that `read` takes as well, so that
    /// opening a container does it once. NULL where a moment can be got at.
    RfResult (*unpack)(const RfFlowSource *source, RfBytes *out);
    /// Its library opens the file by its path: `bytes` may be NULL, and the whole file is never read into memory.
    bool by_path;
} RfFlowFormat;

extern const RfFlowFormat rf_flow_format_flo, rf_flow_format_npy, rf_flow_format_npz, rf_flow_format_exr,
    rf_flow_format_vti, rf_flow_format_netcdf, rf_flow_format_vec, rf_flow_format_openpiv, rf_flow_format_png;

enum
{
    /// Bytes from the start of a file that rf_flow_format_find wants to see.
    RF_FLOW_PROBE_BYTES = 512
};

/// By the first bytes, else by the extension; NULL, with the last error set, for what no reader knows.
const RfFlowFormat *rf_flow_format_find(const char *path, const uint8_t *bytes, size_t size);

/// Extensions that a directory of flows is searched for, in this order; the n-th, or NULL after the last.
const char *rf_flow_format_extension(int index);

void rf_flow_moment_free(RfFlowMoment *moment);

/// Creates out->field, refusing sizes out of range as the file's fault.
RfResult rf_flow_moment_create(const RfFlowSource *source, int64_t width, int64_t height, RfFlowMoment *out);

/// Turns a field whose row 0 is at the bottom upside down; velocities are not touched.
void rf_flow_field_flip_rows(RfFlowField *field);

/// Writes the components' names that the user asked for; false if none were asked for. A text without a comma is
/// RF_INVALID_ARGUMENT at rf_flow_open, so it cannot occur here.
bool rf_flow_wanted_names(const RfFlowReadOptions *options, char u[64], char v[64]);
