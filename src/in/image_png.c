// SPDX-License-Identifier: Apache-2.0
// PNG (ISO/IEC 15948) through libpng: every colour type and depth, interlaced or not. Palettes and 1, 2 and 4 bit are
// expanded, tRNS becomes alpha; gamma and profile chunks are not looked at, as nearly every file means sRGB whatever
// they say.
//
// libpng leaves by longjmp. What must outlive the jump lives in PngReading, which is made by the caller of the function
// that sets the jump.
#include "in/image.h"

#include "core/memory.h"
#include "core/result.h"

#include <png.h>
#include <stdio.h>
#include <string.h>

enum
{
    // Signature and IHDR chunk.
    HEADER_SIZE = 33,
    // Deflate makes at most 258 bytes of 2 bits; 1032 is the limit in practice and in theory.
    DEFLATE_RATIO = 1032
};

static const char g_signature[] = "\x89PNG\r\n\x1a\n";

typedef struct PngReading
{
    const char *file;
    const uint8_t *bytes;
    size_t size, position;
    // The row being read; -1 before the first.
    int row;
    RfImage *image;
    uint8_t *raw;
    RfResult result;
    png_structp png;
    png_infop info;
} PngReading;

static void *png_allocate(png_structp png, png_alloc_size_t size)
{
    (void)png;
    return rf_allocate(size, 1);
}

static void png_release(png_structp png, void *memory)
{
    (void)png;
    rf_release(memory);
}

static void place_of(const PngReading *reading, char place[64])
{
    if (reading->row >= 0)
        snprintf(place, 64, "row %d", reading->row);
    else
        snprintf(place, 64, "byte %zu", reading->position);
}

_Noreturn static void on_error(png_structp png, const char *message)
{
    PngReading *reading = png_get_error_ptr(png);
    if (reading->result == RF_OK)
    {
        char place[64];
        place_of(reading, place);
        reading->result = rf_fail(RF_BAD_INPUT, reading->file, place, "broken PNG: %s; save or copy it again", message);
    }
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, const char *message)
{
    (void)png;
    (void)message;
}

static void read_bytes(png_structp png, png_bytep to, size_t count)
{
    PngReading *reading = png_get_io_ptr(png);
    if (count > reading->size - reading->position)
    {
        char place[64];
        place_of(reading, place);
        reading->result =
            rf_fail(RF_BAD_INPUT, reading->file, place,
                    "broken PNG: the file ends after %zu bytes, inside its image; copy it again", reading->size);
        png_error(png, "end of file");
    }
    memcpy(to, reading->bytes + reading->position, count);
    reading->position += count;
}

static void set_up(PngReading *reading)
{
    png_set_read_fn(reading->png, reading, read_bytes);
    // Sizes are checked here, with our message; the chunks that matter are the critical ones and tRNS.
    png_set_user_limits(reading->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    png_set_keep_unknown_chunks(reading->png, PNG_HANDLE_CHUNK_NEVER, NULL, -1);
    png_read_info(reading->png, reading->info);
}

static RfResult make_image(PngReading *reading)
{
    int64_t width = png_get_image_width(reading->png, reading->info);
    int64_t height = png_get_image_height(reading->png, reading->info);
    RF_TRY(rf_image_check_size(reading->file, width, height, 1));
    int64_t stored = height * (int64_t)png_get_rowbytes(reading->png, reading->info);
    RF_TRY(rf_image_check_plausible(reading->file, stored, reading->size, DEFLATE_RATIO));

    png_set_expand(reading->png);
    if (png_get_bit_depth(reading->png, reading->info) == 16)
        png_set_swap(reading->png);
    int passes = png_set_interlace_handling(reading->png);
    png_read_update_info(reading->png, reading->info);

    int channels = png_get_channels(reading->png, reading->info);
    size_t row_bytes = png_get_rowbytes(reading->png, reading->info);
    RF_TRY(rf_image_check_size(reading->file, width, height, channels));
    RF_TRY(rf_image_create((int)width, (int)height, channels, &reading->image));
    reading->raw = rf_allocate_zero((size_t)height, row_bytes);
    if (!reading->raw)
        return RF_OUT_OF_MEMORY;
    for (int pass = 0; pass < passes; ++pass)
    {
        for (reading->row = 0; reading->row < height; ++reading->row)
            png_read_row(reading->png, reading->raw + (size_t)reading->row * row_bytes, NULL);
    }
    // Reads on to IEND, so that what follows the last row is checked as well.
    png_read_end(reading->png, NULL);
    return RF_OK;
}

static void to_float(const PngReading *reading, bool deep)
{
    RfImageView view = rf_image_view(reading->image);
    size_t count = (size_t)view.width * (size_t)view.height * (size_t)view.channels;
    if (deep)
    {
        const uint16_t *samples = (const uint16_t *)(const void *)reading->raw;
        for (size_t i = 0; i < count; ++i)
            view.pixels[i] = (float)samples[i] / 65535.0f;
    }
    else
    {
        for (size_t i = 0; i < count; ++i)
            view.pixels[i] = (float)reading->raw[i] / 255.0f;
    }
}

static void decode_guarded(PngReading *reading)
{
    if (setjmp(png_jmpbuf(reading->png)) != 0)
        return;
    set_up(reading);
    RfResult result = make_image(reading);
    if (result != RF_OK)
    {
        reading->result = result;
        return;
    }
    bool deep = png_get_bit_depth(reading->png, reading->info) == 16;
    to_float(reading, deep);
    rf_image_set_origin(reading->image, deep ? RF_SAMPLE_U16 : RF_SAMPLE_U8, RF_ENCODING_SRGB);
}

static bool probe_png(const uint8_t *bytes, size_t size)
{
    return rf_image_has_signature(bytes, size, g_signature, 8);
}

static RfResult decode_png(const char *file, const uint8_t *bytes, size_t size, RfImage **out)
{
    *out = NULL;
    if (!probe_png(bytes, size))
        return rf_fail(RF_BAD_INPUT, file, "header", "not a PNG: its signature is missing");
    if (size < HEADER_SIZE)
        return rf_fail(RF_BAD_INPUT, file, NULL, "not a PNG: the file ends inside the header (%zu of %d bytes)", size,
                       HEADER_SIZE);
    PngReading reading = {.file = file, .bytes = bytes, .size = size, .row = -1};
    reading.png = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, &reading, on_error, on_warning, NULL, png_allocate,
                                           png_release);
    reading.info = reading.png ? png_create_info_struct(reading.png) : NULL;
    if (!reading.info)
        reading.result = RF_OUT_OF_MEMORY;
    else
        decode_guarded(&reading);
    png_destroy_read_struct(&reading.png, &reading.info, NULL);
    rf_release(reading.raw);
    if (reading.result != RF_OK)
    {
        rf_image_destroy(reading.image);
        return reading.result;
    }
    *out = reading.image;
    return RF_OK;
}

const RfImageReader rf_png_reader = {"PNG", "png", probe_png, decode_png};
