// SPDX-License-Identifier: Apache-2.0
#include "flow_files.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

void test_bytes_add(TestBytes *bytes, const void *data, size_t size)
{
    if (size > sizeof bytes->data - bytes->size)
        abort();
    memcpy(bytes->data + bytes->size, data, size);
    bytes->size += size;
}

void test_bytes_text(TestBytes *bytes, const char *format, ...)
{
    char text[2048];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= sizeof text)
        abort();
    test_bytes_add(bytes, text, (size_t)length);
}

static void add_integer(TestBytes *bytes, uint64_t x, int size, bool big)
{
    for (int i = 0; i < size; ++i)
    {
        int place = big ? size - 1 - i : i;
        uint8_t byte = place < 8 ? (uint8_t)(x >> 8 * place) : 0;
        test_bytes_add(bytes, &byte, 1);
    }
}

static void add_float(TestBytes *bytes, double value, int size, bool big)
{
    uint64_t bits = 0;
    float f = (float)value;
    if (size == 8)
        memcpy(&bits, &value, 8);
    else if (size == 4)
    {
        uint32_t b;
        memcpy(&b, &f, 4);
        bits = b;
    }
    else if (value != 0)
    {
        int exponent;
        double mantissa = frexp(fabs(value), &exponent);
        bits = (value < 0 ? 0x8000u : 0) | (uint64_t)(exponent + 14) << 10 | (uint64_t)((mantissa * 2 - 1) * 1024);
    }
    add_integer(bytes, bits, size, big);
}

void test_flo(TestBytes *out, int width, int height, const float *uv)
{
    out->size = 0;
    test_bytes_text(out, "PIEH");
    add_integer(out, (uint64_t)width, 4, false);
    add_integer(out, (uint64_t)height, 4, false);
    for (int k = 0; k < 2 * width * height; ++k)
        add_float(out, (double)uv[k], 4, false);
}

void test_npy(TestBytes *out, const char *descr, bool fortran, const char *shape, const double *numbers, int count)
{
    char text[256];
    out->size = 0;
    int length = snprintf(text, sizeof text, "{'descr': '%s', 'fortran_order': %s, 'shape': (%s), }\n", descr,
                          fortran ? "True" : "False", shape);
    test_bytes_add(out, "\x93NUMPY\1\0", 8);
    add_integer(out, (uint64_t)length, 2, false);
    test_bytes_add(out, text, (size_t)length);
    for (int k = 0; k < count; ++k)
        add_float(out, numbers[k], descr[2] - '0', descr[0] == '>');
}

// ---- zip ---------------------------------------------------------------------------------------------------------

static void add_zip_fields(TestBytes *out, int method, uint32_t crc, size_t packed, size_t size, size_t name)
{
    add_integer(out, 20, 2, false);
    add_integer(out, 0, 2, false);
    add_integer(out, (uint64_t)method, 2, false);
    add_integer(out, 0, 4, false);
    add_integer(out, crc, 4, false);
    add_integer(out, packed, 4, false);
    add_integer(out, size, 4, false);
    add_integer(out, name, 2, false);
    add_integer(out, 0, 2, false);
}

