// SPDX-License-Identifier: Apache-2.0
// All of this holds on every instruction set: the program runs itself once for each that the machine has.
#include "core/random.h"
#include "core/simd.h"
#include "kernels/fixed_picture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    LARGEST = RF_FIXED_RANGE / 2,
    MOST_CANDIDATES = 64,
    MASK = RF_FIXED_SIDE * RF_MAX_EXEMPLAR_CHANNELS + RF_FIXED_LANES
};

static const char *g_program;

static RfFixedPicture make_picture(int width, int height, int channels, int apron)
{
    RfFixedPicture picture;
    assert_int_equal(rf_fixed_create(width, height, channels, apron, &picture), RF_OK);
    return picture;
}

// Numbers of any size, or nothing but the two extremes.
static void fill(RfFixedPicture *picture, uint64_t seed, bool extremes)
{
    for (int y = 0; y < picture->height; ++y)
        for (int i = 0; i < picture->width * picture->channels; ++i)
        {
            int random = (int)rf_random_below(RF_FIXED_RANGE + 1, seed, 0, (uint64_t)y, (uint64_t)i) - LARGEST;
            rf_fixed_at(picture, 0, y)[i] = (int16_t)(extremes ? (random < 0 ? -LARGEST : LARGEST) : random);
        }
    rf_fixed_extend(picture, true);
}

static double slow_distance(const RfFixedPicture *a, int ax, int ay, const RfFixedPicture *b, int bx, int by, int side)
{
    double sum = 0;
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            for (int c = 0; c < a->channels; ++c)
            {
                double d = (double)rf_fixed_at(a, ax + x, ay + y)[c] - (double)rf_fixed_at(b, bx + x, by + y)[c];
                sum += d * d;
            }
    return sum;
}

static float distance_between(const RfFixedPicture *a, int ax, int ay, const RfFixedPicture *b, int bx, int by,
                              int side)
{
    int16_t mask[MASK];
    RfFixedQuery query;
    rf_fixed_query(a, b, side, mask, &query);
    query.window = rf_fixed_at(a, ax, ay);
    const int16_t *candidate = rf_fixed_at(b, bx, by);
    float distance = -1;
    assert_int_equal(rf_fixed_least(&query, &candidate, NULL, 1, &distance), 0);
    return distance;
}

static void distances_are_those_of_a_slow_double_sum(void **state)
{
    (void)state;
    static const int sides[] = {1, 3, 4, 5, 9, 17, 33}, channels[] = {1, 2, 3, 4, 5, 7, 11, 16};
    for (size_t s = 0; s < sizeof sides / sizeof *sides; ++s)
        for (size_t c = 0; c < sizeof channels / sizeof *channels; ++c)
            for (int extremes = 0; extremes < 2; ++extremes)
            {
                RfFixedPicture a = make_picture(40, 37, channels[c], 2), b = make_picture(35, 39, channels[c], 5);
                fill(&a, 1, extremes);
                fill(&b, 2, extremes);
                for (int i = 0; i < 6; ++i)
                {
                    uint64_t item = (uint64_t)i;
                    int room = 35 - sides[s] + 1;
                    int ax = (int)rf_random_below((uint32_t)room, 3, 0, item, 0),
                        ay = (int)rf_random_below((uint32_t)room, 3, 0, item, 1),
                        bx = (int)rf_random_below((uint32_t)room, 3, 0, item, 2),
                        by = (int)rf_random_below((uint32_t)room, 3, 0, item, 3);
                    // Whole numbers up to 2^53 are exact in doubles; only the result is rounded.
                    assert_true(distance_between(&a, ax, ay, &b, bx, by, sides[s]) ==
                                (float)slow_distance(&a, ax, ay, &b, bx, by, sides[s]));
                }
                rf_fixed_free(&a);
                rf_fixed_free(&b);
            }
}

static void the_largest_windows_as_far_apart_as_can_be_do_not_overflow(void **state)
{
    (void)state;
    const int side = RF_FIXED_SIDE, channels = RF_MAX_EXEMPLAR_CHANNELS;
    RfFixedPicture a = make_picture(side, side, channels, 0), b = make_picture(side, side, channels, 0);
    for (int y = 0; y < side; ++y)
        for (int i = 0; i < side * channels; ++i)
        {
            rf_fixed_at(&a, 0, y)[i] = LARGEST;
            rf_fixed_at(&b, 0, y)[i] = -LARGEST;
        }
    double expected = (double)side * side * channels * RF_FIXED_RANGE * RF_FIXED_RANGE;
    assert_true(expected > 0x1p32);
    assert_true(distance_between(&a, 0, 0, &b, 0, 0, side) == (float)expected);
    assert_true(distance_between(&a, 0, 0, &a, 0, 0, side) == 0);
    rf_fixed_free(&a);
    rf_fixed_free(&b);
}

