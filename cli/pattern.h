// SPDX-License-Identifier: Apache-2.0
// Names of numbered output files: name.%04d.ext, name.####.ext, name.$F4.ext.
#pragma once

#include <stdbool.h>
#include <stddef.h>

enum
{
    PATH_SIZE = 4096
};

/// The text before the number, the number's digits, and the text behind.
typedef struct Pattern
{
    char head[PATH_SIZE];
    char tail[PATH_SIZE];
    int digits;
    /// False: one file, all of it in `head`.
    bool numbered;
} Pattern;

/// False if the text is too long.
bool pattern_parse(const char *text, Pattern *pattern);
/// The file's name. `map` (may be NULL) goes before the number, as "out.height.0001.exr"; `extension` (may be NULL)
/// takes the place of the pattern's own. False if the name would be too long.
bool pattern_name(const Pattern *pattern, int frame, const char *map, const char *extension, char name[PATH_SIZE]);
