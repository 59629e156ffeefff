// SPDX-License-Identifier: Apache-2.0
#include "core/random.h"
#include "core/simd.h"
#include "kernels/short_bounds.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    CANDIDATES = 150,
    TILES = (CANDIDATES + RF_TILE_CANDIDATES - 1) / RF_TILE_CANDIDATES,
    ROOM = TILES * RF_TILE_CANDIDATES,
    MOST_KEPT = 65
};

// Candidates and 12 queries in floats, and what the kernel makes of them.
typedef struct Case
{
    int kept;
    float candidate[CANDIDATES][RF_KEPT_STRIDE], query[RF_TILE_QUERIES][RF_KEPT_STRIDE];
    float candidate_rest[CANDIDATES][RF_REST_NUMBERS], query_rest[RF_TILE_QUERIES][RF_REST_NUMBERS];
    double penalty[CANDIDATES];
    RfShortNumbers shorts;
    int32_t starts[ROOM] __attribute__((aligned(64)));
    int16_t queries[RF_TILE_QUERIES][RF_KEPT_STRIDE] __attribute__((aligned(64)));
    int16_t rests[RF_TILE_QUERIES][RF_REST_NUMBERS] __attribute__((aligned(64)));
    int32_t squares[RF_TILE_QUERIES];
    bool fits[RF_TILE_QUERIES];
    float scores[RF_TILE_QUERIES][ROOM];
} Case;

static Case g_case;

static float random_number(int what, int i, int k)
{
    return 2 * rf_random_float((uint64_t)what, 0, (uint64_t)i, (uint64_t)k) - 1;
}

static void *require(void *memory)
{
    assert_non_null(memory);
    return memory;
}

// Where there is a rest, the last number kept is the norm of what its others leave out: that of the rest.
static void close_rest(float *kept, int count, float *rest)
{
    double square = 0;
    for (int k = 0; k < RF_REST_NUMBERS - 1; ++k)
        square += (double)rest[k] * (double)rest[k];
    kept[count - 1] = rest[RF_REST_NUMBERS - 1] = (float)sqrt(square);
}

static double norm_of(const float *numbers, int count)
{
    double sum = 0;
    for (int k = 0; k < count; ++k)
        sum += (double)numbers[k] * (double)numbers[k];
    return sqrt(sum);
}

static void shorten(Case *c, bool rests)
{
    double norm = 0;
    for (int i = 0; i < CANDIDATES; ++i)
    {
        if (rests)
            close_rest(c->candidate[i], c->kept, c->candidate_rest[i]);
        norm = fmax(norm, norm_of(c->candidate[i], c->kept));
    }
    RfShortNumbers *s = &c->shorts;
    *s = (RfShortNumbers){.kept = c->kept, .pairs = (c->kept + 1) / 2, .scale = rf_short_scale(norm)};
    s->numbers = require(aligned_alloc(64, (size_t)ROOM * (size_t)s->pairs * 2 * sizeof *s->numbers));
    s->starts = require(aligned_alloc(64, ROOM * sizeof *s->starts));
    s->rests = rests ? require(aligned_alloc(64, ROOM * RF_REST_NUMBERS * sizeof *s->rests)) : NULL;
    memset(s->numbers, 0, (size_t)ROOM * (size_t)s->pairs * 2 * sizeof *s->numbers);
    for (int i = 0; i < ROOM; ++i)
        c->starts[i] = s->starts[i] = RF_SHORT_INFINITE;
    for (int i = 0; i < CANDIDATES; ++i)
    {
        rf_shorten_candidate(s, i, c->candidate[i], c->candidate_rest[i]);
        c->starts[i] = rf_short_start(s, i, c->penalty[i]);
    }
    int32_t unused;
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        if (rests)
            close_rest(c->query[q], c->kept, c->query_rest[q]);
        c->fits[q] = rf_shorten_query(s, c->query[q], c->kept, c->queries[q], &c->squares[q]);
        rf_shorten_query(s, c->query_rest[q], RF_REST_NUMBERS, c->rests[q], &unused);
    }
    for (int tile = 0; tile < TILES; ++tile)
        rf_short_products(c->queries[0], s->numbers + (size_t)tile * (size_t)s->pairs * 2 * RF_TILE_CANDIDATES,
                          s->pairs, c->starts + tile * RF_TILE_CANDIDATES, &c->scores[0][tile * RF_TILE_CANDIDATES],
                          ROOM);
}

static void release(Case *c)
{
    free(c->shorts.numbers);
    free(c->shorts.starts);
    free(c->shorts.rests);
}

static double distance(const float *a, const float *b, int count)
{
    double sum = 0;
    for (int k = 0; k < count; ++k)
        sum += ((double)a[k] - (double)b[k]) * ((double)a[k] - (double)b[k]);
    return sqrt(sum);
}

