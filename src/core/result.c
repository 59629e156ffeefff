// SPDX-License-Identifier: Apache-2.0
#include "core/result.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static _Thread_local RfError g_last_error;

static void copy_text(char *to, size_t size, const char *from)
{
    snprintf(to, size, "%s", from ? from : "");
}

RfResult rf_fail(RfResult result, const char *file, const char *place, const char *format, ...)
{
    // The arguments may point into the old error, so it is replaced last.
    RfError error = {.result = result};
    copy_text(error.file, sizeof error.file, file);
    copy_text(error.place, sizeof error.place, place);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error.message, sizeof error.message, format, arguments);
    va_end(arguments);
    g_last_error = error;
    return result;
}

const RfError *rf_last_error(void)
{
    return &g_last_error;
}

const char *rf_result_name(RfResult result)
{
    static const char *const names[] = {"ok",          "invalid argument", "unreadable",    "bad input",
                                        "unsupported", "write failed",     "out of memory", "cancelled"};
    size_t count = sizeof names / sizeof names[0];
    return (size_t)result < count ? names[result] : "unknown";
}

const char *rf_version(void)
{
    return RF_VERSION_STRING;
}
