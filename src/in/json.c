// SPDX-License-Identifier: Apache-2.0
// Walks the members of one object and skips the values that are not asked for. Escapes in keys are not decoded: the
// names looked for have none.
#include "in/json.h"
#include "in/text.h"

#include "core/result.h"

#include <stdio.h>
#include <string.h>

static bool take(RfText *text, char c)
{
    rf_text_skip(text, "");
    if (text->at == text->end || *text->at != c)
        return false;
    ++text->at;
    return true;
}

static bool take_string(RfText *text, RfText *content)
{
    if (!take(text, '"'))
        return false;
    content->at = text->at;
    for (; text->at < text->end && *text->at != '"'; ++text->at)
        if (*text->at == '\\' && text->at + 1 < text->end)
            ++text->at;
    if (text->at == text->end)
        return false;
    content->end = text->at++;
    return true;
}

// A value of any kind: brackets are counted, which accepts [} too; it is skipped, not understood.
static bool skip_value(RfText *text)
{
    int depth = 0;
    RfText string;
    do
    {
        rf_text_skip(text, ":,");
        if (text->at == text->end)
            return false;
        char c = *text->at;
        if (c == '"')
        {
            if (!take_string(text, &string))
                return false;
            continue;
        }
        depth += (c == '{' || c == '[') - (c == '}' || c == ']');
        if (depth < 0)
            return false;
        ++text->at;
        while (!strchr("{}[]", c) && text->at < text->end && *text->at && !strchr(" \t\r\n,:{}[]\"", *text->at))
            ++text->at;
    } while (depth > 0);
    return true;
}

static RfResult broken(const char *path, const uint8_t *bytes, const char *at, const char *expected)
{
    int line = 1;
    for (const char *p = (const char *)bytes; p < at; ++p)
        line += *p == '\n';
    char place[32];
    snprintf(place, sizeof place, "line %d", line);
    return rf_fail(RF_BAD_INPUT, path, place, "not a JSON object: %s was expected here", expected);
}

RfResult rf_json_number(const char *path, const uint8_t *bytes, size_t size, const char *key, double *out)
{
    RfText text = {(const char *)bytes, (const char *)bytes + size}, name;
    if (!take(&text, '{'))
        return broken(path, bytes, text.at, "{");
    if (!take(&text, '}'))
        do
        {
            if (!take_string(&text, &name))
                return broken(path, bytes, text.at, "a name in quotes");
            if (!take(&text, ':'))
                return broken(path, bytes, text.at, ":");
            rf_text_skip(&text, "");
            bool wanted = (size_t)(name.end - name.at) == strlen(key) && memcmp(name.at, key, strlen(key)) == 0;
            if (wanted)
                return rf_text_number(&text, out) ? RF_OK : broken(path, bytes, text.at, "a number");
            if (!skip_value(&text))
                return broken(path, bytes, text.at, "a value");
        } while (take(&text, ','));
    return rf_fail(RF_BAD_INPUT, path, NULL, "the object has no \"%s\"", key);
}
