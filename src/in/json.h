// SPDX-License-Identifier: Apache-2.0
// As much of JSON as files of named numbers and lists of names need.
#pragma once

#include "riffle/base.h"

/// The number that the top-level object holds under `key`. RF_BAD_INPUT, naming `path` and the line, if the text is no
/// JSON object up to there, or has no such number.
RfResult rf_json_number(const char *path, const uint8_t *bytes, size_t size, const char *key, double *out);

/// Calls `take` with the text under `name` of every object in the array that the top-level object holds under `array`,
/// and hands up its failure. Names with escapes other than \" \\ and \/ are refused.
RfResult rf_json_strings(const char *path, const uint8_t *bytes, size_t size, const char *array, const char *name,
                         RfResult (*take)(void *user, const char *text, size_t length), void *user);
