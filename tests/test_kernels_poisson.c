// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/poisson_disk.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    MAX_POINTS = 8192
};

static RfVec2 g_points[MAX_POINTS];

typedef bool Domain(RfVec2 point);

static bool everywhere(RfVec2 point)
{
    (void)point;
    return true;
}

static bool ring(RfVec2 point)
{
    float r = hypotf(point.x - 100, point.y - 75);
    return r > 20 && r < 70;
}

// Adds points to the `count` there are until no cell is open; returns how many there are then.
static int refill(int width, int height, float radius, Domain *domain, uint64_t seed, int count, RfArena *arena,
                  RfDiskField *field)
{
    assert_int_equal(rf_disk_field_create(width, height, radius, arena, field), RF_OK);
    for (int i = 0; i < count; ++i)
        rf_disk_field_mark(field, g_points[i]);
    assert_int_equal(rf_disk_field_list(field, arena), RF_OK);
    int cell;
    for (uint64_t draw = 0; (cell = rf_disk_field_pick(field, seed, 0, draw)) >= 0; ++draw)
    {
        RfVec2 point = rf_disk_field_centre(field, cell);
        assert_true(field->open[cell]);
        field->open[cell] = 0;
        if (!domain(point))
            continue;
        assert_true(count < MAX_POINTS);
        rf_disk_field_mark(field, point);
        g_points[count++] = point;
    }
    return count;
}

static float nearest(RfVec2 p, int count, int except)
{
    float best = INFINITY;
    for (int i = 0; i < count; ++i)
        if (i != except)
            best = fminf(best, rf_vec2_length(rf_vec2_sub(p, g_points[i])));
    return best;
}

static void no_place_of_the_domain_is_farther_than_d_and_no_two_points_much_nearer(void **state)
{
    (void)state;
    static const struct
    {
        int width, height;
        float radius;
    } cases[] = {{200, 150, 20}, {97, 31, 2.3f}, {256, 256, 64}, {1, 1, 2}, {1, 300, 7}, {640, 480, 400}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; ++c)
    {
        RfArena arena = {0};
        RfDiskField field;
        int w = cases[c].width, h = cases[c].height;
        float d = cases[c].radius;
        int count = refill(w, h, d, everywhere, c, 0, &arena, &field);
        assert_true(count >= 1);
        for (uint64_t k = 0; k < 20000; ++k)
        {
            RfVec2 p = {(float)w * rf_random_float(9, 0, k, 0), (float)h * rf_random_float(9, 0, k, 1)};
            assert_true(nearest(p, count, -1) <= d * 1.00001f);
        }
        for (int i = 0; i < count; ++i)
            assert_true(nearest(g_points[i], count, i) >= d - 0.7072f * field.spacing - 1e-3f);
        rf_arena_free(&arena);
    }
}

static void a_mask_is_filled_and_nothing_else(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfDiskField field;
    int count = refill(200, 150, 12, ring, 3, 0, &arena, &field);
    for (int i = 0; i < count; ++i)
        assert_true(ring(g_points[i]));
    for (int cell = 0; cell < field.columns * field.rows; ++cell)
    {
        RfVec2 p = rf_disk_field_centre(&field, cell);
        if (ring(p))
            assert_true(nearest(p, count, -1) <= 12.0001f);
    }
    rf_arena_free(&arena);
}

static void only_a_gap_is_filled_and_points_beyond_the_border_count(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfDiskField field;
    int count = refill(200, 150, 20, everywhere, 5, 0, &arena, &field);
    rf_arena_reset(&arena);
    assert_int_equal(refill(200, 150, 20, everywhere, 6, count, &arena, &field), count);
    // Without its last point there is a gap, all of it within d of where that was.
    RfVec2 lost = g_points[count - 1];
    rf_arena_reset(&arena);
    int mended = refill(200, 150, 20, everywhere, 7, count - 1, &arena, &field);
    assert_true(mended >= count);
    for (int i = count - 1; i < mended; ++i)
        assert_true(rf_vec2_length(rf_vec2_sub(g_points[i], lost)) < 20);
    // One outside closes what it reaches; far, infinite and NaN ones close nothing.
    g_points[0] = (RfVec2){-5, 75};
    g_points[1] = (RfVec2){1e30f, 75};
    g_points[2] = (RfVec2){NAN, 75};
    g_points[3] = (RfVec2){75, -INFINITY};
    rf_arena_reset(&arena);
    count = refill(200, 150, 20, everywhere, 8, 4, &arena, &field);
    for (int i = 4; i < count; ++i)
        assert_true(rf_vec2_length(rf_vec2_sub(g_points[i], g_points[0])) > 20 - field.spacing);
    assert_true(count > 4 + 50);
    rf_arena_free(&arena);
}

