// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/memory.h"
#include "core/random.h"
#include "data/exemplar.h"
#include "kernels/cubic_spline.h"
#include "measure/judgement.h"
#include "measure/spectrum.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 192,
    PIXELS = N * N
};

static float g_texture[PIXELS], g_other[PIXELS], g_displacement[2 * PIXELS], g_backward[2 * PIXELS], g_frame[PIXELS];

static void draw_texture(float *grey, float low, float high, uint64_t seed)
{
    scene_noise(N, N, low, high, seed, grey);
    for (int k = 0; k < PIXELS; ++k)
        grey[k] *= 255;
}

static void invert(void)
{
    assert_int_equal(rf_measure_invert(g_displacement, N, N, g_backward), RF_OK);
}

static void warp_texture(void)
{
    assert_int_equal(rf_measure_warp(g_texture, g_backward, N, N, g_frame), RF_OK);
}

static void displace_by(SceneFlow *flow)
{
    SceneMoments moments = scene_moments(flow, N, N);
    RfFlowView view = scene_step(&moments, 5);
    rf_measure_displacement(&view, view.time - 1, N, N, g_displacement);
    invert();
    scene_moments_free(&moments);
}

static RfMeasureFlow judge_with(RfMeasureEstimator estimator, const float *a, const float *b, const uint8_t *mask,
                                bool exemplar)
{
    RfFramePair pair = {N, N, a, b, mask, mask};
    RfGrey texture = {g_texture, N, N};
    RfMeasureFlow result;
    assert_int_equal(
        rf_measure_flow_error(estimator, &pair, g_displacement, exemplar ? &texture : NULL, NULL, NULL, &result),
        RF_OK);
    return result;
}

static RfMeasureFlow judge(const float *a, const float *b)
{
    return judge_with(RF_MEASURE_LUCAS_KANADE, a, b, NULL, true);
}

static RfMeasureSpectrum spectrum(const float *frame, const float *exemplar, int *crop)
{
    RfGrey f = {frame, N, N}, e = {exemplar, N, N};
    RfSpectrometer *spectrometer = NULL;
    RfRadialSpectrum radial;
    RfMeasureSpectrum result;
    assert_int_equal(rf_spectrometer_create(&e, &f, NULL, 0, 1, 7, &spectrometer), RF_OK);
    assert_int_equal(rf_spectrometer_measure(spectrometer, &f, NULL, &radial, &result), RF_OK);
    if (crop)
        *crop = rf_spectrometer_crop(spectrometer);
    rf_spectrometer_destroy(spectrometer);
    return result;
}

static RfMeasureFlicker flicker(const float *a, const float *b)
{
    RfFramePair pair = {N, N, a, b, NULL, NULL};
    RfMeasureFlicker result;
    assert_int_equal(rf_measure_flicker(&pair, g_displacement, NULL, NULL, &result), RF_OK);
    return result;
}

static RfMeasureContrast contrast(const RfImageView *frame, const RfImageView *exemplar)
{
    RfMeasureContrast result;
    rf_measure_contrast(frame, NULL, exemplar, &result);
    return result;
}

static void the_scene_is_unsteady_incompressible_and_no_faster_than_three_cells(void **state)
{
    (void)state;
    float *v = g_displacement, fastest = 0, divergence = 0, change = 0;
    for (int frame = 0; frame < 120; frame += 10)
    {
        memcpy(g_backward, v, sizeof g_backward);
        scene_two_vortices(N, N, frame, v);
        for (int y = 1; y < N - 1; ++y)
            for (int x = 1; x < N - 1; ++x)
            {
                const float *p = v + 2 * (y * N + x);
                fastest = fmaxf(fastest, hypotf(p[0], p[1]));
                divergence = fmaxf(divergence, fabsf(p[2] - p[-2] + p[2 * N + 1] - p[-2 * N + 1]) / 2);
                change = frame > 0 ? fmaxf(change, fabsf(p[0] - g_backward[2 * (y * N + x)])) : 0;
            }
    }
    assert_true(fastest > 2 && fastest <= 3);
    assert_true(divergence < 0.003f);
    assert_true(change > 0.3f);
}

