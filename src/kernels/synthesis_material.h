// SPDX-License-Identifier: Apache-2.0
// An exemplar made ready for texture optimisation: which of its channels are compared, in one unit, from coarse to
// fine.
#pragma once

#include "data/exemplar.h"
#include "kernels/synthesis.h"

enum
{
    RF_SYNTHESIS_LEVELS = 10
};

typedef struct RfSynthesisMaterial
{
    const RfExemplar *exemplar;
    /// Compared channels, the guides among them last.
    int channels, guides;
    /// Channel of the exemplar for each, what is subtracted and what it is multiplied by. Equal channels are compared
    /// once, with their weights' sum.
    int from[RF_MAX_EXEMPLAR_CHANNELS];
    float middle[RF_MAX_EXEMPLAR_CHANNELS], factor[RF_MAX_EXEMPLAR_CHANNELS];
    /// For each channel of the exemplar: 1 + the compared channel that equals it, 0 if there is none.
    int compared[RF_MAX_EXEMPLAR_CHANNELS];
    /// The widest range of a compared channel, in the unit of comparison.
    float widest;
    int level_count;
    /// 0 is the finest.
    RfSynthesisExemplar levels[RF_SYNTHESIS_LEVELS];
} RfSynthesisMaterial;

/// The map of this name is compared with a guide, and not made.
#define RF_GUIDE_MAP "guide"

/// levels: 0 picks as many as leave 9 to 17 pixels on the shorter side, but 3 at least where there is room. Exemplar
/// borrowed.
RfResult rf_synthesis_material_create(const RfExemplar *exemplar, int levels, int similar, RfSynthesisMaterial *out);
void rf_synthesis_material_free(RfSynthesisMaterial *material);

/// A window's side on a level: odd, as asked, but under two thirds of the exemplar's side unless it tiles, and within
/// the frame; 0 if that is under 5, so that the level is of no use for it.
int rf_synthesis_side(const RfSynthesisMaterial *material, int level, int side, int width, int height);
