// SPDX-License-Identifier: Apache-2.0
#include "in/text.h"

#include <math.h>
#include <string.h>
#include <strings.h>

void rf_text_skip(RfText *text, const char *also)
{
    while (text->at < text->end && *text->at && (strchr(" \t\r\n", *text->at) || strchr(also, *text->at)))
        ++text->at;
}

static bool take_word(RfText *text, const char *word)
{
    size_t length = strlen(word);
    if ((size_t)(text->end - text->at) < length || strncasecmp(text->at, word, length) != 0)
        return false;
    text->at += length;
    return true;
}

static bool is_digit(const RfText *text)
{
    return text->at < text->end && *text->at >= '0' && *text->at <= '9';
}

// Nineteen digits fit 64 bits; those that follow change nothing in a double.
static bool take_digits(RfText *text, uint64_t *mantissa, int *exponent, bool fraction)
{
    bool any = false;
    for (; is_digit(text); ++text->at, any = true)
    {
        bool kept = *mantissa < 1000000000000000000u;
        if (kept)
            *mantissa = *mantissa * 10 + (uint64_t)(*text->at - '0');
        // A digit dropped before the point makes the number ten times larger, one kept behind it ten times smaller.
        if (kept == fraction && *exponent > -100000 && *exponent < 100000)
            *exponent += fraction ? -1 : 1;
    }
    return any;
}

static void take_exponent(RfText *text, int *exponent)
{
    RfText t = *text;
    if (t.at >= t.end || (*t.at != 'e' && *t.at != 'E'))
        return;
    ++t.at;
    bool negative = t.at < t.end && *t.at == '-';
    t.at += t.at < t.end && (*t.at == '-' || *t.at == '+');
    if (!is_digit(&t))
        return;
    int value = 0;
    for (; is_digit(&t); ++t.at)
        value = value < 100000 ? value * 10 + (*t.at - '0') : value;
    *exponent += negative ? -value : value;
    *text = t;
}

static double scale(uint64_t mantissa, int exponent)
{
    double x = (double)mantissa;
    if (exponent < -300)
        return x * pow(10, -300) * pow(10, exponent + 300);
    return exponent < 0 ? x / pow(10, -exponent) : x * pow(10, exponent);
}

bool rf_text_number(RfText *text, double *out)
{
    RfText t = *text;
    bool negative = t.at < t.end && *t.at == '-';
    t.at += t.at < t.end && (*t.at == '-' || *t.at == '+');
    if (take_word(&t, "nan"))
        *out = NAN;
    else if (take_word(&t, "infinity") || take_word(&t, "inf"))
        *out = negative ? -INFINITY : INFINITY;
    else
    {
        uint64_t mantissa = 0;
        int exponent = 0;
        bool any = take_digits(&t, &mantissa, &exponent, false);
        if (t.at < t.end && *t.at == '.')
        {
            ++t.at;
            any |= take_digits(&t, &mantissa, &exponent, true);
        }
        if (!any)
            return false;
        take_exponent(&t, &exponent);
        double magnitude = mantissa ? scale(mantissa, exponent) : 0;
        *out = negative ? -magnitude : magnitude;
    }
    *text = t;
    return true;
}

const char *rf_text_find(RfText text, const char *key)
{
    size_t length = strlen(key);
    for (const char *p = text.at; (size_t)(text.end - p) >= length; ++p)
        if (strncasecmp(p, key, length) == 0)
            return p;
    return NULL;
}

bool rf_text_number_after(RfText text, const char *key, double *out)
{
    const char *found = rf_text_find(text, key);
    if (!found)
        return false;
    text.at = found + strlen(key);
    rf_text_skip(&text, "\"'=");
    return rf_text_number(&text, out);
}

bool rf_text_line(RfText *text, RfText *line)
{
    if (text->at >= text->end)
        return false;
    const char *stop = memchr(text->at, '\n', (size_t)(text->end - text->at));
    *line = (RfText){text->at, stop ? stop : text->end};
    text->at = stop ? stop + 1 : text->end;
    return true;
}
