// SPDX-License-Identifier: Apache-2.0
// OpenEXR through OpenEXRCore: scanlines, ZIP compression, half or float, channels named as in the image.
//
// EXR is linear, so sRGB-encoded colour (channels R, G, B and Y) is converted on the way; other channels are data and
// go as they are.
#include "out/image.h"

#include "core/memory.h"
#include "core/result.h"
#include "data/colour.h"

#include <openexr.h>
#include <stdio.h>
#include <string.h>

enum
{
    ZIP_LEVEL = 4,
    // What ZIP compression groups.
    LINES_PER_CHUNK = 16
};

typedef struct ExrWriting
{
    RfOutFile *file;
    const RfImage *image;
    RfImageView view;
    uint64_t position;
    RfResult result;
    exr_context_t context;
    // LINES_PER_CHUNK rows of the image, converted.
    float *lines;
} ExrWriting;

static void *exr_allocate(size_t size)
{
    return rf_allocate(size, 1);
}

static int64_t stream_write(exr_const_context_t context, void *user, const void *data, uint64_t count, uint64_t offset,
                            exr_stream_error_func_ptr_t error)
{
    (void)context;
    (void)error;
    ExrWriting *writing = user;
    if (writing->result == RF_OK && offset != writing->position &&
        fseeko(writing->file->stream, (off_t)offset, SEEK_SET) != 0)
        writing->result = rf_fail(RF_WRITE_FAILED, writing->file->path, NULL, "cannot be written: seeking failed");
    if (writing->result == RF_OK)
        writing->result = rf_out_write(writing->file, data, count);
    if (writing->result != RF_OK)
        return -1;
    writing->position = offset + count;
    return (int64_t)count;
}

static void on_error(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)code;
    void *user = NULL;
    if (exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user)
        return;
    ExrWriting *writing = user;
    if (writing->result == RF_OK)
        writing->result = rf_fail(RF_WRITE_FAILED, writing->file->path, NULL, "cannot be written as EXR: %s", message);
}

static RfResult result_of(const ExrWriting *writing, exr_result_t code)
{
    if (writing->result != RF_OK || code == EXR_ERR_SUCCESS)
        return writing->result;
    if (code == EXR_ERR_OUT_OF_MEMORY)
        return RF_OUT_OF_MEMORY;
    return rf_fail(RF_WRITE_FAILED, writing->file->path, NULL, "cannot be written as EXR: %s",
                   exr_get_default_error_message(code));
}

static RfResult check_names(const RfOutFile *file, const RfImage *image, int channels)
{
    for (int i = 0; i < channels; ++i)
    {
        const char *name = rf_image_channel_name(image, i);
        for (int j = 0; j < i; ++j)
        {
            if (strcmp(rf_image_channel_name(image, j), name) == 0)
                return rf_fail(RF_INVALID_ARGUMENT, file->path, NULL, "channels %d and %d are both named %s", j, i,
                               name);
        }
        if (name[0] == '\0')
            return rf_fail(RF_INVALID_ARGUMENT, file->path, NULL, "channel %d has no name", i);
    }
    return RF_OK;
}

static exr_result_t write_header(ExrWriting *writing)
{
    bool half = rf_image_format(writing->image) == RF_SAMPLE_HALF;
    int part = 0;
    exr_result_t code = exr_add_part(writing->context, NULL, EXR_STORAGE_SCANLINE, &part);
    if (code == EXR_ERR_SUCCESS)
        code = exr_initialize_required_attr_simple(writing->context, part, writing->view.width, writing->view.height,
                                                   EXR_COMPRESSION_ZIP);
    for (int c = 0; c < writing->view.channels && code == EXR_ERR_SUCCESS; ++c)
        code = exr_add_channel(writing->context, part, rf_image_channel_name(writing->image, c),
                               half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1);
    return code == EXR_ERR_SUCCESS ? exr_write_header(writing->context) : code;
}

static bool is_colour(const char *name)
{
    return name[0] != '\0' && name[1] == '\0' && strchr("RGBY", name[0]);
}

