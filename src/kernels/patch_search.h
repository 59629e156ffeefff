// SPDX-License-Identifier: Apache-2.0
// The best-fit patch under a mask: of all places of a picture that one at which it differs least from what is known.
//
// Wang, Wang, Yong, Sun. Synthesizing 2D directional moving texture. 2005 (equation 2, with weights for its mask).
//
// The result is that of trying all places one by one, of equals the first; it does not depend on the instruction set.
// kernels/neighbours.h does the same for windows of one size that it knows beforehand; here each query has its own size
// and mask, and a mask is mostly empty.
#pragma once

#include "riffle/data.h"

enum
{
    /// Of a query's box.
    RF_PATCH_BOX = 64,
    RF_PATCH_GROUPS = 64,
    RF_MAX_PATCH_TERMS = RF_PATCH_BOX * RF_PATCH_BOX * RF_MAX_EXEMPLAR_CHANNELS
};

/// Where a box has room: where all of its pixels are valid, or the one in its middle is (the other ones are then taken
/// as they are).
typedef enum RfPatchRoom
{
    RF_ROOM_OF_ALL,
    RF_ROOM_OF_MIDDLE
} RfPatchRoom;

/// A picture that patches are taken from.
typedef struct RfPatchPicture
{
    int width, height, channels;
    /// [channels][height][stride], and some numbers more at the end.
    float *planes;
    ptrdiff_t stride;
    /// [height + 1][width + 1]: how many pixels above and left of here are not valid.
    int32_t *invalid;
    RfPatchRoom room;
    /// [height][width]: the group of each pixel, which is priced; RF_PATCH_GROUPS where no box may have its middle.
    uint8_t *groups;
} RfPatchPicture;

/// pixels: [height][width][channels], finite where they are looked at. valid: [height][width], 0: not valid; NULL: all
/// are. groups: [height][width], below RF_PATCH_GROUPS; NULL: all 0.
RfResult rf_patch_picture_create(const float *pixels, int width, int height, int channels, const uint8_t *valid,
                                 const uint8_t *groups, RfPatchRoom room, RfPatchPicture *out);
void rf_patch_picture_free(RfPatchPicture *picture);

typedef struct RfPatchQuery
{
    /// Of the box, 1 to RF_PATCH_BOX.
    int width, height;
    /// [height][width][channels] and [height][width]: what is known, and how much it counts, 0: not known.
    const float *pixels, *weights;
    /// [RF_PATCH_GROUPS]: what a place costs besides, by the group of the pixel in the box's middle; 0 or more. NULL:
    /// nothing.
    const float *prices;
    /// A place that may fit well, from which the search starts. Any numbers: it changes the time, never the result.
    int guess_x, guess_y;
} RfPatchQuery;

typedef struct RfPatchMatch
{
    /// Of the box's first (top left) pixel. -1 where the box has room nowhere.
    int x, y;
    /// Sum of squared differences, each times its weight, and the price.
    double distance;
} RfPatchMatch;

/// What one search needs at a time.
typedef struct RfPatchTerms
{
    int count;
    ptrdiff_t offset[RF_MAX_PATCH_TERMS];
    float value[RF_MAX_PATCH_TERMS], weight[RF_MAX_PATCH_TERMS];
    float prices[RF_PATCH_GROUPS + 1];
} RfPatchTerms;

/// From inside: adds the differences from the query's numbers to the sums of places side by side, the first of which
/// lies at `first`. whole: false if it was left because all sums were above the limit; they are then as they were.
void rf_sum_patch_terms(const float *first, const RfPatchTerms *terms, float limit, float *sums, bool *whole);

RfPatchMatch rf_patch_search(const RfPatchPicture *picture, const RfPatchQuery *query, RfPatchTerms *scratch);
