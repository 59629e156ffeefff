// SPDX-License-Identifier: Apache-2.0
// Checks an options struct against its table.
#pragma once

#include "riffle/base.h"

/// RF_INVALID_ARGUMENT naming the field and its range if one is out of it; struct_size must be `size` ("start from
/// NAME").
RfResult rf_options_check(const void *options, uint32_t struct_size, size_t size, const char *defaults_name,
                          const RfOption *table, int count);

/// Of every field's value, for saved states; the struct's padding has no defined bytes.
uint64_t rf_options_hash(const void *options, const RfOption *table, int count, uint64_t seed);
