// SPDX-License-Identifier: Apache-2.0
// Draws deformed textured grids into one tile: samples, weighs and sums them. The walk over tiles and the resolving of
// the sums are the caller's.
#pragma once

#include "core/memory.h"
#include "kernels/texture.h"

enum
{
    /// Pixels of a tile: wide rather than square, since its rows are what is worked on. A tile is drawn with one more
    /// row and column, so that the lattice below reaches its border.
    RF_TILE_WIDTH = 128,
    RF_TILE_HEIGHT = 64,
    RF_TILE_COLUMNS = RF_TILE_WIDTH + 1,
    RF_TILE_ROWS = RF_TILE_HEIGHT + 1,
    /// Row stride of a tile's planes: whole vectors.
    RF_TILE_PITCH = (RF_TILE_COLUMNS + 15) / 16 * 16,
    /// Weights of single grids are kept at every RF_LATTICE_STEP-th pixel, for the correlation of grids that overlap.
    RF_LATTICE_STEP = 8,
    RF_LATTICE_COLUMNS = RF_TILE_WIDTH / RF_LATTICE_STEP + 1,
    RF_LATTICE_ROWS = RF_TILE_HEIGHT / RF_LATTICE_STEP + 1,
    RF_LATTICE_POINTS = RF_LATTICE_COLUMNS * RF_LATTICE_ROWS
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

typedef struct RfDrawJob
{
    const RfTexture *texture;
    /// Power of K_p.
    float sharpness;
    /// For each quad: 0 as it is; 1 normals (x right, y up); 2 vectors (x right, y down), turned with the grid.
    int turned[RF_TEXTURE_QUADS];
    /// Pixel (i, j) of the tile is centred on origin + (i + 0.5, j + 0.5) * spacing; width <= RF_TILE_COLUMNS, height
    /// <= RF_TILE_ROWS.
    RfVec2 origin;
    float spacing;
    int width, height;
    /// Added to the texture level that each triangle asks for: log2 of the spacing.
    int level_bias;
} RfDrawJob;

/// One grid's coordinates and K_g K_d over a tile, between rasterising and sampling; `weight` is 0 everywhere between
/// two grids.
typedef struct RfTilePlanes
{
    float u[RF_TILE_ROWS * RF_TILE_PITCH], v[RF_TILE_ROWS * RF_TILE_PITCH], weight[RF_TILE_ROWS * RF_TILE_PITCH];
} RfTilePlanes;

/// Sums over the grids drawn so far. colour: [quads][RF_TILE_ROWS * RF_TILE_COLUMNS][4], of w (T - m); the others:
/// [RF_TILE_ROWS * RF_TILE_COLUMNS], row stride RF_TILE_COLUMNS.
typedef struct RfTileSums
{
    float *colour;
    float *weight, *weight2;
    /// Of w times the texture level.
    float *level;
    RfTilePlanes *planes;
} RfTileSums;

/// Memory for the sums of one tile, of which the first `rows` rows are cleared and may be drawn.
RfResult rf_tile_create(int quads, int rows, RfArena *arena, RfTileSums *out);
void rf_tile_clear(RfTileSums *sums, int quads, int rows);

/// Adds one grid. lattice (NULL: not wanted): [RF_LATTICE_POINTS], cleared here, w of this grid at the lattice. Returns
/// nothing; pixels_drawn grows by the samples taken.
void rf_tile_draw(const RfDrawJob *job, const RfDrawGrid *grid, RfTileSums *sums, float *lattice, int64_t *samples);

/// The four strongest grids a pixel, strongest first: [RF_TILE_ROWS * RF_TILE_COLUMNS].
typedef struct RfTileLayer
{
    float u[4], v[4], weight[4];
    int32_t id[4];
    float total;
} RfTileLayer;

void rf_tile_layers(const RfDrawJob *job, const RfDrawGrid *grid, RfTilePlanes *planes, RfTileLayer *layers);
