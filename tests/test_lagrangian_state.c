// SPDX-License-Identifier: Apache-2.0
// Lagrangian texture advection as a stepper: threads, saved states, failures, options.
#include "methods/lagrangian/lagrangian.h"
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
    N = 96,
    PIXELS = N * N
};

static float g_frame[3 * PIXELS], g_other[3 * PIXELS];

static RfLagrangianOptions options_of(float radius)
{
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.particle_radius = radius;
    return options;
}

static RfLagrangian *make(const RfExemplar *exemplar, RfLagrangianOptions options)
{
    RfLagrangian *lagrangian = NULL;
    assert_int_equal(rf_lagrangian_create(exemplar, &options, &lagrangian), RF_OK);
    return lagrangian;
}

static void run(RfLagrangian *lagrangian, int first, int last, float *out)
{
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfImageView frame = {out, N, N, 3, 3 * N};
    for (int f = first; f <= last; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
    }
    scene_moments_free(&moments);
}

static void any_number_of_threads_gives_the_same_bytes(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    static const int threads[] = {1, 2, 3, 8};
    for (int blend = RF_BLEND_CONTRAST; blend <= RF_BLEND_HISTOGRAM; ++blend)
        for (int i = 0; i < 4; ++i)
        {
            RfLagrangianOptions options = options_of(10);
            options.blend = (RfBlend)blend;
            rf_set_threads(threads[i]);
            RfLagrangian *lagrangian = make(exemplar, options);
            run(lagrangian, 1, 25, i == 0 ? g_frame : g_other);
            if (i > 0)
                assert_memory_equal(g_frame, g_other, sizeof g_frame);
            rf_lagrangian_destroy(lagrangian);
        }
    rf_set_threads(0);
    rf_exemplar_destroy(exemplar);
}

static void another_seed_gives_another_picture(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangianOptions options = options_of(16);
    for (int i = 0; i < 2; ++i)
    {
        options.seed = 1 + (uint64_t)i;
        RfLagrangian *lagrangian = make(exemplar, options);
        run(lagrangian, 1, 1, i ? g_other : g_frame);
        rf_lagrangian_destroy(lagrangian);
    }
    assert_memory_not_equal(g_frame, g_other, sizeof g_frame);
    rf_exemplar_destroy(exemplar);
}

static void frames_passed_over_change_nothing(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangian *drawn = make(exemplar, options_of(16)), *passed = make(exemplar, options_of(16));
    run(drawn, 1, 30, g_frame);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    for (int f = 1; f < 30; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_advance(passed, &view, N, N), RF_OK);
    }
    run(passed, 30, 30, g_other);
    assert_memory_equal(g_frame, g_other, sizeof g_frame);
    scene_moments_free(&moments);
    rf_lagrangian_destroy(drawn);
    rf_lagrangian_destroy(passed);
    rf_exemplar_destroy(exemplar);
}

// ---- saved states

