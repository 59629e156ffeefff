// SPDX-License-Identifier: Apache-2.0
// Middlebury .flo: "PIEH" (the float 202021.25), width, height, then u, v interleaved, all little-endian.
//
// Baker, Scharstein, Lewis, Roth, Black, Szeliski. A database and evaluation methodology for optical flow. 2011.
// There a component over 1e9 says "unknown": such cells are kept still and masked.
#include "in/flow_format.h"
#include "in/samples.h"

#include "core/result.h"

#include <stdio.h>

enum
{
    HEADER = 12
};

static const float unknown_flow = 1e9f;

static bool flo_probe(const uint8_t *bytes, size_t size)
{
    return size >= 4 && memcmp(bytes, "PIEH", 4) == 0;
}

static RfResult flo_header(const RfFlowSource *source, int64_t *width, int64_t *height)
{
    const uint8_t *bytes = source->bytes;
    if (source->size < 4 || memcmp(bytes, "PIEH", 4) != 0)
        return rf_fail(RF_BAD_INPUT, source->path, "byte 0", "not a .flo: it does not begin with PIEH");
    if (source->size < HEADER)
        return rf_fail(RF_BAD_INPUT, source->path, "header", "the file ends inside the header (%zu of %d bytes)",
                       source->size, HEADER);
    *width = (int32_t)rf_load_u32(bytes + 4, false);
    *height = (int32_t)rf_load_u32(bytes + 8, false);
    if (*width < 1 || *width > RF_MAX_SIZE || *height < 1 || *height > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, source->path, "header", "%lld x %lld cells: each side must be 1 to %d",
                       (long long)*width, (long long)*height, RF_MAX_SIZE);
    uint64_t wanted = HEADER + 8 * (uint64_t)*width * (uint64_t)*height;
    if (source->size < wanted)
        return rf_fail(RF_BAD_INPUT, source->path, "data", "%lld x %lld cells need %llu bytes, the file has %zu",
                       (long long)*width, (long long)*height, (unsigned long long)wanted, source->size);
    return RF_OK;
}

static RfResult mask_unknown(RfFlowField *field)
{
    RF_TRY(rf_flow_field_add_mask(field));
    for (size_t k = 0; k < (size_t)field->width * (size_t)field->height; ++k)
    {
        float *cell = field->velocity + 2 * k;
        if (!(fabsf(cell[0]) > unknown_flow) && !(fabsf(cell[1]) > unknown_flow))
            continue;
        field->mask[k] = 0;
        cell[0] = cell[1] = 0;
    }
    return RF_OK;
}

static RfResult flo_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    int64_t width = 0, height = 0;
    RF_TRY(flo_header(source, &width, &height));
    RF_TRY(rf_flow_moment_create(source, width, height, out));
    size_t cells = (size_t)width * (size_t)height;
    bool hole = false;
    for (size_t k = 0; k < 2 * cells; ++k)
    {
        out->field.velocity[k] = rf_load_f32(source->bytes + HEADER + 4 * k, false);
        hole |= fabsf(out->field.velocity[k]) > unknown_flow;
    }
    out->moment_count = 1;
    snprintf(out->conventions, sizeof out->conventions, "cells a frame, y down, as in the file%s",
             hole ? "; cells over 1e9 (unknown) masked" : "");
    return hole ? mask_unknown(&out->field) : RF_OK;
}

const RfFlowFormat rf_flow_format_flo = {.name = "flo", .extensions = "flo", .probe = flo_probe, .read = flo_read};
