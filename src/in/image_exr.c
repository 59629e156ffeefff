// SPDX-License-Identifier: Apache-2.0
// OpenEXR through OpenEXRCore: scanlines and tiles (the finest level), half, float and unsigned channels of any name,
// every compression the library has. Of a file with several parts the first is read; the image is the data window.
//
// The library reads through callbacks from the bytes in memory and decompresses a chunk; spreading the chunk's samples
// over the interleaved float image is done here, because OpenEXRCore 3.1.5 mixes up the channels when it turns three or
// four interleaved half channels to float. A decompressed chunk is little endian and lies as
//
//   row 0: channel 0 [width] | channel 1 [width] | ...    row 1: channel 0 [width] | ...
#include "in/image.h"

#include "core/memory.h"
#include "core/result.h"

#include <openexr.h>
#include <stdio.h>
#include <string.h>

enum
{
    // Deflate expands at most 1032 times, PIZ's run lengths about 400 times.
    USUAL_RATIO = 2048,
    // DWA deflates the mean of blocks of 64.
    DWA_RATIO = 65536
};

typedef struct ExrReading
{
    const char *file;
    const uint8_t *bytes;
    size_t size;
    exr_context_t context;
    exr_attr_box2i_t window;
    // Of the library's last complaint.
    char message[256];
    RfImage *image;
    // Channel of the image for each channel of the file.
    int order[RF_MAX_CHANNELS];
    // Where in the image the chunk at hand begins.
    int x, y;
} ExrReading;

static void *exr_allocate(size_t size)
{
    return rf_allocate(size, 1);
}

static int64_t stream_size(exr_const_context_t context, void *user)
{
    (void)context;
    return (int64_t)((const ExrReading *)user)->size;
}

static int64_t stream_read(exr_const_context_t context, void *user, void *to, uint64_t count, uint64_t offset,
                           exr_stream_error_func_ptr_t error)
{
    (void)context;
    (void)error;
    const ExrReading *reading = user;
    if (offset >= reading->size)
        return 0;
    uint64_t there = reading->size - offset;
    if (count > there)
        count = there;
    memcpy(to, reading->bytes + offset, count);
    return (int64_t)count;
}

static void on_error(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)code;
    void *user = NULL;
    if (exr_get_user_data(context, &user) == EXR_ERR_SUCCESS && user)
        snprintf(((ExrReading *)user)->message, sizeof((ExrReading *)user)->message, "%s", message);
}

static RfResult fail_exr(ExrReading *reading, exr_result_t code, const char *place)
{
    if (code == EXR_ERR_OUT_OF_MEMORY)
        return RF_OUT_OF_MEMORY;
    const char *message = reading->message[0] ? reading->message : exr_get_default_error_message(code);
    // The library puts the file's name in front of some messages; it is said already.
    size_t length = strlen(reading->file);
    if (strncmp(message, reading->file, length) == 0 && strncmp(message + length, ": ", 2) == 0)
        message += length + 2;
    if (code == EXR_ERR_FEATURE_NOT_IMPLEMENTED)
        return rf_fail(RF_UNSUPPORTED, reading->file, place, "%s; save it with ZIP compression", message);
    return rf_fail(RF_BAD_INPUT, reading->file, place, "broken EXR: %s; save or copy it again", message);
}

// R G B or Y, then A, then the others by name.
static int channel_rank(const char *name)
{
    static const char *const first[] = {"R", "G", "B", "Y", "A"};
    for (int i = 0; i < 5; ++i)
    {
        if (strcmp(name, first[i]) == 0)
            return i;
    }
    return 5;
}

static bool channel_before(const exr_attr_chlist_entry_t *a, const exr_attr_chlist_entry_t *b)
{
    int rank_a = channel_rank(a->name.str), rank_b = channel_rank(b->name.str);
    return rank_a != rank_b ? rank_a < rank_b : strcmp(a->name.str, b->name.str) < 0;
}

