// SPDX-License-Identifier: Apache-2.0
#include "pattern.h"
#include "text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// Length of the number's mark at `at`, 0 if there is none; sets its digits.
static size_t mark_length(const char *at, int *digits)
{
    if (*at == '#')
    {
        size_t length = strspn(at, "#");
        *digits = (int)length;
        return length;
    }
    bool houdini = at[0] == '$' && at[1] == 'F';
    if (*at != '%' && !houdini)
        return 0;
    const char *number = at + (houdini ? 2 : 1);
    size_t length = strspn(number, "0123456789");
    if (length > 2)
        return 0;
    *digits = length ? atoi(number) : 1;
    if (houdini)
        return 2 + length;
    return number[length] == 'd' ? length + 2 : 0;
}

bool pattern_parse(const char *text, Pattern *pattern)
{
    *pattern = (Pattern){0};
    if (strlen(text) >= PATH_SIZE)
        return false;
    for (const char *at = text_base_name(text); *at; ++at)
    {
        int digits = 0;
        size_t length = mark_length(at, &digits);
        if (length == 0)
            continue;
        pattern->numbered = true;
        pattern->digits = digits > 32 ? 32 : digits;
        memcpy(pattern->head, text, (size_t)(at - text));
        pattern->head[at - text] = '\0';
        snprintf(pattern->tail, sizeof pattern->tail, "%s", at + length);
        return true;
    }
    snprintf(pattern->head, sizeof pattern->head, "%s", text);
    return true;
}

/// Length of `text` without its extension and the dot before it.
static int stem_length(const char *text)
{
    const char *extension = text_extension(text);
    return (int)strlen(text) - (int)(extension[0] ? strlen(extension) + 1 : 0);
}

bool pattern_name(const Pattern *pattern, int frame, const char *map, const char *extension, char name[PATH_SIZE])
{
    const char *last = pattern->numbered ? pattern->tail : pattern->head;
    int stem = stem_length(last);
    char number[64] = "", middle[64] = "";
    if (pattern->numbered)
        snprintf(number, sizeof number, "%0*d", pattern->digits, frame);
    if (map && pattern->numbered)
    {
        // "frame_0001" gives "frame_height_0001", "out.0001" and "out0001" a dot.
        size_t length = strlen(pattern->head);
        char before = length ? pattern->head[length - 1] : '/';
        bool separated = before == '.' || before == '_' || before == '-' || before == '/';
        char separator = before == '_' || before == '-' ? before : '.';
        snprintf(middle, sizeof middle, "%s%s%c", separated ? "" : ".", map, separator);
    }
    else if (map)
        snprintf(middle, sizeof middle, ".%s", map);
    if (!extension)
    {
        extension = text_extension(last);
        stem = extension[0] ? stem : (int)strlen(last);
    }
    const char *dot = extension[0] ? "." : "";
    int length = pattern->numbered
                     ? snprintf(name, PATH_SIZE, "%s%s%s%.*s%s%s", pattern->head, middle, number, stem, pattern->tail,
                                dot, extension)
                     : snprintf(name, PATH_SIZE, "%.*s%s%s%s", stem, pattern->head, middle, dot, extension);
    return length > 0 && length < PATH_SIZE;
}
