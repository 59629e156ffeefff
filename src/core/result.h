// SPDX-License-Identifier: Apache-2.0
// Failures: the file's fault and running failures go through rf_fail, the caller's through RF_REQUIRE, ours through
// assert.
#pragma once

#include "riffle/base.h"

#include <assert.h>

/// Records the failure as the thread's last error and returns `result`. file and place may be NULL.
__attribute__((format(printf, 4, 5))) RfResult rf_fail(RfResult result, const char *file, const char *place,
                                                       const char *format, ...);

/// The caller's mistake: a build with RIFFLE_STOP_ON_MISUSE=ON stops, others return RF_INVALID_ARGUMENT with the
/// message.
#ifdef RF_STOP_ON_MISUSE
#define RF_MISUSE() assert(!"the caller's mistake, told in rf_last_error()")
#else
#define RF_MISUSE() ((void)0)
#endif
#define RF_REQUIRE(condition, ...)                                                                                     \
    do                                                                                                                 \
    {                                                                                                                  \
        if (!(condition))                                                                                              \
        {                                                                                                              \
            RfResult rf_misuse = rf_fail(RF_INVALID_ARGUMENT, NULL, NULL, __VA_ARGS__);                                \
            RF_MISUSE();                                                                                               \
            return rf_misuse;                                                                                          \
        }                                                                                                              \
    } while (0)

/// Hands a failure up.
#define RF_TRY(expression)                                                                                             \
    do                                                                                                                 \
    {                                                                                                                  \
        RfResult rf_try_result = (expression);                                                                         \
        if (rf_try_result != RF_OK)                                                                                    \
            return rf_try_result;                                                                                      \
    } while (0)
