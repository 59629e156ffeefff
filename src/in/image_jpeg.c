// SPDX-License-Identifier: Apache-2.0
// JPEG (ITU-T T.81) through libjpeg-turbo: grey and RGB, baseline and progressive.
//
// libjpeg only warns where data is missing or spoilt and paints grey instead. An exemplar with a grey bar is worse than
// none, so warnings about the coded data are failures here. It leaves by longjmp: what must outlive the jump lives in
// JpegReading, made by the caller of the function that sets it.
#include "in/image.h"

#include "core/memory.h"
#include "core/result.h"

#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include <jpeglib.h>

#include <jerror.h>

enum
{
    // A baseline block of 64 pixels takes 2 bits or more, a progressive one 1; arithmetic coding goes lower still.
    PIXELS_PER_BYTE = 4096,
    // Progressive files have about 10 scans. Thousands of empty ones are the known way to keep a decoder busy for
    // hours.
    MAX_SCANS = 200
};

typedef struct JpegReading
{
    struct jpeg_decompress_struct jpeg;
    struct jpeg_error_mgr errors;
    struct jpeg_progress_mgr progress;
    jmp_buf jump;
    const char *file;
    RfResult result;
    RfImage *image;
    uint8_t *row;
} JpegReading;

static RfResult fail_jpeg(JpegReading *reading, RfResult result, const char *message)
{
    char place[64] = "header";
    if (reading->image)
        snprintf(place, sizeof place, "row %u", reading->jpeg.output_scanline);
    if (result == RF_UNSUPPORTED)
        return rf_fail(result, reading->file, place, "%s; save it as baseline JPEG or PNG", message);
    return rf_fail(result, reading->file, place, "broken JPEG: %s; save or copy it again", message);
}

static RfResult result_of(int code)
{
    switch (code)
    {
    case JERR_OUT_OF_MEMORY:
        return RF_OUT_OF_MEMORY;
    case JERR_BAD_PRECISION:
    case JERR_SOF_UNSUPPORTED:
    case JERR_ARITH_NOTIMPL:
    case JERR_CONVERSION_NOTIMPL:
    case JERR_NOT_COMPILED:
        return RF_UNSUPPORTED;
    default:
        return RF_BAD_INPUT;
    }
}

_Noreturn static void on_error(j_common_ptr common)
{
    JpegReading *reading = common->client_data;
    char message[JMSG_LENGTH_MAX];
    common->err->format_message(common, message);
    reading->result = fail_jpeg(reading, result_of(common->err->msg_code), message);
    longjmp(reading->jump, 1);
}

static void on_message(j_common_ptr common, int level)
{
    if (level >= 0)
        return;
    switch (common->err->msg_code)
    {
    case JWRN_JPEG_EOF:
    case JWRN_HIT_MARKER:
    case JWRN_HUFF_BAD_CODE:
    case JWRN_ARITH_BAD_CODE:
    case JWRN_MUST_RESYNC:
    case JWRN_BOGUS_PROGRESSION:
    case JWRN_NOT_SEQUENTIAL:
        on_error(common);
    default:
        ++common->err->num_warnings;
    }
}

static void on_progress(j_common_ptr common)
{
    JpegReading *reading = common->client_data;
    if (reading->jpeg.input_scan_number <= MAX_SCANS)
        return;
    reading->result = fail_jpeg(reading, RF_BAD_INPUT, "it has more than 200 scans");
    longjmp(reading->jump, 1);
}

static RfResult start(JpegReading *reading, const uint8_t *bytes, size_t size)
{
    struct jpeg_decompress_struct *jpeg = &reading->jpeg;
    jpeg->progress = &reading->progress;
    jpeg_mem_src(jpeg, bytes, (unsigned long)size);
    (void)jpeg_read_header(jpeg, TRUE);
    if (jpeg->jpeg_color_space == JCS_CMYK || jpeg->jpeg_color_space == JCS_YCCK)
        return rf_fail(RF_UNSUPPORTED, reading->file, "header",
                       "is a CMYK JPEG, whose colours depend on a printer; convert it to RGB");
    bool grey = jpeg->jpeg_color_space == JCS_GRAYSCALE;
    jpeg->out_color_space = grey ? JCS_GRAYSCALE : JCS_RGB;
    int64_t width = jpeg->image_width, height = jpeg->image_height;
    RF_TRY(rf_image_check_size(reading->file, width, height, grey ? 1 : 3));
    RF_TRY(rf_image_check_plausible(reading->file, width * height, size, PIXELS_PER_BYTE));
    RF_TRY(rf_image_create((int)width, (int)height, grey ? 1 : 3, &reading->image));
    reading->row = rf_allocate((size_t)width, 3);
    return reading->row ? RF_OK : RF_OUT_OF_MEMORY;
}

static void read_rows(JpegReading *reading)
{
    RfImageView view = rf_image_view(reading->image);
    size_t row = (size_t)view.width * (size_t)view.channels;
    (void)jpeg_start_decompress(&reading->jpeg);
    for (int y = 0; y < view.height; ++y)
    {
        JSAMPROW rows[1] = {reading->row};
        (void)jpeg_read_scanlines(&reading->jpeg, rows, 1);
        float *to = view.pixels + (ptrdiff_t)y * view.row_stride;
        for (size_t i = 0; i < row; ++i)
            to[i] = (float)reading->row[i] / 255.0f;
    }
    (void)jpeg_finish_decompress(&reading->jpeg);
}

static void decode_guarded(JpegReading *reading, const uint8_t *bytes, size_t size)
{
    if (setjmp(reading->jump) != 0)
        return;
    jpeg_create_decompress(&reading->jpeg);
    reading->result = start(reading, bytes, size);
    if (reading->result != RF_OK)
        return;
    read_rows(reading);
    rf_image_set_origin(reading->image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
}

static bool probe_jpeg(const uint8_t *bytes, size_t size)
{
    return rf_image_has_signature(bytes, size, "\xff\xd8\xff", 3);
}

static RfResult decode_jpeg(const char *file, const uint8_t *bytes, size_t size, RfImage **out)
{
    *out = NULL;
    if (!probe_jpeg(bytes, size))
        return rf_fail(RF_BAD_INPUT, file, "header", "not a JPEG: its signature is missing");
    // On the heap: jpeg_decompress_struct and jmp_buf are large, and nothing of it may sit in a register at the jump.
    JpegReading *reading = rf_allocate_zero(1, sizeof *reading);
    if (!reading)
        return RF_OUT_OF_MEMORY;
    reading->file = file;
    reading->jpeg.err = jpeg_std_error(&reading->errors);
    reading->jpeg.client_data = reading;
    reading->errors.error_exit = on_error;
    reading->errors.emit_message = on_message;
    reading->progress.progress_monitor = on_progress;
    decode_guarded(reading, bytes, size);
    jpeg_destroy_decompress(&reading->jpeg);
    RfResult result = reading->result;
    if (result == RF_OK)
        *out = reading->image;
    else
        rf_image_destroy(reading->image);
    rf_release(reading->row);
    rf_release(reading);
    return result;
}

const RfImageReader rf_jpeg_reader = {"JPEG", "jpg,jpeg", probe_jpeg, decode_jpeg};
