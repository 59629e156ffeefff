// SPDX-License-Identifier: Apache-2.0
// NumPy's .npy, versions 1 to 3: "\x93NUMPY", version, length of the header, and the header as a Python literal,
// {'descr': '<f4', 'fortran_order': False, 'shape': (60, 80, 2), }. The three keys come in any order, so each is
// looked for by name; nothing else of Python is understood.
#include "in/npy.h"

#include "core/memory.h"
#include "core/result.h"
#include "in/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

enum
{
    LONGEST_HEADER = 4096
};

bool rf_npy_probe(const uint8_t *bytes, size_t size)
{
    return size >= 6 && memcmp(bytes, "\x93NUMPY", 6) == 0;
}

// Where a key's value begins, or NULL.
static const char *value_of(const char *text, const char *key)
{
    const char *found = strstr(text, key);
    found = found ? strchr(found + strlen(key), ':') : NULL;
    if (!found)
        return NULL;
    ++found;
    return found + strspn(found, " ");
}

static bool parse_descr(const char *value, RfNpyHeader *out)
{
    if (!value || (*value != '\'' && *value != '"'))
        return false;
    static const struct
    {
        const char *code;
        RfNumberKind kind;
    } kinds[] = {{"f2", RF_NUMBER_F16}, {"f4", RF_NUMBER_F32}, {"f8", RF_NUMBER_F64}, {"i1", RF_NUMBER_I8},
                 {"u1", RF_NUMBER_U8},  {"i2", RF_NUMBER_I16}, {"u2", RF_NUMBER_U16}, {"i4", RF_NUMBER_I32},
                 {"u4", RF_NUMBER_U32}, {"i8", RF_NUMBER_I64}, {"u8", RF_NUMBER_U64}};
    if (!strchr("<>|=", value[1]) || value[1] == '\0')
        return false;
    out->big_endian = value[1] == '>';
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; ++i)
        if (strncmp(value + 2, kinds[i].code, 2) == 0 && value[4] == value[0])
        {
            out->kind = kinds[i].kind;
            return true;
        }
    return false;
}

static bool parse_shape(const char *value, RfNpyHeader *out)
{
    if (!value || *value != '(')
        return false;
    const char *p = value + 1;
    for (;;)
    {
        p += strspn(p, " ,");
        if (*p == ')')
            return true;
        char *end;
        errno = 0;
        if (*p < '0' || *p > '9' || out->dimension_count == RF_NPY_MAX_DIMENSIONS)
            return false;
        out->shape[out->dimension_count++] = strtoull(p, &end, 10);
        if (errno || (*end != ',' && *end != ')' && *end != ' ' && *end != 'L'))
            return false;
        p = end + (*end == 'L');
    }
}

static RfResult parse_literal(const RfFlowSource *source, const char *place, const char *text, RfNpyHeader *out)
{
    const char *order = value_of(text, "fortran_order");
    if (!parse_descr(value_of(text, "descr"), out))
        return rf_fail(RF_UNSUPPORTED, source->path, place,
                       "numbers of this kind are not read: save the array as float32, float64, float16 or integers");
    if (!order || (strncmp(order, "True", 4) != 0 && strncmp(order, "False", 5) != 0))
        return rf_fail(RF_BAD_INPUT, source->path, place, "the header does not say fortran_order");
    out->fortran_order = order[0] == 'T';
    if (!parse_shape(value_of(text, "shape"), out))
        return rf_fail(RF_BAD_INPUT, source->path, place, "the header's shape cannot be read");
    return RF_OK;
}

