// SPDX-License-Identifier: Apache-2.0
// An output file that appears whole or not at all: written as .tmpPID.NAME in the same folder, flushed to the disk,
// renamed.
#pragma once

#include "riffle/base.h"

#include <stdio.h>

typedef struct RfOutFile
{
    FILE *stream;
    char path[4096];
    char temporary[4160];
} RfOutFile;

RfResult rf_out_open(const char *path, RfOutFile *out);
/// Writes or fails with RF_WRITE_FAILED; the file must still be closed.
RfResult rf_out_write(RfOutFile *out, const void *data, size_t size);
/// keep: flushes and renames over `path`, replacing what is there. Else, and on failure, the temporary file is removed.
/// Always closes.
RfResult rf_out_close(RfOutFile *out, bool keep);
/// The temporary name for `path`, for programs that write a file themselves (ffmpeg); the extension stays last.
RfResult rf_out_temporary_name(const char *path, char *name, size_t size);
