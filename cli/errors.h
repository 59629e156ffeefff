// SPDX-License-Identifier: Apache-2.0
// The command's failures: one line for a human, or one JSON object, and the exit code that goes with it.
#pragma once

#include "riffle/base.h"

#include <stdarg.h>
#include <stdio.h>

/// Exit codes, a contract. Every function of the command that can fail returns one; 0 is success. A run ended by a
/// signal returns 128 + its number.
enum
{
    CODE_DONE = 0,
    CODE_FAILED = 1,
    CODE_USAGE = 2,
    CODE_BAD_INPUT = 3,
    CODE_SIGNAL = 128
};

typedef struct Fault
{
    int code;
    char file[512];
    char place[128];
    char message[1024];
} Fault;

/// Records the calling thread's failure and returns `code`. file and place may be NULL.
__attribute__((format(printf, 4, 5))) int fail(int code, const char *file, const char *place, const char *format, ...);
/// The same for what the library just refused; `file` stands in where the library names none.
int fail_result(RfResult result, const char *file);
/// Of the calling thread, so that a worker's failure can be handed over.
const Fault *last_fault(void);
void adopt_fault(const Fault *fault);
/// Prints the calling thread's failure on stderr, as one line or one object.
void print_fault(bool json);

/// Text in quotes, escaped for JSON; bytes that are no UTF-8 become U+FFFD.
void print_json_text(FILE *stream, const char *text);
/// `"name":` and the text.
void print_json_member(FILE *stream, const char *name, const char *text);
/// A number JSON can carry: NaN and infinity become null.
void print_json_number(FILE *stream, double value);
