// SPDX-License-Identifier: Apache-2.0
// An exemplar made ready for texture optimisation: which of its channels are compared, in one unit, from coarse to
// fine.
#pragma once

#include "kernels/comparison.h"
#include "kernels/synthesis.h"

enum
{
    RF_SYNTHESIS_LEVELS = 10
};

typedef struct RfSynthesisMaterial
{
    RfComparison comparison;
    int level_count;
    /// 0 is the finest.
    RfSynthesisExemplar levels[RF_SYNTHESIS_LEVELS];
} RfSynthesisMaterial;

/// levels: 0 picks as many as leave 9 to 17 pixels on the shorter side, but 3 at least where there is room. Exemplar
/// borrowed.
RfResult rf_synthesis_material_create(const RfExemplar *exemplar, int levels, int similar, RfSynthesisMaterial *out);
void rf_synthesis_material_free(RfSynthesisMaterial *material);

/// A window's side on a level: odd, as asked, but under two thirds of the exemplar's side unless it tiles, and within
/// the frame; 0 if that is under 5, so that the level is of no use for it.
int rf_synthesis_side(const RfSynthesisMaterial *material, int level, int side, int width, int height);
