// SPDX-License-Identifier: Apache-2.0
// One body, compiled for three instruction sets and chosen at run time.
//
// RF_WIDE(name, (parameters), (arguments)) defines `void name(parameters)` from `static inline void
// name_body(parameters)` above it, which must be marked RF_WIDE_BODY. The compiler widens the body's loops for each
// set. gcc's target_clones would do the same without a macro, but chooses by the processor alone; here
// RF_SIMD=plain|avx2|avx512 can pick a lower set, which tests need to hold the sets against each other.
#pragma once

#include <stdbool.h>

typedef enum RfSimdLevel
{
    RF_SIMD_PLAIN,
    RF_SIMD_AVX2,
    RF_SIMD_AVX512
} RfSimdLevel;

/// What the machine has, or less if the environment variable RF_SIMD says so. Read once.
RfSimdLevel rf_simd_level(void);

/// Whether there is, besides AVX-512, its product of 16-bit integers (VNNI). RF_SIMD=avx512 does without it. No result
/// depends on it.
bool rf_simd_multiplies_shorts(void);

#define RF_WIDE_BODY static inline __attribute__((always_inline))

enum
{
    /// Of the widest vector. Arrays are padded to it, so that no loop has a rest.
    RF_WIDE_FLOATS = 16
};

/// Loops run over whole vectors: to here, where they would run to `end`.
RF_WIDE_BODY int rf_whole_vectors(int end)
{
    return (end + RF_WIDE_FLOATS - 1) / RF_WIDE_FLOATS * RF_WIDE_FLOATS;
}

#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define RF_WIDE(name, parameters, arguments)                                                                           \
    static void name##_plain parameters                                                                                \
    {                                                                                                                  \
        name##_body arguments;                                                                                         \
    }                                                                                                                  \
    __attribute__((target("arch=x86-64-v3"))) static void name##_avx2 parameters                                       \
    {                                                                                                                  \
        name##_body arguments;                                                                                         \
    }                                                                                                                  \
    __attribute__((target("arch=x86-64-v4,prefer-vector-width=512"))) static void name##_avx512 parameters             \
    {                                                                                                                  \
        name##_body arguments;                                                                                         \
    }                                                                                                                  \
    void name parameters                                                                                               \
    {                                                                                                                  \
        RfSimdLevel level = rf_simd_level();                                                                           \
        if (level == RF_SIMD_AVX512)                                                                                   \
            name##_avx512 arguments;                                                                                   \
        else if (level == RF_SIMD_AVX2)                                                                                \
            name##_avx2 arguments;                                                                                     \
        else                                                                                                           \
            name##_plain arguments;                                                                                    \
    }
#else
#define RF_WIDE(name, parameters, arguments)                                                                           \
    void name parameters                                                                                               \
    {                                                                                                                  \
        name##_body arguments;                                                                                         \
    }
#endif
