// SPDX-License-Identifier: Apache-2.0
#include "errors.h"
#include "stop.h"

#include <math.h>
#include <string.h>

static _Thread_local Fault g_fault;

static void copy_text(char *to, size_t size, const char *from)
{
    snprintf(to, size, "%s", from ? from : "");
}

int fail(int code, const char *file, const char *place, const char *format, ...)
{
    // The arguments may point into the old fault, so it is replaced last.
    Fault fault = {.code = code};
    copy_text(fault.file, sizeof fault.file, file);
    copy_text(fault.place, sizeof fault.place, place);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(fault.message, sizeof fault.message, format, arguments);
    va_end(arguments);
    g_fault = fault;
    return code;
}

static int code_of(RfResult result)
{
    switch (result)
    {
    case RF_OK:
        return CODE_DONE;
    case RF_INVALID_ARGUMENT:
        return CODE_USAGE;
    case RF_UNREADABLE:
    case RF_BAD_INPUT:
    case RF_UNSUPPORTED:
        return CODE_BAD_INPUT;
    case RF_WRITE_FAILED:
    case RF_OUT_OF_MEMORY:
        return CODE_FAILED;
    case RF_CANCELLED:
        return CODE_SIGNAL + stop_asked();
    }
    return CODE_FAILED;
}

int fail_result(RfResult result, const char *file)
{
    const RfError *error = rf_last_error();
    const char *message = error->message[0] ? error->message : rf_result_name(result);
    return fail(code_of(result), error->file[0] ? error->file : file, error->place, "%s", message);
}

const Fault *last_fault(void)
{
    return &g_fault;
}

void adopt_fault(const Fault *fault)
{
    g_fault = *fault;
}

/// Line breaks and other control characters in file names must not break the one line.
static void print_line_text(const char *text)
{
    for (const unsigned char *c = (const unsigned char *)text; *c; ++c)
    {
        if (*c < 32 || *c == 127)
            fprintf(stderr, "\\x%02x", *c);
        else
            fputc(*c, stderr);
    }
}

void print_fault(bool json)
{
    const Fault *fault = &g_fault;
    if (json)
    {
        fputs("{\"event\":\"error\",", stderr);
        print_json_member(stderr, "file", fault->file);
        fputc(',', stderr);
        print_json_member(stderr, "place", fault->place);
        fputc(',', stderr);
        print_json_member(stderr, "message", fault->message);
        fputs("}\n", stderr);
        return;
    }
    fputs("riffle: ", stderr);
    print_line_text(fault->file);
    if (fault->place[0])
    {
        if (fault->file[0])
            fputc(':', stderr);
        print_line_text(fault->place);
    }
    if (fault->file[0] || fault->place[0])
        fputs(": ", stderr);
    print_line_text(fault->message);
    fputc('\n', stderr);
}

/// Length of the UTF-8 sequence at `text` by its first byte and its followers, 0 if it is none.
static int utf8_length(const unsigned char *text)
{
    int length = text[0] < 0x80 ? 1 : text[0] >= 0xc2 && text[0] < 0xe0 ? 2 : (text[0] & 0xf0) == 0xe0 ? 3 : 0;
    if (text[0] >= 0xf0 && text[0] < 0xf5)
        length = 4;
    for (int i = 1; i < length; ++i)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    bool overlong = (text[0] == 0xe0 && text[1] < 0xa0) || (text[0] == 0xf0 && text[1] < 0x90);
    bool surrogate = text[0] == 0xed && text[1] >= 0xa0;
    bool beyond = text[0] == 0xf4 && text[1] >= 0x90;
    return overlong || surrogate || beyond ? 0 : length;
}

void print_json_text(FILE *stream, const char *text)
{
    const unsigned char *c = (const unsigned char *)text;
    fputc('"', stream);
    while (*c)
    {
        int length = utf8_length(c);
        if (length == 0)
            fputs("\\ufffd", stream);
        else if (*c == '"' || *c == '\\')
            fprintf(stream, "\\%c", *c);
        else if (*c < 32 || *c == 127)
            fprintf(stream, "\\u%04x", *c);
        else
            fwrite(c, 1, (size_t)length, stream);
        c += length ? length : 1;
    }
    fputc('"', stream);
}

void print_json_member(FILE *stream, const char *name, const char *text)
{
    print_json_text(stream, name);
    fputc(':', stream);
    print_json_text(stream, text);
}

void print_json_number(FILE *stream, double value)
{
    if (isfinite(value))
        fprintf(stream, "%.6g", value);
    else
        fputs("null", stream);
}
