// SPDX-License-Identifier: Apache-2.0
// Draws deformed textured grids into one tile: samples, weighs and sums them. The walk over tiles and the resolving of
// the sums are the caller's.
#pragma once

#include "core/memory.h"
#include "kernels/rasterising.h"
#include "kernels/texture.h"

enum
{
    /// Weights of single grids are kept at every RF_LATTICE_STEP-th pixel, for the correlation of grids that overlap.
    RF_LATTICE_STEP = 8,
    RF_LATTICE_COLUMNS = RF_TILE_WIDTH / RF_LATTICE_STEP + 1,
    RF_LATTICE_ROWS = RF_TILE_HEIGHT / RF_LATTICE_STEP + 1,
    RF_LATTICE_POINTS = RF_LATTICE_COLUMNS * RF_LATTICE_ROWS
};

typedef struct RfDrawJob
{
    const RfTexture *texture;
    /// Power of K_p.
    float sharpness;
    /// For each quad: 0 as it is; 1 normals (x right, y up); 2 vectors (x right, y down), turned with the grid.
    int turned[RF_TEXTURE_QUADS];
    /// The tile's pixels.
    RfRasterArea area;
    /// Added to the texture level that each triangle asks for: log2 of the spacing.
    int level_bias;
} RfDrawJob;

/// Sums over the grids drawn so far. colour: [quads][RF_TILE_ROWS * RF_TILE_COLUMNS][4], of w (T - m); the others:
/// [RF_TILE_ROWS * RF_TILE_COLUMNS], row stride RF_TILE_COLUMNS.
typedef struct RfTileSums
{
    float *colour;
    float *weight, *weight2;
    /// Of w times the texture level.
    float *level;
    RfRasterPlanes *planes;
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

void rf_tile_layers(const RfDrawJob *job, const RfDrawGrid *grid, RfRasterPlanes *planes, RfTileLayer *layers);