static void picks_are_a_function_of_the_seed(void **state)
{
    (void)state;
    static RfVec2 first[MAX_POINTS];
    RfArena arena = {0};
    RfDiskField field;
    int count = refill(200, 150, 20, everywhere, 11, 0, &arena, &field);
    memcpy(first, g_points, sizeof first);
    assert_int_equal(refill(200, 150, 20, everywhere, 11, 0, &arena, &field), count);
    assert_memory_equal(first, g_points, (size_t)count * sizeof *first);
    refill(200, 150, 20, everywhere, 12, 0, &arena, &field);
    assert_memory_not_equal(first, g_points, 4 * sizeof *first);
    rf_arena_free(&arena);
}

// ---- close pairs

static int compare(const void *left, const void *right)
{
    const RfPair *p = left, *q = right;
    if (p->distance != q->distance)
        return p->distance < q->distance ? -1 : 1;
    return p->a != q->a ? p->a - q->a : p->b - q->b;
}

static void check_pairs(int count, float limit, int least)
{
    static RfPair expected[200000];
    int wanted = 0;
    for (int a = 0; a < count; ++a)
        for (int b = a + 1; b < count; ++b)
        {
            float distance = rf_vec2_length(rf_vec2_sub(g_points[a], g_points[b]));
            if (distance < limit)
                expected[wanted++] = (RfPair){distance, a, b};
        }
    qsort(expected, (size_t)wanted, sizeof *expected, compare);
    RfArena arena = {0};
    RfPair *pairs = NULL;
    assert_int_equal(rf_close_pairs(g_points, count, limit, &arena, &pairs), wanted);
    assert_true(wanted >= least);
    for (int i = 0; i < wanted; ++i)
    {
        assert_int_equal(pairs[i].a, expected[i].a);
        assert_int_equal(pairs[i].b, expected[i].b);
        assert_true(fabsf(pairs[i].distance - expected[i].distance) <= 1e-5f * limit);
    }
    rf_arena_free(&arena);
}

static void scatter(int count, float side)
{
    // Half of them on a coarse lattice, so that distances tie.
    for (int i = 0; i < count; ++i)
    {
        float x = side * rf_random_float(4, 0, (uint64_t)i, 0), y = side * rf_random_float(4, 0, (uint64_t)i, 1);
        g_points[i] = i % 2 ? (RfVec2){x, y} : (RfVec2){floorf(x / 5) * 5, floorf(y / 5) * 5};
    }
}

static void close_pairs_are_all_pairs_in_order_of_distance(void **state)
{
    (void)state;
    scatter(400, 100);
    check_pairs(400, 8, 500);
    check_pairs(400, 0.5f, 1);
    check_pairs(100, 1000, 100 * 99 / 2);
    check_pairs(2, 1e-6f, 0);
    // Far apart: more bins than are allowed would be needed.
    g_points[17] = (RfVec2){1e7f, -1e7f};
    g_points[18] = (RfVec2){1e7f, -1e7f};
    g_points[300] = (RfVec2){-1e8f, 3};
    check_pairs(400, 8, 400);
    g_points[5] = (RfVec2){1e30f, 1e30f};
    check_pairs(400, 8, 400);
}

static void one_point_or_none_has_no_pair_and_equal_points_have_all(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfPair *pairs;
    g_points[0] = (RfVec2){3, 4};
    assert_int_equal(rf_close_pairs(g_points, 0, 5, &arena, &pairs), 0);
    assert_int_equal(rf_close_pairs(g_points, 1, 5, &arena, &pairs), 0);
    assert_null(pairs);
    for (int i = 0; i < 20; ++i)
        g_points[i] = (RfVec2){3, 4};
    check_pairs(20, 5, 190);
    rf_arena_free(&arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_place_of_the_domain_is_farther_than_d_and_no_two_points_much_nearer),
        cmocka_unit_test(a_mask_is_filled_and_nothing_else),
        cmocka_unit_test(only_a_gap_is_filled_and_points_beyond_the_border_count),
        cmocka_unit_test(picks_are_a_function_of_the_seed),
        cmocka_unit_test(close_pairs_are_all_pairs_in_order_of_distance),
        cmocka_unit_test(one_point_or_none_has_no_pair_and_equal_points_have_all),
    };
    return cmocka_run_group_tests_name("poisson disk", tests, NULL, NULL);
}