RfResult rf_npy_header(const RfFlowSource *source, const char *place, RfNpyHeader *out)
{
    *out = (RfNpyHeader){0};
    place = place ? place : "header";
    const uint8_t *bytes = source->bytes;
    if (!rf_npy_probe(bytes, source->size))
        return rf_fail(RF_BAD_INPUT, source->path, place, "not a NumPy array: it does not begin with \\x93NUMPY");
    size_t fixed = source->size > 6 && bytes[6] > 1 ? 12 : 10;
    if (source->size < fixed)
        return rf_fail(RF_BAD_INPUT, source->path, place, "the file ends inside the header (%zu of %zu bytes)",
                       source->size, fixed);
    if (bytes[6] < 1 || bytes[6] > 3)
        return rf_fail(RF_UNSUPPORTED, source->path, place, "version %d of the format is not read: 1 to 3 are",
                       bytes[6]);
    size_t length = fixed == 10 ? rf_load_u16(bytes + 8, false) : rf_load_u32(bytes + 8, false);
    if (length > source->size - fixed)
        return rf_fail(RF_BAD_INPUT, source->path, place, "the file ends inside the header (%zu of %zu bytes)",
                       source->size, fixed + length);
    char text[LONGEST_HEADER];
    if (length >= sizeof text)
        return rf_fail(RF_UNSUPPORTED, source->path, place,
                       "the header has %zu bytes: an array of plain numbers has "
                       "less than %d",
                       length, LONGEST_HEADER);
    memcpy(text, bytes + fixed, length);
    text[length] = '\0';
    out->data_offset = fixed + length;
    return parse_literal(source, place, text, out);
}

static RfResult wrong_shape(const RfFlowSource *source, const char *place, const RfNpyHeader *header, int components)
{
    char text[192] = "";
    for (int i = 0; i < header->dimension_count; ++i)
        snprintf(text + strlen(text), sizeof text - strlen(text), "%s%llu", i ? ", " : "",
                 (unsigned long long)header->shape[i]);
    return rf_fail(RF_BAD_INPUT, source->path, place,
                   "the shape is [%s]: a %s has [height, width%s] or [moments, "
                   "height, width%s]",
                   text, components == 2 ? "flow" : "component", components == 2 ? ", 2" : "",
                   components == 2 ? ", 2" : "");
}

RfResult rf_npy_shape(const RfFlowSource *source, const char *place, const RfNpyHeader *header, int components,
                      uint64_t shape[4])
{
    place = place ? place : "header";
    int n = header->dimension_count - (components == 2);
    if ((n != 2 && n != 3) || (components == 2 && header->shape[n] != 2))
        return wrong_shape(source, place, header, components);
    shape[0] = n == 3 ? header->shape[0] : 1;
    shape[1] = header->shape[n - 2];
    shape[2] = header->shape[n - 1];
    shape[3] = (uint64_t)components;
    if (shape[0] < 1 || shape[0] > 1000000 || shape[1] < 1 || shape[1] > RF_MAX_SIZE || shape[2] < 1 ||
        shape[2] > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, source->path, place,
                       "%llu moments of %llu x %llu cells: each side must be 1 to %d, moments 1 to 1000000",
                       (unsigned long long)shape[0], (unsigned long long)shape[2], (unsigned long long)shape[1],
                       RF_MAX_SIZE);
    // At most 2^20 * 2^15 * 2^15 * 2 * 8 = 2^54 bytes: no overflow.
    uint64_t wanted = shape[0] * shape[1] * shape[2] * shape[3] * (uint64_t)rf_number_size(header->kind);
    if (wanted > source->size - header->data_offset)
        return rf_fail(RF_BAD_INPUT, source->path, place, "the shape needs %llu bytes of numbers, %zu are there",
                       (unsigned long long)wanted, source->size - header->data_offset);
    return RF_OK;
}

void rf_npy_copy(const RfFlowSource *source, const RfNpyHeader *header, const uint64_t shape[4], uint64_t moment,
                 size_t step, float *out)
{
    size_t stride[4] = {0}, bytes = (size_t)rf_number_size(header->kind);
    for (int i = 0; i < 4; ++i)
    {
        int axis = header->fortran_order ? i : 3 - i;
        stride[axis] = bytes;
        bytes *= (size_t)shape[axis];
    }
    const uint8_t *base = source->bytes + header->data_offset + moment * stride[0];
    for (size_t y = 0; y < shape[1]; ++y)
        for (size_t x = 0; x < shape[2]; ++x, out += step)
            for (size_t c = 0; c < shape[3]; ++c)
                out[c] = (float)rf_load_number(base + y * stride[1] + x * stride[2] + c * stride[3], header->kind,
                                               header->big_endian);
}

// A file may change between two moments.
static RfResult check_moment(const RfFlowSource *source, const uint64_t shape[4], int moment)
{
    if ((uint64_t)moment < shape[0])
        return RF_OK;
    return rf_fail(RF_BAD_INPUT, source->path, "header", "has %llu moments now: it changed while it was read",
                   (unsigned long long)shape[0]);
}

