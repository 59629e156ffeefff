// SPDX-License-Identifier: Apache-2.0
#include "core/memory.h"
#include "core/options.h"
#include "core/parallel.h"
#include "core/random.h"
#include "riffle/riffle.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

static void an_array_too_large_to_count_is_refused(void **state)
{
    (void)state;
    assert_null(rf_allocate(SIZE_MAX / 2, 4));
    assert_int_equal(rf_last_error()->result, RF_OUT_OF_MEMORY);
}

static void an_arena_learns_its_peak(void **state)
{
    (void)state;
    RfArena arena = {0};
    for (int round = 0; round < 3; ++round)
    {
        for (int i = 0; i < 5; ++i)
        {
            uint8_t *memory = rf_arena_push(&arena, 100, 3);
            assert_non_null(memory);
            assert_int_equal((uintptr_t)memory % 64, 0);
            memset(memory, round, 300);
        }
        assert_int_equal(arena.overflow != NULL, round == 0);
        rf_arena_reset(&arena);
    }
    rf_arena_free(&arena);
}

static void square(void *context, int item, int worker)
{
    (void)worker;
    ((int *)context)[item] = item * item;
}

static void every_item_runs_once_for_any_number_of_threads(void **state)
{
    (void)state;
    for (int threads = 1; threads <= 5; ++threads)
    {
        int squares[100];
        memset(squares, -1, sizeof squares);
        rf_set_threads(threads);
        rf_parallel_for(100, square, squares);
        for (int i = 0; i < 100; ++i)
            assert_int_equal(squares[i], i * i);
    }
    rf_set_threads(0);
}

static void random_numbers_are_uniform_and_independent_of_order(void **state)
{
    (void)state;
    double sum = 0, squares = 0, lagged = 0;
    const int n = 100000;
    for (int i = 0; i < n; ++i)
    {
        double x = rf_random_float(1, 2, (uint64_t)i, 0) - 0.5, y = rf_random_float(1, 2, (uint64_t)i + 1, 0) - 0.5;
        sum += x;
        squares += x * x;
        lagged += x * y;
    }
    assert_true(sum / n < 0.005 && sum / n > -0.005);
    assert_true(squares / n > 0.0825 && squares / n < 0.0842);
    assert_true(lagged / n < 0.001 && lagged / n > -0.001);
}

typedef struct Choices
{
    uint32_t struct_size;
    float stretch;
} Choices;

static RfResult check_stretch(float stretch)
{
    static const RfOption table[] = {{"stretch", RF_OPTION_FLOAT, offsetof(Choices, stretch), "", 1.05, 0.1 + 1.1, 1.1,
                                      NULL, "Neither end of the range is a float."}};
    Choices choices = {sizeof choices, stretch};
    return rf_options_check(&choices, choices.struct_size, sizeof choices, "defaults", table, 1);
}

static void an_option_may_lie_on_the_ends_of_its_range_and_not_beyond(void **state)
{
    (void)state;
    assert_int_equal(check_stretch(1.05f), RF_OK);
    assert_int_equal(check_stretch(1.2f), RF_OK);
#ifndef RF_STOP_ON_MISUSE
    assert_int_equal(check_stretch(nextafterf(1.05f, 0)), RF_INVALID_ARGUMENT);
    assert_int_equal(check_stretch(nextafterf(1.2f, 2)), RF_INVALID_ARGUMENT);
    assert_int_equal(check_stretch(NAN), RF_INVALID_ARGUMENT);
#endif
}

typedef struct Sides
{
    uint32_t struct_size;
    int sides[RF_MAX_OPTION_INTS];
} Sides;

static const RfOption g_sides[] = {
    {"sides", RF_OPTION_INTS, offsetof(Sides, sides), "", 5, 33, 17, "17,9", "A 0 ends them."}};

static RfResult check_sides(Sides sides)
{
    return rf_options_check(&sides, sizeof sides, sizeof sides, "defaults", g_sides, 1);
}

static uint64_t hash_sides(Sides sides)
{
    return rf_options_hash(&sides, g_sides, 1, 1);
}

static void each_number_of_a_list_is_held_to_its_range_and_nothing_behind_its_end(void **state)
{
    (void)state;
    assert_int_equal(check_sides((Sides){0, {33}}), RF_OK);
    assert_int_equal(check_sides((Sides){0, {5, 6, 7, 33}}), RF_OK);
    assert_int_equal(check_sides((Sides){0, {17, 9, 0, 1000}}), RF_OK);
#ifndef RF_STOP_ON_MISUSE
    assert_int_equal(check_sides((Sides){0, {0, 9}}), RF_INVALID_ARGUMENT);
    assert_int_equal(check_sides((Sides){0, {17, 4}}), RF_INVALID_ARGUMENT);
    assert_int_equal(check_sides((Sides){0, {17, 9, 5, 34}}), RF_INVALID_ARGUMENT);
    assert_int_equal(check_sides((Sides){0, {-17}}), RF_INVALID_ARGUMENT);
#endif
    assert_true(hash_sides((Sides){0, {17, 9, 0, 5}}) == hash_sides((Sides){0, {17, 9, 0, 7}}));
    assert_true(hash_sides((Sides){0, {17, 9, 0, 0}}) != hash_sides((Sides){0, {17, 9, 5, 0}}));
    assert_true(hash_sides((Sides){0, {17, 9, 0, 0}}) != hash_sides((Sides){0, {9, 17, 0, 0}}));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_array_too_large_to_count_is_refused),
        cmocka_unit_test(an_arena_learns_its_peak),
        cmocka_unit_test(every_item_runs_once_for_any_number_of_threads),
        cmocka_unit_test(random_numbers_are_uniform_and_independent_of_order),
        cmocka_unit_test(each_number_of_a_list_is_held_to_its_range_and_nothing_behind_its_end),
        cmocka_unit_test(an_option_may_lie_on_the_ends_of_its_range_and_not_beyond),
    };
    return cmocka_run_group_tests_name("core", tests, NULL, NULL);
}
