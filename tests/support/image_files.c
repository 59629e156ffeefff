// SPDX-License-Identifier: Apache-2.0
#include "support/image_files.h"

#include <OpenEXR/openexr.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <jpeglib.h>
#include <png.h>

void test_bytes_free(TestBytes bytes)
{
    free(bytes.data);
}

unsigned test_sample(int x, int y, int c, unsigned limit)
{
    return (unsigned)(x * 7 + y * 131 + c * 317 + x * y * 3) % limit;
}

// ---- PNG -----------------------------------------------------------------------------------------------------------

static void set_transparency(png_structp writer, png_infop info, const TestPng *png)
{
    png_byte alpha[1] = {128};
    unsigned limit = 1u << png->depth;
    png_color_16 colour = {.gray = (png_uint_16)test_sample(0, 0, 0, limit),
                           .red = (png_uint_16)test_sample(0, 0, 0, limit),
                           .green = (png_uint_16)test_sample(0, 0, 1, limit),
                           .blue = (png_uint_16)test_sample(0, 0, 2, limit)};
    png_set_tRNS(writer, info, alpha, png->colour_type == PNG_COLOR_TYPE_PALETTE ? 1 : 0, &colour);
}

static void fill_row(const TestPng *png, int channels, int y, png_byte *row)
{
    unsigned limit = png->colour_type == PNG_COLOR_TYPE_PALETTE ? 4 : 1u << png->depth;
    if (limit > 1u << png->depth)
        limit = 1u << png->depth;
    for (int i = 0; i < png->width * channels; ++i)
    {
        unsigned value = test_sample(i / channels, y, i % channels, limit);
        if (png->depth == 16)
        {
            row[2 * i] = (png_byte)(value >> 8);
            row[2 * i + 1] = (png_byte)value;
        }
        else
            row[i] = (png_byte)value;
    }
}

TestBytes test_png(const TestPng *png)
{
    static const int channels_of[] = {1, 0, 3, 1, 2, 0, 4};
    TestBytes bytes = {0};
    char *memory = NULL;
    FILE *stream = open_memstream(&memory, &bytes.size);
    png_structp writer = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(writer);
    png_init_io(writer, stream);
    png_set_IHDR(writer, info, (png_uint_32)png->width, (png_uint_32)png->height, png->depth, png->colour_type,
                 png->interlaced ? PNG_INTERLACE_ADAM7 : PNG_INTERLACE_NONE, 0, 0);
    if (png->colour_type == PNG_COLOR_TYPE_PALETTE)
    {
        png_color palette[4];
        for (int i = 0; i < 4; ++i)
            palette[i] = (png_color){(png_byte)(80 * i), (png_byte)(255 - 60 * i), (png_byte)(20 * i)};
        png_set_PLTE(writer, info, palette, png->depth == 1 ? 2 : 4);
    }
    if (png->transparent)
        set_transparency(writer, info, png);
    png_write_info(writer, info);
    png_set_packing(writer);
    int passes = png->interlaced ? png_set_interlace_handling(writer) : 1;
    int channels = channels_of[png->colour_type];
    png_byte *row = malloc((size_t)png->width * (size_t)channels * 2);
    for (int pass = 0; pass < passes; ++pass)
    {
        for (int y = 0; y < png->height; ++y)
        {
            fill_row(png, channels, y, row);
            png_write_row(writer, row);
        }
    }
    png_write_end(writer, info);
    png_destroy_write_struct(&writer, &info);
    free(row);
    fclose(stream);
    bytes.data = (uint8_t *)memory;
    return bytes;
}

// ---- JPEG ----------------------------------------------------------------------------------------------------------

TestBytes test_jpeg(int width, int height, int components, bool progressive)
{
    struct jpeg_compress_struct jpeg;
    struct jpeg_error_mgr errors;
    TestBytes bytes = {0};
    unsigned long size = 0;
    jpeg.err = jpeg_std_error(&errors);
    jpeg_create_compress(&jpeg);
    jpeg_mem_dest(&jpeg, &bytes.data, &size);
    jpeg.image_width = (JDIMENSION)width;
    jpeg.image_height = (JDIMENSION)height;
    jpeg.input_components = components;
    jpeg.in_color_space = components == 1 ? JCS_GRAYSCALE : components == 3 ? JCS_RGB : JCS_CMYK;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, 95, TRUE);
    if (progressive)
        jpeg_simple_progression(&jpeg);
    jpeg_start_compress(&jpeg, TRUE);
    JSAMPLE *row = malloc((size_t)(width * components));
    for (int i = 0; i < width * components; ++i)
        row[i] = (JSAMPLE)(i / components * 255 / (width > 1 ? width - 1 : 1));
    for (int y = 0; y < height; ++y)
        jpeg_write_scanlines(&jpeg, &row, 1);
    jpeg_finish_compress(&jpeg);
    jpeg_destroy_compress(&jpeg);
    free(row);
    bytes.size = size;
    return bytes;
}

