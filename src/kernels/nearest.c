// SPDX-License-Identifier: Apache-2.0
// A blocked comparison is a matrix product whose result is looked at while it is still near. The tile of 12 queries by
// 32 candidates is what fits 32 AVX-512 registers: 24 sums, a candidate row (2), a query number.
//
//      queries [k][12]            candidates [k][32]                 bounds of one query
//     ┌────────────┐   ┌────────────────┬────────────────┐
//     │ k = 0      │   │ k = 0          │                │      tile 0   tile 1   tile 2   tile 3
//     │ k = 1      │ x │ k = 1          │                │  =  │15 16 31│        │        │        │
//     │ ...        │   │ ...            │                │       lane l's minimum: every 16th of the group
//     └────────────┘   └────────────────┴────────────────┘
//
// AVX2 and plain C walk the same tile in pieces that fit their 16 registers. The product's rounding differs between
// the three, which only moves bounds within their slack; what decides is rf_window_distance.
//
// A minimum in registers for each query would end with the least bound alone. The search also wants all bounds below
// the first full distance, so bounds are stored (24 stores a tile) and every 8 of them are folded into one minimum
// while they are in the first cache; the search then reads an eighth and looks closer where it must.

#include "kernels/nearest.h"
#include "core/maths.h"
#include "core/simd.h"

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef float Vec8 __attribute__((vector_size(32), aligned(4), may_alias));
typedef float Vec16 __attribute__((vector_size(64), aligned(4), may_alias));

#ifdef __x86_64__
#include <immintrin.h>
#define LEAST(a, b) _mm_min_ps(a, b)
#define BELOW(a, limit) (unsigned)_mm_movemask_ps(_mm_cmple_ps(a, limit))
#else
static inline Vec4 least_4(Vec4 a, Vec4 b)
{
    return (Vec4){rf_min(a[0], b[0]), rf_min(a[1], b[1]), rf_min(a[2], b[2]), rf_min(a[3], b[3])};
}
static inline unsigned below_4(Vec4 a, Vec4 limit)
{
    return (unsigned)((a[0] <= limit[0]) | (a[1] <= limit[1]) << 1 | (a[2] <= limit[2]) << 2 | (a[3] <= limit[3]) << 3);
}
#define LEAST(a, b) least_4(a, b)
#define BELOW(a, limit) below_4(a, limit)
#endif
static inline int list_bits(unsigned bits, int base, int *list)
{
    int listed = 0;
    for (; bits; bits &= bits - 1)
        list[listed++] = base + __builtin_ctz(bits);
    return listed;
}
#define LIST_BITS(bits, base, list) list_bits(bits, base, list)
#define SET(name) name##_plain
#define TARGET
#define WIDTH 4
#define Vector Vec4
#define ROWS 6
#include "kernels/nearest_wide.h"

// As RF_WIDE, for functions whose three forms differ. (clang 14 drops a target with an architecture and intrinsics then
// fail, so the features are named.)
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
#define SET(name) name##_avx2
#define TARGET __attribute__((target("avx2,fma")))
#define WIDTH 8
#define Vector Vec8
#define ROWS 6
#define LEAST(a, b) _mm256_min_ps(a, b)
#define BELOW(a, limit) (unsigned)_mm256_movemask_ps(_mm256_cmp_ps(a, limit, _CMP_LE_OQ))
#define LIST_BITS(bits, base, list) list_bits(bits, base, list)
#include "kernels/nearest_wide.h"

__attribute__((target("avx512f,popcnt"))) static inline int list_bits_avx512(unsigned bits, int base, int *list)
{
    __m512i numbers = _mm512_add_epi32(_mm512_set1_epi32(base),
                                       _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
    _mm512_storeu_si512(list, _mm512_maskz_compress_epi32((__mmask16)bits, numbers));
    return __builtin_popcount(bits);
}
#define LIST_BITS(bits, base, list) list_bits_avx512(bits, base, list)
#define SET(name) name##_avx512
#define TARGET __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,fma,popcnt")))
#define WIDTH 16
#define Vector Vec16
#define ROWS 12
#define LEAST(a, b) _mm512_min_ps(a, b)
#define BELOW(a, limit) (unsigned)_mm512_cmp_ps_mask(a, limit, _CMP_LE_OQ)
#include "kernels/nearest_wide.h"

#define CHOOSE(name)                                                                                                   \
    (rf_simd_level() == RF_SIMD_AVX512 ? name##_avx512 : rf_simd_level() == RF_SIMD_AVX2 ? name##_avx2 : name##_plain)
#else
#define CHOOSE(name) name##_plain
#endif

void rf_tile_products(const float *queries, const float *candidates, int numbers, const float *start, float *out,
                      ptrdiff_t stride)
{
    CHOOSE(tile_products)(queries, candidates, numbers, start, out, stride);
}

void rf_project(const float *windows, int numbers, const float *basis, float *out, ptrdiff_t stride)
{
    CHOOSE(project)(windows, numbers, basis, out, stride);
}

void rf_fold_group(const float *bounds, ptrdiff_t bounds_stride, int queries, float *minima, ptrdiff_t minima_stride)
{
    CHOOSE(fold_group)(bounds, bounds_stride, queries, minima, minima_stride);
}

int rf_find_least(const float *bounds, const float *minima, int count, float *value)
{
    return CHOOSE(find_least)(bounds, minima, count, value);
}

int rf_list_below(const float *bounds, const float *minima, int count, float limit, int *list)
{
    return CHOOSE(list_below)(bounds, minima, count, limit, list);
}

RF_WIDE_BODY float distance_round(float a, float b, float period)
{
    float d = a > b ? a - b : b - a;
    return rf_min(d, period > 0 ? rf_max(period - d, -(period - d)) : d);
}

RF_WIDE_BODY void rf_exclude_bounds_body(const RfExclusion *exclusion, const float *restrict x, const float *restrict y,
                                         int count, float *restrict bounds)
{
    const RfExclusion e = *exclusion;
#pragma omp simd
    for (int i = 0; i < count; ++i)
    {
        float dx = distance_round(x[i], e.x, e.period_x), dy = distance_round(y[i], e.y, e.period_y);
        bounds[i] = rf_max(dx, dy) < e.reach ? INFINITY : bounds[i];
    }
}

RF_WIDE(rf_exclude_bounds,
        (const RfExclusion *exclusion, const float *restrict x, const float *restrict y, int count,
         float *restrict bounds),
        (exclusion, x, y, count, bounds))