static void a_state_loaded_at_any_frame_goes_on_with_the_same_bytes(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangianOptions options = options_of(16);
    // Frame 0: before the first step.
    static const int frames[] = {0, 1, 2, 17, 40};
    for (int i = 0; i < 5; ++i)
    {
        RfLagrangian *lagrangian = make(exemplar, options), *loaded = NULL;
        void *block = NULL, *again = NULL;
        size_t size = 0, size_again = 0;
        run(lagrangian, 1, frames[i], g_frame);
        assert_int_equal(rf_lagrangian_save(lagrangian, &block, &size), RF_OK);
        run(lagrangian, frames[i] + 1, frames[i] + 12, g_frame);
        // The block may be moved.
        void *moved = malloc(size + 1);
        assert_non_null(moved);
        memcpy((uint8_t *)moved + 1, block, size);
        assert_int_equal(rf_lagrangian_load(exemplar, &options, (uint8_t *)moved + 1, size, &loaded), RF_OK);
        assert_int_equal(rf_lagrangian_save(loaded, &again, &size_again), RF_OK);
        assert_int_equal(size, size_again);
        assert_memory_equal(block, again, size);
        run(loaded, frames[i] + 1, frames[i] + 12, g_other);
        assert_memory_equal(g_frame, g_other, sizeof g_frame);
        rf_free(block);
        rf_free(again);
        free(moved);
        rf_lagrangian_destroy(loaded);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_exemplar_destroy(exemplar);
}

static void a_damaged_cut_or_foreign_state_is_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(16, 1), *stranger = scene_noise_exemplar(16, 2);
    RfLagrangianOptions options = options_of(16);
    RfLagrangian *lagrangian = make(exemplar, options), *loaded = NULL;
    void *block = NULL;
    size_t size = 0;
    run(lagrangian, 1, 6, g_frame);
    assert_int_equal(rf_lagrangian_save(lagrangian, &block, &size), RF_OK);
    rf_lagrangian_destroy(lagrangian);
    assert_true(size > 1000);
    // Every byte of the header, then some everywhere.
    for (size_t at = 0; at < size; at += at < 160 ? 1 : size / 61)
    {
        uint8_t *byte = (uint8_t *)block + at;
        *byte ^= (uint8_t)(1u << at % 8);
        assert_int_equal(rf_lagrangian_load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
        assert_null(loaded);
        *byte ^= (uint8_t)(1u << at % 8);
    }
    for (size_t cut = 0; cut < size; cut += cut < 160 ? 7 : size / 37)
        assert_int_equal(rf_lagrangian_load(exemplar, &options, block, cut, &loaded), RF_BAD_INPUT);
    assert_int_equal(rf_lagrangian_load(stranger, &options, block, size, &loaded), RF_BAD_INPUT);
    RfLagrangianOptions others = options;
    others.seed = 2;
    assert_int_equal(rf_lagrangian_load(exemplar, &others, block, size, &loaded), RF_BAD_INPUT);
    others = options;
    others.blend = RF_BLEND_PLAIN;
    assert_int_equal(rf_lagrangian_load(exemplar, &others, block, size, &loaded), RF_BAD_INPUT);
    assert_int_equal(rf_lagrangian_load(exemplar, &options, block, size, &loaded), RF_OK);
    rf_lagrangian_destroy(loaded);
    rf_free(block);
    rf_exemplar_destroy(stranger);
    rf_exemplar_destroy(exemplar);
}

// ---- failures

static void a_step_that_fails_leaves_the_frame_and_the_state(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangian *lagrangian = make(exemplar, options_of(16)), *other = make(exemplar, options_of(16));
    static float before[3 * PIXELS], layers[16];
    run(lagrangian, 1, 4, g_frame);
    memcpy(before, g_frame, sizeof before);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfImageView frame = {g_frame, N, N, 3, 3 * N};
    static const float broken[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 6; ++i)
    {
        RfFlowView view = scene_step(&moments, 5);
        (i < 3 ? moments.before : moments.after)[i == 0 ? 0 : i == 1 ? 2 * PIXELS - 1 : 77] = broken[i % 3];
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_BAD_INPUT);
        assert_non_null(strstr(rf_last_error()->place, "cell"));
    }
#ifndef RF_STOP_ON_MISUSE
    RfFlowView good = scene_step(&moments, 5);
    const struct
    {
        RfFlowView flow;
        RfImageView frame;
    } wrong[] = {{good, {g_frame, N, N, 2, 3 * N}},
                 {good, {g_frame, N, N, 4, 3 * N}},
                 {good, {g_frame, N - 1, N, 3, 3 * N}},
                 {good, {NULL, N, N, 3, 3 * N}},
                 {{.width = N, .height = N, .velocity = good.velocity, .time = 3}, frame},
                 {{.width = N, .height = N, .velocity = good.velocity, .time = (double)NAN}, frame},
                 {{.width = 0, .height = N, .velocity = good.velocity, .time = 5}, frame},
                 {{.width = N, .height = N, .velocity = NULL, .time = 5}, frame}};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; ++i)
        assert_int_equal(rf_lagrangian_step(lagrangian, &wrong[i].flow, &wrong[i].frame), RF_INVALID_ARGUMENT);
    RfImageView one = {layers, 1, 1, 16, 16};
    assert_int_equal(rf_lagrangian_layers(lagrangian, &one), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_lagrangian_layers(other, &one), RF_INVALID_ARGUMENT);
#endif
    (void)layers;
    assert_memory_equal(g_frame, before, sizeof before);
    run(lagrangian, 5, 8, g_frame);
    run(other, 1, 8, g_other);
    assert_memory_equal(g_frame, g_other, sizeof g_frame);
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_lagrangian_destroy(other);
    rf_exemplar_destroy(exemplar);
}

