// SPDX-License-Identifier: Apache-2.0
// Twice as many numbers in the same time: vpdpwssd multiplies and adds 32 numbers of 16 bits where an instruction for
// floats does 16. A lower bound stays one if what rounding can add to it is taken off again.
//
// The scale. Q = round(s q) and C = round(s c) are integers. s makes every |s c| at most 2^14 (c: the candidates' kept
// numbers, see neighbours.c). A query's |s q| may be 1.8 times that; where one of a panel is more, the panel is
// compared in floats.
//
// The bound. No number is moved by more than half a step, and by 2^-9 of one where the float s q itself was rounded
// (it is under 2^15, and float holds 24 bits). So |Q - s q| <= h sqrt(kept), h = 1/2 + 2^-8, the same for C, and by
// the triangle inequality
//
//     |Q - C| <= s |q - c| + 2 h sqrt(kept) = s (|q - c| + e)
//
// A distance with an error of at most e is what the residual's norm already is; the search adds the two errors. e is
// 3.5e-4 of the largest candidate's norm for 32 numbers: on foam under 1 % more candidates pass than by floats.
//
// The score. The integers' own arithmetic is exact:
//
//     |Q - C|^2 = |Q|^2 + 2 (|C|^2 / 2 - Q.C)        score = offset + floor(|C|^2 / 2 + s^2 penalty / 2) - Q.C
//
// |Q.C| <= 2^15 2^14 = 2^29, |C|^2 / 2 <= 2^27, penalties are taken from the least up and let in up to 2^29 (or the
// search is done in floats). With an offset a little above 2^29 all scores are between 2^23 and the bits of INFINITY,
// where integers order as the floats of the same bits do. So the search folds, scans and excludes them as it does with
// floats. (Sums on the way may wrap; the result, modulo 2^32, is right.)
//
// The second bound takes the residuals r apart for the few candidates that the first one leaves: into up to 30 further
// components e and what these leave out, t. For them
//
//     second = first - (r_q - r_c)^2 + |e_q - e_c|^2 + (t_q - t_c)^2
//
// a difference of 32 numbers, one of them with the other sign, in three instructions. Differences that leave 16 bits
// are cut off there, which makes the bound less; r is never one of them, being positive for both. The sum is below
// 2^31, since |e, t| = r and (1.825 + 1)^2 2^28 = 7.98 2^28. On blended foam it leaves 2 of the 10 candidates that 31
// components leave; but finding twice as many components takes a database three times as long, which foam's few full
// comparisons do not. So it is for spectra that are flat, and have a second block of components anyway.
//
// Tried and dropped: the minima of a group folded while the sums are in registers (slower by 5 %).

#include "kernels/short_bounds.h"
#include "core/maths.h"
#include "core/simd.h"

#include <string.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

enum
{
    // 2^24: rounding adds at most 5 to a norm.
    OFFSET = (1 << 29) + (1 << 24),
    LARGEST_PENALTY = 1 << 29
};
#define CANDIDATE_NORM 16384.0
#define QUERY_NORM 29900.0f
#define HALF_STEP (0.5 + 0x1p-8)

static float as_float(int32_t bits)
{
    float number;
    memcpy(&number, &bits, sizeof number);
    return number;
}

static int32_t bits_of(float number)
{
    int32_t bits;
    memcpy(&bits, &number, sizeof bits);
    return bits;
}

float rf_short_scale(double norm)
{
    // Any scale does where all are 0; 2^60 and its square are in float's range.
    return (float)fmin(CANDIDATE_NORM / norm, 0x1p60);
}

double rf_short_error(const RfShortNumbers *shorts, int numbers)
{
    return 2 * HALF_STEP * sqrt(numbers) / (double)shorts->scale;
}

static double half_penalty(const RfShortNumbers *shorts, double penalty)
{
    return 0.5 * (double)shorts->scale * (double)shorts->scale * penalty;
}

bool rf_short_fits(const RfShortNumbers *shorts, double spread)
{
    return half_penalty(shorts, spread) <= LARGEST_PENALTY;
}

