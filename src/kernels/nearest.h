// SPDX-License-Identifier: Apache-2.0
// The inner loops of the search for nearest windows: blocks of lower bounds, their minima, and the full comparison.
#pragma once

#include <stdbool.h>
#include <stddef.h>

enum
{
    /// Queries and candidates of one tile of the comparison.
    RF_TILE_QUERIES = 12,
    RF_TILE_CANDIDATES = 32,
    /// A minimum is kept for every 16th candidate of a group of 4 tiles.
    RF_GROUP_TILES = 4,
    RF_GROUP_CANDIDATES = RF_GROUP_TILES * RF_TILE_CANDIDATES,
    RF_GROUP_LANES = 16,
    /// Minima of one query at the most.
    RF_MAX_LANES = 512,
    /// Numbers of a window that lie together where 12 windows are projected.
    RF_WINDOW_BLOCK = 16
};

/// out[q * stride + c] = start[c] + sum over k: queries[k][q] * candidates[k][c], for 12 queries and 32 candidates.
/// Everything but `queries` starts on a multiple of 64 bytes.
void rf_tile_products(const float *queries, const float *candidates, int numbers, const float *start, float *out,
                      ptrdiff_t stride);

/// out[q * stride + c] = sum over k: windows[k / 16][q][k % 16] * basis[k][c], for 12 windows and 32 vectors.
void rf_project(const float *windows, int numbers, const float *basis, float *out, ptrdiff_t stride);

/// For each query: minima[lane] = least of bounds[lane + 16 i] over a group of 128.
void rf_fold_group(const float *bounds, ptrdiff_t bounds_stride, int queries, float *minima, ptrdiff_t minima_stride);

/// A candidate that has the least bound, and that bound. minima[count] as rf_fold_group made them of bounds[8 * count];
/// count is a multiple of 16.
int rf_find_least(const float *bounds, const float *minima, int count, float *value);

/// Lists the candidates whose bound is at most `limit`, group by group, lane by lane, and returns how many there are.
/// The list needs room for one more than there can be. At most RF_MAX_LANES minima.
int rf_list_below(const float *bounds, const float *minima, int count, float limit, int *list);

/// A place that candidates may not overlap; `period` is 0 where nothing wraps.
typedef struct RfExclusion
{
    float x, y, reach, period_x, period_y;
} RfExclusion;

/// bounds[i] = INFINITY where (x[i], y[i]) is nearer than `reach` along both axes.
void rf_exclude_bounds(const RfExclusion *exclusion, const float *x, const float *y, int count, float *bounds);

/// Rows of a window in memory, or of weights (stride 0: every row has the same; NULL: all are 1).
typedef struct RfWindowRows
{
    const float *numbers;
    ptrdiff_t stride;
} RfWindowRows;

/// Sum of weight * (a - b)^2 over rows of `count` numbers, the same bytes on every instruction set. Rows are read to
/// the next multiple of 16: numbers past the window's end must be finite and weigh 0.
float rf_window_distance(RfWindowRows a, RfWindowRows b, RfWindowRows weights, int rows, int count);