static RfResult check_channels(const ExrReading *reading, const exr_attr_chlist_t *channels)
{
    for (int i = 0; i < channels->num_channels; ++i)
    {
        const exr_attr_chlist_entry_t *entry = &channels->entries[i];
        if (entry->x_sampling != 1 || entry->y_sampling != 1)
            return rf_fail(RF_UNSUPPORTED, reading->file, "header",
                           "channel %.64s has fewer samples than the image has pixels; save it as RGB",
                           entry->name.str);
        for (int j = 0; j < i; ++j)
        {
            if (strcmp(channels->entries[j].name.str, entry->name.str) == 0)
                return rf_fail(RF_BAD_INPUT, reading->file, "header", "broken EXR: two channels are named %.64s",
                               entry->name.str);
        }
    }
    return RF_OK;
}

// All chunks unpacked, in bytes, against the file: the table of chunks must fit, and the pixels be plausible.
static RfResult check_amount(ExrReading *reading, const exr_attr_chlist_t *channels, int64_t pixels)
{
    int32_t chunks = 0;
    exr_compression_t compression;
    exr_result_t code = exr_get_chunk_count(reading->context, 0, &chunks);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_compression(reading->context, 0, &compression);
    if (code != EXR_ERR_SUCCESS)
        return fail_exr(reading, code, "header");
    if (chunks < 1 || (uint64_t)chunks * 8 > reading->size)
        return rf_fail(RF_BAD_INPUT, reading->file, "table of chunks",
                       "broken EXR: the file ends inside it (%zu bytes for %d chunks); copy it again", reading->size,
                       chunks);
    int64_t pixel_bytes = 0;
    for (int i = 0; i < channels->num_channels; ++i)
        pixel_bytes += channels->entries[i].pixel_type == EXR_PIXEL_HALF ? 2 : 4;
    bool dwa = compression == EXR_COMPRESSION_DWAA || compression == EXR_COMPRESSION_DWAB;
    return rf_image_check_plausible(reading->file, pixels * pixel_bytes, reading->size, dwa ? DWA_RATIO : USUAL_RATIO);
}

static void describe_channels(ExrReading *reading, const exr_attr_chlist_t *channels)
{
    bool half = true, colour = false;
    for (int i = 0; i < channels->num_channels; ++i)
    {
        const exr_attr_chlist_entry_t *entry = &channels->entries[i];
        int place = 0;
        for (int j = 0; j < channels->num_channels; ++j)
            place += channel_before(&channels->entries[j], entry);
        reading->order[i] = place;
        rf_image_set_channel_name(reading->image, place, entry->name.str);
        half = half && entry->pixel_type == EXR_PIXEL_HALF;
        colour = colour || channel_rank(entry->name.str) <= 3;
    }
    rf_image_set_origin(reading->image, half ? RF_SAMPLE_HALF : RF_SAMPLE_FLOAT,
                        colour ? RF_ENCODING_LINEAR : RF_ENCODING_DATA);
}

static RfResult make_image(ExrReading *reading, exr_storage_t *storage)
{
    const exr_attr_chlist_t *channels = NULL;
    exr_result_t code = exr_get_storage(reading->context, 0, storage);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_data_window(reading->context, 0, &reading->window);
    if (code == EXR_ERR_SUCCESS)
        code = exr_get_channels(reading->context, 0, &channels);
    if (code != EXR_ERR_SUCCESS)
        return fail_exr(reading, code, "header");
    if (*storage != EXR_STORAGE_SCANLINE && *storage != EXR_STORAGE_TILED)
        return rf_fail(RF_UNSUPPORTED, reading->file, "header", "is a deep EXR; flatten it");
    int64_t width = (int64_t)reading->window.max.x - reading->window.min.x + 1;
    int64_t height = (int64_t)reading->window.max.y - reading->window.min.y + 1;
    RF_TRY(rf_image_check_size(reading->file, width, height, channels->num_channels));
    RF_TRY(check_channels(reading, channels));
    RF_TRY(check_amount(reading, channels, width * height));
    RF_TRY(rf_image_create((int)width, (int)height, channels->num_channels, &reading->image));
    describe_channels(reading, channels);
    return RF_OK;
}

