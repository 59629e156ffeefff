// SPDX-License-Identifier: Apache-2.0
#include "kernels/fixed_picture.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "core/simd.h"

#include <string.h>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

RfResult rf_fixed_create(int width, int height, int channels, int apron, RfFixedPicture *out)
{
    *out = (RfFixedPicture){.width = width, .height = height, .channels = channels, .apron = apron};
    out->stride = (ptrdiff_t)(width + 2 * apron) * channels;
    // A window's last row may be read for a vector beyond its end.
    size_t numbers = (size_t)out->stride * (size_t)(height + 2 * apron) + RF_FIXED_LANES;
    out->memory = rf_allocate_zero(numbers, sizeof *out->memory);
    if (!out->memory)
        return RF_OUT_OF_MEMORY;
    out->pixels = out->memory + apron * out->stride + (ptrdiff_t)apron * channels;
    return RF_OK;
}

void rf_fixed_free(RfFixedPicture *picture)
{
    rf_release(picture->memory);
    *picture = (RfFixedPicture){0};
}

void rf_fixed_set(RfFixedPicture *picture, const float *pixels, float scale)
{
    ptrdiff_t numbers = (ptrdiff_t)picture->width * picture->channels;
    const float limit = RF_FIXED_RANGE / 2;
    for (int y = 0; y < picture->height; ++y)
    {
        int16_t *row = rf_fixed_at(picture, 0, y);
        for (ptrdiff_t i = 0; i < numbers; ++i)
            row[i] = (int16_t)lrintf(rf_clamp(pixels[y * numbers + i] * scale, -limit, limit));
    }
}

static void copy_pixel(RfFixedPicture *picture, int x, int y, int from_x, int from_y)
{
    memcpy(rf_fixed_at(picture, x, y), rf_fixed_at(picture, from_x, from_y),
           (size_t)picture->channels * sizeof *picture->pixels);
}

void rf_fixed_extend(RfFixedPicture *picture, bool tiles)
{
    int w = picture->width, h = picture->height, apron = picture->apron;
    for (int y = 0; y < h; ++y)
        for (int i = 1; i <= apron; ++i)
        {
            copy_pixel(picture, -i, y, tiles ? rf_wrap_int(-i, w) : 0, y);
            copy_pixel(picture, w - 1 + i, y, tiles ? rf_wrap_int(i - 1, w) : w - 1, y);
        }
    size_t row = (size_t)picture->stride * sizeof *picture->pixels;
    for (int i = 1; i <= apron; ++i)
    {
        memcpy(rf_fixed_at(picture, -apron, -i), rf_fixed_at(picture, -apron, tiles ? rf_wrap_int(-i, h) : 0), row);
        memcpy(rf_fixed_at(picture, -apron, h - 1 + i),
               rf_fixed_at(picture, -apron, tiles ? rf_wrap_int(i - 1, h) : h - 1), row);
    }
}

void rf_fixed_query(const RfFixedPicture *picture, const RfFixedPicture *exemplar, int side, int16_t *mask,
                    RfFixedQuery *out)
{
    int numbers = side * picture->channels;
    int run = (numbers + RF_FIXED_LANES - 1) / RF_FIXED_LANES * RF_FIXED_LANES;
    for (int i = 0; i < run; ++i)
        mask[i] = i < numbers ? -1 : 0;
    *out = (RfFixedQuery){.stride = picture->stride,
                          .exemplar_stride = exemplar->stride,
                          .side = side,
                          .numbers = numbers,
                          .run = run,
                          .mask = mask};
}

// The sum, or anything above `limit` where the sum is.
static int64_t distance_plain(const RfFixedQuery *query, const int16_t *candidate, int64_t limit)
{
    int64_t sum = 0;
    for (int y = 0; y < query->side && sum <= limit; ++y)
    {
        const int16_t *a = query->window + y * query->stride, *b = candidate + y * query->exemplar_stride;
        for (int i = 0; i < query->numbers; ++i)
            sum += (a[i] - b[i]) * (a[i] - b[i]);
    }
    return sum;
}

#if defined(__x86_64__)
// (clang 14 drops a target with an architecture: features are named one by one.)
enum
{
    // Between two looks at the limit.
    ROWS_AT_ONCE = 5
};

