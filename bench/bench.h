// SPDX-License-Identifier: Apache-2.0
// What benchmark programs share.
#pragma once

#include "riffle/base.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// Ends the program where the library refused.
static inline void bench_require(RfResult result)
{
    if (result == RF_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", program_invocation_short_name, rf_last_error()->file, rf_last_error()->message);
    exit(1);
}

/// Milliseconds since some moment.
static inline double bench_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static inline int bench_by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/// Sorts the values.
static inline double bench_median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, bench_by_size);
    return values[count / 2];
}

/// What follows "name=" in an argument; NULL if that is not what it says.
static inline const char *bench_value(const char *argument, const char *name)
{
    size_t length = strlen(name);
    return strncmp(argument, name, length) == 0 && argument[length] == '=' ? argument + length + 1 : NULL;
}
