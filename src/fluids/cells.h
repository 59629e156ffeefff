// SPDX-License-Identifier: Apache-2.0
// Weighted Voronoi cells (a power diagram) on the torus of a drawing: stones, bubbles, plates of crust.
#pragma once

#include "fluids/drawing.h"

typedef struct RfCell
{
    float x, y, radius;
} RfCell;

typedef struct RfCells RfCells;

typedef struct RfCellHit
{
    int cell, neighbour;
    /// From the cell's site.
    float dx, dy;
    float radius;
    /// Distance to the nearest wall, and the same with the corners rounded.
    float wall, round;
} RfCellHit;

/// Sites with radii from `large` down to `small`, the large ones first, none closer than `packing` times the sum of
/// two radii. They fill the torus.
RfResult rf_cells_create(const RfTorus *torus, float large, float small, float packing, uint64_t stream, RfCells **out);
void rf_cells_destroy(RfCells *cells);
/// The cell of a point. Corners are rounded over about `rounding`, less in small cells.
RfCellHit rf_cells_at(const RfCells *cells, float x, float y, float rounding);
