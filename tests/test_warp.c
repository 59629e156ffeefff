// SPDX-License-Identifier: Apache-2.0
#include "core/memory.h"
#include "data/flow_field.h"
#include "measure/judgement.h"
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
    PIXELS = N * N
};

static float g_first[3 * PIXELS], g_last[3 * PIXELS], g_other[3 * PIXELS];

static RfImageView view_of(float *pixels, int channels)
{
    return (RfImageView){pixels, N, N, channels, N * channels};
}

static RfWarp *make(const RfExemplar *exemplar)
{
    RfWarpOptions options = rf_warp_defaults();
    RfWarp *warp = NULL;
    assert_int_equal(rf_warp_create(exemplar, &options, &warp), RF_OK);
    return warp;
}

// Steps through frames first to last; the first and the last one are left in `first` and `out`.
static void run(RfWarp *warp, SceneFlow *flow, int from, int to, float *first, float *out)
{
    SceneMoments moments = scene_moments(flow, N, N);
    for (int frame = from; frame <= to; ++frame)
    {
        RfFlowView view = scene_step(&moments, frame);
        RfImageView target = view_of(frame == from && first ? first : out, 3);
        assert_int_equal(rf_warp_step(warp, &view, &target), RF_OK);
    }
    scene_moments_free(&moments);
}

// Rms difference of two frames inside a circle, over the standard deviation of the first there.
static double difference_inside(const float *a, const float *b, double radius)
{
    double sum = 0, squares = 0, mean = 0, n = 0;
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
            if (hypot(x + 0.5 - N / 2.0, y + 0.5 - N / 2.0) < radius)
            {
                double p = (double)a[3 * (y * N + x)], q = (double)b[3 * (y * N + x)];
                sum += (p - q) * (p - q);
                squares += p * p;
                mean += p;
                n += 1;
            }
    return sqrt(sum / n) / sqrt(squares / n - mean / n * (mean / n));
}

static void a_full_turn_in_a_rigid_rotation_comes_back(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfWarp *warp = make(exemplar);
    run(warp, scene_rotation, 0, 60, g_first, g_last);
    assert_true(difference_inside(g_first, g_last, N / 2 - 6) > 0.5);
    run(warp, scene_rotation, 61, 120, NULL, g_last);
    assert_true(difference_inside(g_first, g_last, N / 2 - 6) < 0.05);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void two_pixels_a_frame(int w, int h, double frame, float *velocity)
{
    (void)frame;
    scene_uniform(w, h, (RfVec2){2, -1}, velocity);
}

static void a_uniform_flow_of_whole_pixels_shifts_the_frame_and_what_flows_in_continues_the_exemplar(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfWarp *warp = make(exemplar);
    run(warp, two_pixels_a_frame, 0, 32, g_first, g_last);
    // 32 frames shift by 64, 32; the exemplar's period is 64, so columns match as they are, also those that came in.
    for (int y = 0; y < N - 32; ++y)
        for (int x = 0; x < 3 * N; ++x)
            assert_true(fabsf(g_last[y * 3 * N + x] - g_first[(y + 32) * 3 * N + x]) < 2e-4f);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static RfExemplar *constant_exemplar(RfTiling tiling)
{
    static float pixels[20 * 12 * 3];
    for (int k = 0; k < 20 * 12; ++k)
        for (int c = 0; c < 3; ++c)
            pixels[3 * k + c] = 0.2f + 0.3f * (float)c;
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, 20, 12, 3, 60}, 1};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(&map, 1, tiling, &exemplar), RF_OK);
    return exemplar;
}

static void a_constant_exemplar_gives_a_constant_frame(void **state)
{
    (void)state;
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
    {
        RfExemplar *exemplar = constant_exemplar((RfTiling)tiling);
        RfWarp *warp = make(exemplar);
        run(warp, scene_two_vortices, 0, 30, g_first, g_last);
        for (int k = 0; k < 3 * PIXELS; ++k)
            assert_true(fabsf(g_last[k] - (0.2f + 0.3f * (float)(k % 3))) < 1e-5f);
        rf_warp_destroy(warp);
        rf_exemplar_destroy(exemplar);
    }
}

