// SPDX-License-Identifier: Apache-2.0
// Is a text JSON (RFC 8259)?
#pragma once

#include <stdbool.h>
#include <stddef.h>

/// The text's first `size` bytes are one JSON value, and nothing else but blanks.
bool json_is_well_formed(const char *text, size_t size);
