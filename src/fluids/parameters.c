// SPDX-License-Identifier: Apache-2.0
#include "fluids/parameters.h"

#include "core/result.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/// One "key=value" of a spec, borrowed.
typedef struct Pair
{
    const char *key, *value;
    int key_length, value_length;
} Pair;

static RfResult refuse(const char *spec, Pair pair, const char *text)
{
    char file[400], place[128];
    snprintf(file, sizeof file, "builtin:%.380s", spec);
    snprintf(place, sizeof place, "%.*s", pair.key_length, pair.key);
    return rf_fail(RF_BAD_INPUT, file, place, "%s", text);
}

static RfResult refuse_unknown(const char *spec, Pair pair, const RfParameterRange *ranges)
{
    char text[512] = "there is no such parameter; there are: ";
    for (int i = 0; ranges[i].name; ++i)
    {
        size_t used = strlen(text);
        snprintf(text + used, sizeof text - used, "%s%s", i ? ", " : "", ranges[i].name);
    }
    return refuse(spec, pair, text);
}

/// Reads a number that must end at `end`; NaN if it does not.
static double read_number(const char *text, const char *end)
{
    char copy[64];
    size_t length = (size_t)(end - text);
    if (length == 0 || length >= sizeof copy)
        return NAN;
    memcpy(copy, text, length);
    copy[length] = 0;
    char *stop = NULL;
    double value = strtod(copy, &stop);
    return *stop || stop == copy ? NAN : value;
}

static bool in_range(double value, const RfParameterRange *range)
{
    if (!(value >= range->minimum && value <= range->maximum))
        return false;
    return range->kind == RF_PARAMETER_NUMBER || value == floor(value);
}

static RfResult read_size(const char *spec, Pair pair, const RfParameterRange *range, RfParameters *out)
{
    const char *end = pair.value + pair.value_length;
    const char *cross = memchr(pair.value, 'x', (size_t)pair.value_length);
    double width = read_number(pair.value, cross ? cross : end);
    double height = cross ? read_number(cross + 1, end) : width;
    if (!in_range(width, range) || !in_range(height, range))
    {
        char text[200];
        snprintf(text, sizeof text, "must be WxH or N with sides of %.0f to %.0f; it is \"%.*s\"", range->minimum,
                 range->maximum, pair.value_length < 40 ? pair.value_length : 40, pair.value);
        return refuse(spec, pair, text);
    }
    out->width = (int)width;
    out->height = (int)height;
    return RF_OK;
}

static RfResult read_pair(const char *spec, Pair pair, const RfParameterRange *ranges, RfParameters *out)
{
    for (int i = 0; ranges[i].name; ++i)
    {
        if (strlen(ranges[i].name) != (size_t)pair.key_length || memcmp(ranges[i].name, pair.key, pair.key_length))
            continue;
        if (ranges[i].kind == RF_PARAMETER_SIZE)
            return read_size(spec, pair, &ranges[i], out);
        double value = read_number(pair.value, pair.value + pair.value_length);
        if (in_range(value, &ranges[i]))
        {
            out->values[i] = value;
            return RF_OK;
        }
        char text[200];
        snprintf(text, sizeof text, "must be %s of %.10g to %.10g; it is \"%.*s\"",
                 ranges[i].kind == RF_PARAMETER_INTEGER ? "a whole number" : "a number", ranges[i].minimum,
                 ranges[i].maximum, pair.value_length < 40 ? pair.value_length : 40, pair.value);
        return refuse(spec, pair, text);
    }
    return refuse_unknown(spec, pair, ranges);
}

static RfResult read_list(const char *spec, const char *list, const RfParameterRange *ranges, RfParameters *out)
{
    while (*list)
    {
        const char *end = list + strcspn(list, "&");
        const char *equals = memchr(list, '=', (size_t)(end - list));
        Pair pair = {.key = list, .key_length = (int)((equals ? equals : end) - list)};
        if (!equals)
            return refuse(spec, pair, "has no value; write name=value");
        pair.value = equals + 1;
        pair.value_length = (int)(end - equals - 1);
        RF_TRY(read_pair(spec, pair, ranges, out));
        list = *end ? end + 1 : end;
    }
    return RF_OK;
}

bool rf_parameters_named(const char *spec, const char *name)
{
    size_t length = strcspn(spec, "?");
    return length == strlen(name) && memcmp(spec, name, length) == 0;
}

RfResult rf_parameters_read(const char *spec, const char *defaults, const RfParameterRange *ranges, RfParameters *out)
{
    *out = (RfParameters){.ranges = ranges};
    RF_TRY(read_list(spec, defaults, ranges, out));
    const char *question = strchr(spec, '?');
    return question ? read_list(spec, question + 1, ranges, out) : RF_OK;
}

double rf_parameter(const RfParameters *parameters, const char *name)
{
    for (int i = 0; parameters->ranges[i].name; ++i)
        if (strcmp(parameters->ranges[i].name, name) == 0)
            return parameters->values[i];
    assert(!"a parameter that is in the scene's list");
    return 0;
}
