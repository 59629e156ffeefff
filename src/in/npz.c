// SPDX-License-Identifier: Apache-2.0
// NumPy's .npz, a zip of .npy files. Taken is the first array of the shape of a flow, or else two arrays of one
// component each: those named by --variables, or u and v. A pair is put together once, as one array.
#include "in/npy.h"
#include "in/zip.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <string.h>

enum
{
    HEADER = 128,
    PEEK = 4096
};

static bool npz_probe(const uint8_t *bytes, size_t size)
{
    return size >= 4 && (memcmp(bytes, "PK\3\4", 4) == 0 || memcmp(bytes, "PK\5\6", 4) == 0);
}

// The shape alone, from the first bytes of an entry.
static bool has_flow_shape(const RfFlowSource *source, const RfZip *zip, const RfZipEntry *entry)
{
    uint8_t head[PEEK];
    RfFlowSource peek = {source->path, head, 0, source->options};
    RfNpyHeader header;
    rf_zip_peek(zip, entry, head, sizeof head, &peek.size);
    if (!rf_npy_probe(head, peek.size) || rf_npy_header(&peek, entry->name, &header) != RF_OK)
        return false;
    int n = header.dimension_count;
    return (n == 3 || n == 4) && header.shape[n - 1] == 2;
}

static bool is_named(const RfZipEntry *entry, const char *name)
{
    size_t length = strlen(name);
    return strncmp(entry->name, name, length) == 0 &&
           (entry->name[length] == '\0' || strcmp(entry->name + length, ".npy") == 0);
}

typedef struct Found
{
    bool flow, pair[2];
    RfZipEntry array, components[2];
    char names[256];
} Found;

static RfResult look_through(const RfFlowSource *source, RfZip *zip, Found *out)
{
    char wanted[2][64] = {"u", "v"};
    bool told = rf_flow_wanted_names(source->options, wanted[0], wanted[1]);
    for (int i = 0; i < zip->entry_count; ++i)
    {
        RfZipEntry entry;
        RF_TRY(rf_zip_next(zip, &entry));
        for (int c = 0; c < 2; ++c)
            if (!out->pair[c] && is_named(&entry, wanted[c]))
            {
                out->pair[c] = true;
                out->components[c] = entry;
            }
        if (!told && !out->flow && has_flow_shape(source, zip, &entry))
        {
            out->flow = true;
            out->array = entry;
        }
        size_t used = strlen(out->names);
        if (used + strlen(entry.name) + 3 < sizeof out->names)
            snprintf(out->names + used, sizeof out->names - used, "%s%s", used ? ", " : "", entry.name);
    }
    if (out->flow || (out->pair[0] && out->pair[1]))
        return RF_OK;
    return rf_fail(RF_BAD_INPUT, source->path, NULL,
                   "no flow here: looked for %s; it has: %s; name two arrays with --variables",
                   told ? source->options->variables
                        : "an array of shape [height, width, 2] or [moments, height, width, 2], or u and v",
                   out->names[0] ? out->names : "nothing");
}

// ---- a pair as one array -----------------------------------------------------------------------------------------

typedef struct Pair
{
    RfBytes bytes[2];
    RfFlowSource sources[2];
    RfNpyHeader headers[2];
    uint64_t shape[4];
} Pair;

static RfResult read_pair(const RfFlowSource *source, const RfZip *zip, const Found *found, Pair *pair)
{
    uint64_t shape[4];
    for (int c = 0; c < 2; ++c)
    {
        const char *name = found->components[c].name;
        RF_TRY(rf_zip_extract(zip, &found->components[c], &pair->bytes[c]));
        pair->sources[c] = (RfFlowSource){source->path, pair->bytes[c].data, pair->bytes[c].size, source->options};
        RF_TRY(rf_npy_header(&pair->sources[c], name, &pair->headers[c]));
        RF_TRY(rf_npy_shape(&pair->sources[c], name, &pair->headers[c], 1, c ? shape : pair->shape));
    }
    if (memcmp(shape, pair->shape, sizeof shape) != 0)
        return rf_fail(RF_BAD_INPUT, source->path, found->components[1].name,
                       "differs in shape from %s: both must agree", found->components[0].name);
    return RF_OK;
}

static RfResult join_pair(const Pair *pair, RfBytes *out)
{
    const uint64_t *shape = pair->shape;
    size_t cells = (size_t)shape[1] * (size_t)shape[2], floats = (size_t)shape[0] * cells * 2;
    out->data = rf_allocate(HEADER + floats * sizeof(float), 1);
    if (!out->data)
        return RF_OUT_OF_MEMORY;
    out->size = HEADER + floats * sizeof(float);
    memset(out->data, ' ', HEADER);
    memcpy(out->data, "\x93NUMPY\1\0\x76\0", 10);
    char *text = (char *)out->data + 10;
    int length =
        snprintf(text, HEADER - 10, "{'descr': '%cf4', 'fortran_order': False, 'shape': (%llu, %llu, %llu, 2), }",
                 __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__ ? '>' : '<', (unsigned long long)shape[0],
                 (unsigned long long)shape[1], (unsigned long long)shape[2]);
    text[length] = ' ';
    out->data[HEADER - 1] = '\n';
    float *numbers = (float *)(void *)(out->data + HEADER);
    for (uint64_t t = 0; t < shape[0]; ++t)
        for (int c = 0; c < 2; ++c)
            rf_npy_copy(&pair->sources[c], &pair->headers[c], shape, t, 2, numbers + t * cells * 2 + (size_t)c);
    return RF_OK;
}

static RfResult unpack_pair(const RfFlowSource *source, const RfZip *zip, const Found *found, RfBytes *out)
{
    Pair pair = {0};
    RfResult result = read_pair(source, zip, found, &pair);
    if (result == RF_OK)
        result = join_pair(&pair, out);
    for (int c = 0; c < 2; ++c)
        rf_bytes_free(&pair.bytes[c]);
    return result;
}

static RfResult npz_unpack(const RfFlowSource *source, RfBytes *out)
{
    *out = (RfBytes){0};
    RfZip zip;
    Found found = {0};
    RF_TRY(rf_zip_open(source->path, source->bytes, source->size, &zip));
    RF_TRY(look_through(source, &zip, &found));
    return found.flow ? rf_zip_extract(&zip, &found.array, out) : unpack_pair(source, &zip, &found, out);
}

static RfResult npz_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    if (rf_npy_probe(source->bytes, source->size))
        return rf_npy_read(source, moment, out);
    RfBytes bytes;
    RF_TRY(npz_unpack(source, &bytes));
    RfFlowSource array = {source->path, bytes.data, bytes.size, source->options};
    RfResult result = rf_npy_read(&array, moment, out);
    rf_bytes_free(&bytes);
    return result;
}

const RfFlowFormat rf_flow_format_npz = {
    .name = "npz", .extensions = "npz", .probe = npz_probe, .read = npz_read, .unpack = npz_unpack};
