// SPDX-License-Identifier: Apache-2.0
// The full comparison of two windows: what decides in the search for the nearest. Its bytes may not depend on the
// instruction set, so there is one order for all of them, and multiplication and addition stay apart (this file is
// built with -ffp-contract=off):
//
//     number i of a row goes to sum i mod 16 of the even or of the odd rows, row after row;
//     the 32 sums are added in pairs, halves of halves.
//
// A set of 4 or 8 lanes holds the 16 sums in more vectors and skips whole vectors past the end of a row; wider ones go
// over them with weight 0, which adds +0 and changes nothing.

#include "core/simd.h"
#include "kernels/nearest.h"

enum
{
    SUMS = RF_GROUP_LANES
};

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));

static inline float add_up(const float sums[SUMS])
{
    const Vec4 *quarters = (const Vec4 *)sums;
    Vec4 sum = (quarters[0] + quarters[2]) + (quarters[1] + quarters[3]);
    return (sum[0] + sum[2]) + (sum[1] + sum[3]);
}

#define DEFINE_DISTANCE(name, width, target)                                                                           \
    target static float name(RfWindowRows a, RfWindowRows b, RfWindowRows weights, int rows, int count)                \
    {                                                                                                                  \
        typedef float Vector __attribute__((vector_size(width * 4), aligned(4), may_alias));                           \
        Vector even[SUMS / width] = {0}, odd[SUMS / width] = {0};                                                      \
        for (int j = 0; j < rows; ++j)                                                                                 \
        {                                                                                                              \
            const float *p = a.numbers + j * a.stride, *q = b.numbers + j * b.stride,                                  \
                        *w = weights.numbers + j * weights.stride;                                                     \
            Vector sum[SUMS / width];                                                                                  \
            for (int s = 0; s < SUMS / width; ++s)                                                                     \
                sum[s] = even[s];                                                                                      \
            for (int i = 0; i < count; i += SUMS)                                                                      \
                for (int s = 0; s < SUMS / width && i + s * width < count; ++s)                                        \
                {                                                                                                      \
                    int k = i + s * width;                                                                             \
                    Vector d = *(const Vector *)(p + k) - *(const Vector *)(q + k);                                    \
                    sum[s] += *(const Vector *)(w + k) * (d * d);                                                      \
                }                                                                                                      \
            for (int s = 0; s < SUMS / width; ++s)                                                                     \
            {                                                                                                          \
                even[s] = odd[s];                                                                                      \
                odd[s] = sum[s];                                                                                       \
            }                                                                                                          \
        }                                                                                                              \
        float sums[SUMS];                                                                                              \
        for (int s = 0; s < SUMS / width; ++s)                                                                         \
            *(Vector *)(sums + s * width) = even[s] + odd[s];                                                          \
        return add_up(sums);                                                                                           \
    }

// The same bytes where all weights are 1: what lies past a row's end is masked away, and adds +0 too.
static const int tail_masks[2 * SUMS] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};

#define DEFINE_BARE_DISTANCE(name, width, target)                                                                      \
    target static float name(RfWindowRows a, RfWindowRows b, int rows, int count)                                      \
    {                                                                                                                  \
        typedef float Vector __attribute__((vector_size(width * 4), aligned(4), may_alias));                           \
        typedef int Mask __attribute__((vector_size(width * 4), aligned(4), may_alias));                               \
        Vector even[SUMS / width] = {0}, odd[SUMS / width] = {0};                                                      \
        Mask mask[SUMS / width];                                                                                       \
        int whole = count / SUMS * SUMS;                                                                               \
        for (int s = 0; s < SUMS / width; ++s)                                                                         \
            mask[s] = *(const Mask *)(tail_masks + SUMS - (count - whole) + s * width);                                \
        for (int j = 0; j < rows; ++j)                                                                                 \
        {                                                                                                              \
            const float *p = a.numbers + j * a.stride, *q = b.numbers + j * b.stride;                                  \
            Vector sum[SUMS / width];                                                                                  \
            for (int s = 0; s < SUMS / width; ++s)                                                                     \
                sum[s] = even[s];                                                                                      \
            for (int i = 0; i < whole; i += SUMS)                                                                      \
                for (int s = 0; s < SUMS / width; ++s)                                                                 \
                {                                                                                                      \
                    Vector d = *(const Vector *)(p + i + s * width) - *(const Vector *)(q + i + s * width);            \
                    sum[s] += d * d;                                                                                   \
                }                                                                                                      \
            for (int s = 0; s < SUMS / width && whole + s * width < count; ++s)                                        \
            {                                                                                                          \
                int k = whole + s * width;                                                                             \
                Vector d = *(const Vector *)(p + k) - *(const Vector *)(q + k);                                        \
                d = (Vector)((Mask)d & mask[s]);                                                                       \
                sum[s] += d * d;                                                                                       \
            }                                                                                                          \
            for (int s = 0; s < SUMS / width; ++s)                                                                     \
            {                                                                                                          \
                even[s] = odd[s];                                                                                      \
                odd[s] = sum[s];                                                                                       \
            }                                                                                                          \
        }                                                                                                              \
        float sums[SUMS];                                                                                              \
        for (int s = 0; s < SUMS / width; ++s)                                                                         \
            *(Vector *)(sums + s * width) = even[s] + odd[s];                                                          \
        return add_up(sums);                                                                                           \
    }

DEFINE_DISTANCE(distance_plain, 4, )
DEFINE_BARE_DISTANCE(bare_plain, 4, )
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
DEFINE_DISTANCE(distance_avx2, 8, __attribute__((target("avx2,fma"))))
DEFINE_DISTANCE(distance_avx512, 16, __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,fma"))))
DEFINE_BARE_DISTANCE(bare_avx2, 8, __attribute__((target("avx2,fma"))))
DEFINE_BARE_DISTANCE(bare_avx512, 16, __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl,fma"))))
#endif

float rf_window_distance(RfWindowRows a, RfWindowRows b, RfWindowRows weights, int rows, int count)
{
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    if (rf_simd_level() == RF_SIMD_AVX512)
        return weights.numbers ? distance_avx512(a, b, weights, rows, count) : bare_avx512(a, b, rows, count);
    if (rf_simd_level() == RF_SIMD_AVX2)
        return weights.numbers ? distance_avx2(a, b, weights, rows, count) : bare_avx2(a, b, rows, count);
#endif
    return weights.numbers ? distance_plain(a, b, weights, rows, count) : bare_plain(a, b, rows, count);
}
