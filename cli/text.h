// SPDX-License-Identifier: Apache-2.0
// Numbers and lists in text.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/// The whole text must be the number; "", "12x", " 12" and numbers out of the type's range are none. NaN and infinity
/// are none.
bool text_to_int(const char *text, int *out);
bool text_to_uint64(const char *text, uint64_t *out);
bool text_to_double(const char *text, double *out);
/// Index of `text` in "plain|contrast|histogram", -1 if it is not there.
int text_choice(const char *choices, const char *text);
/// "plain|contrast|histogram" as "plain, contrast or histogram".
void text_list(const char *choices, char *out, size_t size);
/// After the last '.', without it; "" if there is none.
const char *text_extension(const char *path);
/// True if the extension is in "png|exr|npy", whatever its case.
bool text_extension_in(const char *path, const char *extensions);
/// After the last '/'.
const char *text_base_name(const char *path);
bool text_starts(const char *text, const char *prefix);
