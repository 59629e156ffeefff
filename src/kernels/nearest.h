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
    RF_GROUP_LANES = 16
};

/// out[q * stride + c] = start[c] + sum over k: queries[k][q] * candidates[k][c], for 12 queries and 32 candidates.
/// Everything but `queries` starts on a multiple of 64 bytes.
void rf_tile_products(const float *queries, const float *candidates, int numbers, const float *start, float *out,
                      ptrdiff_t stride);

/// minima[lane] = least of bounds[lane + 16 i] over a group of 128.
void rf_fold_group(const float *bounds, float *minima);

/// The least of minima[count] (a multiple of 16) and the first index it stands at.
typedef struct RfLeast
{
    float value;
    int index;
} RfLeast;
void rf_find_least(const float *minima, int count, RfLeast *least);

/// Lists the candidates whose bound is at most `limit`, group by group, lane by lane, and returns how many there are.
/// minima[count] as rf_fold_group made them of bounds[8 * count]; the list needs room for one more than there can be.
int rf_list_below(const float *bounds, const float *minima, int count, float limit, int *list);

/// A place that candidates may not overlap; `period` is 0 where nothing wraps.
typedef struct RfExclusion
{
    float x, y, reach, period_x, period_y;
} RfExclusion;

/// bounds[i] = INFINITY where (x[i], y[i]) is nearer than `reach` along both axes.
void rf_exclude_bounds(const RfExclusion *exclusion, const float *x, const float *y, int count, float *bounds);

/// Rows of a window in memory, or of weights (stride 0: every row has the same).
typedef struct RfWindowRows
{
    const float *numbers;
    ptrdiff_t stride;
} RfWindowRows;

/// Sum of weight * (a - b)^2 over rows of `count` numbers, a multiple of 4: numbers past the window's end must be
/// finite and weigh 0. Always summed in the same order and never fused.
float rf_window_distance(RfWindowRows a, RfWindowRows b, RfWindowRows weights, int rows, int count);
