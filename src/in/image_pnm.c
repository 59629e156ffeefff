// SPDX-License-Identifier: Apache-2.0
// PGM and PPM (netpbm's P2, P3, P5, P6), up to 16 bit. Of a file with several images the first is read.
#include "in/image.h"

#include "core/result.h"

#include <stdio.h>

typedef struct PnmReading
{
    const char *file;
    const uint8_t *bytes;
    size_t size, position;
    // 2, 3, 5 or 6.
    int kind;
    int64_t width, height, maximum;
    int channels;
} PnmReading;

static bool is_space(uint8_t c)
{
    return c == ' ' || (c >= '\t' && c <= '\r');
}

static RfResult fail_at(const PnmReading *reading, const char *message)
{
    char place[64];
    snprintf(place, sizeof place, "byte %zu", reading->position);
    return rf_fail(RF_BAD_INPUT, reading->file, place, "broken %s: %s", reading->channels == 3 ? "PPM" : "PGM",
                   message);
}

static void skip_space(PnmReading *reading)
{
    while (reading->position < reading->size)
    {
        uint8_t c = reading->bytes[reading->position];
        if (c == '#')
        {
            while (reading->position < reading->size && reading->bytes[reading->position] != '\n')
                ++reading->position;
        }
        else if (is_space(c))
            ++reading->position;
        else
            break;
    }
}

// A number saturates far above every limit, so a long row of digits cannot overflow.
static RfResult read_number(PnmReading *reading, int64_t *out)
{
    skip_space(reading);
    if (reading->position == reading->size)
        return fail_at(reading, "the file ends where a number should be; copy it again");
    if (reading->bytes[reading->position] < '0' || reading->bytes[reading->position] > '9')
        return fail_at(reading, "a number should be here");
    int64_t value = 0;
    for (; reading->position < reading->size; ++reading->position)
    {
        uint8_t c = reading->bytes[reading->position];
        if (c < '0' || c > '9')
            break;
        if (value < (int64_t)1 << 40)
            value = value * 10 + (c - '0');
    }
    *out = value;
    return RF_OK;
}

static RfResult read_header(PnmReading *reading)
{
    if (reading->size < 2 || reading->bytes[0] != 'P')
        return rf_fail(RF_BAD_INPUT, reading->file, "header",
                       "not a PGM or PPM: it does not begin with P2, P3, P5 or P6");
    reading->kind = reading->bytes[1] - '0';
    if (reading->kind == 1 || reading->kind == 4)
        return rf_fail(RF_UNSUPPORTED, reading->file, "header", "is a PBM bitmap; convert it to PGM or PNG");
    if (reading->kind != 2 && reading->kind != 3 && reading->kind != 5 && reading->kind != 6)
        return rf_fail(RF_BAD_INPUT, reading->file, "header",
                       "not a PGM or PPM: it does not begin with P2, P3, P5 or P6");
    reading->channels = reading->kind == 3 || reading->kind == 6 ? 3 : 1;
    reading->position = 2;
    RF_TRY(read_number(reading, &reading->width));
    RF_TRY(read_number(reading, &reading->height));
    RF_TRY(read_number(reading, &reading->maximum));
    if (reading->maximum < 1 || reading->maximum > 65535)
        return fail_at(reading, "the greatest value must be 1 to 65535");
    RF_TRY(rf_image_check_size(reading->file, reading->width, reading->height, reading->channels));
    // Exactly one space ends a binary header.
    if (reading->kind >= 5)
    {
        if (reading->position == reading->size || !is_space(reading->bytes[reading->position]))
            return fail_at(reading, "a space should end the header");
        ++reading->position;
    }
    return RF_OK;
}

// Binary samples have a known size; a sample in text takes two bytes, but for the last.
static RfResult check_length(const PnmReading *reading)
{
    int64_t samples = reading->width * reading->height * reading->channels;
    bool text = reading->kind <= 3;
    int64_t needed = text ? 2 * samples - 1 : samples * (reading->maximum > 255 ? 2 : 1);
    int64_t there = (int64_t)(reading->size - reading->position);
    if (there >= needed)
        return RF_OK;
    char place[64];
    snprintf(place, sizeof place, "byte %zu", reading->size);
    return rf_fail(RF_BAD_INPUT, reading->file, place,
                   "broken %s: the file ends inside the pixels (%lld of %s%lld bytes); copy it again",
                   reading->channels == 3 ? "PPM" : "PGM", (long long)there, text ? "at least " : "",
                   (long long)needed);
}

static RfResult read_sample(PnmReading *reading, int64_t *value)
{
    if (reading->kind <= 3)
        RF_TRY(read_number(reading, value));
    else if (reading->maximum > 255)
    {
        const uint8_t *at = reading->bytes + reading->position;
        *value = at[0] << 8 | at[1];
        reading->position += 2;
    }
    else
        *value = reading->bytes[reading->position++];
    return *value <= reading->maximum ? RF_OK : fail_at(reading, "a sample is greater than the header allows");
}

static RfResult read_samples(PnmReading *reading, RfImage *image)
{
    RfImageView view = rf_image_view(image);
    size_t count = (size_t)view.width * (size_t)view.height * (size_t)view.channels;
    float maximum = (float)reading->maximum;
    for (size_t i = 0; i < count; ++i)
    {
        int64_t value;
        RF_TRY(read_sample(reading, &value));
        view.pixels[i] = (float)value / maximum;
    }
    return RF_OK;
}

static bool probe_pnm(const uint8_t *bytes, size_t size)
{
    return size >= 2 && bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6' &&
           (size == 2 || is_space(bytes[2]) || bytes[2] == '#');
}

static RfResult decode_pnm(const char *file, const uint8_t *bytes, size_t size, RfImage **out)
{
    *out = NULL;
    PnmReading reading = {.file = file, .bytes = bytes, .size = size, .channels = 1};
    RF_TRY(read_header(&reading));
    RF_TRY(check_length(&reading));
    RfImage *image;
    RF_TRY(rf_image_create((int)reading.width, (int)reading.height, reading.channels, &image));
    RfResult result = read_samples(&reading, image);
    if (result != RF_OK)
    {
        rf_image_destroy(image);
        return result;
    }
    rf_image_set_origin(image, reading.maximum > 255 ? RF_SAMPLE_U16 : RF_SAMPLE_U8, RF_ENCODING_SRGB);
    *out = image;
    return RF_OK;
}

const RfImageReader rf_pnm_reader = {"PGM or PPM", "pgm,ppm,pnm", probe_pnm, decode_pnm};
