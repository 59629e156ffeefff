// SPDX-License-Identifier: Apache-2.0
// PNG through libpng, 8 or 16 bit, 1 to 4 channels.
//
// Frames are written by the hundred, so speed counts more than the last tenth of size. Textures repeat too little for
// deflate's search for matches to pay: with the filter "average", runs and Huffman codes alone take half the time of
// level 3 (512 x 512 RGB: 7 to 8.5 ms against 15.5) for files 2 to 9 % larger. What is encoded in memory goes into a
// page, one picture at a time: there libpng's own defaults stay.
#include "out/image.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <png.h>
#include <string.h>
#include <zlib.h>

typedef struct PngWriting
{
    /// NULL: into a block of memory.
    RfOutFile *file;
    uint8_t *block;
    size_t size, capacity;
    RfImageView view;
    bool deep;
    uint8_t *row;
    RfResult result;
    png_structp png;
    png_infop info;
} PngWriting;

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

static const char *path_of(const PngWriting *writing)
{
    return writing->file ? writing->file->path : NULL;
}

_Noreturn static void on_error(png_structp png, const char *message)
{
    PngWriting *writing = png_get_error_ptr(png);
    if (writing->result == RF_OK)
        writing->result = rf_fail(RF_WRITE_FAILED, path_of(writing), NULL, "cannot be written as PNG: %s", message);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, const char *message)
{
    (void)png;
    (void)message;
}

static RfResult append(PngWriting *writing, const uint8_t *data, size_t size)
{
    if (size > writing->capacity - writing->size)
    {
        size_t capacity = 2 * (writing->size + size);
        uint8_t *block = rf_reallocate(writing->block, writing->size, capacity, 1);
        if (!block)
            return RF_OUT_OF_MEMORY;
        writing->block = block;
        writing->capacity = capacity;
    }
    memcpy(writing->block + writing->size, data, size);
    writing->size += size;
    return RF_OK;
}

static void write_bytes(png_structp png, png_bytep data, size_t size)
{
    PngWriting *writing = png_get_io_ptr(png);
    writing->result = writing->file ? rf_out_write(writing->file, data, size) : append(writing, data, size);
    if (writing->result != RF_OK)
        png_error(png, "write failed");
}

static void flush_nothing(png_structp png)
{
    (void)png;
}

static void convert_row(const PngWriting *writing, int y)
{
    const float *from = writing->view.pixels + (ptrdiff_t)y * writing->view.row_stride;
    int count = writing->view.width * writing->view.channels;
    if (writing->deep)
    {
        for (int i = 0; i < count; ++i)
        {
            uint32_t value = (uint32_t)(rf_clamp(from[i], 0, 1) * 65535.0f + 0.5f);
            writing->row[2 * i] = (uint8_t)(value >> 8);
            writing->row[2 * i + 1] = (uint8_t)value;
        }
    }
    else
    {
        for (int i = 0; i < count; ++i)
            writing->row[i] = (uint8_t)(rf_clamp(from[i], 0, 1) * 255.0f + 0.5f);
    }
}

static void encode_guarded(PngWriting *writing)
{
    static const int colour_types[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                       PNG_COLOR_TYPE_RGB_ALPHA};
    if (setjmp(png_jmpbuf(writing->png)) != 0)
        return;
    RfImageView view = writing->view;
    png_set_write_fn(writing->png, writing, write_bytes, flush_nothing);
    if (writing->file)
    {
        png_set_compression_level(writing->png, Z_BEST_SPEED);
        png_set_compression_strategy(writing->png, Z_RLE);
        png_set_filter(writing->png, 0, PNG_FILTER_AVG);
    }
    png_set_IHDR(writing->png, writing->info, (png_uint_32)view.width, (png_uint_32)view.height, writing->deep ? 16 : 8,
                 colour_types[view.channels - 1], PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_write_info(writing->png, writing->info);
    for (int y = 0; y < view.height; ++y)
    {
        convert_row(writing, y);
        png_write_row(writing->png, writing->row);
    }
    png_write_end(writing->png, NULL);
}

static RfResult encode(PngWriting *writing, const RfImage *image)
{
    writing->view = rf_image_view(image);
    if (writing->view.channels > 4)
        return rf_fail(RF_UNSUPPORTED, path_of(writing), NULL,
                       "%d channels do not fit a PNG, which has 1 to 4: write .exr", writing->view.channels);
    writing->deep = rf_image_format(image) != RF_SAMPLE_U8;
    writing->png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, writing, on_error, on_warning, NULL, png_allocate,
                                             png_release);
    writing->info = writing->png ? png_create_info_struct(writing->png) : NULL;
    writing->row = rf_allocate((size_t)writing->view.width, (size_t)writing->view.channels * 2);
    if (writing->info && writing->row)
        encode_guarded(writing);
    else
        writing->result = RF_OUT_OF_MEMORY;
    png_destroy_write_struct(&writing->png, &writing->info);
    rf_release(writing->row);
    return writing->result;
}

static RfResult encode_file(RfOutFile *file, const RfImage *image)
{
    PngWriting writing = {.file = file};
    return encode(&writing, image);
}

RfResult rf_image_encode_png(const RfImage *image, void **block, size_t *size)
{
    RF_REQUIRE(image && block && size, "rf_image_encode_png: NULL argument");
    PngWriting writing = {0};
    RfResult result = encode(&writing, image);
    if (result != RF_OK)
    {
        rf_release(writing.block);
        writing = (PngWriting){0};
    }
    *block = writing.block;
    *size = writing.size;
    return result;
}

const RfImageWriter rf_png_writer = {"png", encode_file};