__attribute__((target("avx2"))) static int64_t fold_avx2(__m256i sum)
{
    __m256i wide = _mm256_add_epi64(_mm256_cvtepu32_epi64(_mm256_castsi256_si128(sum)),
                                    _mm256_cvtepu32_epi64(_mm256_extracti128_si256(sum, 1)));
    __m128i half = _mm_add_epi64(_mm256_castsi256_si128(wide), _mm256_extracti128_si256(wide, 1));
    return _mm_extract_epi64(half, 0) + _mm_extract_epi64(half, 1);
}

__attribute__((target("avx2"))) static int64_t distance_avx2(const RfFixedQuery *query, const int16_t *candidate,
                                                             int64_t limit)
{
    __m256i sum = _mm256_setzero_si256();
    for (int y = 0; y < query->side; ++y)
    {
        const int16_t *a = query->window + y * query->stride, *b = candidate + y * query->exemplar_stride;
        for (int i = 0; i < query->run; i += 16)
        {
            __m256i d = _mm256_sub_epi16(_mm256_loadu_si256((const __m256i *)(const void *)(a + i)),
                                         _mm256_loadu_si256((const __m256i *)(const void *)(b + i)));
            d = _mm256_and_si256(d, _mm256_loadu_si256((const __m256i *)(const void *)(query->mask + i)));
            sum = _mm256_add_epi32(sum, _mm256_madd_epi16(d, d));
        }
        if (y % ROWS_AT_ONCE == ROWS_AT_ONCE - 1 && fold_avx2(sum) > limit)
            break;
    }
    return fold_avx2(sum);
}

__attribute__((target("avx512f,avx512bw,avx512dq,avx512vl"))) static int64_t fold_avx512(__m512i sum)
{
    return _mm512_reduce_add_epi64(_mm512_add_epi64(_mm512_cvtepu32_epi64(_mm512_castsi512_si256(sum)),
                                                    _mm512_cvtepu32_epi64(_mm512_extracti64x4_epi64(sum, 1))));
}

__attribute__((target("avx512f,avx512bw,avx512dq,avx512vl"))) static int64_t
distance_avx512(const RfFixedQuery *query, const int16_t *candidate, int64_t limit)
{
    __m512i sum = _mm512_setzero_si512();
    for (int y = 0; y < query->side; ++y)
    {
        const int16_t *a = query->window + y * query->stride, *b = candidate + y * query->exemplar_stride;
        for (int i = 0; i < query->run; i += 32)
        {
            __m512i d = _mm512_sub_epi16(_mm512_loadu_si512(a + i), _mm512_loadu_si512(b + i));
            d = _mm512_and_si512(d, _mm512_loadu_si512(query->mask + i));
            sum = _mm512_add_epi32(sum, _mm512_madd_epi16(d, d));
        }
        if (y % ROWS_AT_ONCE == ROWS_AT_ONCE - 1 && fold_avx512(sum) > limit)
            break;
    }
    return fold_avx512(sum);
}
#endif

static int64_t distance_to(const RfFixedQuery *query, const int16_t *candidate, int64_t limit, RfSimdLevel level)
{
#if defined(__x86_64__)
    if (level == RF_SIMD_AVX512)
        return distance_avx512(query, candidate, limit);
    if (level == RF_SIMD_AVX2)
        return distance_avx2(query, candidate, limit);
#else
    (void)level;
#endif
    return distance_plain(query, candidate, limit);
}

int rf_fixed_least(const RfFixedQuery *query, const int16_t *const *candidates, const float *penalties, int count,
                   float *distance)
{
    // Doubles hold every sum exactly, so that a sum that was broken off is never taken for the least.
    RfSimdLevel level = rf_simd_level();
    double least = 0x1p62;
    int best = 0;
    for (int i = 0; i < count; ++i)
    {
        double penalty = penalties ? (double)penalties[i] : 0;
        if (penalty >= least)
            continue;
        int64_t sum = distance_to(query, candidates[i], (int64_t)(least - penalty) + 1, level);
        if ((double)sum + penalty >= least)
            continue;
        least = (double)sum + penalty;
        *distance = (float)sum;
        best = i;
    }
    return best;
}