static void only_the_pixels_of_the_frame_are_written(void **state)
{
    (void)state;
    enum
    {
        W = 70,
        H = 65,
        STRIDE = 3 * W + 5
    };
    static float pixels[STRIDE * H + 8];
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangian *lagrangian = make(exemplar, options_of(16));
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    for (int k = 0; k < STRIDE * H + 8; ++k)
        pixels[k] = -7;
    RfImageView frame = {pixels, W, H, 3, STRIDE};
    for (int f = 1; f <= 2; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
    }
    for (int k = 0; k < STRIDE * H + 8; ++k)
        assert_int_equal(pixels[k] == -7, k % STRIDE >= 3 * W || k >= STRIDE * H);
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

static void blowing_up(int w, int h, double frame, float *velocity)
{
    (void)frame;
    for (int k = 0; k < w * h; ++k)
    {
        velocity[2 * k] = k % 7 == 0 ? 1e30f : -1e20f;
        velocity[2 * k + 1] = k % 5 == 0 ? -1e30f : 3;
    }
}

static void bursting(int w, int h, double frame, float *velocity)
{
    for (int k = 0; k < w * h; ++k)
    {
        velocity[2 * k] = (k % w < w / 2 ? -1 : 1) * (float)pow(10, 3 * frame);
        velocity[2 * k + 1] = k % 3 ? 0 : (float)pow(10, 2 * frame);
    }
}

static void absurd_speeds_give_pixels_of_the_exemplar(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    SceneFlow *const flows[] = {blowing_up, bursting};
    for (int i = 0; i < 2; ++i)
    {
        RfLagrangian *lagrangian = make(exemplar, options_of(16));
        SceneMoments moments = scene_moments(flows[i], N, N);
        RfImageView frame = {g_frame, N, N, 3, 3 * N};
        for (int f = 0; f <= 8; ++f)
        {
            RfFlowView view = scene_step(&moments, f);
            assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
            assert_int_equal(rf_lagrangian_stats(lagrangian).holes, 0);
            for (int k = 0; k < 3 * PIXELS; ++k)
                assert_true(g_frame[k] >= 0 && g_frame[k] <= 1);
        }
        scene_moments_free(&moments);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_exemplar_destroy(exemplar);
}

// ---- options

#ifndef RF_STOP_ON_MISUSE
static void assert_refused(const RfExemplar *exemplar, const RfLagrangianOptions *options, const char *word)
{
    RfLagrangian *lagrangian = (RfLagrangian *)1;
    assert_int_equal(rf_lagrangian_create(exemplar, options, &lagrangian), RF_INVALID_ARGUMENT);
    assert_null(lagrangian);
    if (!strstr(rf_last_error()->message, word))
        fail_msg("'%s' does not name %s", rf_last_error()->message, word);
}

static void options_out_of_range_are_refused_by_name(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    assert_int_equal(count, 11);
    for (int i = 0; i < count; ++i)
    {
        const float floats[] = {(float)table[i].minimum - 0.01f, (float)table[i].maximum * 1.01f, NAN, INFINITY,
                                -INFINITY};
        const int ints[] = {(int)table[i].minimum - 1, (int)fmin(table[i].maximum, 1e9) + 1, -2147483647};
        bool is_float = table[i].kind == RF_OPTION_FLOAT, is_int = table[i].kind != RF_OPTION_UINT64 && !is_float;
        for (int k = 0; k < (is_float ? 5 : is_int ? 3 : 0); ++k)
        {
            RfLagrangianOptions options = rf_lagrangian_defaults();
            memcpy((uint8_t *)&options + table[i].offset, is_float ? (const void *)&floats[k] : &ints[k], 4);
            assert_refused(exemplar, &options, table[i].name);
        }
    }
    RfLagrangianOptions options = options_of(1.5f);
    assert_refused(exemplar, &options, "particle-radius");
    rf_exemplar_destroy(exemplar);
}

static void options_that_did_not_start_from_the_defaults_are_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.struct_size = 0;
    assert_refused(exemplar, &options, "start from rf_lagrangian_defaults()");
    options = (RfLagrangianOptions){0};
    assert_refused(exemplar, &options, "start from rf_lagrangian_defaults()");
    rf_exemplar_destroy(exemplar);
}

static void a_radius_too_large_for_the_exemplar_is_refused_with_the_one_that_fits(void **state)
{
    (void)state;
    RfExemplar *tiling = scene_noise_exemplar(64, 1), *exemplar = NULL;
    RfMapView map = rf_exemplar_map(tiling, 0, NULL);
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_NO, &exemplar), RF_OK);
    RfLagrangianOptions options = options_of(16.5f);
    assert_refused(exemplar, &options, "particle-radius");
    // 64 / 3.9 = 16.41
    assert_non_null(strstr(rf_last_error()->message, "16.4 "));
    options.particle_radius = 16.4f;
    rf_lagrangian_destroy(make(exemplar, options));
    options.particle_radius = 100;
    rf_lagrangian_destroy(make(tiling, options));
    rf_exemplar_destroy(exemplar);
    rf_exemplar_destroy(tiling);
}
#endif

