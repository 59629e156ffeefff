// SPDX-License-Identifier: Apache-2.0
// Pictures of half the size, for whatever works from coarse to fine.
#pragma once

#include <stdbool.h>

/// Halves a picture, rounding its size up: pixel (x, y) of `half` covers pixels (2x, 2y) to (2x + 1, 2y + 1), smoothed
/// by a 4 x 4 kernel so that little of what it cannot hold is folded back. Beyond the borders the picture wraps if it
/// tiles, else it is mirrored. Shapes [height][width][channels] and [(height + 1) / 2][(width + 1) / 2][channels].
void rf_halve(const float *pixels, int width, int height, int channels, bool tiles, float *half);
