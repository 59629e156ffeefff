// SPDX-License-Identifier: Apache-2.0
// An exemplar ready to be sampled: mean removed, band-limited, twice oversampled, a level for each halving, four
// channels to a vector.
#pragma once

#include "riffle/data.h"

enum
{
    RF_TEXTURE_LEVELS = 8,
    RF_TEXTURE_QUADS = 8
};

/// Texel k stands at exemplar coordinate u = k / scale_x + 0.5 (pixel centres are at i + 0.5), so u is sampled at (u -
/// 0.5) * scale_x.
typedef struct RfTextureLevel
{
    int width, height;
    float scale_x, scale_y;
    /// Texels from row to row: width + 2; the last columns and rows repeat the first ones (tiling) or the last one
    /// (not).
    int stride;
    /// [quads][height + 2][stride][4]
    float *texels;
} RfTextureLevel;

typedef struct RfTexture
{
    int width, height, quads, level_count;
    bool tiles;
    RfTextureLevel levels[RF_TEXTURE_LEVELS];
} RfTexture;

static inline size_t rf_texture_plane(const RfTextureLevel *level)
{
    return (size_t)(level->height + 2) * (size_t)level->stride * 4;
}

/// pixels: [height][width][4 * quads], mean already removed; copied.
RfResult rf_texture_create(const float *pixels, int width, int height, int quads, bool tiles, RfTexture *out);
/// Mean square of a lane (its mean is 0 at level 0) over a level; lane 4 q + c is channel c of quad q.
double rf_texture_variance(const RfTexture *texture, int level, int lane);
void rf_texture_free(RfTexture *texture);
