// SPDX-License-Identifier: Apache-2.0
// Words and numbers in text that ends where its bytes end, not at a NUL, and whose decimal sign is a dot whatever the
// program's locale says.
#pragma once

#include "riffle/base.h"

typedef struct RfText
{
    const char *at, *end;
} RfText;

/// Skips blanks and every character of `also` (may be "").
void rf_text_skip(RfText *text, const char *also);

/// Reads a decimal number (nan and inf too) and moves behind it; false, without moving, if there is none.
bool rf_text_number(RfText *text, double *out);

/// The number that follows the first `key` in the text, blanks and quotes between them skipped.
bool rf_text_number_after(RfText text, const char *key, double *out);

/// Where `key` begins, ignoring case; NULL if it does not occur.
const char *rf_text_find(RfText text, const char *key);

/// The rest of the line at `text->at`, which is moved behind its end. False at the end of the text.
bool rf_text_line(RfText *text, RfText *line);
