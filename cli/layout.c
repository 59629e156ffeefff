// SPDX-License-Identifier: Apache-2.0
#include "layout.h"

#include <stdio.h>
#include <string.h>

void layout_add(Layout *layout, const char *name, RfMapKind kind, int channels)
{
    LayoutMap *map = &layout->maps[layout->map_count++];
    *map = (LayoutMap){.kind = kind, .first = layout->channels, .channels = channels};
    snprintf(map->name, sizeof map->name, "%s", name);
    layout->channels += channels;
    if (kind == RF_MAP_COLOUR && map->first == 0)
        layout->colours = channels;
    if (kind == RF_MAP_ALPHA && map->first == layout->colours && layout->colours > 0 && !layout->alpha)
    {
        layout->colours += channels;
        layout->alpha = true;
    }
}

static int find_channel(const RfImage *image, const char *name)
{
    int channels = rf_image_view(image).channels;
    for (int c = 0; c < channels; ++c)
        if (strcmp(rf_image_channel_name(image, c), name) == 0)
            return c;
    return -1;
}

/// Lists the channels of colour and alpha in order; returns how many of them are colour.
static int find_colour(const RfImage *image, int order[RF_MAX_CHANNELS])
{
    int r = find_channel(image, "R"), g = find_channel(image, "G"), b = find_channel(image, "B");
    if (r >= 0 && g >= 0 && b >= 0)
    {
        order[0] = r;
        order[1] = g;
        order[2] = b;
        return 3;
    }
    int y = find_channel(image, "Y");
    order[0] = y >= 0 ? y : rf_image_view(image).channels == 1 ? 0 : -1;
    return order[0] >= 0 ? 1 : 0;
}

/// "normal.X" belongs to "normal"; "height" is its own.
static size_t map_name_length(const char *channel)
{
    const char *dot = strrchr(channel, '.');
    return dot && dot != channel ? (size_t)(dot - channel) : strlen(channel);
}

static RfMapKind kind_of(const char *name, int channels)
{
    if (channels == 3 && strcmp(name, "normal") == 0)
        return RF_MAP_NORMAL;
    if (channels == 2 && (strcmp(name, "motion") == 0 || strcmp(name, "velocity") == 0))
        return RF_MAP_VECTOR;
    return RF_MAP_DATA;
}

/// Adds the channels that are neither colour nor alpha, neighbours of one name together.
static void add_others(const RfImage *image, const bool *taken, int order[RF_MAX_CHANNELS], Layout *layout)
{
    int channels = rf_image_view(image).channels;
    for (int c = 0; c < channels;)
    {
        if (taken[c])
        {
            ++c;
            continue;
        }
        const char *first = rf_image_channel_name(image, c);
        size_t length = map_name_length(first);
        char name[32];
        snprintf(name, sizeof name, "%.*s", (int)length, first);
        int count = 0;
        for (; c < channels && !taken[c]; ++c, ++count)
        {
            const char *next = rf_image_channel_name(image, c);
            if (count > 0 && (map_name_length(next) != length || strncmp(next, first, length) != 0))
                break;
            order[layout->channels + count] = c;
        }
        layout_add(layout, name, kind_of(name, count), count);
    }
}

static RfResult copy_ordered(const RfImage *image, const int *order, const Layout *layout, RfImage **pixels)
{
    RfImageView from = rf_image_view(image);
    RfResult result = rf_image_create(from.width, from.height, layout->channels, pixels);
    if (result != RF_OK)
        return result;
    RfImageView to = rf_image_view(*pixels);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
            for (int c = 0; c < layout->channels; ++c)
                to.pixels[y * to.row_stride + (ptrdiff_t)x * to.channels + c] =
                    from.pixels[y * from.row_stride + (ptrdiff_t)x * from.channels + order[c]];
    rf_image_set_origin(*pixels, layout->format, layout->encoding);
    return RF_OK;
}

