// SPDX-License-Identifier: Apache-2.0
// Where is the nearest cell of a grid that is known?
#pragma once

#include <stdint.h>

/// nearest: [height][width], a known cell's own index and -1 elsewhere. Afterwards every cell holds the index of the
/// known one nearest to it (very rarely that of one a little farther), or -1 if none is known at all. Cost is linear.
///
/// Danielsson. Euclidean distance mapping. 1980.
void rf_spread_nearest(int32_t *nearest, int width, int height);