static size_t pack(const TestBytes *content, bool deflated, uint8_t *out, size_t room)
{
    if (!deflated)
    {
        memcpy(out, content->data, content->size);
        return content->size;
    }
    z_stream stream = {0};
    deflateInit2(&stream, 9, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    stream.next_in = (Bytef *)(uintptr_t)content->data;
    stream.avail_in = (uInt)content->size;
    stream.next_out = out;
    stream.avail_out = (uInt)room;
    deflate(&stream, Z_FINISH);
    deflateEnd(&stream);
    return room - stream.avail_out;
}

void test_zip(TestBytes *out, const TestZipEntry *entries, int count, bool deflated)
{
    static uint8_t packed[sizeof out->data];
    static TestBytes directory;
    out->size = directory.size = 0;
    for (int i = 0; i < count; ++i)
    {
        const TestBytes *content = entries[i].content;
        size_t size = pack(content, deflated, packed, sizeof packed), name = strlen(entries[i].name);
        uint32_t crc = (uint32_t)crc32_z(0, content->data, content->size);
        test_bytes_add(&directory, "PK\1\2\x14\0", 6);
        add_zip_fields(&directory, deflated ? 8 : 0, crc, size, content->size, name);
        add_integer(&directory, 0, 2 + 2 + 2 + 4, false);
        add_integer(&directory, out->size, 4, false);
        test_bytes_add(&directory, entries[i].name, name);
        test_bytes_add(out, "PK\3\4", 4);
        add_zip_fields(out, deflated ? 8 : 0, crc, size, content->size, name);
        test_bytes_add(out, entries[i].name, name);
        test_bytes_add(out, packed, size);
    }
    size_t start = out->size;
    test_bytes_add(out, directory.data, directory.size);
    test_bytes_add(out, "PK\5\6\0\0\0\0", 8);
    add_integer(out, (uint64_t)count, 2, false);
    add_integer(out, (uint64_t)count, 2, false);
    add_integer(out, directory.size, 4, false);
    add_integer(out, start, 4, false);
    add_integer(out, 0, 2, false);
}

// ---- NetCDF ------------------------------------------------------------------------------------------------------

static void add_padded(TestBytes *out, const char *text)
{
    size_t length = strlen(text);
    add_integer(out, length, 4, true);
    test_bytes_add(out, text, length);
    add_integer(out, 0, (int)((4 - length % 4) % 4), true);
}

static void add_text_attribute(TestBytes *out, const char *name, const char *text)
{
    add_padded(out, name);
    add_integer(out, 2, 4, true);
    add_padded(out, text);
}

static void add_number_attribute(TestBytes *out, const char *name, double value, bool as_short)
{
    add_padded(out, name);
    add_integer(out, as_short ? 3 : 5, 4, true);
    add_integer(out, 1, 4, true);
    if (as_short)
        add_integer(out, (uint64_t)(int64_t)value << 16, 4, true);
    else
        add_float(out, value, 4, true);
}

static void add_attributes(TestBytes *out, const TestNcVariable *v)
{
    int count = (v->units != NULL) + (v->standard_name != NULL) + v->has_fill + 2 * v->packed;
    add_integer(out, count ? 12 : 0, 4, true);
    add_integer(out, (uint64_t)count, 4, true);
    if (v->units)
        add_text_attribute(out, "units", v->units);
    if (v->standard_name)
        add_text_attribute(out, "standard_name", v->standard_name);
    if (v->has_fill)
        add_number_attribute(out, "_FillValue", v->fill, v->packed);
    if (v->packed)
    {
        add_number_attribute(out, "scale_factor", v->scale, false);
        add_number_attribute(out, "add_offset", v->offset, false);
    }
}

static int count_values(const TestNcVariable *v, const int *sizes)
{
    int count = 1;
    for (int d = 0; d < v->dimension_count; ++d)
        count *= sizes[v->dimensions[d]];
    return count;
}

static int value_bytes(const TestNcVariable *v, const int *sizes)
{
    return (count_values(v, sizes) * (v->packed ? 2 : 4) + 3) / 4 * 4;
}

static void add_nc_header(TestBytes *out, const char *const *names, const int *sizes, int dimension_count,
                          const TestNcVariable *variables, int variable_count, size_t begin)
{
    out->size = 0;
    test_bytes_add(out, "CDF\1\0\0\0\0", 8);
    add_integer(out, 10, 4, true);
    add_integer(out, (uint64_t)dimension_count, 4, true);
    for (int d = 0; d < dimension_count; ++d)
    {
        add_padded(out, names[d]);
        add_integer(out, (uint64_t)sizes[d], 4, true);
    }
    add_integer(out, 0, 8, true);
    add_integer(out, 11, 4, true);
    add_integer(out, (uint64_t)variable_count, 4, true);
    for (int i = 0; i < variable_count; ++i)
    {
        const TestNcVariable *v = &variables[i];
        add_padded(out, v->name);
        add_integer(out, (uint64_t)v->dimension_count, 4, true);
        for (int d = 0; d < v->dimension_count; ++d)
            add_integer(out, (uint64_t)v->dimensions[d], 4, true);
        add_attributes(out, v);
        add_integer(out, v->packed ? 3 : 5, 4, true);
        add_integer(out, (uint64_t)value_bytes(v, sizes), 4, true);
        add_integer(out, begin, 4, true);
        begin += (size_t)value_bytes(v, sizes);
    }
}

void test_nc(TestBytes *out, const char *const *dimension_names, const int *dimension_sizes, int dimension_count,
             const TestNcVariable *variables, int variable_count)
{
    // Once to learn how long the header is.
    for (int round = 0; round < 2; ++round)
        add_nc_header(out, dimension_names, dimension_sizes, dimension_count, variables, variable_count, out->size);
    for (int i = 0; i < variable_count; ++i)
    {
        const TestNcVariable *v = &variables[i];
        int count = count_values(v, dimension_sizes);
        for (int k = 0; k < count; ++k)
        {
            if (v->packed)
                add_integer(out, (uint64_t)(int64_t)v->values[k], 2, true);
            else
                add_float(out, v->values[k], 4, true);
        }
        add_integer(out, 0, value_bytes(v, dimension_sizes) - count * (v->packed ? 2 : 4), true);
    }
}

// ---- VTK ---------------------------------------------------------------------------------------------------------

static void add_base64(TestBytes *out, const uint8_t *data, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3)
    {
        uint32_t quad = (uint32_t)data[i] << 16 | (i + 1 < size ? (uint32_t)data[i + 1] << 8 : 0) |
                        (i + 2 < size ? data[i + 2] : 0);
        char text[4] = {digits[quad >> 18], digits[quad >> 12 & 63], i + 1 < size ? digits[quad >> 6 & 63] : '=',
                        i + 2 < size ? digits[quad & 63] : '='};
        test_bytes_add(out, text, 4);
    }
}

