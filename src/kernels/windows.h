// SPDX-License-Identifier: Apache-2.0
// What a database of windows (neighbours.h) is inside: pixels, places and projections.
#pragma once

#include "kernels/nearest.h"
#include "kernels/neighbours.h"
#include "kernels/short_bounds.h"

/// Larger numbers are not valid: squares of theirs, summed over a window, would leave float's range.
#define RF_WINDOW_LARGEST 1e12f
#define RF_WINDOW_LARGEST_WEIGHT 1e4f

typedef struct RfWindowCopy
{
    /// Places that a window's first pixel can have.
    int places_x, places_y;
    /// Floats from row to row; where the first pixel lies in the pool; its first entry in row_starts.
    ptrdiff_t stride;
    size_t pixels, rows;
    float to_exemplar[6];
} RfWindowCopy;

struct RfWindowDatabase
{
    int side, channels, numbers, copies, candidates, tiles_of_candidates;
    bool wraps;
    RfWindowCopy *copy;
    /// All copies, each with a margin of side - 1 where windows wrap, so that a window is `side` plain rows.
    float *pixels;
    /// [rows of places over all copies + 1]: candidates before each.
    int *row_starts;
    RfWindowPlace *places;
    /// [tiles * 32]: centres in the exemplar.
    float *centre_x, *centre_y;
    float period_x, period_y;
    /// side * channels, rounded up to 16; the weights of such a row, 0 past its end; whether all are 1.
    int row_numbers;
    float *row_weights;
    bool bare;
    float mean[RF_MAX_WINDOW_CHANNELS], scale[RF_MAX_WINDOW_CHANNELS];
    /// The same for all of a window's numbers, 0 up to a multiple of 16.
    float *means, *scales;
    /// Numbers compared, and what they are: `components` coordinates and the residual's norm, or, in few numbers, the
    /// window itself (components = numbers = kept).
    int components, kept, blocks;
    bool complete;
    float variance_kept;
    /// [blocks][numbers][32]
    float *basis;
    /// [tiles][kept][32], negative, and half the squared norm, [tiles * 32], INFINITY past the last candidate.
    float *kept_numbers, *half_norms;
    /// The same in integers; `numbers` is NULL where floats are as fast.
    RfShortNumbers shorts;
    /// Over all candidates: the largest squared norm, and how far a residual's norm can be off.
    float largest_norm, residual_error;
    /// As residual_error, for the second bound's residual: components beyond the kept ones.
    float rest_error;
};

/// Squared norms of a panel's 12 windows, and how far the norms of their residuals can be off.
typedef struct RfPanelNorms
{
    float norm[RF_TILE_QUERIES], residual_error[RF_TILE_QUERIES], rest_error[RF_TILE_QUERIES];
} RfPanelNorms;

/// What of 12 windows is compared, and in the second bound.
typedef struct RfKeptWindows
{
    float kept[RF_TILE_QUERIES][RF_KEPT_STRIDE] __attribute__((aligned(64)));
    float rest[RF_TILE_QUERIES][RF_REST_NUMBERS] __attribute__((aligned(64)));
    RfPanelNorms norms;
} RfKeptWindows;

/// Not masked out, and numbers that a search can take.
bool rf_pixel_is_valid(const RfWindowSource *source, int x, int y);

RfWindowRows rf_window_rows(const RfWindowDatabase *database, int candidate);

/// Where a window's centre lies in the exemplar.
void rf_window_centre(const RfWindowDatabase *database, RfWindowPlace place, float *x, float *y);

/// 12 windows, mean taken off and times the roots of the channel weights: panel[numbers][12]. Windows past `count` are
/// 0.
void rf_pack_panel(const RfWindowDatabase *database, const RfWindowRows *windows, int count, float *panel);

/// Numbers of a window, rounded up to whole blocks.
int rf_block_numbers(const RfWindowDatabase *database);

/// Window q of 12, mean taken off and times the roots of the channel weights: windows[k / 16][q][k % 16]. `window` is
/// read to whole blocks. Returns its squared norm.
float rf_centre_window(const RfWindowDatabase *database, const float *window, int q, float *windows);

/// Fills all but the norms, which must be there.
void rf_keep_windows(const RfWindowDatabase *database, const float *windows, RfKeptWindows *out);

/// Fills basis, components and kept: `wanted` components, or (0) as many as are fastest.
RfResult rf_find_components(RfWindowDatabase *database, int wanted);

/// Room for candidates in integers, where these are faster.
RfResult rf_allocate_shorts(RfWindowDatabase *database);

/// Fills what is stored of candidates.
RfResult rf_project_candidates(RfWindowDatabase *database);

/// Twice the unit roundoff times the length of the sums behind a bound: see neighbours.c.
float rf_rounding_of(int numbers);