static float half_to_float(uint16_t half)
{
    uint32_t sign = (uint32_t)(half & 0x8000) << 16, exponent = half >> 10 & 31, mantissa = half & 1023;
    float value = (float)mantissa * 0x1p-24f;
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (exponent > 0)
        bits = (exponent == 31 ? 255u : exponent + 112) << 23 | mantissa << 13;
    bits |= sign;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// One channel of one row, from the file's samples to every `stride`-th float.
static void spread(const uint8_t *from, int type, int width, float *to, int stride)
{
    for (int x = 0; x < width; ++x, to += stride)
    {
        uint16_t half;
        uint32_t number;
        if (type == EXR_PIXEL_HALF)
        {
            memcpy(&half, from + 2 * (size_t)x, 2);
            *to = half_to_float(half);
        }
        else if (type == EXR_PIXEL_FLOAT)
            memcpy(to, from + 4 * (size_t)x, 4);
        else
        {
            memcpy(&number, from + 4 * (size_t)x, 4);
            *to = (float)number;
        }
    }
}

// The pipeline's last stage.
static exr_result_t unpack(exr_decode_pipeline_t *pipeline)
{
    const ExrReading *reading = pipeline->decoding_user_data;
    RfImageView view = rf_image_view(reading->image);
    const uint8_t *from = pipeline->unpacked_buffer;
    int width = pipeline->chunk.width, height = pipeline->chunk.height;
    size_t pixel_bytes = 0;
    for (int c = 0; c < pipeline->channel_count; ++c)
        pixel_bytes += (size_t)pipeline->channels[c].bytes_per_element;
    // Without compression the library hands out the packed bytes, of which a broken file has fewer.
    uint64_t there = from == pipeline->packed_buffer ? pipeline->chunk.packed_size : pipeline->chunk.unpacked_size;
    if (!from || there < (uint64_t)width * (uint64_t)height * pixel_bytes)
        return EXR_ERR_CORRUPT_CHUNK;
    for (int y = 0; y < height; ++y)
    {
        float *row =
            view.pixels + (ptrdiff_t)(reading->y + y) * view.row_stride + (ptrdiff_t)reading->x * view.channels;
        for (int c = 0; c < pipeline->channel_count; ++c)
        {
            const exr_coding_channel_info_t *channel = &pipeline->channels[c];
            spread(from, channel->data_type, width, row + reading->order[c], view.channels);
            from += (size_t)width * (size_t)channel->bytes_per_element;
        }
    }
    return EXR_ERR_SUCCESS;
}

// A chunk whose sizes disagree with the image would be written outside it.
static exr_result_t decode_chunk(ExrReading *reading, exr_decode_pipeline_t *pipeline, exr_chunk_info_t *chunk, int x,
                                 int y)
{
    RfImageView view = rf_image_view(reading->image);
    if (chunk->width < 1 || chunk->height < 1 || x < 0 || y < 0 || chunk->width > view.width - x ||
        chunk->height > view.height - y || chunk->packed_size > reading->size)
        return EXR_ERR_CORRUPT_CHUNK;
    bool fresh = pipeline->channels == NULL;
    exr_result_t code = fresh ? exr_decoding_initialize(reading->context, 0, chunk, pipeline)
                              : exr_decoding_update(reading->context, 0, chunk, pipeline);
    if (code != EXR_ERR_SUCCESS)
        return code;
    reading->x = x;
    reading->y = y;
    pipeline->decoding_user_data = reading;
    if (fresh)
        code = exr_decoding_choose_default_routines(reading->context, 0, pipeline);
    pipeline->unpack_and_convert_fn = unpack;
    return code == EXR_ERR_SUCCESS ? exr_decoding_run(reading->context, 0, pipeline) : code;
}

static RfResult read_scanlines(ExrReading *reading, exr_decode_pipeline_t *pipeline)
{
    int32_t step = 0;
    int height = rf_image_view(reading->image).height;
    exr_result_t code = exr_get_scanlines_per_chunk(reading->context, 0, &step);
    if (code != EXR_ERR_SUCCESS || step < 1)
        return fail_exr(reading, code, "header");
    for (int y = 0; y < height; y += step)
    {
        exr_chunk_info_t chunk;
        code = exr_read_scanline_chunk_info(reading->context, 0, reading->window.min.y + y, &chunk);
        if (code == EXR_ERR_SUCCESS)
            code = decode_chunk(reading, pipeline, &chunk, 0, y);
        if (code == EXR_ERR_SUCCESS)
            continue;
        char place[64];
        snprintf(place, sizeof place, "row %d", y);
        return fail_exr(reading, code, place);
    }
    return RF_OK;
}

static RfResult read_tiles(ExrReading *reading, exr_decode_pipeline_t *pipeline)
{
    int32_t tile_width = 0, tile_height = 0;
    RfImageView view = rf_image_view(reading->image);
    exr_result_t code = exr_get_tile_sizes(reading->context, 0, 0, 0, &tile_width, &tile_height);
    if (code != EXR_ERR_SUCCESS || tile_width < 1 || tile_height < 1)
        return fail_exr(reading, code, "header");
    int across = (int)(((int64_t)view.width + tile_width - 1) / tile_width);
    int down = (int)(((int64_t)view.height + tile_height - 1) / tile_height);
    for (int i = 0; i < across * down; ++i)
    {
        int x = i % across, y = i / across;
        exr_chunk_info_t chunk;
        code = exr_read_tile_chunk_info(reading->context, 0, x, y, 0, 0, &chunk);
        if (code == EXR_ERR_SUCCESS)
            code = decode_chunk(reading, pipeline, &chunk, x * tile_width, y * tile_height);
        if (code == EXR_ERR_SUCCESS)
            continue;
        char place[64];
        snprintf(place, sizeof place, "tile (%d, %d)", x, y);
        return fail_exr(reading, code, place);
    }
    return RF_OK;
}

static RfResult read_image(ExrReading *reading)
{
    exr_storage_t storage;
    RF_TRY(make_image(reading, &storage));
    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    RfResult result =
        storage == EXR_STORAGE_TILED ? read_tiles(reading, &pipeline) : read_scanlines(reading, &pipeline);
    exr_decoding_destroy(reading->context, &pipeline);
    return result;
}

static bool probe_exr(const uint8_t *bytes, size_t size)
{
    return rf_image_has_signature(bytes, size, "\x76\x2f\x31\x01", 4);
}

static RfResult decode_exr(const char *file, const uint8_t *bytes, size_t size, RfImage **out)
{
    *out = NULL;
    if (!probe_exr(bytes, size))
        return rf_fail(RF_BAD_INPUT, file, "header", "not an EXR: its signature is missing");
    ExrReading reading = {.file = file, .bytes = bytes, .size = size};
    exr_context_initializer_t start = EXR_DEFAULT_CONTEXT_INITIALIZER;
    start.error_handler_fn = on_error;
    start.alloc_fn = exr_allocate;
    start.free_fn = rf_release;
    start.user_data = &reading;
    start.read_fn = stream_read;
    start.size_fn = stream_size;
    // Without the table of chunks the library would search the file for them; a file cut off is refused instead.
    start.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;
    exr_result_t code = exr_start_read(&reading.context, file, &start);
    RfResult result = code == EXR_ERR_SUCCESS ? read_image(&reading) : fail_exr(&reading, code, "header");
    if (code == EXR_ERR_SUCCESS)
        exr_finish(&reading.context);
    if (result == RF_OK)
        *out = reading.image;
    else
        rf_image_destroy(reading.image);
    return result;
}

const RfImageReader rf_exr_reader = {"EXR", "exr", probe_exr, decode_exr};
