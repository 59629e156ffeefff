// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <time.h>

/// Seconds since some moment; never runs backwards.
static inline double rf_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
