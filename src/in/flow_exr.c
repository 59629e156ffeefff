// SPDX-License-Identifier: Apache-2.0
// OpenEXR: two channels of an image, in cells a frame, y down. Renderers and compositors name them differently.
#include "in/flow_format.h"
#include "in/image.h"

#include "core/result.h"

#include <stdio.h>
#include <string.h>

static const char *const known_names[][2] = {
    {"R", "G"}, {"X", "Y"}, {"u", "v"}, {"forward.u", "forward.v"}, {"velocity.x", "velocity.y"}};

enum
{
    KNOWN_COUNT = sizeof known_names / sizeof known_names[0]
};

static bool exr_probe(const uint8_t *bytes, size_t size)
{
    return size >= 4 && memcmp(bytes, "\x76\x2f\x31\x01", 4) == 0;
}

static int find_channel(const RfImage *image, int count, const char *name)
{
    for (int c = 0; c < count; ++c)
        if (strcmp(rf_image_channel_name(image, c), name) == 0)
            return c;
    return -1;
}

static RfResult no_channels(const RfFlowSource *source, const RfImage *image, int count)
{
    char names[256] = "";
    for (int c = 0; c < count && strlen(names) < sizeof names - 40; ++c)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", c ? ", " : "",
                 rf_image_channel_name(image, c));
    return rf_fail(RF_BAD_INPUT, source->path, "channels",
                   "no velocity here: looked for %s; it has: %s; name two with --variables",
                   source->options->variables ? source->options->variables
                                              : "R, G (also X, Y; u, v; forward.u, forward.v; velocity.x, velocity.y)",
                   names);
}

static RfResult find_channels(const RfFlowSource *source, const RfImage *image, int found[2])
{
    char wanted[2][64];
    int count = rf_image_view(image).channels;
    bool told = rf_flow_wanted_names(source->options, wanted[0], wanted[1]);
    for (int i = 0; i < (told ? 1 : KNOWN_COUNT); ++i)
    {
        found[0] = find_channel(image, count, told ? wanted[0] : known_names[i][0]);
        found[1] = find_channel(image, count, told ? wanted[1] : known_names[i][1]);
        if (found[0] >= 0 && found[1] >= 0)
            return RF_OK;
    }
    return no_channels(source, image, count);
}

static RfResult take_channels(const RfFlowSource *source, const RfImage *image, RfFlowMoment *out)
{
    int channels[2];
    RfImageView view = rf_image_view(image);
    RF_TRY(find_channels(source, image, channels));
    RF_TRY(rf_flow_moment_create(source, view.width, view.height, out));
    float *velocity = out->field.velocity;
    for (int y = 0; y < view.height; ++y)
        for (int x = 0; x < view.width; ++x)
            for (int c = 0; c < 2; ++c)
                *velocity++ = view.pixels[y * view.row_stride + (ptrdiff_t)x * view.channels + channels[c]];
    out->moment_count = 1;
    snprintf(out->conventions, sizeof out->conventions, "cells a frame, y down, from channels %s and %s",
             rf_image_channel_name(image, channels[0]), rf_image_channel_name(image, channels[1]));
    return RF_OK;
}

static RfResult exr_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    RfImage *image;
    RF_TRY(rf_image_decode(source->path, source->bytes, source->size, &image));
    RfResult result = take_channels(source, image, out);
    rf_image_destroy(image);
    return result;
}

const RfFlowFormat rf_flow_format_exr = {.name = "exr", .extensions = "exr", .probe = exr_probe, .read = exr_read};