static void the_option_table_tells_the_defaults(void **state)
{
    (void)state;
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    RfLagrangianOptions options = rf_lagrangian_defaults();
    for (int i = 0; i < count; ++i)
    {
        const uint8_t *field = (const uint8_t *)&options + table[i].offset;
        double value = 0;
        if (table[i].kind == RF_OPTION_FLOAT)
            value = *(const float *)(const void *)field;
        else if (table[i].kind == RF_OPTION_UINT64)
            value = (double)*(const uint64_t *)(const void *)field;
        else
            value = *(const int *)(const void *)field;
        assert_true(fabs(value - table[i].default_value) < 1e-6 * fabs(value) + 1e-12);
    }
    RfLagrangianOptions paper = rf_lagrangian_paper();
    assert_true(paper.struct_size == sizeof paper && paper.max_distortion == 5 && paper.fade == 5 && paper.adapt == 0 &&
                paper.sharpness == 1 && paper.candidates == 1 && paper.grid_vertices == 8);
}

static void the_extremes_of_the_options_work(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    for (int i = 0; i < count; ++i)
        for (int end = 0; end < 2; ++end)
        {
            RfLagrangianOptions options = options_of(16);
            double value = end ? table[i].maximum : table[i].minimum;
            if (strcmp(table[i].name, "particle-radius") == 0 && !end)
                value = 2;
            // As many tries as there are places, which is what more come to.
            if (strcmp(table[i].name, "candidates") == 0 && end)
                options.particle_radius = 40;
            float f = (float)value;
            int n = (int)fmin(value, 2e9);
            uint8_t *field = (uint8_t *)&options + table[i].offset;
            if (table[i].kind == RF_OPTION_FLOAT)
                memcpy(field, &f, sizeof f);
            else if (table[i].kind == RF_OPTION_UINT64)
                memset(field, end ? 0xff : 0, sizeof(uint64_t));
            else
                memcpy(field, &n, sizeof n);
            RfLagrangian *lagrangian = make(exemplar, options);
            run(lagrangian, 1, 6, g_frame);
            assert_int_equal(rf_lagrangian_stats(lagrangian).holes, 0);
            for (int k = 0; k < 3 * PIXELS; ++k)
                assert_true(g_frame[k] >= 0 && g_frame[k] <= 1);
            rf_lagrangian_destroy(lagrangian);
        }
    rf_lagrangian_destroy(NULL);
    rf_exemplar_destroy(exemplar);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_number_of_threads_gives_the_same_bytes),
        cmocka_unit_test(another_seed_gives_another_picture),
        cmocka_unit_test(frames_passed_over_change_nothing),
        cmocka_unit_test(a_state_loaded_at_any_frame_goes_on_with_the_same_bytes),
        cmocka_unit_test(a_damaged_cut_or_foreign_state_is_refused),
        cmocka_unit_test(a_step_that_fails_leaves_the_frame_and_the_state),
        cmocka_unit_test(only_the_pixels_of_the_frame_are_written),
#ifndef RF_STOP_ON_MISUSE
        cmocka_unit_test(options_out_of_range_are_refused_by_name),
        cmocka_unit_test(options_that_did_not_start_from_the_defaults_are_refused),
        cmocka_unit_test(a_radius_too_large_for_the_exemplar_is_refused_with_the_one_that_fits),
#endif
        cmocka_unit_test(the_option_table_tells_the_defaults),
        cmocka_unit_test(the_extremes_of_the_options_work),
        cmocka_unit_test(absurd_speeds_give_pixels_of_the_exemplar),
    };
    return cmocka_run_group_tests_name("lagrangian state", tests, NULL, NULL);
}
