// SPDX-License-Identifier: Apache-2.0
// The numbers of a VTK XML array. Binary ones, inline or appended, raw or as base64, are a header and the data:
//
//     uncompressed   bytes | data
//     zlib           blocks | bytes a block | bytes of the last, or 0 for a full one | compressed bytes of each | data
//
// with 32 or 64 bit words. In base64 the header and the data may each be padded, so a quad that ends in = does not end
// the stream: the bytes of all quads, put together, read the same as raw ones.
#include "in/text.h"
#include "in/vtk_xml.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <string.h>
#include <zlib.h>

/// No zlib stream expands more than 1032 times.
static const uint64_t most_expansion = 1040;

typedef struct Stream
{
    const RfVtkImage *image;
    const RfVtkArray *array;
    const uint8_t *bytes;
    size_t size;
    /// To be released; NULL if `bytes` lies in the file.
    uint8_t *owned;
} Stream;

static RfResult broken(const RfVtkImage *image, const RfVtkArray *array, const char *what)
{
    char place[RF_VTK_NAME + 8];
    snprintf(place, sizeof place, "array %s", array->name);
    return rf_fail(RF_BAD_INPUT, image->path, place, "%s", what);
}

// ---- from the file to bytes --------------------------------------------------------------------------------------

static int base64_value(uint8_t c)
{
    if (c >= 'A' && c <= 'Z')
        return c - 'A';
    if (c >= 'a' && c <= 'z')
        return c - 'a' + 26;
    if (c >= '0' && c <= '9')
        return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : -1;
}

static size_t decode_base64(const uint8_t *text, size_t size, uint8_t *out)
{
    size_t written = 0;
    uint32_t quad = 0;
    int digits = 0, padding = 0;
    for (size_t i = 0; i < size; ++i)
    {
        int value = base64_value(text[i]);
        bool pad = text[i] == '=';
        if (strchr(" \t\r\n", text[i]) && text[i])
            continue;
        if (value < 0 && !pad)
            break;
        quad = quad << 6 | (uint32_t)(pad ? 0 : value);
        padding += pad;
        if (++digits < 4)
            continue;
        for (int k = 0; k < 3 - padding; ++k)
            out[written++] = (uint8_t)(quad >> (16 - 8 * k));
        quad = 0;
        digits = padding = 0;
    }
    return written;
}

static RfResult open_stream(const RfVtkImage *image, const RfVtkArray *array, Stream *out)
{
    *out = (Stream){.image = image, .array = array};
    size_t begin = array->begin, end = array->end;
    if (array->coding == RF_VTK_APPENDED)
    {
        if (!image->appended || begin >= image->size - image->appended)
            return broken(image, array, "its appended data lie behind the end of the file: the file is cut");
        begin += image->appended;
        end = image->size;
    }
    out->bytes = image->bytes + begin;
    out->size = end - begin;
    if (array->coding == RF_VTK_APPENDED && !image->appended_base64)
        return RF_OK;
    out->owned = rf_allocate(out->size / 4 * 3 + 3, 1);
    if (!out->owned)
        return RF_OUT_OF_MEMORY;
    out->size = decode_base64(out->bytes, out->size, out->owned);
    out->bytes = out->owned;
    return RF_OK;
}

static bool take_word(Stream *stream, uint64_t *out)
{
    bool big = stream->image->big_endian, wide = stream->image->wide_headers;
    size_t size = wide ? 8 : 4;
    if (stream->size < size)
        return false;
    *out = wide ? rf_load_u64(stream->bytes, big) : rf_load_u32(stream->bytes, big);
    stream->bytes += size;
    stream->size -= size;
    return true;
}

// ---- zlib --------------------------------------------------------------------------------------------------------

static bool inflate_block(const uint8_t *from, uint64_t from_size, uint8_t *to, uint64_t to_size)
{
    uLongf written = (uLongf)to_size;
    return uncompress(to, &written, from, (uLong)from_size) == Z_OK && written == to_size;
}

