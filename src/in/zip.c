// SPDX-License-Identifier: Apache-2.0
// PKWARE's APPNOTE 6.3, as far as numpy.savez and savez_compressed go: the end record is looked for from the file's
// end, it points to the central directory, and each entry there to a local header before the data. The central
// directory's sizes count; local ones may be 0 where the writer could not seek.
#include "in/zip.h"
#include "in/samples.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <zlib.h>

enum
{
    END_RECORD = 22,
    LONGEST_COMMENT = 65535,
    DIRECTORY_ENTRY = 46,
    LOCAL_HEADER = 30
};

/// No deflated stream expands more than 1032 times.
static const uint64_t most_expansion = 1040;

static bool signature_at(const RfZip *zip, size_t at, const char *signature)
{
    return at <= zip->size && zip->size - at >= 4 && memcmp(zip->bytes + at, signature, 4) == 0;
}

static RfResult broken(const RfZip *zip, const char *place, const char *what)
{
    return rf_fail(RF_BAD_INPUT, zip->path, place, "not a sound zip archive: %s", what);
}

RfResult rf_zip_open(const char *path, const uint8_t *bytes, size_t size, RfZip *out)
{
    *out = (RfZip){.path = path, .bytes = bytes, .size = size};
    if (size < END_RECORD)
        return broken(out, NULL, "the file is too short");
    size_t at = size - END_RECORD, stop = at > LONGEST_COMMENT ? at - LONGEST_COMMENT : 0;
    while (!signature_at(out, at, "PK\5\6") && at > stop)
        --at;
    if (!signature_at(out, at, "PK\5\6"))
        return broken(out, NULL, "its directory is missing, so the file is probably cut");
    out->entry_count = rf_load_u16(bytes + at + 10, false);
    out->directory = out->next = rf_load_u32(bytes + at + 16, false);
    if (out->entry_count == 0xffff || out->directory == 0xffffffffu)
        return rf_fail(RF_UNSUPPORTED, path, NULL, "a zip64 archive: save arrays over 4 GiB as .npy");
    if (out->directory > at)
        return broken(out, NULL, "its directory lies behind its end");
    return RF_OK;
}

// Where the data begin, behind the local header, whose names and extras have lengths of their own.
static RfResult find_data(const RfZip *zip, RfZipEntry *entry, size_t local)
{
    if (!signature_at(zip, local, "PK\3\4") || zip->size - local < LOCAL_HEADER)
        return broken(zip, entry->name, "an entry's header is not where the directory says");
    const uint8_t *header = zip->bytes + local;
    entry->offset =
        local + LOCAL_HEADER + (size_t)rf_load_u16(header + 26, false) + (size_t)rf_load_u16(header + 28, false);
    if (entry->offset > zip->size || entry->packed_size > zip->size - entry->offset)
        return broken(zip, entry->name, "an entry's data end behind the file");
    return RF_OK;
}

RfResult rf_zip_next(RfZip *zip, RfZipEntry *out)
{
    *out = (RfZipEntry){0};
    if (!signature_at(zip, zip->next, "PK\1\2") || zip->size - zip->next < DIRECTORY_ENTRY)
        return broken(zip, NULL, "its directory is damaged");
    const uint8_t *p = zip->bytes + zip->next;
    size_t name = rf_load_u16(p + 28, false);
    size_t length = DIRECTORY_ENTRY + name + (size_t)rf_load_u16(p + 30, false) + (size_t)rf_load_u16(p + 32, false);
    if (length > zip->size - zip->next)
        return broken(zip, NULL, "its directory is damaged");
    snprintf(out->name, sizeof out->name, "%.*s", (int)name, (const char *)p + DIRECTORY_ENTRY);
    out->method = rf_load_u16(p + 10, false);
    out->crc = rf_load_u32(p + 16, false);
    out->packed_size = rf_load_u32(p + 20, false);
    out->size = rf_load_u32(p + 24, false);
    size_t local = rf_load_u32(p + 42, false);
    zip->next += length;
    if (rf_load_u16(p + 8, false) & 1)
        return rf_fail(RF_UNSUPPORTED, zip->path, out->name, "the entry is encrypted: save it without a password");
    if (out->packed_size == 0xffffffffu || out->size == 0xffffffffu || local == 0xffffffffu)
        return rf_fail(RF_UNSUPPORTED, zip->path, out->name, "a zip64 entry: save arrays over 4 GiB as .npy");
    if (out->method != 0 && out->method != 8)
        return rf_fail(RF_UNSUPPORTED, zip->path, out->name,
                       "compression method %d is not read: numpy.savez and savez_compressed are", out->method);
    return find_data(zip, out, local);
}

// Inflates until `to` is full or the data end; the number of bytes written.
static size_t inflate_into(const uint8_t *from, size_t from_size, uint8_t *to, size_t to_size, bool *whole)
{
    z_stream stream = {0};
    *whole = false;
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK)
        return 0;
    // zlib counts in 32 bits; entries are under 4 GiB, so one round does.
    stream.next_in = (Bytef *)(uintptr_t)from;
    stream.avail_in = (uInt)from_size;
    stream.next_out = to;
    stream.avail_out = (uInt)to_size;
    *whole = inflate(&stream, Z_FINISH) == Z_STREAM_END;
    size_t written = to_size - stream.avail_out;
    inflateEnd(&stream);
    return written;
}

void rf_zip_peek(const RfZip *zip, const RfZipEntry *entry, uint8_t *out, size_t most, size_t *got)
{
    const uint8_t *data = zip->bytes + entry->offset;
    bool whole;
    if (entry->method == 8)
    {
        *got = inflate_into(data, entry->packed_size, out, most, &whole);
        return;
    }
    *got = entry->packed_size < most ? entry->packed_size : most;
    memcpy(out, data, *got);
}

RfResult rf_zip_extract(const RfZip *zip, const RfZipEntry *entry, RfBytes *out)
{
    *out = (RfBytes){0};
    const uint8_t *data = zip->bytes + entry->offset;
    bool whole = entry->method == 0;
    if (entry->method == 0 ? entry->size != entry->packed_size
                           : entry->size > (uint64_t)entry->packed_size * most_expansion)
        return broken(zip, entry->name, "an entry claims a size that its data cannot have");
    out->data = rf_allocate(entry->size, 1);
    if (!out->data)
        return RF_OUT_OF_MEMORY;
    out->size = entry->size;
    size_t got = entry->size;
    if (entry->method == 0)
        memcpy(out->data, data, entry->size);
    else
        got = inflate_into(data, entry->packed_size, out->data, entry->size, &whole);
    if (!whole || got != entry->size || crc32_z(0, out->data, out->size) != entry->crc)
    {
        rf_bytes_free(out);
        return broken(zip, entry->name, "an entry is cut or damaged (its checksum differs)");
    }
    return RF_OK;
}