static void the_texture_follows_an_unsteady_flow_and_keeps_its_contrast(void **state)
{
    (void)state;
    static float a[PIXELS], b[PIXELS], displacement[2 * PIXELS];
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfWarp *warp = make(exemplar);
    run(warp, scene_two_vortices, 0, 20, g_first, g_other);
    run(warp, scene_two_vortices, 21, 21, NULL, g_last);
    RfImageView before = view_of(g_other, 3), after = view_of(g_last, 3);
    rf_measure_grey(&before, a);
    rf_measure_grey(&after, b);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfFlowView view = scene_step(&moments, 21);
    rf_measure_displacement(&view, 20, N, N, displacement);
    RfFramePair pair = {N, N, a, b, NULL, NULL};
    RfMeasureFlow error;
    RfMeasureFlicker flicker;
    RfMeasureContrast contrast;
    assert_int_equal(rf_measure_flow_error(RF_MEASURE_LUCAS_KANADE, &pair, displacement, NULL, NULL, NULL, &error),
                     RF_OK);
    assert_int_equal(rf_measure_flicker(&pair, displacement, NULL, NULL, &flicker), RF_OK);
    RfImageView map = rf_exemplar_map(exemplar, 0, NULL).image;
    rf_measure_contrast(&after, NULL, &map, &contrast);
    print_message("flow error %.4f px (floor %.4f), flicker %.3f (floor %.3f), contrast %.3f\n", error.error,
                  error.floor, flicker.whole, flicker.floor, contrast.luma);
    assert_true(error.error < 0.05 && error.ratio < 1.5);
    assert_true(flicker.whole < 0.1);
    assert_true(contrast.luma > 0.9 && contrast.luma < 1.05);
    scene_moments_free(&moments);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void land_is_black_and_the_fluid_beside_it_is_not(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    for (int k = 0; k < PIXELS; ++k)
        mask[k] = hypot(k % N - 64.0, (double)(k / N) - 64.0) > 20;
    RfExemplar *exemplar = constant_exemplar(RF_TILING_YES);
    RfWarp *warp = make(exemplar);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    for (int frame = 0; frame <= 10; ++frame)
    {
        RfFlowView view = scene_step(&moments, frame);
        view.mask = mask;
        RfImageView target = view_of(g_last, 3);
        assert_int_equal(rf_warp_step(warp, &view, &target), RF_OK);
    }
    for (int k = 0; k < PIXELS; ++k)
        assert_true(mask[k] ? fabsf(g_last[3 * k] - 0.2f) < 1e-5f : g_last[3 * k] == 0);
    scene_moments_free(&moments);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void directions_turn_with_the_texture(void **state)
{
    (void)state;
    static float vectors[64 * 2], normals[64 * 3], frame[5 * PIXELS];
    for (int k = 0; k < 64; ++k)
    {
        vectors[2 * k] = 3;
        normals[3 * k] = 0.5f + 0.5f * 0.6f;
        normals[3 * k + 1] = 0.5f;
        normals[3 * k + 2] = 0.5f + 0.5f * 0.8f;
    }
    RfMapView maps[] = {{"motion", RF_MAP_VECTOR, {vectors, 8, 8, 2, 16}, 1},
                        {"normal", RF_MAP_NORMAL, {normals, 8, 8, 3, 24}, 1}};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(maps, 2, RF_TILING_YES, &exemplar), RF_OK);
    RfWarp *warp = make(exemplar);
    SceneMoments moments = scene_moments(scene_rotation, N, N);
    RfImageView target = view_of(frame, 5);
    // A quarter of a turn, clockwise: what pointed right points down.
    for (int step = 0; step <= 30; ++step)
    {
        RfFlowView view = scene_step(&moments, step);
        assert_int_equal(rf_warp_step(warp, &view, &target), RF_OK);
    }
    const float *p = frame + 5 * (50 * N + 70);
    assert_true(fabsf(p[0]) < 0.02f && fabsf(p[1] - 3) < 0.02f);
    assert_true(fabsf(p[2] - 0.5f) < 0.01f && fabsf(p[3] - 0.2f) < 0.01f && fabsf(p[4] - 0.9f) < 0.01f);
    scene_moments_free(&moments);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void a_loaded_state_goes_on_with_the_same_bytes_and_a_wrong_one_is_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1), *stranger = scene_noise_exemplar(64, 2);
    RfWarp *warp = make(exemplar), *loaded = NULL;
    RfWarpOptions options = rf_warp_defaults();
    void *block = NULL;
    size_t size = 0;
    run(warp, scene_two_vortices, 0, 7, g_first, g_last);
    assert_int_equal(rf_warp_save(warp, &block, &size), RF_OK);
    run(warp, scene_two_vortices, 8, 14, NULL, g_last);
    assert_int_equal(rf_warp_load(exemplar, &options, block, size, &loaded), RF_OK);
    run(loaded, scene_two_vortices, 8, 14, NULL, g_other);
    assert_memory_equal(g_last, g_other, sizeof g_last);
    rf_warp_destroy(loaded);
    rf_warp_destroy(warp);

    assert_int_equal(rf_warp_load(stranger, &options, block, size, &loaded), RF_BAD_INPUT);
    for (size_t cut = 0; cut < size; cut += 7919)
        assert_int_equal(rf_warp_load(exemplar, &options, block, cut, &loaded), RF_BAD_INPUT);
    for (size_t at = 0; at < size; at += at < 64 ? 1 : 4999)
    {
        ((uint8_t *)block)[at] ^= 16;
        assert_int_equal(rf_warp_load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
        assert_null(loaded);
        ((uint8_t *)block)[at] ^= 16;
    }
    options.seed = 2;
    assert_int_equal(rf_warp_load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
    rf_free(block);
    rf_exemplar_destroy(stranger);
    rf_exemplar_destroy(exemplar);
}

static void a_state_saved_before_the_first_frame_loads(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfWarp *warp = make(exemplar), *loaded = NULL;
    RfWarpOptions options = rf_warp_defaults();
    void *block = NULL;
    size_t size = 0;
    assert_int_equal(rf_warp_save(warp, &block, &size), RF_OK);
    assert_int_equal(rf_warp_load(exemplar, &options, block, size, &loaded), RF_OK);
    run(warp, scene_two_vortices, 3, 5, g_first, g_last);
    run(loaded, scene_two_vortices, 3, 5, g_first, g_other);
    assert_memory_equal(g_last, g_other, sizeof g_last);
    rf_free(block);
    rf_warp_destroy(loaded);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void what_cannot_be_followed_is_refused_and_leaves_the_frame(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfWarp *warp = make(exemplar);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfFlowView view = scene_step(&moments, 4);
    RfImageView target = view_of(g_last, 3);
    assert_int_equal(rf_warp_step(warp, &view, &target), RF_OK);
    memcpy(g_other, g_last, sizeof g_last);
    view = scene_step(&moments, 5);
    moments.after[77] = NAN;
    assert_int_equal(rf_warp_step(warp, &view, &target), RF_BAD_INPUT);
#ifndef RF_STOP_ON_MISUSE
    view = scene_step(&moments, 3);
    assert_int_equal(rf_warp_step(warp, &view, &target), RF_INVALID_ARGUMENT);
    view = scene_step(&moments, 5);
    target.channels = 2;
    assert_int_equal(rf_warp_step(warp, &view, &target), RF_INVALID_ARGUMENT);
    RfWarpOptions zero = {0};
    RfWarp *none = NULL;
    assert_int_equal(rf_warp_create(exemplar, &zero, &none), RF_INVALID_ARGUMENT);
#endif
    assert_memory_equal(g_last, g_other, sizeof g_last);
    scene_moments_free(&moments);
    rf_warp_destroy(warp);
    rf_exemplar_destroy(exemplar);
}

static void the_table_of_options_needs_no_count(void **state)
{
    (void)state;
    int count = 0;
    assert_ptr_equal(rf_warp_option_table(NULL), rf_warp_option_table(&count));
    assert_int_equal(count, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_table_of_options_needs_no_count),
        cmocka_unit_test(a_full_turn_in_a_rigid_rotation_comes_back),
        cmocka_unit_test(a_uniform_flow_of_whole_pixels_shifts_the_frame_and_what_flows_in_continues_the_exemplar),
        cmocka_unit_test(a_constant_exemplar_gives_a_constant_frame),
        cmocka_unit_test(the_texture_follows_an_unsteady_flow_and_keeps_its_contrast),
        cmocka_unit_test(land_is_black_and_the_fluid_beside_it_is_not),
        cmocka_unit_test(directions_turn_with_the_texture),
        cmocka_unit_test(a_loaded_state_goes_on_with_the_same_bytes_and_a_wrong_one_is_refused),
        cmocka_unit_test(a_state_saved_before_the_first_frame_loads),
        cmocka_unit_test(what_cannot_be_followed_is_refused_and_leaves_the_frame),
    };
    return cmocka_run_group_tests_name("warp", tests, NULL, NULL);
}
