// SPDX-License-Identifier: Apache-2.0
#include "core/simd.h"
#include "riffle/base.h"

#include <stdlib.h>
#include <string.h>

static const char *const level_names[] = {"plain", "avx2", "avx512"};

static RfSimdLevel find_level(void)
{
    RfSimdLevel level = RF_SIMD_PLAIN;
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
        level = RF_SIMD_AVX2;
    if (level == RF_SIMD_AVX2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        level = RF_SIMD_AVX512;
#endif
    const char *wanted = getenv("RF_SIMD");
    for (RfSimdLevel lower = RF_SIMD_PLAIN; wanted && lower < level; ++lower)
        if (strcmp(wanted, level_names[lower]) == 0)
            return lower;
    return level;
}

RfSimdLevel rf_simd_level(void)
{
    // Every thread that gets here first computes the same value.
    static int level = -1;
    int known = __atomic_load_n(&level, __ATOMIC_RELAXED);
    if (known < 0)
    {
        known = (int)find_level();
        __atomic_store_n(&level, known, __ATOMIC_RELAXED);
    }
    return (RfSimdLevel)known;
}

static int find_shorts(void)
{
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    const char *wanted = getenv("RF_SIMD");
    return rf_simd_level() == RF_SIMD_AVX512 && __builtin_cpu_supports("avx512vnni") &&
           !(wanted && strcmp(wanted, level_names[RF_SIMD_AVX512]) == 0);
#else
    return 0;
#endif
}

bool rf_simd_multiplies_shorts(void)
{
    static int shorts = -1;
    int known = __atomic_load_n(&shorts, __ATOMIC_RELAXED);
    if (known < 0)
    {
        known = find_shorts();
        __atomic_store_n(&shorts, known, __ATOMIC_RELAXED);
    }
    return known;
}

const char *rf_simd_name(void)
{
    return level_names[rf_simd_level()];
}
