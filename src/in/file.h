// SPDX-License-Identifier: Apache-2.0
// Whole files in memory: every reader decodes bytes, so that a fuzzer can hand it any.
#pragma once

#include "riffle/base.h"

typedef struct RfBytes
{
    uint8_t *data;
    size_t size;
} RfBytes;

/// Refuses what is missing, unreadable, a directory, or larger than `limit` bytes (0: 8 GiB).
RfResult rf_bytes_read(const char *path, size_t limit, RfBytes *out);
void rf_bytes_free(RfBytes *bytes);
