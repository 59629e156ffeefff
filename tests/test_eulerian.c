// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 128,
    VALUES = 3 * N * N
};

static float g_before[VALUES], g_last[VALUES];

// Calm on the left, on the right a shear of 0.25 a frame, which turns squares to parallelograms along x.
static void half_sheared(int w, int h, double frame, float *velocity)
{
    (void)frame;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            velocity[2 * (y * w + x)] = x < w / 2 ? 0 : 0.25f * ((float)y + 0.5f - 0.5f * (float)h);
            velocity[2 * (y * w + x) + 1] = 0;
        }
}

static RfEulerianOptions options_of(int latency, int layers)
{
    RfEulerianOptions options = rf_eulerian_defaults();
    options.latency = latency;
    options.layers = layers;
    options.max_distortion = 1.5f;
    options.blend = RF_BLEND_PLAIN;
    return options;
}

// How much longer than high the texture's features are on the right.
static double elongation(const float *pixels)
{
    return scene_elongation(pixels, N, N / 2 + 12, 20, N - 12, N - 20);
}

static float largest_change_on_the_left(void)
{
    float largest = 0;
    for (int y = 0; y < N; ++y)
        for (int k = 0; k < 3 * (N / 2 - 24); ++k)
            largest = rf_max(fabsf(g_last[3 * N * y + k] - g_before[3 * N * y + k]), largest);
    return largest;
}

typedef struct Look
{
    /// Mean over the frames, and the largest difference of two consecutive ones.
    double elongation;
    float change;
} Look;

static Look look_at(RfEulerianOptions options)
{
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfEulerian *eulerian = NULL;
    assert_int_equal(rf_eulerian_create(exemplar, &options, &eulerian), RF_OK);
    SceneMoments moments = scene_moments(half_sheared, N, N);
    RfImageView target = {g_last, N, N, 3, 3 * N};
    Look look = {0};
    for (int frame = 0; frame < 80; ++frame)
    {
        memcpy(g_before, g_last, sizeof g_last);
        RfFlowView view = scene_step(&moments, frame);
        assert_int_equal(rf_eulerian_step(eulerian, &view, &target), RF_OK);
        if (frame >= 40)
            look.elongation += elongation(g_last) / 40;
        if (frame > 0)
            look.change = rf_max(largest_change_on_the_left(), look.change);
    }
    scene_moments_free(&moments);
    rf_eulerian_destroy(eulerian);
    rf_exemplar_destroy(exemplar);
    return look;
}

static void calm_water_has_the_longest_latency_and_sheared_water_the_shortest(void **state)
{
    (void)state;
    Look mixed = look_at(options_of(8, 3)), shortest = look_at(options_of(8, 1)), longest = look_at(options_of(32, 1));
    print_message("elongation and change: mixed %.2f %.3f, latency 8: %.2f %.3f, 32: %.2f %.3f\n", mixed.elongation,
                  (double)mixed.change, shortest.elongation, (double)shortest.change, longest.elongation,
                  (double)longest.change);
    assert_true(longest.elongation > 1.4 * shortest.elongation);
    assert_true(fabs(mixed.elongation / shortest.elongation - 1) < 0.1);
    assert_true(shortest.change > 2 * longest.change);
    assert_true(mixed.change < 1.3f * longest.change);
}

static void a_larger_limit_lets_a_longer_latency_show(void **state)
{
    (void)state;
    double last = 0;
    static const float limits[] = {1.2f, 2.2f, 3.2f, 10};
    for (int i = 0; i < 4; ++i)
    {
        RfEulerianOptions options = options_of(8, 3);
        options.max_distortion = limits[i];
        Look look = look_at(options);
        assert_true(look.elongation > last * (i == 1 || i == 2 ? 1.05 : 1));
        last = look.elongation;
    }
}

static void sets_start_afresh_unseen_whatever_the_latency_and_the_phases(void **state)
{
    (void)state;
    for (int phases = 2; phases <= 3; ++phases)
        for (int latency = 9; latency <= 14; latency += 5)
        {
            RfEulerianOptions options = options_of(latency, 1);
            options.phases = phases;
            Look look = look_at(options);
            // A share rises by about pi / latency at most, and all values are 0 to 1.
            assert_true(look.change < 1.2f * RF_PI / (float)latency);
            assert_true(look.change > 0.05f);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(calm_water_has_the_longest_latency_and_sheared_water_the_shortest),
        cmocka_unit_test(a_larger_limit_lets_a_longer_latency_show),
        cmocka_unit_test(sets_start_afresh_unseen_whatever_the_latency_and_the_phases),
    };
    return cmocka_run_group_tests_name("eulerian", tests, NULL, NULL);
}
