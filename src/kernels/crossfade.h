// SPDX-License-Identifier: Apache-2.0
// Draws a frame from several sets of carried coordinates that take turns: each set starts afresh while its weight is 0,
// somewhere else in the exemplar.
#pragma once

#include "core/random.h"
#include "kernels/coordinates.h"
#include "kernels/resolving.h"

enum
{
    /// Pixels of a row that are weighed at a time.
    RF_CROSSFADE_PIXELS = 64,
    RF_SAMPLE_QUADS = RF_SAMPLE_CHANNELS / 4
};

/// When a set starts afresh: every `period` frames, `phase` frames ahead of the first one.
typedef struct RfTurn
{
    double period, phase;
} RfTurn;

/// Frames since the set last started, 0 to period.
static inline double rf_turn_age(RfTurn turn, double elapsed)
{
    return fmod(elapsed + turn.phase, turn.period);
}

/// How often it has started.
static inline uint64_t rf_turn_count(RfTurn turn, double elapsed)
{
    return (uint64_t)((elapsed + turn.phase) / turn.period);
}

/// rf_coordinates_move, then starts those sets afresh whose turn came. turns: one a set.
RfResult rf_crossfade_move(RfCoordinates *coordinates, const RfTurn *turns, const char *stage, const RfFlowView *flow,
                           int width, int height);

/// Weights >= 0 of all sets at `count` pixels from (x, y) on: weights[set][RF_CROSSFADE_PIXELS].
typedef void RfWeighPixels(const void *context, int x, int y, int count, float (*weights)[RF_CROSSFADE_PIXELS]);

typedef struct RfCrossfade
{
    const RfSampler *sampler;
    const RfCoordinates *coordinates;
    /// Exemplar coordinates of the frame's corner, for each set, before it moves.
    RfVec2 origins[RF_MAX_COORDINATE_SETS];
    RfWeighPixels *weigh;
    const void *context;
    /// From rf_crossfade_quads; NULL for a single set.
    const RfResolveQuad *quads;
} RfCrossfade;

/// Draws the sets' origins from the seed: another one at each turn, or with turns NULL one for all, for ever.
void rf_crossfade_origins(RfCrossfade *crossfade, uint64_t seed, const RfTurn *turns);

/// What the exemplar's channels are blended about and kept within. Directions and alpha are blended plainly.
void rf_crossfade_quads(const RfExemplar *exemplar, bool contrast, RfResolveQuad quads[RF_SAMPLE_QUADS]);

/// Draws every pixel; land becomes 0. A single set is drawn as it is, without weighing.
void rf_crossfade_draw(const RfCrossfade *crossfade, const RfFlowView *flow, const RfImageView *frame);

/// The usual checks of a step's frame.
RfResult rf_crossfade_check(const RfSampler *sampler, const RfImageView *frame);