// Rounded down, as |C|^2 / 2 is: a candidate may seem nearer, never farther.
int32_t rf_short_start(const RfShortNumbers *shorts, int candidate, double penalty)
{
    return shorts->starts[candidate] + (int32_t)half_penalty(shorts, penalty);
}

float rf_short_limit(const RfShortNumbers *shorts, double distance, int32_t square)
{
    double scale = (double)shorts->scale, limit = OFFSET + 0.5 * (scale * scale * distance - (double)square) + 1;
    return as_float((int32_t)fmax(fmin(limit, RF_SHORT_INFINITE - 1), 0));
}

// Numbers past the last are 0. What does not fit is made to, and told by its norm.
RF_WIDE_BODY void rf_round_numbers_body(const float *restrict numbers, float scale, int kept, int16_t *restrict out,
                                        float *restrict norm, int32_t *restrict square)
{
    float norms = 0;
    uint32_t squares = 0;
#pragma omp simd reduction(+ : norms, squares)
    for (int k = 0; k < rf_whole_vectors(kept); ++k)
    {
        float scaled = k < kept ? numbers[k] * scale : 0;
        norms += scaled * scaled;
        int number = (int)rintf(rf_clamp(scaled, -INT16_MAX, INT16_MAX));
        out[k] = (int16_t)number;
        squares += (uint32_t)(number * number);
    }
    *norm = norms;
    *square = (int32_t)squares;
}

RF_WIDE(rf_round_numbers,
        (const float *restrict numbers, float scale, int kept, int16_t *restrict out, float *restrict norm,
         int32_t *restrict square),
        (numbers, scale, kept, out, norm, square))

bool rf_shorten_query(const RfShortNumbers *shorts, const float *numbers, int count, int16_t *out, int32_t *square)
{
    float norm;
    rf_round_numbers(numbers, shorts->scale, count, out, &norm, square);
    return norm <= QUERY_NORM * QUERY_NORM;
}

void rf_shorten_candidate(const RfShortNumbers *shorts, int candidate, const float *kept, const float *rest)
{
    int16_t numbers[RF_KEPT_STRIDE] = {0};
    int32_t square, unused;
    rf_shorten_query(shorts, kept, shorts->kept, numbers, &square);
    size_t tile = (size_t)(candidate / RF_TILE_CANDIDATES), lane = (size_t)(candidate % RF_TILE_CANDIDATES);
    int16_t *out = shorts->numbers + (tile * (size_t)shorts->pairs * RF_TILE_CANDIDATES + lane) * 2;
    for (int k = 0; k < shorts->pairs; ++k, out += 2 * RF_TILE_CANDIDATES)
    {
        out[0] = (int16_t)-numbers[2 * k];
        out[1] = (int16_t)-numbers[2 * k + 1];
    }
    shorts->starts[candidate] = OFFSET + square / 2;
    if (shorts->rests)
        rf_shorten_query(shorts, rest, RF_REST_NUMBERS, shorts->rests + (size_t)candidate * RF_REST_NUMBERS, &unused);
}

typedef int32_t MayAliasInt __attribute__((may_alias));

// Twice what the second bound adds to the first.
static int32_t rest_plain(const int16_t *query, const int16_t *candidate)
{
    int32_t sum = 0;
    for (int k = 0; k < RF_REST_NUMBERS; ++k)
    {
        int apart = rf_clamp_int(candidate[k] - query[k], INT16_MIN, INT16_MAX);
        sum += k < RF_REST_NUMBERS - 1 ? apart * apart : -apart * apart;
    }
    return sum;
}

static int sieve_plain(const int16_t *query, const int16_t *rests, const float *scores, int32_t limit, int *list,
                       int count)
{
    int passed = 0;
    for (int i = 0; i < count; ++i)
    {
        int c = list[i];
        list[passed] = c;
        passed += rest_plain(query, rests + (ptrdiff_t)c * RF_REST_NUMBERS) >> 1 <= limit - bits_of(scores[c]);
    }
    return passed;
}

