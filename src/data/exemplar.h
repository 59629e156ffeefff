// SPDX-License-Identifier: Apache-2.0
// An exemplar from inside: all maps interleaved in one image, and what each channel is.
#pragma once

#include "riffle/data.h"

struct RfExemplar
{
    /// [height][width][channels], the maps' channels one after the other.
    float *pixels;
    int width, height, channels;
    bool tiles;
    int map_count;
    RfMapView maps[RF_MAX_MAPS];
    char names[RF_MAX_MAPS][32];
    int first_channel[RF_MAX_MAPS];
    /// Of sizes, kinds and pixels, for saved states.
    uint64_t hash;
};