// |Q - C| is within `error` of s |q - c|: no bound is above the true distance, and none is far below.
static void expect_bounds(Case *c)
{
    shorten(c, false);
    double error = rf_short_error(&c->shorts, c->kept), step = 1 / (double)c->shorts.scale;
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        assert_true(c->fits[q]);
        for (int i = 0; i < CANDIDATES; ++i)
        {
            double apart = distance(c->query[q], c->candidate[i], c->kept), far = apart + error,
                   near = fmax(apart - error, 0);
            assert_true(c->scores[q][i] <= rf_short_limit(&c->shorts, far * far + c->penalty[i], c->squares[q]));
            assert_true(c->scores[q][i] >
                        rf_short_limit(&c->shorts, near * near + c->penalty[i] - 6 * step * step - 1e-9 * c->penalty[i],
                                       c->squares[q]));
        }
        for (int i = CANDIDATES; i < ROOM; ++i)
            assert_true(c->scores[q][i] == INFINITY);
    }
    release(c);
}

static void fill_random(Case *c, int kept, float size)
{
    memset(c, 0, sizeof *c);
    c->kept = kept;
    for (int k = 0; k < kept; ++k)
    {
        // A falling spectrum, as components have.
        float along = size * powf(0.9f, (float)k);
        for (int i = 0; i < CANDIDATES; ++i)
            c->candidate[i][k] = along * random_number(1, i, k);
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            c->query[q][k] = along * 1.2f * random_number(2, q, k);
    }
}

// ---- tests -------------------------------------------------------------------------------------------------------

static void no_bound_is_above_the_distance(void **state)
{
    (void)state;
    for (int kept = 1; kept <= MOST_KEPT; ++kept)
    {
        fill_random(&g_case, kept, 1);
        expect_bounds(&g_case);
    }
}

static void nor_for_tiny_and_huge_numbers(void **state)
{
    (void)state;
    const float sizes[] = {1e-30f, 1e-12f, 1e12f, 1e15f};
    for (int i = 0; i < 4; ++i)
    {
        fill_random(&g_case, 32, sizes[i]);
        if (sizes[i] < 1e-18f)
            // The scale ends at 2^60: all of these round to 0, and nothing is told apart.
            for (int q = 0; q < RF_TILE_QUERIES; ++q)
                memset(g_case.query[q], 0, sizeof g_case.query[q]);
        expect_bounds(&g_case);
    }
}

static void nor_where_every_number_lies_halfway_between_two_steps(void **state)
{
    (void)state;
    for (int kept = 2; kept <= MOST_KEPT; kept += 21)
    {
        fill_random(&g_case, kept, 0);
        // The longest candidate sets a scale of 1; all others, and the queries, are halves.
        g_case.candidate[0][0] = 16384;
        for (int i = 1; i < CANDIDATES; ++i)
            for (int k = 0; k < kept; ++k)
                g_case.candidate[i][k] = (float)(int)(900 * random_number(3, i, k)) + 0.5f;
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            for (int k = 0; k < kept; ++k)
                g_case.query[q][k] = (float)(int)(1900 * random_number(4, q, k)) - 0.5f;
        expect_bounds(&g_case);
    }
}

static void nor_for_zeros_and_for_equal_windows(void **state)
{
    (void)state;
    fill_random(&g_case, 24, 0);
    expect_bounds(&g_case);
    fill_random(&g_case, 24, 1);
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
        memcpy(g_case.query[q], g_case.candidate[q * 11], sizeof g_case.query[q]);
    expect_bounds(&g_case);
}

// The longest vectors there can be, opposite and alike, are where sums are greatest.
static void scores_of_the_longest_vectors_stay_in_range(void **state)
{
    (void)state;
    for (int spread = 0; spread < 2; ++spread)
    {
        fill_random(&g_case, 64, 0);
        for (int k = 0; k < (spread ? 64 : 1); ++k)
        {
            float part = spread ? 0.125f : 1;
            for (int i = 0; i < CANDIDATES; ++i)
                g_case.candidate[i][k] = i % 2 ? part : -part;
            for (int q = 0; q < RF_TILE_QUERIES; ++q)
                g_case.query[q][k] = 1.8f * (q % 2 ? part : -part);
        }
        for (int i = 0; i < CANDIDATES; ++i)
            g_case.penalty[i] = (i % 3) * 1.99;
        expect_bounds(&g_case);
        shorten(&g_case, false);
        assert_true(rf_short_fits(&g_case.shorts, 3.99));
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            for (int i = 0; i < CANDIDATES; ++i)
                assert_true(isnormal(g_case.scores[q][i]) && g_case.scores[q][i] > 0);
        release(&g_case);
    }
}

