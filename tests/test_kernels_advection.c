// SPDX-License-Identifier: Apache-2.0
#include "core/random.h"
#include "kernels/advection.h"
#include "kernels/extrapolation.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    CELLS = 32,
    SIDE = 128,
    N = 6
};

static float g_velocity[2 * CELLS * CELLS], g_next[2 * CELLS * CELLS];
static uint8_t g_mask[CELLS * CELLS];

static RfFlowView view_at(double time)
{
    return (RfFlowView){.width = CELLS, .height = CELLS, .velocity = g_velocity, .time = time};
}

static void fill(float *velocity, float x, float y)
{
    for (int k = 0; k < CELLS * CELLS; ++k)
    {
        velocity[2 * k] = x;
        velocity[2 * k + 1] = y;
    }
}

static void place_grid(float x0, float y0, float cell, float *x, float *y)
{
    for (int k = 0; k < N * N; ++k)
    {
        x[k] = x0 + (float)(k % N) * cell;
        y[k] = y0 + (float)(k / N) * cell;
    }
}

// Greatest distance from the start after a full turn in `steps` steps.
static double error_of_a_turn(int steps)
{
    float x[N * N], y[N * N], x0[N * N], y0[N * N];
    bool inside[N * N];
    for (int k = 0; k < CELLS * CELLS; ++k)
    {
        float dx = (float)(k % CELLS) + 0.5f - CELLS / 2, dy = (float)(k / CELLS) + 0.5f - CELLS / 2;
        g_velocity[2 * k] = -2 * RF_PI / (float)steps * dy;
        g_velocity[2 * k + 1] = 2 * RF_PI / (float)steps * dx;
    }
    // At most 2.2 cells from the centre, so that no step is cut.
    place_grid(SIDE / 2 - 4, SIDE / 2 - 4, 2, x, y);
    place_grid(SIDE / 2 - 4, SIDE / 2 - 4, 2, x0, y0);
    for (int s = 1; s <= steps; ++s)
    {
        RfFlowView view = view_at(s);
        assert_int_equal(rf_advect_grid(x, y, inside, N, &view, s - 1, SIDE, SIDE), N * N);
    }
    double greatest = 0;
    for (int k = 0; k < N * N; ++k)
        greatest = fmax(greatest, hypot((double)(x[k] - x0[k]), (double)(y[k] - y0[k])));
    return greatest;
}

static void a_full_turn_in_a_rigid_rotation_comes_back_at_fourth_order(void **state)
{
    (void)state;
    double coarse = error_of_a_turn(10), fine = error_of_a_turn(20);
    print_message("10 steps a turn: %.4f px, 20 steps: %.5f px, ratio %.1f\n", coarse, fine, coarse / fine);
    assert_true(coarse / fine > 12);
    assert_true(fine < 0.02);
}

static void a_step_in_a_fast_flow_is_cut_so_that_it_stays_as_exact(void **state)
{
    (void)state;
    // A step of 1/5 turn, 14 cells from the centre: 17 cells in one step.
    for (int k = 0; k < CELLS * CELLS; ++k)
    {
        float dx = (float)(k % CELLS) + 0.5f - CELLS / 2, dy = (float)(k / CELLS) + 0.5f - CELLS / 2;
        g_velocity[2 * k] = -0.4f * RF_PI * dy;
        g_velocity[2 * k + 1] = 0.4f * RF_PI * dx;
    }
    float x[N * N], y[N * N];
    bool inside[N * N];
    place_grid(SIDE / 2 + 50, SIDE / 2 - 3, 1, x, y);
    RfFlowView view = view_at(1);
    rf_advect_grid(x, y, inside, N, &view, 0, SIDE, SIDE);
    for (int k = 0; k < N * N; ++k)
    {
        double dx = 50 + k % N, dy = -3 + k / N, c = cos(0.4 * M_PI), s = sin(0.4 * M_PI);
        assert_true(hypot(c * dx - s * dy + SIDE / 2 - (double)x[k], s * dx + c * dy + SIDE / 2 - (double)y[k]) < 0.01);
    }
}

static void far_and_nan_vertices_are_defined_and_do_not_disturb_the_others(void **state)
{
    (void)state;
    fill(g_velocity, 0.5f, -0.25f);
    float x[N * N], y[N * N], x0[N * N], y0[N * N];
    bool inside[N * N];
    place_grid(40, 40, 4, x, y);
    x[3] = NAN;
    y[7] = NAN;
    x[8] = 1e30f;
    y[9] = -1e30f;
    x[10] = INFINITY;
    memcpy(x0, x, sizeof x);
    memcpy(y0, y, sizeof y);
    RfFlowView view = view_at(1);
    assert_int_equal(rf_advect_grid(x, y, inside, N, &view, 0, SIDE, SIDE), N * N - 5);
    for (int k = 0; k < N * N; ++k)
    {
        bool odd = k == 3 || (k >= 7 && k <= 10);
        assert_int_equal(inside[k], !odd);
        if (!odd)
            assert_true(fabsf(x[k] - x0[k] - 2) < 1e-4f && fabsf(y[k] - y0[k] + 1) < 1e-4f);
    }
    for (int k = 0; k < N * N; ++k)
        x[k] = y[k] = NAN;
    assert_int_equal(rf_advect_grid(x, y, inside, N, &view, 0, SIDE, SIDE), 0);
}