// Rows are read in whole vectors; what lies right of a window, or behind the picture's last number, never counts.
static void what_lies_beside_a_window_does_not_count(void **state)
{
    (void)state;
    static const int channels[] = {1, 3, 16};
    for (size_t c = 0; c < 3; ++c)
    {
        const int apron = 2, size = 20, side = 7;
        RfFixedPicture a = make_picture(size, size, channels[c], apron),
                       b = make_picture(size, size, channels[c], apron);
        fill(&a, 4, false);
        fill(&b, 5, false);
        int last = size + apron - side;
        float before = distance_between(&a, last, last, &b, 0, 0, side);
        assert_true(before == (float)slow_distance(&a, last, last, &b, 0, 0, side));
        assert_true(distance_between(&b, 0, 0, &a, last, last, side) == before);
        for (int y = 0; y < size; ++y)
            for (int x = 0; x < size; ++x)
                for (int k = 0; k < channels[c] && (x >= side || y >= side); ++k)
                    rf_fixed_at(&b, x, y)[k] ^= 255;
        assert_true(distance_between(&a, last, last, &b, 0, 0, side) == before);
        rf_fixed_free(&a);
        rf_fixed_free(&b);
    }
}

typedef struct Contest
{
    RfFixedPicture picture, exemplar;
    int16_t mask[MASK];
    RfFixedQuery query;
    int side, count;
    const int16_t *candidates[MOST_CANDIDATES];
    double distances[MOST_CANDIDATES];
    float penalties[MOST_CANDIDATES];
} Contest;

static void open_contest(Contest *c, int side, int count)
{
    c->side = side;
    c->count = count;
    c->picture = make_picture(side, side, 3, 0);
    c->exemplar = make_picture(30, 30, 3, 0);
    fill(&c->picture, 6, false);
    fill(&c->exemplar, 7, false);
    rf_fixed_query(&c->picture, &c->exemplar, side, c->mask, &c->query);
    c->query.window = c->picture.pixels;
    for (int i = 0; i < count; ++i)
    {
        int x = (int)rf_random_below((uint32_t)(30 - side), 8, 0, (uint64_t)i, 0);
        int y = (int)rf_random_below((uint32_t)(30 - side), 8, 0, (uint64_t)i, 1);
        c->candidates[i] = rf_fixed_at(&c->exemplar, x, y);
        c->distances[i] = slow_distance(&c->picture, 0, 0, &c->exemplar, x, y, side);
        c->penalties[i] = 0;
    }
}

static void close_contest(Contest *c)
{
    rf_fixed_free(&c->picture);
    rf_fixed_free(&c->exemplar);
}

static int slow_least(const Contest *c)
{
    int best = 0;
    for (int i = 1; i < c->count; ++i)
        if (c->distances[i] + (double)c->penalties[i] < c->distances[best] + (double)c->penalties[best])
            best = i;
    return best;
}

static void check_contest(const Contest *c, bool penalties)
{
    float distance = -1;
    int best = rf_fixed_least(&c->query, c->candidates, penalties ? c->penalties : NULL, c->count, &distance);
    assert_int_equal(best, slow_least(c));
    assert_true(distance == (float)c->distances[best]);
}

static void the_least_is_found_in_any_order(void **state)
{
    (void)state;
    for (int side = 3; side <= 17; side += 7)
        for (int count = 1; count <= MOST_CANDIDATES; count += 9)
        {
            Contest c;
            open_contest(&c, side, count);
            check_contest(&c, false);
            // The best last, and all others before it from the worst on, so that no sum is broken off early.
            for (int i = 0; i < count; ++i)
                for (int j = i + 1; j < count; ++j)
                    if (c.distances[j] > c.distances[i])
                    {
                        double d = c.distances[i];
                        const int16_t *p = c.candidates[i];
                        c.distances[i] = c.distances[j], c.candidates[i] = c.candidates[j];
                        c.distances[j] = d, c.candidates[j] = p;
                    }
            check_contest(&c, false);
            close_contest(&c);
        }
}

static void of_equals_the_first_is_taken(void **state)
{
    (void)state;
    Contest c;
    open_contest(&c, 9, 20);
    int best = slow_least(&c);
    for (int i = 0; i < c.count; ++i)
        if (i % 3 == 2)
        {
            c.candidates[i] = c.candidates[best];
            c.distances[i] = c.distances[best];
        }
    float distance;
    int first = best < 2 ? best : 2;
    assert_int_equal(rf_fixed_least(&c.query, c.candidates, NULL, c.count, &distance), first);
    // Equal with the penalty, one by pixels and one by price.
    c.count = 2;
    c.candidates[0] = c.candidates[1] == c.candidates[best] ? c.candidates[3] : c.candidates[0];
    c.distances[0] = c.distances[1] == c.distances[best] ? c.distances[3] : c.distances[0];
    c.penalties[0] = 0;
    c.penalties[1] = (float)(c.distances[0] - c.distances[1]);
    assert_true((double)c.penalties[1] == c.distances[0] - c.distances[1]);
    assert_int_equal(rf_fixed_least(&c.query, c.candidates, c.penalties, 2, &distance), 0);
    close_contest(&c);
}

