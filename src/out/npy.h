// SPDX-License-Identifier: Apache-2.0
// What files of NPY 1.0 begin with.
#pragma once

#include "out/file.h"

/// Announces little-endian float32 in C order; shape as "3, 4, 2".
RfResult rf_npy_header_write(RfOutFile *file, const char *shape);