// ---- EXR -----------------------------------------------------------------------------------------------------------

static int64_t write_memory(exr_const_context_t context, void *user, const void *data, uint64_t count, uint64_t offset,
                            exr_stream_error_func_ptr_t error)
{
    (void)context;
    (void)error;
    TestBytes *bytes = user;
    if (offset + count > bytes->size)
    {
        bytes->data = realloc(bytes->data, offset + count);
        bytes->size = offset + count;
    }
    memcpy(bytes->data + offset, data, count);
    return (int64_t)count;
}

static void start_part(exr_context_t context, const TestExr *exr)
{
    static const char *const names[] = {"A", "B", "G", "R"};
    exr_attr_box2i_t window = {.min = {.x = exr->x, .y = exr->y},
                               .max = {.x = exr->x + exr->width - 1, .y = exr->y + exr->height - 1}};
    exr_attr_v2f_t centre = {.x = 0, .y = 0};
    int part;
    exr_add_part(context, NULL, exr->tile ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part);
    exr_initialize_required_attr(context, 0, &window, &window, 1, &centre, 1, EXR_LINEORDER_INCREASING_Y,
                                 (exr_compression_t)exr->compression);
    if (exr->tile)
        exr_set_tile_descriptor(context, 0, (uint32_t)exr->tile, (uint32_t)exr->tile, EXR_TILE_ONE_LEVEL,
                                EXR_TILE_ROUND_DOWN);
    for (int c = 0; c < 4; ++c)
        exr_add_channel(context, 0, names[c], (exr_pixel_type_t)exr->type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    exr_write_header(context);
}

// One chunk whose first pixel is (x, y) of the image.
static void write_chunk(exr_context_t context, const TestExr *exr, const exr_chunk_info_t *chunk, int x, int y)
{
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_encoding_initialize(context, 0, chunk, &pipeline);
    size_t plane = (size_t)chunk->width * (size_t)chunk->height;
    // Unsigned goes in as it is, float and half as float.
    uint32_t *samples = malloc(4 * plane * sizeof *samples);
    for (int c = 0; c < 4; ++c)
    {
        for (size_t i = 0; i < plane; ++i)
        {
            uint32_t value =
                test_sample(x + (int)(i % (size_t)chunk->width), y + (int)(i / (size_t)chunk->width), 3 - c, 2048);
            float number = (float)value;
            memcpy(&samples[(size_t)c * plane + i], exr->type == EXR_PIXEL_UINT ? (void *)&value : (void *)&number, 4);
        }
        pipeline.channels[c].encode_from_ptr = (const uint8_t *)(samples + (size_t)c * plane);
        pipeline.channels[c].user_data_type = exr->type == EXR_PIXEL_UINT ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
        pipeline.channels[c].user_bytes_per_element = 4;
        pipeline.channels[c].user_pixel_stride = 4;
        pipeline.channels[c].user_line_stride = chunk->width * 4;
    }
    exr_encoding_choose_default_routines(context, 0, &pipeline);
    if (exr_encoding_run(context, 0, &pipeline) != EXR_ERR_SUCCESS)
        fprintf(stderr, "test_exr: compression %d cannot be written\n", exr->compression);
    exr_encoding_destroy(context, &pipeline);
    free(samples);
}

TestBytes test_exr(const TestExr *exr)
{
    TestBytes bytes = {0};
    exr_context_t context = NULL;
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    start.user_data = &bytes;
    start.write_fn = write_memory;
    exr_start_write(&context, "memory.exr", EXR_WRITE_FILE_DIRECTLY, &start);
    start_part(context, exr);
    exr_chunk_info_t chunk;
    if (exr->tile)
    {
        for (int y = 0; y * exr->tile < exr->height; ++y)
        {
            for (int x = 0; x * exr->tile < exr->width; ++x)
            {
                exr_write_tile_chunk_info(context, 0, x, y, 0, 0, &chunk);
                write_chunk(context, exr, &chunk, x * exr->tile, y * exr->tile);
            }
        }
    }
    else
    {
        for (int y = 0; y < exr->height; y += chunk.height)
        {
            exr_write_scanline_chunk_info(context, 0, exr->y + y, &chunk);
            write_chunk(context, exr, &chunk, 0, y);
        }
    }
    exr_finish(&context);
    return bytes;
}
