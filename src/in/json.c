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

// Moves to the value of the object's member `key`.
static RfResult find_member(const char *path, const uint8_t *bytes, RfText *text, const char *key)
{
    RfText name;
    if (!take(text, '{'))
        return broken(path, bytes, text->at, "{");
    if (!take(text, '}'))
        do
        {
            if (!take_string(text, &name))
                return broken(path, bytes, text->at, "a name in quotes");
            if (!take(text, ':'))
                return broken(path, bytes, text->at, ":");
            rf_text_skip(text, "");
            if ((size_t)(name.end - name.at) == strlen(key) && memcmp(name.at, key, strlen(key)) == 0)
                return RF_OK;
            if (!skip_value(text))
                return broken(path, bytes, text->at, "a value");
        } while (take(text, ','));
    return rf_fail(RF_BAD_INPUT, path, NULL, "the object has no \"%s\"", key);
}

RfResult rf_json_number(const char *path, const uint8_t *bytes, size_t size, const char *key, double *out)
{
    RfText text = {(const char *)bytes, (const char *)bytes + size};
    RF_TRY(find_member(path, bytes, &text, key));
    return rf_text_number(&text, out) ? RF_OK : broken(path, bytes, text.at, "a number");
}

static bool unescape(RfText string, char *out, size_t most, size_t *length)
{
    *length = 0;
    for (const char *p = string.at; p < string.end; ++p)
    {
        if (*p == '\\' && (++p == string.end || !strchr("\"\\/", *p)))
            return false;
        if (*length == most)
            return false;
        out[(*length)++] = *p;
    }
    return true;
}

RfResult rf_json_strings(const char *path, const uint8_t *bytes, size_t size, const char *array, const char *name,
                         RfResult (*take_text)(void *user, const char *text, size_t length), void *user)
{
    RfText text = {(const char *)bytes, (const char *)bytes + size};
    RF_TRY(find_member(path, bytes, &text, array));
    if (!take(&text, '['))
        return broken(path, bytes, text.at, "[");
    if (take(&text, ']'))
        return RF_OK;
    do
    {
        char plain[4096];
        size_t length;
        RfText object = text, string;
        RF_TRY(find_member(path, bytes, &object, name));
        if (!take_string(&object, &string) || !unescape(string, plain, sizeof plain, &length))
            return broken(path, bytes, object.at, "a name without escapes");
        RF_TRY(take_text(user, plain, length));
        if (!skip_value(&text))
            return broken(path, bytes, text.at, "a value");
    } while (take(&text, ','));
    return take(&text, ']') ? RF_OK : broken(path, bytes, text.at, "]");
}
