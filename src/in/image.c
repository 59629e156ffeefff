// SPDX-License-Identifier: Apache-2.0
#include "in/image.h"
#include "in/file.h"

#include "core/result.h"
#include "fluids/builtin.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

static const RfImageReader *const g_readers[] = {&rf_png_reader, &rf_jpeg_reader, &rf_exr_reader, &rf_pnm_reader};

enum
{
    READER_COUNT = sizeof g_readers / sizeof g_readers[0]
};

// Kinds that are recognised only to say what they are.
static const struct
{
    const char *name, *signature;
    size_t offset, length;
} g_foreign[] = {
    {"a TIFF", "II*\0", 0, 4},         {"a TIFF", "MM\0*", 0, 4},
    {"a GIF", "GIF8", 0, 4},           {"a BMP", "BM", 0, 2},
    {"a PSD", "8BPS", 0, 4},           {"a Radiance HDR", "#?RADIANCE", 0, 10},
    {"a WebP", "WEBP", 8, 4},          {"a JPEG 2000", "jP  ", 4, 4},
    {"a PDF", "%PDF", 0, 4},           {"an AVIF or HEIF", "ftyp", 4, 4},
    {"a gzip file", "\x1f\x8b", 0, 2}, {"a ZIP file", "PK\x03\x04", 0, 4},
};

bool rf_image_has_signature(const uint8_t *bytes, size_t size, const char *signature, size_t length)
{
    return size >= 2 && memcmp(bytes, signature, size < length ? size : length) == 0;
}

RfResult rf_image_check_size(const char *file, int64_t width, int64_t height, int64_t channels)
{
    if (width < 1 || width > RF_MAX_SIZE || height < 1 || height > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, file, "header",
                       "says %lld x %lld pixels: each side must be 1 to %d; scale the image down", (long long)width,
                       (long long)height, RF_MAX_SIZE);
    if (channels < 1 || channels > RF_MAX_CHANNELS)
        return rf_fail(RF_BAD_INPUT, file, "header", "has %lld channels: 1 to %d can be read", (long long)channels,
                       RF_MAX_CHANNELS);
    if (width * height * channels > RF_MAX_IMAGE_SAMPLES)
        return rf_fail(RF_BAD_INPUT, file, "header",
                       "says %lld x %lld pixels of %lld channels: at most %lld million samples are read; scale the "
                       "image down",
                       (long long)width, (long long)height, (long long)channels,
                       (long long)(RF_MAX_IMAGE_SAMPLES / 1000000));
    return RF_OK;
}

RfResult rf_image_check_plausible(const char *file, int64_t needed, size_t size, int64_t ratio)
{
    if ((uint64_t)needed / (uint64_t)ratio <= size)
        return RF_OK;
    return rf_fail(RF_BAD_INPUT, file, "header",
                   "promises %lld bytes of pixels, but the file's %zu bytes cannot hold them; it is cut off or broken",
                   (long long)needed, size);
}

// What the name's extension promised, NULL if nothing.
static const RfImageReader *reader_by_extension(const char *name)
{
    const char *dot = strrchr(name, '.');
    if (!dot || dot[1] == '\0')
        return NULL;
    size_t length = strlen(dot + 1);
    for (int i = 0; i < READER_COUNT; ++i)
    {
        for (const char *e = g_readers[i]->extensions; *e; e += strcspn(e, ","), e += *e == ',')
        {
            if (strcspn(e, ",") == length && strncasecmp(e, dot + 1, length) == 0)
                return g_readers[i];
        }
    }
    return NULL;
}

static RfResult fail_unknown(const char *name, const uint8_t *bytes, size_t size)
{
    for (size_t i = 0; i < sizeof g_foreign / sizeof g_foreign[0]; ++i)
    {
        if (size >= g_foreign[i].offset + g_foreign[i].length &&
            memcmp(bytes + g_foreign[i].offset, g_foreign[i].signature, g_foreign[i].length) == 0)
            return rf_fail(RF_UNSUPPORTED, name, NULL,
                           "is %s: PNG, JPEG, EXR, PGM and PPM can be read; convert it to one of them",
                           g_foreign[i].name);
    }
    const RfImageReader *promised = reader_by_extension(name);
    return rf_fail(RF_BAD_INPUT, name, NULL, "not %s %s: %s; give a PNG, JPEG, EXR, PGM or PPM file",
                   promised == &rf_exr_reader ? "an" : "a", promised ? promised->name : "readable image",
                   size == 0 ? "the file is empty" : "its first bytes are of no kind of image that is known");
}

RfResult rf_image_decode(const char *name, const uint8_t *bytes, size_t size, RfImage **out)
{
    *out = NULL;
    for (int i = 0; i < READER_COUNT; ++i)
    {
        if (g_readers[i]->probe(bytes, size))
            return g_readers[i]->decode(name, bytes, size, out);
    }
    return fail_unknown(name, bytes, size);
}

// Only EXR can hold NaN and infinity. A method would spread them over the frame, so they end here, where the file's
// name is known.
static RfResult check_finite(const char *path, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    size_t row = (size_t)view.width * (size_t)view.channels;
    for (int y = 0; y < view.height; ++y)
    {
        const float *samples = view.pixels + (ptrdiff_t)y * view.row_stride;
        for (size_t i = 0; i < row; ++i)
        {
            if (isfinite(samples[i]))
                continue;
            char place[128];
            snprintf(place, sizeof place, "pixel (%d, %d), channel %s", (int)(i / (size_t)view.channels), y,
                     rf_image_channel_name(image, (int)(i % (size_t)view.channels)));
            return rf_fail(RF_BAD_INPUT, path, place, "is %s: every sample must be a finite number; fill or clamp it",
                           isnan(samples[i]) ? "NaN" : "infinite");
        }
    }
    return RF_OK;
}

RfResult rf_image_read(const char *path, RfImage **out)
{
    RF_REQUIRE(path && out, "rf_image_read: NULL argument");
    *out = NULL;
    if (strncmp(path, "builtin:", 8) == 0)
        return rf_exemplar_draw(path + 8, out);
    RfBytes bytes;
    RF_TRY(rf_bytes_read(path, 0, &bytes));
    RfImage *image = NULL;
    RfResult result = rf_image_decode(path, bytes.data, bytes.size, &image);
    rf_bytes_free(&bytes);
    if (result == RF_OK && rf_image_format(image) >= RF_SAMPLE_HALF)
        result = check_finite(path, image);
    if (result != RF_OK)
    {
        rf_image_destroy(image);
        return result;
    }
    *out = image;
    return RF_OK;
}