// Header and data as they go raw into the file. *head is the length of the header, which base64 codes apart if the
// data are compressed.
static void make_block(const TestVti *vti, TestBytes *block, size_t *head)
{
    static TestBytes plain;
    int count = vti->width * vti->height * vti->depth * vti->components, word = vti->wide ? 8 : 4;
    plain.size = block->size = 0;
    for (int k = 0; k < count; ++k)
        add_float(&plain, vti->values[k], strcmp(vti->type, "Float64") == 0 ? 8 : 4, vti->big_endian);
    *head = 0;
    if (!vti->compressed)
    {
        add_integer(block, plain.size, word, vti->big_endian);
        test_bytes_add(block, plain.data, plain.size);
        return;
    }
    // Two blocks, the second shorter.
    size_t size = plain.size / 2 + 1, sizes[2] = {size, plain.size - size};
    static uint8_t packed[2][1 << 15];
    uLongf lengths[2] = {sizeof packed[0], sizeof packed[1]};
    for (int i = 0; i < 2; ++i)
        compress(packed[i], &lengths[i], plain.data + (size_t)i * size, sizes[i]);
    const uint64_t words[5] = {2, sizes[0], sizes[1], lengths[0], lengths[1]};
    for (int i = 0; i < 5; ++i)
        add_integer(block, words[i], word, vti->big_endian);
    *head = block->size;
    for (int i = 0; i < 2; ++i)
        test_bytes_add(block, packed[i], lengths[i]);
}

void test_vti(TestBytes *out, const TestVti *vti)
{
    static TestBytes block;
    size_t head;
    int last[3] = {vti->width - vti->points, vti->height - vti->points, vti->depth > 1 ? vti->depth - vti->points : 0};
    const char *section = vti->points ? "PointData" : "CellData";
    bool inside = strcmp(vti->coding, "ascii") == 0 || strcmp(vti->coding, "binary") == 0;
    make_block(vti, &block, &head);
    out->size = 0;
    test_bytes_text(out,
                    "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" byte_order=\"%s\" header_type=\"%s\"%s>\n",
                    vti->big_endian ? "BigEndian" : "LittleEndian", vti->wide ? "UInt64" : "UInt32",
                    vti->compressed ? " compressor=\"vtkZLibDataCompressor\"" : "");
    test_bytes_text(out, "<ImageData WholeExtent=\"0 %d 0 %d 0 %d\" Origin=\"0 0 0\" Spacing=\"%g %g 1\">\n", last[0],
                    last[1], last[2], vti->spacing[0], vti->spacing[1]);
    test_bytes_text(out, "<Piece Extent=\"0 %d 0 %d 0 %d\"><%s><DataArray type=\"%s\" Name=\"%s\" ", last[0], last[1],
                    last[2], section, vti->type, vti->name);
    test_bytes_text(out, "NumberOfComponents=\"%d\" format=\"%s\" offset=\"0\">", vti->components,
                    inside ? vti->coding : "appended");
    test_bytes_text(out, "<InformationKey name=\"L2_NORM_RANGE\">1</InformationKey>\n");
    if (strcmp(vti->coding, "ascii") == 0)
        for (int k = 0; k < vti->width * vti->height * vti->depth * vti->components; ++k)
            test_bytes_text(out, "%.9g ", vti->values[k]);
    else if (inside)
    {
        add_base64(out, block.data, head);
        add_base64(out, block.data + head, block.size - head);
    }
    test_bytes_text(out, "\n</DataArray></%s></Piece></ImageData>\n", section);
    if (!inside)
    {
        bool raw = strcmp(vti->coding, "raw") == 0;
        test_bytes_text(out, "<AppendedData encoding=\"%s\">\n_", vti->coding);
        if (raw)
            test_bytes_add(out, block.data, block.size);
        else
        {
            add_base64(out, block.data, head);
            add_base64(out, block.data + head, block.size - head);
        }
        test_bytes_text(out, "\n</AppendedData>\n");
    }
    test_bytes_text(out, "</VTKFile>\n");
}

// ---- PIV ---------------------------------------------------------------------------------------------------------

void test_vec(TestBytes *out)
{
    out->size = 0;
    test_bytes_text(out, "TITLE=\"a.vec\" VARIABLES=\"X pixel\", \"Y pixel\", \"U pixel\", \"V pixel\", \"CHC\", "
                         "DATASETAUXDATA LengthUnit=\"pixel\" DATASETAUXDATA OriginInImageY=\"100.0\" ZONE I=3, J=2, "
                         "F=POINT\r\n");
    for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 3; ++i)
        {
            bool bad = i == 1 && j == 0;
            test_bytes_text(out, "%d.0, %d.0, %d.0, %d.0, %d\r\n", 16 + 32 * i, 48 - 32 * j, bad ? 999 : 32,
                            bad ? 999 : 16, bad ? -1 : 1);
        }
}
