// SPDX-License-Identifier: Apache-2.0
// Pictures in 16-bit fixed point, and the comparison of a window of one with windows of another: half the memory and
// twice the numbers a vector of float, and exact, so that every instruction set finds the same.
#pragma once

#include "riffle/data.h"

enum
{
    /// A picture's numbers lie within +-RF_FIXED_RANGE / 2. With windows up to RF_FIXED_SIDE wide and 16 channels the
    /// sums below then fit 32 bits: 33 rows * 17 vectors of 32 numbers * 2 squares of 1224 a lane < 2^31.
    RF_FIXED_RANGE = 1224,
    RF_FIXED_SIDE = 33,
    /// Numbers a vector: rows of windows are compared in whole ones.
    RF_FIXED_LANES = 32
};

typedef struct RfFixedPicture
{
    int width, height, channels;
    /// Pixels on every side of the picture that belong to its memory.
    int apron;
    /// Numbers from row to row.
    ptrdiff_t stride;
    int16_t *memory;
    /// Pixel (0, 0).
    int16_t *pixels;
} RfFixedPicture;

RfResult rf_fixed_create(int width, int height, int channels, int apron, RfFixedPicture *out);
void rf_fixed_free(RfFixedPicture *picture);

static inline int16_t *rf_fixed_at(const RfFixedPicture *picture, int x, int y)
{
    return picture->pixels + (ptrdiff_t)y * picture->stride + (ptrdiff_t)x * picture->channels;
}

/// Sets all pixels from [height][width][channels] numbers times `scale`, rounded and clamped.
void rf_fixed_set(RfFixedPicture *picture, const float *pixels, float scale);
/// Fills the apron: with what lies round the other side, or with the border's pixels.
void rf_fixed_extend(RfFixedPicture *picture, bool tiles);

/// One window to be compared with windows of `exemplar`, all given by their first (top left) pixel.
typedef struct RfFixedQuery
{
    const int16_t *window;
    ptrdiff_t stride, exemplar_stride;
    int side;
    /// Numbers in a row of a window, and the same in whole vectors.
    int numbers, run;
    /// [run]: -1 for the numbers, 0 for the rest.
    const int16_t *mask;
} RfFixedQuery;

/// Sets everything but `window`. mask: RF_FIXED_SIDE * 16 + RF_FIXED_LANES numbers.
void rf_fixed_query(const RfFixedPicture *picture, const RfFixedPicture *exemplar, int side, int16_t *mask,
                    RfFixedQuery *out);

/// Index of the candidate with the least sum of squared differences plus penalty (in the same unit; NULL: none), the
/// first of equals. *distance: its sum, without the penalty.
int rf_fixed_least(const RfFixedQuery *query, const int16_t *const *candidates, const float *penalties, int count,
                   float *distance);
