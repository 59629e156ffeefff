// SPDX-License-Identifier: Apache-2.0
#include "text.h"

#include <ctype.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

bool text_to_int(const char *text, int *out)
{
    if (!isdigit((unsigned char)text[0]) && text[0] != '-')
        return false;
    char *end = NULL;
    errno = 0;
    long value = strtol(text, &end, 10);
    if (end == text || *end || errno || value < INT_MIN || value > INT_MAX)
        return false;
    *out = (int)value;
    return true;
}

bool text_to_uint64(const char *text, uint64_t *out)
{
    if (!isdigit((unsigned char)text[0]))
        return false;
    char *end = NULL;
    errno = 0;
    unsigned long long value = strtoull(text, &end, 10);
    if (*end || errno)
        return false;
    *out = value;
    return true;
}

bool text_to_double(const char *text, double *out)
{
    if (!isdigit((unsigned char)text[0]) && !strchr("+-.", text[0]))
        return false;
    char *end = NULL;
    double value = strtod(text, &end);
    if (end == text || *end || !isfinite(value))
        return false;
    *out = value;
    return true;
}

int text_choice(const char *choices, const char *text)
{
    size_t length = strlen(text);
    int index = 0;
    for (const char *at = choices; at; ++index)
    {
        const char *bar = strchr(at, '|');
        size_t size = bar ? (size_t)(bar - at) : strlen(at);
        if (size == length && length > 0 && strncmp(at, text, size) == 0)
            return index;
        at = bar ? bar + 1 : NULL;
    }
    return -1;
}

void text_list(const char *choices, char *out, size_t size)
{
    size_t used = 0;
    const char *last = strrchr(choices, '|');
    for (const char *c = choices; *c && used + 5 < size; ++c)
    {
        const char *piece = *c != '|' ? NULL : c == last ? " or " : ", ";
        if (piece)
            used += (size_t)snprintf(out + used, size - used, "%s", piece);
        else
            out[used++] = *c;
    }
    out[used] = '\0';
}

const char *text_base_name(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

const char *text_extension(const char *path)
{
    const char *dot = strrchr(text_base_name(path), '.');
    return dot ? dot + 1 : "";
}

bool text_extension_in(const char *path, const char *extensions)
{
    char lower[16];
    size_t i = 0;
    for (const char *c = text_extension(path); *c && i + 1 < sizeof lower; ++c)
        lower[i++] = (char)tolower((unsigned char)*c);
    lower[i] = '\0';
    return text_choice(extensions, lower) >= 0;
}

bool text_starts(const char *text, const char *prefix)
{
    return strncmp(text, prefix, strlen(prefix)) == 0;
}
