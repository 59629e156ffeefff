// SPDX-License-Identifier: Apache-2.0
// The place in an exemplar that fits best what is drawn somewhere already.
#pragma once

#include "kernels/texture.h"

/// A window of a picture at a texture level's spacing, to be laid over that level.
typedef struct RfMatchWindow
{
    const RfTexture *texture;
    int level, width, height;
    /// Texels that must stay free round the window in an exemplar that does not tile.
    int margin;
    /// [quads][height][width][4]: the picture, and the weight of every number's squared difference.
    const float *target, *weight;
    /// Sum of weight * target^2.
    float energy;
    /// What it is on average over the exemplar: sum of weight * variance.
    float mean_energy;
} RfMatchWindow;

/// How ill the exemplar fits with the window's first pixel on texel (x, y): 2 - 2 correlation, plus a penalty on energy
/// unlike the exemplar's mean. Wraps where the exemplar tiles, else the window must fit. Without energies: the bare sum
/// of squared differences.
void rf_match_cost(const RfMatchWindow *window, int x, int y, float *cost);

/// Number of places at which the window may lie, along x and y.
void rf_match_places(const RfMatchWindow *window, int places[2]);

typedef struct RfMatch
{
    int x, y;
    float cost;
} RfMatch;

/// The `keep` best of `tries` random places (all of them in order, if there are no more), best first; ties go to the
/// earlier try. Returns how many were found.
int rf_match_search(const RfMatchWindow *window, int tries, int keep, uint64_t seed, uint64_t frame, uint64_t item,
                    RfMatch *best);
