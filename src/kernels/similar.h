// SPDX-License-Identifier: Apache-2.0
// For every pixel of an exemplar the few places whose surroundings are most like its own: what k-coherent search takes
// its candidates from, at a cost that does not grow with the exemplar.
//
// Tong, Zhang, Liu, Wang, Guo, Shum. Synthesis of bidirectional texture functions on arbitrary surfaces. 2002.
#pragma once

#include "kernels/fixed_picture.h"

enum
{
    RF_MAX_SIMILAR = 8,
    /// Of the windows compared, where the picture has room for it.
    RF_SIMILAR_SIDE = 9
};

typedef struct RfPlace
{
    int16_t x, y;
} RfPlace;

typedef struct RfSimilar
{
    int width, height, count;
    /// [height][width][count], best first. Where fewer were found the pixel itself stands.
    RfPlace *places;
} RfSimilar;

static inline const RfPlace *rf_similar_at(const RfSimilar *similar, int x, int y)
{
    return similar->places + ((size_t)y * (size_t)similar->width + (size_t)x) * (size_t)similar->count;
}

/// `picture` has an apron of RF_SIMILAR_SIDE / 2 at least. coarse: the same of the picture halved, or NULL for the
/// coarsest one, where all places are compared (a regular part of them if there are very many).
RfResult rf_similar_create(const RfFixedPicture *picture, bool tiles, int count, const RfSimilar *coarse,
                           RfSimilar *out);
void rf_similar_free(RfSimilar *similar);
