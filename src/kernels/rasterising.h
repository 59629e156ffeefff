// SPDX-License-Identifier: Apache-2.0
// Rasterises deformed textured grids: exemplar coordinates and vertex weights at the points of a regular lattice.
#pragma once

#include "riffle/data.h"

enum
{
    /// Pixels of a tile: wide rather than square, since its rows are what is worked on. A tile is drawn with one more
    /// row and column, so that lattices of every 2^k-th pixel reach its border.
    RF_TILE_WIDTH = 128,
    RF_TILE_HEIGHT = 64,
    RF_TILE_COLUMNS = RF_TILE_WIDTH + 1,
    RF_TILE_ROWS = RF_TILE_HEIGHT + 1,
    /// Row stride of a tile's planes: whole vectors.
    RF_TILE_PITCH = (RF_TILE_COLUMNS + 15) / 16 * 16
};

/// A grid as drawing sees it. Vertex (i, j) is number j * n + i and stands for the exemplar coordinates u0 + i * cell,
/// v0 + j * cell.
typedef struct RfDrawGrid
{
    const float *x, *y;
    /// K_d at the vertices.
    const float *quality;
    int n;
    float u0, v0, cell;
    /// Frame pixels an exemplar pixel, averaged over the grid: d(x, y) / d(u, v), row by row. Chooses the filter.
    float stretch[4];
    /// Of the kernel K_p.
    RfVec2 centre;
    float radius;
    /// F_in F_out.
    float fade;
    /// Cosine and sine of the grid's turn, for direction maps.
    float turn_cos, turn_sin;
    /// Bounding box of what can be seen of it.
    float x0, y0, x1, y1;
    uint32_t id;
} RfDrawGrid;

/// The points origin + ((i + 0.5) spacing, (j + 0.5) row_spacing), i < width <= RF_TILE_COLUMNS, j < height <=
/// RF_TILE_ROWS.
typedef struct RfRasterArea
{
    RfVec2 origin;
    float spacing, row_spacing;
    int width, height;
} RfRasterArea;

/// One grid's coordinates and K_g K_d over an area, row stride RF_TILE_PITCH; `weight` is 0 everywhere between two
/// grids.
typedef struct RfRasterPlanes
{
    float u[RF_TILE_ROWS * RF_TILE_PITCH], v[RF_TILE_ROWS * RF_TILE_PITCH], weight[RF_TILE_ROWS * RF_TILE_PITCH];
} RfRasterPlanes;

/// Columns of each row that a grid has written to: [first, end), none where end <= first.
typedef struct RfRasterExtent
{
    // Padded, so that whole vectors of rows can be updated.
    int first[RF_TILE_ROWS + 16], end[RF_TILE_ROWS + 16];
} RfRasterExtent;

/// Writes what lies within `reach` of the grid's centre; the rest of the planes keeps its values.
void rf_rasterise(const RfRasterArea *area, const RfDrawGrid *grid, float reach, RfRasterPlanes *planes,
                  RfRasterExtent *extent);