static RfResult inflate_blocks(Stream *stream, uint64_t blocks, uint64_t block, uint64_t last, uint8_t *out)
{
    size_t word = stream->image->wide_headers ? 8 : 4;
    Stream sizes = *stream;
    stream->bytes += blocks * word;
    stream->size -= (size_t)blocks * word;
    for (uint64_t i = 0; i < blocks; ++i)
    {
        uint64_t packed = 0, full = i + 1 == blocks && last ? last : block;
        take_word(&sizes, &packed);
        if (packed > stream->size || !inflate_block(stream->bytes, packed, out, full))
            return broken(stream->image, stream->array, "its compressed data are cut or damaged");
        stream->bytes += packed;
        stream->size -= (size_t)packed;
        out += full;
    }
    return RF_OK;
}

static RfResult take_compressed(Stream *stream, size_t wanted, uint8_t **out)
{
    uint64_t blocks = 0, block = 0, last = 0;
    size_t word = stream->image->wide_headers ? 8 : 4;
    if (!take_word(stream, &blocks) || !take_word(stream, &block) || !take_word(stream, &last) || blocks == 0 ||
        blocks > stream->size / word || block == 0 || block > wanted || last > block)
        return broken(stream->image, stream->array, "its compressed data are cut or damaged");
    if (blocks - 1 > wanted / block)
        return broken(stream->image, stream->array, "it holds more numbers than the extent says");
    uint64_t total = (blocks - 1) * block + (last ? last : block);
    if (total != wanted)
        return broken(stream->image, stream->array, "it does not hold as many numbers as the extent says");
    if (stream->size * most_expansion < wanted)
        return broken(stream->image, stream->array, "its compressed data are cut");
    *out = rf_allocate(wanted, 1);
    if (!*out)
        return RF_OUT_OF_MEMORY;
    return inflate_blocks(stream, blocks, block, last, *out);
}

// ---- to numbers --------------------------------------------------------------------------------------------------

static RfResult read_ascii(const RfVtkImage *image, const RfVtkArray *array, size_t count, float **out)
{
    const char *text = (const char *)image->bytes;
    RfText numbers = {text + array->begin, text + array->end};
    if (count > (array->end - array->begin + 1) / 2)
        return broken(image, array, "it does not hold as many numbers as the extent says");
    *out = rf_allocate(count, sizeof **out);
    if (!*out)
        return RF_OUT_OF_MEMORY;
    for (size_t k = 0; k < count; ++k)
    {
        double value;
        rf_text_skip(&numbers, "");
        if (!rf_text_number(&numbers, &value))
            return broken(image, array, "it does not hold as many numbers as the extent says");
        (*out)[k] = (float)value;
    }
    return RF_OK;
}

static RfResult read_binary(Stream *stream, size_t count, float **out)
{
    RfNumberKind kind = stream->array->kind;
    size_t step = (size_t)rf_number_size(kind), wanted = count * step;
    uint8_t *inflated = NULL;
    uint64_t told = 0;
    RfResult result = RF_OK;
    if (stream->image->compressed)
        result = take_compressed(stream, wanted, &inflated);
    else if (!take_word(stream, &told) || told != wanted || stream->size < wanted)
        result = broken(stream->image, stream->array,
                        told != wanted ? "it does not hold as many numbers as the extent says" : "its data are cut");
    if (result == RF_OK && (*out = rf_allocate(count, sizeof **out)) == NULL)
        result = RF_OUT_OF_MEMORY;
    const uint8_t *bytes = inflated ? inflated : stream->bytes;
    for (size_t k = 0; result == RF_OK && k < count; ++k)
        (*out)[k] = (float)rf_load_number(bytes + k * step, kind, stream->image->big_endian);
    rf_release(inflated);
    return result;
}

RfResult rf_vtk_array_read(const RfVtkImage *image, const RfVtkArray *array, size_t count, float **out)
{
    *out = NULL;
    Stream stream = {0};
    RfResult result;
    if (array->coding == RF_VTK_ASCII)
        result = read_ascii(image, array, count, out);
    else if ((result = open_stream(image, array, &stream)) == RF_OK)
        result = read_binary(&stream, count, out);
    rf_release(stream.owned);
    if (result != RF_OK)
    {
        rf_release(*out);
        *out = NULL;
    }
    return result;
}
