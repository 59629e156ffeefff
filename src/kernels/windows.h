// SPDX-License-Identifier: Apache-2.0
// What a database of windows (neighbours.h) is inside: pixels, places and projections.
#pragma once

#include "kernels/nearest.h"
#include "kernels/neighbours.h"

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
    /// side * channels, rounded up to 4; the weights of such a row, 0 past its end.
    int row_numbers;
    float *row_weights;
    float mean[RF_MAX_WINDOW_CHANNELS], scale[RF_MAX_WINDOW_CHANNELS];
    /// Numbers compared, and what they are: `components` coordinates and the residual's norm, or, in few numbers, the
    /// window itself (components = numbers = kept).
    int components, kept, blocks;
    bool complete;
    float variance_kept;
    /// [blocks][numbers][32]
    float *basis;
    /// [tiles][kept][32], and half the squared norm, [tiles * 32], INFINITY past the last candidate.
    float *kept_numbers, *half_norms;
    /// Over all candidates: the largest squared norm, and how far a residual's norm can be off.
    float largest_norm, residual_error;
};

/// What a panel of 12 windows is in the comparison.
typedef struct RfPanelNorms
{
    float norm[RF_TILE_QUERIES], residual[RF_TILE_QUERIES], residual_error[RF_TILE_QUERIES];
} RfPanelNorms;

/// Not masked out, and numbers that a search can take.
bool rf_pixel_is_valid(const RfWindowSource *source, int x, int y);

RfWindowRows rf_window_rows(const RfWindowDatabase *database, int candidate);

/// Where a window's centre lies in the exemplar.
void rf_window_centre(const RfWindowDatabase *database, RfWindowPlace place, float *x, float *y);

/// 12 windows, mean taken off and times the roots of the channel weights: panel[numbers][12]. Windows past `count` are
/// 0.
void rf_pack_panel(const RfWindowDatabase *database, const RfWindowRows *windows, int count, float *panel);

/// products[12][blocks * 32] are the panel's coordinates on the basis (unused if the database is complete).
void rf_measure_panel(const RfWindowDatabase *database, const float *panel, const float *products, RfPanelNorms *norms);

/// Twice the unit roundoff times the length of the sums behind a bound: see neighbours.c.
float rf_rounding_of(int numbers);