static void a_displacement_in_solid_rotation_is_the_rotation(void **state)
{
    (void)state;
    displace_by(scene_rotation);
    double angle = 2 * 3.14159265358979 / 120, c = cos(angle), s = sin(angle);
    // Inside the circle that never leaves the domain, where velocities are not the border's.
    for (int y = 30; y < N - 30; y += 7)
        for (int x = 30; x < N - 30; x += 7)
        {
            double dx = x + 0.5 - N / 2.0, dy = y + 0.5 - N / 2.0;
            const float *d = g_displacement + 2 * (y * N + x), *b = g_backward + 2 * (y * N + x);
            assert_true(hypot((double)d[0] - (c * dx - s * dy - dx), (double)d[1] - (s * dx + c * dy - dy)) < 1e-4);
            assert_true(hypot((double)b[0] - (c * dx + s * dy - dx), (double)b[1] - (-s * dx + c * dy - dy)) < 1e-4);
        }
}

static void splines_go_through_their_samples_and_follow_a_sine(void **state)
{
    (void)state;
    float samples[3 * 40], line[40], value;
    for (int i = 0; i < 120; ++i)
        samples[i] = rf_random_float(1, 0, (uint64_t)i, 0);
    float coefficients[120];
    memcpy(coefficients, samples, sizeof samples);
    rf_spline_prefilter(coefficients, 10, 4, 3);
    for (int y = 0; y < 4; ++y)
        for (int x = 0; x < 10; ++x)
        {
            float values[3];
            rf_spline_sample(coefficients, 10, 4, 3, 3, (float)x, (float)y, values);
            for (int c = 0; c < 3; ++c)
                assert_true(fabsf(values[c] - samples[(y * 10 + x) * 3 + c]) < 1e-5f);
        }
    for (int i = 0; i < 40; ++i)
        line[i] = sinf(0.6f * (float)i);
    rf_spline_prefilter(line, 40, 1, 1);
    for (float x = 8; x < 32; x += 0.37f)
    {
        rf_spline_sample(line, 40, 1, 1, 1, x, 0, &value);
        assert_true(fabsf(value - sinf(0.6f * x)) < 1e-3f);
    }
    float one = 7;
    rf_spline_prefilter(&one, 1, 1, 1);
    rf_spline_sample(&one, 1, 1, 1, 1, 0.3f, -5, &value);
    assert_true(fabsf(value - 7) < 1e-5f);
}

static void check_floor(SceneFlow *flow, float low, float high, double allowed)
{
    draw_texture(g_texture, low, high, 3);
    displace_by(flow);
    warp_texture();
    RfMeasureFlow e = judge(g_texture, g_frame);
    print_message("flow floor at %.3f to %.3f cycles a pixel: %.4f px\n", (double)low, (double)high, e.floor);
    assert_true(e.pixels > PIXELS / 2);
    assert_true(e.floor < allowed);
    assert_true(fabs(e.ratio - 1) < 1e-9 && fabs(e.exemplar_ratio - 1) < 1e-9);
}

static void the_flow_of_a_warped_texture_is_found_to_a_small_fraction_of_a_pixel(void **state)
{
    (void)state;
    check_floor(scene_translation, 0.01f, 0.15f, 0.02);
    check_floor(scene_rotation, 0.01f, 0.15f, 0.08);
    check_floor(scene_two_vortices, 0.01f, 0.15f, 0.08);
    check_floor(scene_two_vortices, 0.03f, 0.25f, 0.08);
}

static void motions_of_eight_pixels_are_found(void **state)
{
    (void)state;
    draw_texture(g_texture, 0.01f, 0.15f, 3);
    for (int k = 0; k < PIXELS; ++k)
    {
        g_displacement[2 * k] = 7.3f;
        g_displacement[2 * k + 1] = -3.6f;
    }
    invert();
    warp_texture();
    assert_true(judge(g_texture, g_frame).error < 0.05);
}

