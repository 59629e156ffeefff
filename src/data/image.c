// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "data/colour.h"

#include <stdio.h>
#include <string.h>

enum
{
    NAME_SIZE = 32
};

struct RfImage
{
    RfImageView view;
    RfSampleFormat format;
    RfEncoding encoding;
    char names[RF_MAX_CHANNELS][NAME_SIZE];
};

static void set_standard_names(RfImage *image)
{
    static const char *const grey[] = {"Y", "A"}, *const colour[] = {"R", "G", "B", "A"};
    int channels = image->view.channels;
    for (int c = 0; c < channels; ++c)
    {
        if (channels <= 2)
            snprintf(image->names[c], NAME_SIZE, "%s", grey[c]);
        else if (channels <= 4)
            snprintf(image->names[c], NAME_SIZE, "%s", colour[c]);
        else
            snprintf(image->names[c], NAME_SIZE, "channel%02d", c);
    }
}

RfResult rf_image_create(int width, int height, int channels, RfImage **out)
{
    RF_REQUIRE(out, "rf_image_create: out is NULL");
    *out = NULL;
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "image: %d x %d pixels: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    RF_REQUIRE(channels >= 1 && channels <= RF_MAX_CHANNELS, "image: %d channels: must be 1 to %d", channels,
               RF_MAX_CHANNELS);
    RfImage *image = rf_allocate_zero(1, sizeof *image);
    float *pixels = image ? rf_allocate_zero((size_t)width * (size_t)height, (size_t)channels * sizeof *pixels) : NULL;
    if (!pixels)
    {
        rf_release(image);
        return RF_OUT_OF_MEMORY;
    }
    image->view = (RfImageView){pixels, width, height, channels, (ptrdiff_t)width * channels};
    image->format = RF_SAMPLE_FLOAT;
    image->encoding = RF_ENCODING_SRGB;
    set_standard_names(image);
    *out = image;
    return RF_OK;
}

void rf_image_destroy(RfImage *image)
{
    if (!image)
        return;
    rf_release(image->view.pixels);
    rf_release(image);
}

RfImageView rf_image_view(const RfImage *image)
{
    return image->view;
}

RfSampleFormat rf_image_format(const RfImage *image)
{
    return image->format;
}

RfEncoding rf_image_encoding(const RfImage *image)
{
    return image->encoding;
}

void rf_image_set_origin(RfImage *image, RfSampleFormat format, RfEncoding encoding)
{
    image->format = format;
    image->encoding = encoding;
}

void rf_image_set_channel_name(RfImage *image, int channel, const char *name)
{
    assert(channel >= 0 && channel < image->view.channels);
    snprintf(image->names[channel], NAME_SIZE, "%s", name);
}

const char *rf_image_channel_name(const RfImage *image, int channel)
{
    assert(channel >= 0 && channel < image->view.channels);
    return image->names[channel];
}

bool rf_image_has_alpha(const RfImage *image)
{
    return image->view.channels > 1 && strcmp(image->names[image->view.channels - 1], "A") == 0;
}

// Colour channels are R, G, B and Y; alpha and everything else is data.
static bool is_colour(const char *name)
{
    return (name[0] == 'R' || name[0] == 'G' || name[0] == 'B' || name[0] == 'Y') && name[1] == '\0';
}

void rf_image_convert(RfImage *image, RfEncoding encoding)
{
    if (image->encoding == encoding || image->encoding == RF_ENCODING_DATA || encoding == RF_ENCODING_DATA)
        return;
    int channels = image->view.channels;
    size_t pixels = (size_t)image->view.width * (size_t)image->view.height;
    for (int c = 0; c < channels; ++c)
    {
        float *value = image->view.pixels + c;
        for (size_t i = 0; i < pixels && is_colour(image->names[c]); ++i, value += channels)
            *value = encoding == RF_ENCODING_LINEAR ? rf_srgb_to_linear(*value) : rf_linear_to_srgb(*value);
    }
    image->encoding = encoding;
}
