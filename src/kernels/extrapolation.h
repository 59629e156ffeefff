// SPDX-License-Identifier: Apache-2.0
// Push-pull: fills the unknown nodes of a small square grid from its known ones.
#pragma once

#include "riffle/data.h"

enum
{
    RF_MAX_GRID_VERTICES = 32
};

/// values, known: [n][n], 1 <= n <= RF_MAX_GRID_VERTICES. Unknown values are replaced; with nothing known all become 0.
/// Returns how many were known.
int rf_push_pull(RfVec2 *values, const bool *known, int n);