static void products_plain(const int16_t *queries, const int16_t *candidates, int pairs, const int32_t *starts,
                           float *out, ptrdiff_t stride)
{
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
        for (int c = 0; c < RF_TILE_CANDIDATES; ++c)
        {
            int64_t sum = starts[c];
            for (int k = 0; k < 2 * pairs; ++k)
                sum += queries[q * RF_KEPT_STRIDE + k] * candidates[(k / 2 * RF_TILE_CANDIDATES + c) * 2 + k % 2];
            out[q * stride + c] = as_float((int32_t)sum);
        }
}

#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
// The tile of nearest.c: 24 sums, 2 vectors of candidates, a pair of a query's numbers.
__attribute__((target("avx512f,avx512bw,avx512vnni"))) static void products_vnni(const int16_t *queries,
                                                                                 const int16_t *candidates, int pairs,
                                                                                 const int32_t *starts, float *out,
                                                                                 ptrdiff_t stride)
{
    const MayAliasInt *query = (const MayAliasInt *)queries;
    __m512i left[RF_TILE_QUERIES], right[RF_TILE_QUERIES];
#pragma GCC unroll 12
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        left[q] = _mm512_load_si512(starts);
        right[q] = _mm512_load_si512(starts + 16);
    }
    for (int k = 0; k < pairs; ++k, candidates += 2 * RF_TILE_CANDIDATES, ++query)
    {
        __m512i l = _mm512_load_si512(candidates), r = _mm512_load_si512(candidates + RF_TILE_CANDIDATES);
#pragma GCC unroll 12
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
        {
            __m512i pair = _mm512_set1_epi32(query[q * (RF_KEPT_STRIDE / 2)]);
            left[q] = _mm512_dpwssd_epi32(left[q], pair, l);
            right[q] = _mm512_dpwssd_epi32(right[q], pair, r);
        }
    }
#pragma GCC unroll 12
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        _mm512_storeu_si512(out + q * stride, left[q]);
        _mm512_storeu_si512(out + q * stride + 16, right[q]);
    }
}

__attribute__((target("avx512f,avx512bw,avx512vnni"))) static int
sieve_vnni(const int16_t *query, const int16_t *rests, const float *scores, int32_t limit, int *list, int count)
{
    __m512i own = _mm512_loadu_si512(query), zero = _mm512_setzero_si512();
    int passed = 0;
    for (int i = 0; i < count; ++i)
    {
        int c = list[i];
        __m512i apart = _mm512_subs_epi16(_mm512_load_si512(rests + (ptrdiff_t)c * RF_REST_NUMBERS), own),
                signs = _mm512_mask_sub_epi16(apart, 1u << (RF_REST_NUMBERS - 1), zero, apart);
        list[passed] = c;
        passed += _mm512_reduce_add_epi32(_mm512_dpwssd_epi32(zero, apart, signs)) >> 1 <= limit - bits_of(scores[c]);
    }
    return passed;
}
#endif

int rf_short_sieve(const RfShortNumbers *shorts, const int16_t *rest, const float *scores, int first, float limit,
                   int *list, int count)
{
    const int16_t *rests = shorts->rests + (size_t)first * RF_REST_NUMBERS;
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    if (rf_simd_multiplies_shorts())
        return sieve_vnni(rest, rests, scores, bits_of(limit), list, count);
#endif
    return sieve_plain(rest, rests, scores, bits_of(limit), list, count);
}

void rf_short_products(const int16_t *queries, const int16_t *candidates, int pairs, const int32_t *starts, float *out,
                       ptrdiff_t stride)
{
#if defined(__x86_64__) && !defined(__SANITIZE_THREAD__)
    if (rf_simd_multiplies_shorts())
    {
        products_vnni(queries, candidates, pairs, starts, out, stride);
        return;
    }
#endif
    products_plain(queries, candidates, pairs, starts, out, stride);
}