static void what_does_not_fit_is_told(void **state)
{
    (void)state;
    fill_random(&g_case, 31, 1);
    for (int i = 0; i < CANDIDATES; ++i)
        g_case.candidate[i][0] = 1;
    const float sizes[] = {1.3f, 3, 100, 1e12f, 1e30f};
    for (int i = 0; i < 5; ++i)
        g_case.query[i][0] = 3 * sizes[i];
    shorten(&g_case, false);
    double most = 0;
    for (int i = 0; i < CANDIDATES; ++i)
        most = fmax(most, norm_of(g_case.candidate[i], 31));
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
        assert_int_equal(g_case.fits[q], norm_of(g_case.query[q], 31) <= 29900.0 / 16384 * most);
    assert_false(g_case.fits[1]);
    assert_false(rf_short_fits(&g_case.shorts, 4.01 * most * most));
    assert_false(rf_short_fits(&g_case.shorts, 2e30));
    release(&g_case);
}

static void what_is_multiplied_in_one_go_is_what_is_multiplied_one_by_one(void **state)
{
    (void)state;
    if (!rf_simd_multiplies_shorts())
    {
        print_message("skipped: this machine does not multiply short integers\n");
        skip();
    }
    for (int kept = 1; kept <= MOST_KEPT; kept += 4)
    {
        fill_random(&g_case, kept, 7);
        shorten(&g_case, false);
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            for (int i = 0; i < CANDIDATES; ++i)
            {
                const int16_t *own = g_case.shorts.numbers + (size_t)(i / 32) * (size_t)g_case.shorts.pairs * 64;
                int64_t sum = g_case.starts[i];
                for (int k = 0; k < kept; ++k)
                    sum += g_case.queries[q][k] * own[(k / 2 * 32 + i % 32) * 2 + k % 2];
                int32_t bits;
                memcpy(&bits, &g_case.scores[q][i], sizeof bits);
                assert_int_equal(bits, sum);
            }
        release(&g_case);
    }
}

// A candidate is kept if its distance in all numbers is the limit's, and dropped if it is clearly more.
static void the_sieve_keeps_what_may_be_nearest_and_little_else(void **state)
{
    (void)state;
    for (int size = 0; size < 3; ++size)
    {
        fill_random(&g_case, 16, 1);
        // Third: a query whose rest is longer than any candidate's, as long as it may be.
        for (int k = 0; k < RF_REST_NUMBERS - 1; ++k)
        {
            float along = (size == 2 ? 0.6f : 0.3f) * (k == RF_REST_NUMBERS - 2 ? 0.3f : 1);
            for (int i = 0; i < CANDIDATES; ++i)
                g_case.candidate_rest[i][k] = along * random_number(5, i, k);
            for (int q = 0; q < RF_TILE_QUERIES; ++q)
                g_case.query_rest[q][k] = along * (size == 0 ? 0 : size == 1 ? 0.9f : 1.4f) * random_number(6, q, k);
        }
        shorten(&g_case, true);
        const RfShortNumbers *s = &g_case.shorts;
        double error = rf_short_error(s, s->kept + RF_REST_NUMBERS), step = 1 / (double)s->scale;
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
        {
            assert_true(g_case.fits[q]);
            for (int i = 0; i < CANDIDATES; ++i)
            {
                double first = distance(g_case.query[q], g_case.candidate[i], s->kept - 1),
                       rest = distance(g_case.query_rest[q], g_case.candidate_rest[i], RF_REST_NUMBERS - 1),
                       apart = sqrt(first * first + rest * rest);
                int list[2] = {i, i};
                // What adding the errors of 4 vectors, of which two are taken off, can come to.
                double far = (apart + error) * (apart + error), near = fmax(apart - 2 * error, 0);
                near = near * near - 8 * step * apart * sqrt(64) - 64 * step * step;
                assert_int_equal(rf_short_sieve(s, g_case.rests[q], g_case.scores[q], 0,
                                                rf_short_limit(s, far, g_case.squares[q]), list, 2),
                                 2);
                assert_int_equal(list[1], i);
                if (near > 0)
                    assert_int_equal(rf_short_sieve(s, g_case.rests[q], g_case.scores[q], 0,
                                                    rf_short_limit(s, near, g_case.squares[q]), list, 2),
                                     0);
            }
        }
        release(&g_case);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_bound_is_above_the_distance),
        cmocka_unit_test(nor_for_tiny_and_huge_numbers),
        cmocka_unit_test(nor_where_every_number_lies_halfway_between_two_steps),
        cmocka_unit_test(nor_for_zeros_and_for_equal_windows),
        cmocka_unit_test(scores_of_the_longest_vectors_stay_in_range),
        cmocka_unit_test(what_does_not_fit_is_told),
        cmocka_unit_test(what_is_multiplied_in_one_go_is_what_is_multiplied_one_by_one),
        cmocka_unit_test(the_sieve_keeps_what_may_be_nearest_and_little_else),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
