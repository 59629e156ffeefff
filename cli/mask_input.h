// SPDX-License-Identifier: Apache-2.0
// The mask of --mask: white is fluid.
#pragma once

#include <stdint.h>

/// Brings it to width x height cells: fluid where it is half white or more. [height][width], from malloc. A mask
/// without any fluid is refused.
int mask_read(const char *path, int width, int height, uint8_t **out);