static void say_conventions(RfFlowMoment *out)
{
    snprintf(out->conventions, sizeof out->conventions, "cells a frame, y down, as in the file");
}

RfResult rf_npy_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    RfNpyHeader header;
    uint64_t shape[4];
    RF_TRY(rf_npy_header(source, NULL, &header));
    RF_TRY(rf_npy_shape(source, NULL, &header, 2, shape));
    RF_TRY(check_moment(source, shape, moment));
    RF_TRY(rf_flow_moment_create(source, (int64_t)shape[2], (int64_t)shape[1], out));
    rf_npy_copy(source, &header, shape, (uint64_t)moment, 2, out->field.velocity);
    out->moment_count = (int)shape[0];
    say_conventions(out);
    return RF_OK;
}

// ---- a file of many moments, of which one is read ------------------------------------------------------------------

static RfResult read_part(int file, const char *path, uint64_t offset, void *out, size_t size)
{
    uint8_t *p = out;
    while (size > 0)
    {
        ssize_t got = pread(file, p, size, (off_t)offset);
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return rf_fail(RF_UNREADABLE, path, NULL, "cannot be read: %s",
                           got < 0 ? strerror(errno) : "it became shorter meanwhile");
        p += got;
        offset += (uint64_t)got;
        size -= (size_t)got;
    }
    return RF_OK;
}

// In C order a moment is one stretch of the file.
static RfResult read_stretch(int file, const RfFlowSource *source, const RfNpyHeader *header, const uint64_t shape[4],
                             int moment, RfFlowMoment *out)
{
    RF_TRY(rf_flow_moment_create(source, (int64_t)shape[2], (int64_t)shape[1], out));
    size_t size = (size_t)(shape[1] * shape[2] * 2) * (size_t)rf_number_size(header->kind);
    uint8_t *bytes = rf_allocate(size, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    RfResult result = read_part(file, source->path, header->data_offset + (uint64_t)moment * size, bytes, size);
    if (result == RF_OK)
    {
        RfNpyHeader here = *header;
        here.data_offset = 0;
        rf_npy_copy(&(RfFlowSource){source->path, bytes, size, source->options}, &here, shape, 0, 2,
                    out->field.velocity);
    }
    rf_release(bytes);
    out->moment_count = (int)shape[0];
    say_conventions(out);
    return result;
}

static RfResult read_whole(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    RfBytes bytes;
    RF_TRY(rf_bytes_read(source->path, 0, &bytes));
    RfResult result = rf_npy_read(&(RfFlowSource){source->path, bytes.data, bytes.size, source->options}, moment, out);
    rf_bytes_free(&bytes);
    return result;
}

static RfResult read_open_file(int file, const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    struct stat status;
    if (fstat(file, &status) != 0 || !S_ISREG(status.st_mode))
        return rf_fail(RF_UNREADABLE, source->path, NULL, "is not a regular file");
    // The header's reader looks at no more than this, whatever size it is told.
    uint8_t head[2 * LONGEST_HEADER] = {0};
    RfFlowSource start = {source->path, head, (size_t)status.st_size, source->options};
    RfNpyHeader header;
    uint64_t shape[4];
    RF_TRY(read_part(file, source->path, 0, head, start.size < sizeof head ? start.size : sizeof head));
    RF_TRY(rf_npy_header(&start, NULL, &header));
    RF_TRY(rf_npy_shape(&start, NULL, &header, 2, shape));
    if (header.fortran_order)
        return read_whole(source, moment, out);
    RF_TRY(check_moment(source, shape, moment));
    return read_stretch(file, source, &header, shape, moment, out);
}

static RfResult npy_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    if (source->bytes)
        return rf_npy_read(source, moment, out);
    int file = open(source->path, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return rf_fail(RF_UNREADABLE, source->path, NULL, "cannot be opened: %s", strerror(errno));
    RfResult result = read_open_file(file, source, moment, out);
    close(file);
    return result;
}

const RfFlowFormat rf_flow_format_npy = {
    .name = "npy", .extensions = "npy", .probe = rf_npy_probe, .read = npy_read, .by_path = true};
