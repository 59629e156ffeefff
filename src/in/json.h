// SPDX-License-Identifier: Apache-2.0
// As much of JSON as a file of named numbers needs.
#pragma once

#include "riffle/base.h"

/// The number that the top-level object holds under `key`. RF_BAD_INPUT, naming `path` and the line, if the text is no
/// JSON object up to there, or has no such number.
RfResult rf_json_number(const char *path, const uint8_t *bytes, size_t size, const char *key, double *out);