static void penalties_count_in_the_choice_and_not_in_the_distance(void **state)
{
    (void)state;
    Contest c;
    open_contest(&c, 9, 40);
    int plain = slow_least(&c);
    for (int round = 0; round < 20; ++round)
    {
        for (int i = 0; i < c.count; ++i)
            c.penalties[i] = (rf_random_float(9, (uint64_t)round, (uint64_t)i, 0) - 0.5f) * 1e7f * (float)round;
        check_contest(&c, true);
    }
    memset(c.penalties, 0, sizeof c.penalties);
    c.penalties[plain] = 1e9f;
    check_contest(&c, true);
    assert_int_not_equal(slow_least(&c), plain);
    close_contest(&c);
}

static void numbers_are_rounded_and_kept_within_the_range(void **state)
{
    (void)state;
    static const float numbers[6] = {0, 0.26f, -0.24f, 1e9f, -1e9f, 153};
    static const int16_t expected[6] = {0, 1, -1, LARGEST, -LARGEST, LARGEST};
    RfFixedPicture picture = make_picture(3, 1, 2, 1);
    rf_fixed_set(&picture, numbers, 4);
    assert_memory_equal(picture.pixels, expected, sizeof expected);
    rf_fixed_free(&picture);
}

// Any apron, also one wider than the picture.
static void the_apron_holds_the_other_side_or_the_border(void **state)
{
    (void)state;
    static const int sizes[][3] = {{5, 4, 33}, {1, 1, 6}, {12, 3, 4}, {8, 8, 0}};
    for (size_t s = 0; s < 4; ++s)
        for (int tiles = 0; tiles < 2; ++tiles)
        {
            int w = sizes[s][0], h = sizes[s][1], apron = sizes[s][2];
            RfFixedPicture picture = make_picture(w, h, 2, apron);
            for (int i = 0; i < w * h; ++i)
                for (int c = 0; c < 2; ++c)
                    rf_fixed_at(&picture, i % w, i / w)[c] = (int16_t)(2 * i + c);
            rf_fixed_extend(&picture, tiles);
            for (int y = -apron; y < h + apron; ++y)
                for (int x = -apron; x < w + apron; ++x)
                {
                    int u = tiles ? (x + 40 * w) % w : x < 0 ? 0 : x >= w ? w - 1 : x;
                    int v = tiles ? (y + 40 * h) % h : y < 0 ? 0 : y >= h ? h - 1 : y;
                    for (int c = 0; c < 2; ++c)
                        assert_int_equal(rf_fixed_at(&picture, x, y)[c], 2 * (v * w + u) + c);
                }
            rf_fixed_free(&picture);
        }
}

static void all_of_this_holds_on_every_instruction_set(void **state)
{
    (void)state;
    static const char *const sets[] = {"plain", "avx2"};
    for (int i = 0; i < 2; ++i)
    {
        char command[4096];
        if ((int)rf_simd_level() <= i)
        {
            print_message("%s is the one in use\n", sets[i]);
            break;
        }
        snprintf(command, sizeof command, "RF_SIMD=%s '%s' again >/dev/null 2>&1", sets[i], g_program);
        assert_int_equal(system(command), 0);
    }
}

int main(int argc, char **argv)
{
    g_program = argv[0];
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distances_are_those_of_a_slow_double_sum),
        cmocka_unit_test(the_largest_windows_as_far_apart_as_can_be_do_not_overflow),
        cmocka_unit_test(what_lies_beside_a_window_does_not_count),
        cmocka_unit_test(the_least_is_found_in_any_order),
        cmocka_unit_test(of_equals_the_first_is_taken),
        cmocka_unit_test(penalties_count_in_the_choice_and_not_in_the_distance),
        cmocka_unit_test(numbers_are_rounded_and_kept_within_the_range),
        cmocka_unit_test(the_apron_holds_the_other_side_or_the_border),
    };
    const struct CMUnitTest sets[] = {cmocka_unit_test(all_of_this_holds_on_every_instruction_set)};
    int failed = cmocka_run_group_tests_name("fixed picture", tests, NULL, NULL);
    return failed + (argc > 1 ? 0 : cmocka_run_group_tests_name("instruction sets", sets, NULL, NULL));
}