static void convert_lines(const ExrWriting *writing, int first, int count)
{
    size_t row = (size_t)writing->view.width * (size_t)writing->view.channels;
    for (int y = 0; y < count; ++y)
        memcpy(writing->lines + (size_t)y * row,
               writing->view.pixels + (ptrdiff_t)(first + y) * writing->view.row_stride, row * sizeof(float));
    if (rf_image_encoding(writing->image) != RF_ENCODING_SRGB)
        return;
    for (int c = 0; c < writing->view.channels; ++c)
    {
        if (!is_colour(rf_image_channel_name(writing->image, c)))
            continue;
        for (size_t i = (size_t)c; i < row * (size_t)count; i += (size_t)writing->view.channels)
            writing->lines[i] = rf_srgb_to_linear(writing->lines[i]);
    }
}

static int channel_named(const ExrWriting *writing, const char *name)
{
    int c = 0;
    while (strcmp(rf_image_channel_name(writing->image, c), name) != 0)
        ++c;
    return c;
}

static void aim(const ExrWriting *writing, exr_encode_pipeline_t *pipeline)
{
    for (int i = 0; i < pipeline->channel_count; ++i)
    {
        exr_coding_channel_info_t *channel = &pipeline->channels[i];
        channel->encode_from_ptr = (const uint8_t *)(writing->lines + channel_named(writing, channel->channel_name));
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = sizeof(float);
        channel->user_pixel_stride = writing->view.channels * (int32_t)sizeof(float);
        channel->user_line_stride = writing->view.width * channel->user_pixel_stride;
    }
}

static exr_result_t write_chunk(ExrWriting *writing, exr_encode_pipeline_t *pipeline, int y)
{
    exr_chunk_info_t chunk;
    exr_result_t code = exr_write_scanline_chunk_info(writing->context, 0, y, &chunk);
    if (code != EXR_ERR_SUCCESS)
        return code;
    assert(chunk.height <= LINES_PER_CHUNK);
    convert_lines(writing, y, chunk.height);
    bool fresh = pipeline->channels == NULL;
    code = fresh ? exr_encoding_initialize(writing->context, 0, &chunk, pipeline)
                 : exr_encoding_update(writing->context, 0, &chunk, pipeline);
    if (code != EXR_ERR_SUCCESS)
        return code;
    aim(writing, pipeline);
    if (fresh)
        code = exr_encoding_choose_default_routines(writing->context, 0, pipeline);
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(writing->context, 0, pipeline) : code;
}

static exr_result_t write_all(ExrWriting *writing)
{
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    exr_result_t code = write_header(writing);
    for (int y = 0; y < writing->view.height && code == EXR_ERR_SUCCESS; y += LINES_PER_CHUNK)
        code = write_chunk(writing, &pipeline, y);
    exr_encoding_destroy(writing->context, &pipeline);
    return code;
}

static RfResult encode_exr(RfOutFile *file, const RfImage *image)
{
    ExrWriting writing = {.file = file, .image = image, .view = rf_image_view(image)};
    RF_TRY(check_names(file, image, writing.view.channels));
    writing.lines =
        rf_allocate((size_t)writing.view.width * LINES_PER_CHUNK, (size_t)writing.view.channels * sizeof(float));
    if (!writing.lines)
        return RF_OUT_OF_MEMORY;
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    start.error_handler_fn = on_error;
    start.alloc_fn = exr_allocate;
    start.free_fn = rf_release;
    start.user_data = &writing;
    start.write_fn = stream_write;
    start.zip_level = ZIP_LEVEL;
    exr_result_t code = exr_start_write(&writing.context, file->path, EXR_WRITE_FILE_DIRECTLY, &start);
    if (code == EXR_ERR_SUCCESS)
    {
        code = write_all(&writing);
        // Writes the table of chunks, too.
        exr_result_t finished = exr_finish(&writing.context);
        code = code == EXR_ERR_SUCCESS ? finished : code;
    }
    rf_release(writing.lines);
    return result_of(&writing, code);
}

const RfImageWriter rf_exr_writer = {"exr", encode_exr};