static void vertices_on_land_and_beyond_the_domain_move_with_the_grid(void **state)
{
    (void)state;
    fill(g_velocity, 0.75f, 0.25f);
    // Land from column 16 on, with velocities that must not count.
    for (int k = 0; k < CELLS * CELLS; ++k)
    {
        g_mask[k] = k % CELLS < 16;
        if (!g_mask[k])
            g_velocity[2 * k] = g_velocity[2 * k + 1] = 99;
    }
    float x[N * N], y[N * N], x0[N * N], y0[N * N];
    bool inside[N * N];
    RfFlowView view = view_at(1);
    view.mask = g_mask;
    // Across the shore, and across two borders of the domain.
    const float corner[2][2] = {{16 * 4 - 20, 50}, {-22, -18}};
    for (int i = 0; i < 2; ++i)
    {
        place_grid(corner[i][0], corner[i][1], 8, x, y);
        memcpy(x0, x, sizeof x);
        memcpy(y0, y, sizeof y);
        int count = rf_advect_grid(x, y, inside, N, &view, 0, SIDE, SIDE);
        assert_in_range(count, 4, N * N - 4);
        for (int k = 0; k < N * N; ++k)
            assert_true(fabsf(x[k] - x0[k] - 3) < 1e-4f && fabsf(y[k] - y0[k] - 1) < 1e-4f);
    }
    RfVec2 v;
    assert_false(rf_flow_velocity(&view, (RfVec2){100, 50}, 4, 4, 0, &v));
    assert_true(rf_flow_velocity(&view, (RfVec2){62, 50}, 4, 4, 0, &v));
    assert_true(v.x == 3 && v.y == 1);
}

static void a_flow_that_changes_linearly_in_time_is_integrated_exactly(void **state)
{
    (void)state;
    fill(g_velocity, 1, -0.5f);
    fill(g_next, -2, 1.5f);
    float x[N * N], y[N * N], x0[N * N], y0[N * N];
    bool inside[N * N];
    place_grid(40, 40, 4, x, y);
    memcpy(x0, x, sizeof x);
    memcpy(y0, y, sizeof y);
    RfFlowView view = view_at(12);
    view.next_velocity = g_next;
    view.velocity_time = 10;
    view.next_time = 14;
    rf_advect_grid(x, y, inside, N, &view, 10.5, SIDE, SIDE);
    // The mean blend from 10.5 to 12 is (0.125 + 0.5) / 2.
    float blend = 0.3125f, dx = 4 * 1.5f * (1 - 3 * blend), dy = 4 * 1.5f * (-0.5f + 2 * blend);
    for (int k = 0; k < N * N; ++k)
        assert_true(fabsf(x[k] - x0[k] - dx) < 1e-4f && fabsf(y[k] - y0[k] - dy) < 1e-4f);
}

// ---- push-pull

// The mean of the known ones among a block's quarters, each a block of half the side.
static bool block_value(const RfVec2 *values, const bool *known, int n, int level, int x, int y, double out[2])
{
    if (level == 0)
    {
        if (x >= n || y >= n || !known[y * n + x])
            return false;
        out[0] = (double)values[y * n + x].x;
        out[1] = (double)values[y * n + x].y;
        return true;
    }
    double sum[2] = {0, 0}, part[2];
    int count = 0;
    for (int k = 0; k < 4; ++k)
        if (block_value(values, known, n, level - 1, 2 * x + k % 2, 2 * y + k / 2, part))
        {
            sum[0] += part[0];
            sum[1] += part[1];
            ++count;
        }
    out[0] = count ? sum[0] / count : 0;
    out[1] = count ? sum[1] / count : 0;
    return count > 0;
}

static void push_pull_takes_the_smallest_known_block_round_a_node(void **state)
{
    (void)state;
    static RfVec2 values[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES],
        given[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    static bool known[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    for (int n = 1; n <= RF_MAX_GRID_VERTICES; ++n)
        for (int density = 1; density <= 4; ++density)
        {
            int count = 0;
            for (int k = 0; k < n * n; ++k)
            {
                known[k] = rf_random_float(1, (uint64_t)n, (uint64_t)k, (uint64_t)density) < powf(0.2f, (float)density);
                count += known[k];
                given[k] = known[k] ? (RfVec2){rf_random_float(2, 0, (uint64_t)k, 0), rf_random_float(2, 0, 0, k)}
                                    : (RfVec2){NAN, 1e30f};
            }
            memcpy(values, given, sizeof values);
            assert_int_equal(rf_push_pull(values, known, n), count);
            for (int k = 0; k < n * n; ++k)
            {
                double expected[2] = {0, 0};
                for (int level = 0; level < 7; ++level)
                    if (block_value(given, known, n, level, (k % n) >> level, (k / n) >> level, expected))
                        break;
                assert_true(fabs((double)values[k].x - expected[0]) < 1e-6);
                assert_true(fabs((double)values[k].y - expected[1]) < 1e-6);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_full_turn_in_a_rigid_rotation_comes_back_at_fourth_order),
        cmocka_unit_test(a_step_in_a_fast_flow_is_cut_so_that_it_stays_as_exact),
        cmocka_unit_test(far_and_nan_vertices_are_defined_and_do_not_disturb_the_others),
        cmocka_unit_test(vertices_on_land_and_beyond_the_domain_move_with_the_grid),
        cmocka_unit_test(a_flow_that_changes_linearly_in_time_is_integrated_exactly),
        cmocka_unit_test(push_pull_takes_the_smallest_known_block_round_a_node),
    };
    return cmocka_run_group_tests_name("advection", tests, NULL, NULL);
}