// A 256 x 256 picture of the exemplar, mirrored where it is smaller, and the same carried by vortices of 8 pixels a
// frame.
static double floor_at_8_pixels(const char *name, RfMeasureEstimator estimator)
{
    enum
    {
        SIDE = 256,
        COUNT = SIDE * SIDE
    };
    static float filled[COUNT], carried[COUNT], velocity[2 * COUNT], displacement[2 * COUNT], backward[2 * COUNT];
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(name, &image), RF_OK);
    RfImageView picture = rf_image_view(image);
    float *grey = malloc((size_t)picture.width * (size_t)picture.height * sizeof(float));
    rf_measure_grey(&picture, grey);
    for (int k = 0; k < COUNT; ++k)
        filled[k] =
            grey[rf_mirror_int(k / SIDE, picture.height) * picture.width + rf_mirror_int(k % SIDE, picture.width)];
    scene_two_vortices(SIDE, SIDE, 5, velocity);
    float fastest = 0;
    for (int k = 0; k < COUNT; ++k)
        fastest = fmaxf(fastest, hypotf(velocity[2 * k], velocity[2 * k + 1]));
    for (int k = 0; k < 2 * COUNT; ++k)
        velocity[k] *= 8 / fastest;
    RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity, .time = 1};
    rf_measure_displacement(&flow, 0, SIDE, SIDE, displacement);
    assert_int_equal(rf_measure_invert(displacement, SIDE, SIDE, backward), RF_OK);
    assert_int_equal(rf_measure_warp(filled, backward, SIDE, SIDE, carried), RF_OK);
    RfFramePair pair = {SIDE, SIDE, filled, carried, NULL, NULL};
    RfMeasureFlow result;
    assert_int_equal(rf_measure_flow_error(estimator, &pair, displacement, NULL, NULL, NULL, &result), RF_OK);
    free(grey);
    rf_image_destroy(image);
    return result.error;
}

static void at_8_pixels_a_frame_textures_are_followed_to_less_than_a_seventh_of_a_pixel(void **state)
{
    (void)state;
    static const char *const names[] = {"builtin:foam", "builtin:noise", "builtin:lava", "builtin:pebbles",
                                        "builtin:bubbles"};
    for (size_t i = 0; i < sizeof names / sizeof *names; ++i)
    {
        double dis = floor_at_8_pixels(names[i], RF_MEASURE_INVERSE_SEARCH);
        double fine = floor_at_8_pixels(names[i], RF_MEASURE_LUCAS_KANADE);
        print_message("%-16s 8 px: inverse search %.3f px, Lucas and Kanade %.3f px\n", names[i], dis, fine);
        assert_true(dis < 0.14 && fine < 0.14);
    }
}

static void a_frozen_texture_and_another_texture_fail_the_flow_error(void **state)
{
    (void)state;
    draw_texture(g_texture, 0.01f, 0.15f, 3);
    draw_texture(g_other, 0.01f, 0.15f, 4);
    displace_by(scene_two_vortices);
    RfMeasureFlow frozen = judge(g_texture, g_texture), unrelated = judge(g_texture, g_other);
    assert_true(frozen.error > 0.5 && frozen.ratio > 10);
    assert_true(unrelated.error > 1 && unrelated.ratio > 20);
}

static void land_does_not_count(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    draw_texture(g_texture, 0.01f, 0.15f, 3);
    displace_by(scene_two_vortices);
    warp_texture();
    // The left half is land where nothing moves.
    for (int k = 0; k < PIXELS; ++k)
    {
        mask[k] = k % N >= N / 2;
        if (k % N < N / 2 - 4)
            g_frame[k] = g_texture[k];
    }
    RfMeasureFlow all = judge(g_texture, g_frame);
    RfMeasureFlow fluid = judge_with(RF_MEASURE_LUCAS_KANADE, g_texture, g_frame, mask, false);
    assert_true(fluid.pixels < all.pixels / 2 + N);
    assert_true(fluid.error < 0.1 && all.error > 0.3);
}

static void a_spectrum_is_at_no_distance_from_itself_and_far_from_white_noise(void **state)
{
    (void)state;
    draw_texture(g_texture, 0.01f, 0.15f, 3);
    int crop;
    RfMeasureSpectrum same = spectrum(g_texture, g_texture, &crop);
    assert_true(same.distance < 1e-9 && same.floor > 0.3 && same.floor < 4 && crop == N / 2);
    draw_texture(g_other, 0.01f, 0.15f, 8);
    RfMeasureSpectrum alike = spectrum(g_other, g_texture, NULL);
    assert_true(alike.ratio < 1 && alike.pair_ratio > 0.8 && alike.pair_ratio < 1.25);
    for (int k = 0; k < PIXELS; ++k)
        g_other[k] = 255 * rf_random_float(9, 0, (uint64_t)k, 0);
    RfMeasureSpectrum white = spectrum(g_other, g_texture, NULL);
    assert_true(white.ratio > 5 && white.pair_ratio > 5);
}

