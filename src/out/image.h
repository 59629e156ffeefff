// SPDX-License-Identifier: Apache-2.0
// Image writers: one constant table entry a format.
#pragma once

#include "out/file.h"
#include "riffle/io.h"

typedef struct RfImageWriter
{
    const char *extension;
    /// Writes to the open file; neither opens nor closes it.
    RfResult (*encode)(RfOutFile *file, const RfImage *image);
} RfImageWriter;

extern const RfImageWriter rf_png_writer, rf_exr_writer, rf_npy_writer;
