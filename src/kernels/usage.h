// SPDX-License-Identifier: Apache-2.0
// Spreads the use of an exemplar: places that are used more than others cost more.
//
// The idea of a cost for use: Kaspar, Neubert, Lischinski, Pauly, Kopf. Self tuning texture optimization. 2015;
// Jamriska, Fiser, Asente, Lu, Shechtman, Sykora. LazyFluids. 2015.
//
// A cost that follows the present use alone swings: all windows leave a crowded place at once. Here the prices of a
// coarse grid of cells rise while a cell is used more than the mean and fall while it is used less, as prices in a
// market do (dual ascent on the constraint of even use), and stay from level to level.
#pragma once

enum
{
    /// Cells a side.
    RF_USAGE_CELLS = 8
};

typedef struct RfUsage
{
    float price[RF_USAGE_CELLS * RF_USAGE_CELLS];
    float count[RF_USAGE_CELLS * RF_USAGE_CELLS];
} RfUsage;

/// A window's centre was put at (x, y) of an exemplar where centres lie `margin` pixels from the border at least.
void rf_usage_add(RfUsage *usage, int width, int height, int margin, float x, float y);
/// Moves the prices by what was counted, and counts anew.
void rf_usage_settle(RfUsage *usage);
/// Prices of every pixel [height][width] times `scale`, interpolated between cells.
void rf_usage_prices(const RfUsage *usage, int width, int height, int margin, float scale, float *prices);
