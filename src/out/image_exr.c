// SPDX-License-Identifier: Apache-2.0
// OpenEXR through OpenEXRCore: scanlines, ZIP compression, half or float, channels named as in the image.
//
// EXR is linear, so sRGB-encoded colour (channels R, G, B and Y) is converted on the way; other channels are data and
// go as they are. Chunks are converted and compressed side by side, a batch at a time, then written in their order.
#include "out/image.h"

#include "core/memory.h"
#include "core/result.h"
#include "data/colour.h"

#include <openexr.h>
#include <stdio.h>
#include <string.h>

enum
{
    // Level 4 takes 1.3 times as long for 1 to 3 % less.
    ZIP_LEVEL = 2,
    // What ZIP compression groups.
    LINES_PER_CHUNK = 16,
    BATCH = 32
};

// One chunk of a batch.
typedef struct ExrChunk
{
    exr_chunk_info_t info;
    exr_encode_pipeline_t pipeline;
    // LINES_PER_CHUNK rows of the image, converted.
    float *lines;
    exr_result_t code;
} ExrChunk;

typedef struct ExrWriting
{
    RfOutFile *file;
    const RfImage *image;
    RfImageView view;
    uint64_t position;
    RfResult result;
    exr_context_t context;
    ExrChunk chunks[BATCH];
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

// The code says enough; without a handler the library prints to stderr.
static void on_error(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)context;
    (void)code;
    (void)message;
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

// A half ends at 65504; beyond, the library would write infinity, which is refused when it is read.
static void limit_to_half(float *numbers, size_t count)
{
    const float largest = 65504;
    for (size_t i = 0; i < count; ++i)
        if (fabsf(numbers[i]) > largest && isfinite(numbers[i]))
            numbers[i] = copysignf(largest, numbers[i]);
}

static void convert_lines(const ExrWriting *writing, ExrChunk *chunk)
{
    size_t row = (size_t)writing->view.width * (size_t)writing->view.channels;
    for (int y = 0; y < chunk->info.height; ++y)
        memcpy(chunk->lines + (size_t)y * row,
               writing->view.pixels + (ptrdiff_t)(chunk->info.start_y + y) * writing->view.row_stride,
               row * sizeof(float));
    for (int c = 0; c < writing->view.channels; ++c)
    {
        if (rf_image_encoding(writing->image) != RF_ENCODING_SRGB ||
            !is_colour(rf_image_channel_name(writing->image, c)))
            continue;
        for (size_t i = (size_t)c; i < row * (size_t)chunk->info.height; i += (size_t)writing->view.channels)
            chunk->lines[i] = rf_srgb_to_linear(chunk->lines[i]);
    }
    if (rf_image_format(writing->image) == RF_SAMPLE_HALF)
        limit_to_half(chunk->lines, row * (size_t)chunk->info.height);
}

static int channel_named(const ExrWriting *writing, const char *name)
{
    int c = 0;
    while (strcmp(rf_image_channel_name(writing->image, c), name) != 0)
        ++c;
    return c;
}

static void aim(const ExrWriting *writing, ExrChunk *chunk)
{
    for (int i = 0; i < chunk->pipeline.channel_count; ++i)
    {
        exr_coding_channel_info_t *channel = &chunk->pipeline.channels[i];
        channel->encode_from_ptr = (const uint8_t *)(chunk->lines + channel_named(writing, channel->channel_name));
        channel->user_data_type = EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = sizeof(float);
        channel->user_pixel_stride = writing->view.channels * (int32_t)sizeof(float);
        channel->user_line_stride = writing->view.width * channel->user_pixel_stride;
    }
}

// The pipeline's last stage: the chunk waits for its turn.
static exr_result_t keep_compressed(exr_encode_pipeline_t *pipeline)
{
    (void)pipeline;
    return EXR_ERR_SUCCESS;
}

static exr_result_t compress_chunk(const ExrWriting *writing, ExrChunk *chunk)
{
    convert_lines(writing, chunk);
    bool fresh = chunk->pipeline.channels == NULL;
    exr_result_t code = fresh ? exr_encoding_initialize(writing->context, 0, &chunk->info, &chunk->pipeline)
                              : exr_encoding_update(writing->context, 0, &chunk->info, &chunk->pipeline);
    if (code != EXR_ERR_SUCCESS)
        return code;
    aim(writing, chunk);
    if (fresh)
        code = exr_encoding_choose_default_routines(writing->context, 0, &chunk->pipeline);
    chunk->pipeline.write_fn = keep_compressed;
    chunk->pipeline.yield_until_ready_fn = keep_compressed;
    return code == EXR_ERR_SUCCESS ? exr_encoding_run(writing->context, 0, &chunk->pipeline) : code;
}

static exr_result_t write_batch(ExrWriting *writing, int first, int count)
{
    for (int i = 0; i < count; ++i)
    {
        ExrChunk *chunk = &writing->chunks[i];
        exr_result_t code =
            exr_write_scanline_chunk_info(writing->context, 0, first + i * LINES_PER_CHUNK, &chunk->info);
        if (code != EXR_ERR_SUCCESS)
            return code;
        assert(chunk->info.height <= LINES_PER_CHUNK);
    }
    // One after the other: OpenEXRCore does not promise that one context may be encoded from several threads.
    for (int i = 0; i < count; ++i)
        writing->chunks[i].code = compress_chunk(writing, &writing->chunks[i]);
    for (int i = 0; i < count; ++i)
    {
        const ExrChunk *chunk = &writing->chunks[i];
        exr_result_t code = chunk->code;
        if (code == EXR_ERR_SUCCESS)
            code = exr_write_scanline_chunk(writing->context, 0, chunk->info.start_y, chunk->pipeline.compressed_buffer,
                                            chunk->pipeline.compressed_bytes);
        if (code != EXR_ERR_SUCCESS)
            return code;
    }
    return EXR_ERR_SUCCESS;
}

static exr_result_t write_all(ExrWriting *writing)
{
    exr_result_t code = write_header(writing);
    int count = (writing->view.height + LINES_PER_CHUNK - 1) / LINES_PER_CHUNK;
    for (int first = 0; first < count && code == EXR_ERR_SUCCESS; first += BATCH)
        code = write_batch(writing, first * LINES_PER_CHUNK, count - first < BATCH ? count - first : BATCH);
    for (int i = 0; i < BATCH; ++i)
        exr_encoding_destroy(writing->context, &writing->chunks[i].pipeline);
    return code;
}

static exr_result_t write_file(ExrWriting *writing)
{
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    start.error_handler_fn = on_error;
    start.alloc_fn = exr_allocate;
    start.free_fn = rf_release;
    start.user_data = writing;
    start.write_fn = stream_write;
    start.zip_level = ZIP_LEVEL;
    exr_result_t code = exr_start_write(&writing->context, writing->file->path, EXR_WRITE_FILE_DIRECTLY, &start);
    if (code != EXR_ERR_SUCCESS)
        return code;
    code = write_all(writing);
    // Writes the table of chunks, too.
    exr_result_t finished = exr_finish(&writing->context);
    return code == EXR_ERR_SUCCESS ? finished : code;
}

static RfResult encode_exr(RfOutFile *file, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    RF_TRY(check_names(file, image, view.channels));
    size_t lines = (size_t)view.width * LINES_PER_CHUNK * (size_t)view.channels;
    ExrWriting *writing = rf_allocate_zero(1, sizeof *writing);
    float *memory = writing ? rf_allocate(lines * BATCH, sizeof *memory) : NULL;
    RfResult result = RF_OUT_OF_MEMORY;
    if (memory)
    {
        writing->file = file;
        writing->image = image;
        writing->view = view;
        for (int i = 0; i < BATCH; ++i)
            writing->chunks[i].lines = memory + (size_t)i * lines;
        result = result_of(writing, write_file(writing));
    }
    rf_release(memory);
    rf_release(writing);
    return result;
}

const RfImageWriter rf_exr_writer = {"exr", encode_exr};