/// Writes the image's channels over those of the frame from `first` on.
static void put_channels(const RfImage *image, const RfImageView *frame, int first)
{
    RfImageView from = rf_image_view(image);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
            memcpy(frame->pixels + y * frame->row_stride + (ptrdiff_t)x * frame->channels + first,
                   from.pixels + y * from.row_stride + (ptrdiff_t)x * from.channels,
                   (size_t)from.channels * sizeof(float));
}

RfResult layout_encode(const RfImageView *frame, Layout *layout, RfEncoding encoding)
{
    if (layout->colours == 0 || layout->encoding == encoding || layout->encoding == RF_ENCODING_DATA)
        return RF_OK;
    RfImage *colour = NULL;
    RfResult result = layout_channels(frame, layout, 0, layout->colours, &colour);
    if (result != RF_OK)
        return result;
    rf_image_convert(colour, encoding);
    put_channels(colour, frame, 0);
    rf_image_destroy(colour);
    layout->encoding = encoding;
    return RF_OK;
}

RfResult layout_split(const RfImage *image, Layout *layout, RfImage **pixels)
{
    *layout = (Layout){.format = rf_image_format(image), .encoding = rf_image_encoding(image)};
    int order[RF_MAX_CHANNELS] = {0};
    bool taken[RF_MAX_CHANNELS] = {false};
    int colours = find_colour(image, order), alpha = find_channel(image, "A");
    for (int i = 0; i < colours; ++i)
        taken[order[i]] = true;
    if (colours > 0)
        layout_add(layout, "colour", RF_MAP_COLOUR, colours);
    if (colours > 0 && alpha >= 0 && !taken[alpha])
    {
        taken[alpha] = true;
        order[layout->channels] = alpha;
        layout_add(layout, "alpha", RF_MAP_ALPHA, 1);
    }
    add_others(image, taken, order, layout);
    return copy_ordered(image, order, layout, pixels);
}

RfResult layout_channels(const RfImageView *frame, const Layout *layout, int first, int count, RfImage **out)
{
    RfResult result = rf_image_create(frame->width, frame->height, count, out);
    if (result != RF_OK)
        return result;
    RfImageView to = rf_image_view(*out);
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
            memcpy(to.pixels + y * to.row_stride + (ptrdiff_t)x * count,
                   frame->pixels + y * frame->row_stride + (ptrdiff_t)x * frame->channels + first,
                   (size_t)count * sizeof(float));
    rf_image_set_origin(*out, layout->format, layout->encoding);
    return RF_OK;
}

static void name_channels(RfImage *image, const Layout *layout)
{
    static const char *const colours[] = {"R", "G", "B"}, *const axes[] = {"X", "Y", "Z"};
    for (int m = 0; m < layout->map_count; ++m)
    {
        const LayoutMap *map = &layout->maps[m];
        bool visible = map->first < layout->colours;
        for (int c = 0; c < map->channels; ++c)
        {
            char name[64];
            if (visible && map->kind == RF_MAP_COLOUR)
                snprintf(name, sizeof name, "%s", map->channels == 1 ? "Y" : colours[c]);
            else if (visible)
                snprintf(name, sizeof name, "A");
            else if (map->channels == 1)
                snprintf(name, sizeof name, "%s", map->name);
            else if (map->channels <= 3)
                snprintf(name, sizeof name, "%.29s.%s", map->name, axes[c]);
            else
                snprintf(name, sizeof name, "%.27s.%02d", map->name, c);
            rf_image_set_channel_name(image, map->first + c, name);
        }
    }
}

RfResult layout_linear(const RfImageView *frame, const Layout *layout, RfImage **out)
{
    RfResult result = layout_channels(frame, layout, 0, layout->channels, out);
    if (result != RF_OK)
        return result;
    name_channels(*out, layout);
    RfImageView view = rf_image_view(*out);
    Layout encoded = *layout;
    result = layout_encode(&view, &encoded, RF_ENCODING_LINEAR);
    if (result == RF_OK)
        rf_image_set_origin(*out, layout->format, layout->colours ? encoded.encoding : RF_ENCODING_DATA);
    else
    {
        rf_image_destroy(*out);
        *out = NULL;
    }
    return result;
}
