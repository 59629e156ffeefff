// SPDX-License-Identifier: Apache-2.0
// The options that belong to no method.
#pragma once

#include "options.h"

typedef struct GenericOption
{
    const char *name;
    char letter;
    /// What follows: "A-B[xS]"; NULL for a flag.
    const char *value;
    /// The verbs that have it.
    unsigned verbs;
    /// The default, as text; "" where there is none to tell.
    const char *fallback;
    const char *sentence;
    int (*set)(Settings *settings, const char *value);
} GenericOption;

const GenericOption *generic_option_table(int *count);
/// By name, or by letter where name is NULL; NULL if there is none.
const GenericOption *generic_option(const char *name, char letter);
