// SPDX-License-Identifier: Apache-2.0
// Checks an options struct against its table.
#pragma once

#include "riffle/base.h"

/// RF_INVALID_ARGUMENT naming the field and its range if one is out of it; struct_size must be `size` ("start from
/// NAME").
RfResult rf_options_check(const void *options, uint32_t struct_size, size_t size, const char *defaults_name,
                          const RfOption *table, int count);