static void half_the_amplitude_is_six_decibels_and_half_the_contrast(void **state)
{
    (void)state;
    draw_texture(g_texture, 0.01f, 0.5f, 3);
    for (int k = 0; k < PIXELS; ++k)
        g_other[k] = 100 + 0.5f * (g_texture[k] - 127.5f);
    RfMeasureSpectrum s = spectrum(g_other, g_texture, NULL);
    assert_true(fabs(s.distance - 6.02) < 0.1);
    for (int k = 0; k < PIXELS; ++k)
    {
        g_frame[k] = g_other[k] / 255;
        g_backward[k] = g_texture[k] / 255;
    }
    RfImageView frame = {g_frame, N, N, 1, N}, exemplar = {g_backward, N, N, 1, N};
    RfMeasureContrast c = contrast(&frame, &exemplar);
    assert_true(fabs(c.luma - 0.5) < 0.01 && fabs(c.channel[0] - 0.5) < 0.01 && isnan(c.channel[1]));
    assert_true(fabs(c.brightness + 27.5) < 1 && c.histogram_l1 > 0.4);
    RfMeasureContrast same = contrast(&exemplar, &exemplar);
    assert_true(same.luma == 1 && same.histogram_l1 == 0 && same.histogram_mover == 0);
}

static void the_earth_movers_distance_of_a_shift_is_the_shift(void **state)
{
    (void)state;
    float a[12], b[12];
    for (int i = 0; i < 12; ++i)
    {
        a[i] = (float)(10 * (i / 3)) / 255;
        b[i] = a[i] + 17.0f / 255;
    }
    RfImageView frame = {b, 2, 2, 3, 6}, exemplar = {a, 2, 2, 3, 6};
    RfMeasureContrast c = contrast(&frame, &exemplar);
    assert_true(fabs(c.histogram_mover - 17) < 1e-3 && fabs(c.luma - 1) < 1e-3);
}

static void a_carried_frame_does_not_flicker_and_a_changed_block_pops_where_it_is(void **state)
{
    (void)state;
    draw_texture(g_texture, 0.01f, 0.15f, 3);
    displace_by(scene_two_vortices);
    warp_texture();
    RfMeasureFlicker still = flicker(g_texture, g_frame);
    assert_true(still.whole < 1e-4 && still.block < 1e-3);
    assert_true(still.floor > 0 && still.floor < 0.05);
    draw_texture(g_other, 0.01f, 0.15f, 4);
    for (int y = 64; y < 96; ++y)
        memcpy(g_frame + y * N + 112, g_other + y * N + 112, 32 * sizeof(float));
    RfMeasureFlicker pop = flicker(g_texture, g_frame);
    assert_true(pop.block_x == 112 && pop.block_y == 64);
    assert_true(pop.block > 0.8 && pop.whole < 0.4 && pop.whole > 0.1);
    RfMeasureFlicker frozen = flicker(g_texture, g_texture);
    assert_true(frozen.whole > 0.3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_scene_is_unsteady_incompressible_and_no_faster_than_three_cells),
        cmocka_unit_test(a_displacement_in_solid_rotation_is_the_rotation),
        cmocka_unit_test(splines_go_through_their_samples_and_follow_a_sine),
        cmocka_unit_test(the_flow_of_a_warped_texture_is_found_to_a_small_fraction_of_a_pixel),
        cmocka_unit_test(motions_of_eight_pixels_are_found),
        cmocka_unit_test(at_8_pixels_a_frame_textures_are_followed_to_less_than_a_seventh_of_a_pixel),
        cmocka_unit_test(a_frozen_texture_and_another_texture_fail_the_flow_error),
        cmocka_unit_test(land_does_not_count),
        cmocka_unit_test(a_spectrum_is_at_no_distance_from_itself_and_far_from_white_noise),
        cmocka_unit_test(half_the_amplitude_is_six_decibels_and_half_the_contrast),
        cmocka_unit_test(the_earth_movers_distance_of_a_shift_is_the_shift),
        cmocka_unit_test(a_carried_frame_does_not_flicker_and_a_changed_block_pops_where_it_is),
    };
    return cmocka_run_group_tests_name("measures", tests, NULL, NULL);
}
