// SPDX-License-Identifier: Apache-2.0
#include "support/json_check.h"

#include <ctype.h>
#include <string.h>

typedef struct Cursor
{
    const char *at, *end;
    int depth;
} Cursor;

static bool take_value(Cursor *cursor);

static void skip_blanks(Cursor *cursor)
{
    while (cursor->at < cursor->end && strchr(" \t\r\n", *cursor->at) && *cursor->at)
        ++cursor->at;
}

static bool take(Cursor *cursor, char c)
{
    skip_blanks(cursor);
    bool found = cursor->at < cursor->end && *cursor->at == c;
    cursor->at += found;
    return found;
}

static bool take_text(Cursor *cursor)
{
    if (!take(cursor, '"'))
        return false;
    for (; cursor->at < cursor->end && *cursor->at != '"'; ++cursor->at)
    {
        if ((unsigned char)*cursor->at < 32)
            return false;
        if (*cursor->at != '\\')
            continue;
        ++cursor->at;
        if (cursor->at >= cursor->end || !strchr("\"\\/bfnrtu", *cursor->at))
            return false;
        for (int i = 0; *cursor->at == 'u' && i < 4; ++i)
            if (cursor->at + i + 1 >= cursor->end || !isxdigit((unsigned char)cursor->at[i + 1]))
                return false;
    }
    return take(cursor, '"');
}

static bool take_digits(Cursor *cursor)
{
    const char *start = cursor->at;
    while (cursor->at < cursor->end && isdigit((unsigned char)*cursor->at))
        ++cursor->at;
    return cursor->at > start;
}

static bool take_number(Cursor *cursor)
{
    take(cursor, '-');
    const char *start = cursor->at;
    if (!take_digits(cursor) || (*start == '0' && cursor->at - start > 1))
        return false;
    if (cursor->at < cursor->end && *cursor->at == '.' && (++cursor->at, !take_digits(cursor)))
        return false;
    if (cursor->at >= cursor->end || (*cursor->at != 'e' && *cursor->at != 'E'))
        return true;
    ++cursor->at;
    if (cursor->at < cursor->end && (*cursor->at == '+' || *cursor->at == '-'))
        ++cursor->at;
    return take_digits(cursor);
}

static bool take_word(Cursor *cursor, const char *word)
{
    size_t length = strlen(word);
    bool found = (size_t)(cursor->end - cursor->at) >= length && memcmp(cursor->at, word, length) == 0;
    cursor->at += found ? length : 0;
    return found;
}

/// Members up to the closing bracket.
static bool take_members(Cursor *cursor, char close)
{
    if (take(cursor, close))
        return true;
    do
    {
        if (close == '}' && (!take_text(cursor) || !take(cursor, ':')))
            return false;
        if (!take_value(cursor))
            return false;
    } while (take(cursor, ','));
    return take(cursor, close);
}

static bool take_value(Cursor *cursor)
{
    skip_blanks(cursor);
    if (cursor->at >= cursor->end || ++cursor->depth > 64)
        return false;
    char c = *cursor->at;
    bool good;
    if (c == '{' || c == '[')
    {
        ++cursor->at;
        good = take_members(cursor, c == '{' ? '}' : ']');
    }
    else if (c == '"')
        good = take_text(cursor);
    else if (c == '-' || isdigit((unsigned char)c))
        good = take_number(cursor);
    else
        good = take_word(cursor, "true") || take_word(cursor, "false") || take_word(cursor, "null");
    --cursor->depth;
    return good;
}

bool json_is_well_formed(const char *text, size_t size)
{
    Cursor cursor = {.at = text, .end = text + size};
    bool good = take_value(&cursor);
    skip_blanks(&cursor);
    return good && cursor.at == cursor.end;
}
