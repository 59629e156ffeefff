// SPDX-License-Identifier: Apache-2.0
// Zip archives in memory, stored or deflated, under 4 GiB: what .npz is.
#pragma once

#include "in/file.h"

typedef struct RfZipEntry
{
    char name[128];
    /// 0 stored, 8 deflated.
    int method;
    uint32_t crc;
    size_t packed_size, size;
    /// Of the packed data in the archive.
    size_t offset;
} RfZipEntry;

typedef struct RfZip
{
    const char *path;
    const uint8_t *bytes;
    size_t size;
    int entry_count;
    /// Where the central directory stands, and where reading it goes on.
    size_t directory, next;
} RfZip;

/// `bytes` must outlive *out.
RfResult rf_zip_open(const char *path, const uint8_t *bytes, size_t size, RfZip *out);

/// The entries one after the other; call it entry_count times.
RfResult rf_zip_next(RfZip *zip, RfZipEntry *out);

/// The first bytes of an entry, at most `most`; how many there were is told in *got. Damage shows as fewer.
void rf_zip_peek(const RfZip *zip, const RfZipEntry *entry, uint8_t *out, size_t most, size_t *got);

/// The whole entry, its checksum tested. Refuses one that cannot be as large as it claims, before memory is asked for.
RfResult rf_zip_extract(const RfZip *zip, const RfZipEntry *entry, RfBytes *out);
