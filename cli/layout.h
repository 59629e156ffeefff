// SPDX-License-Identifier: Apache-2.0
// What each channel of a frame is, and how its colour is encoded.
#pragma once

#include "riffle/riffle.h"

typedef struct LayoutMap
{
    char name[32];
    RfMapKind kind;
    int first, channels;
} LayoutMap;

/// Colour first, alpha behind it, then the others: so the first `colours` channels are an image of 1 to 4 channels.
typedef struct Layout
{
    LayoutMap maps[RF_MAX_CHANNELS];
    int map_count, channels;
    /// Colour and alpha; 0: there is no colour.
    int colours;
    /// The last of them is alpha.
    bool alpha;
    RfSampleFormat format;
    /// Of the colour; the other maps are data.
    RfEncoding encoding;
} Layout;

/// Appends a map behind the others.
void layout_add(Layout *layout, const char *name, RfMapKind kind, int channels);

/// Splits an image by the names of its channels: R G B or Y are colour, A is alpha, "height" is a map of one channel,
/// "normal.X" and "normal.Y" belong to one map. `pixels` (an image of the layout's channels) is a copy in the layout's
/// order. An image of one channel with any name is colour of one channel.
RfResult layout_split(const RfImage *image, Layout *layout, RfImage **pixels);

/// Brings the frame's colour from the layout's encoding to `encoding`, and says so in the layout.
RfResult layout_encode(const RfImageView *frame, Layout *layout, RfEncoding encoding);

/// Copies `count` channels from `first` on into an image of their own.
RfResult layout_channels(const RfImageView *frame, const Layout *layout, int first, int count, RfImage **out);

/// The whole frame as an image for EXR: colour linear, every channel named ("R", "A", "height", "normal.X").
RfResult layout_linear(const RfImageView *frame, const Layout *layout, RfImage **out);
