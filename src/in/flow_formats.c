// SPDX-License-Identifier: Apache-2.0
#include "in/flow_format.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

// Formats with a signature stand before those without, and the plainest text last.
static const RfFlowFormat *const formats[] = {
    &rf_flow_format_flo, &rf_flow_format_npy,    &rf_flow_format_npz, &rf_flow_format_exr,     &rf_flow_format_png,
    &rf_flow_format_vti, &rf_flow_format_netcdf, &rf_flow_format_vec, &rf_flow_format_openpiv,
};

static const char *const directory_extensions[] = {"flo", "npy", "exr", "vti", "vec", "png", "txt"};

enum
{
    FORMAT_COUNT = sizeof formats / sizeof formats[0],
    DIRECTORY_COUNT = sizeof directory_extensions / sizeof directory_extensions[0]
};

static bool has_extension(const char *list, const char *extension)
{
    size_t length = strlen(extension);
    for (const char *word = list; word; word = strchr(word, ','))
    {
        word += *word == ',';
        if (strncasecmp(word, extension, length) == 0 && (word[length] == ',' || word[length] == '\0'))
            return true;
    }
    return false;
}

const RfFlowFormat *rf_flow_format_find(const char *path, const uint8_t *bytes, size_t size)
{
    if (size == 0)
    {
        rf_fail(RF_BAD_INPUT, path, NULL, "the file is empty");
        return NULL;
    }
    for (int i = 0; i < FORMAT_COUNT; ++i)
        if (formats[i]->probe && formats[i]->probe(bytes, size))
            return formats[i];
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    for (int i = 0; dot && dot[1] && i < FORMAT_COUNT; ++i)
        if (has_extension(formats[i]->extensions, dot + 1))
            return formats[i];
    rf_fail(RF_UNSUPPORTED, path, NULL,
            "is no 2D flow that is known: flo, npy, npz, exr, vti, nc, vec, txt (PIV), or png beside a json of its "
            "name");
    return NULL;
}

const char *rf_flow_format_extension(int index)
{
    return index < DIRECTORY_COUNT ? directory_extensions[index] : NULL;
}

void rf_flow_moment_free(RfFlowMoment *moment)
{
    rf_flow_field_free(&moment->field);
}

RfResult rf_flow_moment_create(const RfFlowSource *source, int64_t width, int64_t height, RfFlowMoment *out)
{
    if (width < 1 || width > RF_MAX_SIZE || height < 1 || height > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, source->path, "header", "%lld x %lld cells: each side must be 1 to %d",
                       (long long)width, (long long)height, RF_MAX_SIZE);
    return rf_flow_field_create((int)width, (int)height, &out->field);
}

static void swap_bytes(void *a, void *b, size_t size)
{
    uint8_t *p = a, *q = b;
    for (size_t i = 0; i < size; ++i)
    {
        uint8_t t = p[i];
        p[i] = q[i];
        q[i] = t;
    }
}

void rf_flow_field_flip_rows(RfFlowField *field)
{
    size_t width = (size_t)field->width, height = (size_t)field->height;
    for (size_t y = 0; y < height / 2; ++y)
    {
        size_t z = height - 1 - y;
        swap_bytes(field->velocity + 2 * y * width, field->velocity + 2 * z * width, 2 * width * sizeof(float));
        if (field->mask)
            swap_bytes(field->mask + y * width, field->mask + z * width, width);
    }
}

bool rf_flow_wanted_names(const RfFlowReadOptions *options, char u[64], char v[64])
{
    const char *comma = options->variables ? strchr(options->variables, ',') : NULL;
    if (!comma)
        return false;
    snprintf(u, 64, "%.*s", (int)(comma - options->variables), options->variables);
    snprintf(v, 64, "%s", comma + 1);
    return true;
}
