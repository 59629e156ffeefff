// SPDX-License-Identifier: Apache-2.0
// What holds for every method of texturing a flow, whatever it does inside.
#include "core/memory.h"
#include "data/flow_field.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"
#include "support/steppers.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 128,
    PIXELS = N * N,
    // The last frame of runs that are only compared with one another.
    LAST = TEST_SANITIZED ? 24 : 40
};

static const char *const g_names[] = {"lagrangian", "optimize", "directional", "eulerian", "dual", "sprites", "warp"};

enum
{
    METHODS = sizeof g_names / sizeof g_names[0]
};

static float g_last[3 * PIXELS], g_other[3 * PIXELS];

static RfImageView view_of(float *pixels, int channels)
{
    return (RfImageView){pixels, N, N, channels, N * channels};
}

static void *make(const Stepper *stepper, const RfExemplar *exemplar)
{
    StepperOptions options = stepper->defaults();
    void *method = NULL;
    // The default radius is made for larger frames.
    stepper_set(stepper, &options, "particle-radius", "20");
    assert_int_equal(stepper->create(exemplar, &options, &method), RF_OK);
    return method;
}

static void run(const Stepper *stepper, void *method, SceneFlow *flow, const uint8_t *mask, int from, int to,
                float *out)
{
    SceneMoments moments = scene_moments(flow, N, N);
    for (int frame = from; frame <= to; ++frame)
    {
        RfFlowView view = scene_step(&moments, frame);
        view.mask = mask;
        RfImageView target = view_of(out, 3);
        assert_int_equal(stepper->step(method, &view, &target), RF_OK);
    }
    scene_moments_free(&moments);
}

static RfExemplar *constant_exemplar(RfTiling tiling)
{
    static float pixels[90 * 80 * 3];
    for (int k = 0; k < 90 * 80; ++k)
        for (int c = 0; c < 3; ++c)
            pixels[3 * k + c] = 0.2f + 0.3f * (float)c;
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, 90, 80, 3, 270}, 1};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(&map, 1, tiling, &exemplar), RF_OK);
    return exemplar;
}

static bool is_constant(const float *pixel)
{
    for (int c = 0; c < 3; ++c)
        if (!(fabsf(pixel[c] - (0.2f + 0.3f * (float)c)) < 1e-4f))
            return false;
    return true;
}

static void a_constant_exemplar_gives_a_constant_frame_where_much_flows_in_and_out(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; ++m)
        for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
        {
            const Stepper *stepper = stepper_find(g_names[m]);
            RfExemplar *exemplar = constant_exemplar((RfTiling)tiling);
            void *method = make(stepper, exemplar);
            // 90 pixels come in.
            run(stepper, method, scene_translation, NULL, 0, 40, g_last);
            for (int k = 0; k < PIXELS; ++k)
                assert_true(is_constant(g_last + 3 * k));
            stepper->destroy(method);
            rf_exemplar_destroy(exemplar);
        }
}

// An island, a strait of two cells and a lake cut off from everything.
static void draw_mask(uint8_t *mask)
{
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
        {
            bool island = hypot(x - 50.0, y - 64.0)<20, wall = x> 96 && x < 102 && y != 40 && y != 41;
            bool lake = hypot(x - 50.0, y - 64.0) < 6;
            mask[y * N + x] = (!island && !wall) || lake;
        }
}

static void land_is_black_and_all_fluid_is_textured(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    draw_mask(mask);
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        RfExemplar *exemplar = constant_exemplar(RF_TILING_YES);
        void *method = make(stepper, exemplar);
        run(stepper, method, scene_two_vortices, mask, 0, 40, g_last);
        for (int k = 0; k < PIXELS; ++k)
        {
            const float *p = g_last + 3 * k;
            assert_true(mask[k] ? is_constant(p) : p[0] == 0 && p[1] == 0 && p[2] == 0);
        }
        stepper->destroy(method);
        rf_exemplar_destroy(exemplar);
    }
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

static void absurd_speeds_give_finite_pixels(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        RfExemplar *exemplar = constant_exemplar(RF_TILING_NO);
        void *method = make(stepper, exemplar);
        run(stepper, method, blowing_up, NULL, 0, 3, g_last);
        for (int k = 0; k < PIXELS; ++k)
            assert_true(is_constant(g_last + 3 * k));
        stepper->destroy(method);
        rf_exemplar_destroy(exemplar);
    }
}

static void directions_turn_with_the_texture(void **state)
{
    (void)state;
    static float vectors[6400 * 2], normals[6400 * 3], frame[5 * PIXELS];
    for (int k = 0; k < 6400; ++k)
    {
        vectors[2 * k] = 3;
        normals[3 * k] = 0.5f + 0.5f * 0.6f;
        normals[3 * k + 1] = 0.5f;
        normals[3 * k + 2] = 0.5f + 0.5f * 0.8f;
    }
    RfMapView maps[] = {{"motion", RF_MAP_VECTOR, {vectors, 80, 80, 2, 160}, 1},
                        {"normal", RF_MAP_NORMAL, {normals, 80, 80, 3, 240}, 1}};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(maps, 2, RF_TILING_YES, &exemplar), RF_OK);
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        if (strcmp(stepper->name, "directional") == 0)
            continue; // its texture lies as the flow does, not as it lay before
        void *method = make(stepper, exemplar);
        SceneMoments moments = scene_moments(scene_rotation, N, N);
        RfImageView target = view_of(frame, 5);
        // 15 degrees, clockwise, before anything that shows starts afresh: what pointed right points a little down.
        for (int step = 0; step <= 5; ++step)
        {
            RfFlowView view = scene_step(&moments, step);
            assert_int_equal(stepper->step(method, &view, &target), RF_OK);
        }
        const float *p = frame + 5 * (60 * N + 70), c = cosf(RF_PI / 12), s = sinf(RF_PI / 12);
        // Only the direction of a vector: lagrangian's contrast-preserving blend makes vectors that agree longer.
        float length = hypotf(p[0], p[1]);
        assert_true(fabsf(p[0] / length - c) < 0.01f && fabsf(p[1] / length - s) < 0.01f && length > 2.9f);
        assert_true(fabsf(p[2] - 0.5f - 0.3f * c) < 0.01f && fabsf(p[3] - 0.5f + 0.3f * s) < 0.01f &&
                    fabsf(p[4] - 0.9f) < 0.01f);
        scene_moments_free(&moments);
        stepper->destroy(method);
    }
    rf_exemplar_destroy(exemplar);
}

static void any_number_of_threads_gives_the_same_bytes(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int m = 0; m < METHODS; ++m)
        for (int threads = 1; threads <= 5; threads += 2)
        {
            const Stepper *stepper = stepper_find(g_names[m]);
            rf_set_threads(threads);
            void *method = make(stepper, exemplar);
            run(stepper, method, scene_two_vortices, NULL, 0, LAST - 10, threads == 1 ? g_other : g_last);
            stepper->destroy(method);
            if (threads > 1)
                assert_memory_equal(g_last, g_other, sizeof g_last);
        }
    rf_set_threads(0);
    rf_exemplar_destroy(exemplar);
}

static void passing_over_frames_changes_nothing(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        void *drawn = make(stepper, exemplar), *passed = make(stepper, exemplar);
        run(stepper, drawn, scene_two_vortices, NULL, 0, LAST - 10, g_other);
        SceneMoments moments = scene_moments(scene_two_vortices, N, N);
        for (int frame = 0; frame < LAST - 10; ++frame)
        {
            RfFlowView view = scene_step(&moments, frame);
            assert_int_equal(stepper->advance(passed, &view, N, N), RF_OK);
        }
        run(stepper, passed, scene_two_vortices, NULL, LAST - 10, LAST - 10, g_last);
        assert_memory_equal(g_last, g_other, sizeof g_last);
        scene_moments_free(&moments);
        stepper->destroy(drawn);
        stepper->destroy(passed);
    }
    rf_exemplar_destroy(exemplar);
}

// Damage anywhere, the wrong exemplar and other options are refused.
static void check_refusals(const Stepper *stepper, const RfExemplar *exemplar, uint8_t *block, size_t size)
{
    StepperOptions options = stepper->defaults();
    stepper_set(stepper, &options, "particle-radius", "20");
    RfExemplar *stranger = scene_noise_exemplar(64, 2);
    void *loaded = NULL;
    assert_int_equal(stepper->load(stranger, &options, block, size, &loaded), RF_BAD_INPUT);
    assert_null(loaded);
    for (size_t cut = 0; cut < size; cut += size / 3)
        assert_int_equal(stepper->load(exemplar, &options, block, cut, &loaded), RF_BAD_INPUT);
    for (size_t at = 0; at < size; at += at < 100 ? 17 : size / 3)
    {
        block[at] ^= 16;
        assert_int_equal(stepper->load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
        assert_null(loaded);
        block[at] ^= 16;
    }
    stepper_set(stepper, &options, "seed", "2");
    assert_int_equal(stepper->load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *other = stepper_find(g_names[m]);
        options = other->defaults();
        stepper_set(other, &options, "particle-radius", "20");
        if (other != stepper)
            assert_int_equal(other->load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
    }
    rf_exemplar_destroy(stranger);
}

static void a_loaded_state_goes_on_with_the_same_bytes_and_a_wrong_one_is_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int m = 0; m < METHODS; ++m)
        for (int saved = -1; saved <= 19; saved += 20)
        {
            // Before the first frame, and in the middle of everything.
            const Stepper *stepper = stepper_find(g_names[m]);
            void *method = make(stepper, exemplar), *loaded = NULL, *block = NULL;
            size_t size = 0;
            run(stepper, method, scene_two_vortices, NULL, 0, saved, g_last);
            assert_int_equal(stepper->save(method, &block, &size), RF_OK);
            run(stepper, method, scene_two_vortices, NULL, saved + 1, LAST, g_last);
            StepperOptions options = stepper->defaults();
            stepper_set(stepper, &options, "particle-radius", "20");
            assert_int_equal(stepper->load(exemplar, &options, block, size, &loaded), RF_OK);
            run(stepper, loaded, scene_two_vortices, NULL, saved + 1, LAST, g_other);
            assert_memory_equal(g_last, g_other, sizeof g_last);
            if (saved > 0)
                check_refusals(stepper, exemplar, block, size);
            stepper->destroy(loaded);
            stepper->destroy(method);
            rf_free(block);
        }
    rf_exemplar_destroy(exemplar);
}

static void what_cannot_be_followed_is_refused_and_leaves_the_frame(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        void *method = make(stepper, exemplar);
        run(stepper, method, scene_two_vortices, NULL, 4, 4, g_last);
        memcpy(g_other, g_last, sizeof g_last);
        SceneMoments moments = scene_moments(scene_two_vortices, N, N);
        RfImageView target = view_of(g_last, 3);
        RfFlowView view = scene_step(&moments, 5);
        moments.after[77] = NAN;
        assert_int_equal(stepper->step(method, &view, &target), RF_BAD_INPUT);
#ifndef RF_STOP_ON_MISUSE
        view = scene_step(&moments, 3);
        assert_int_equal(stepper->step(method, &view, &target), RF_INVALID_ARGUMENT);
        view = scene_step(&moments, 5);
        assert_int_equal(stepper->advance(method, &view, N, N - 1), RF_INVALID_ARGUMENT);
        target.channels = 2;
        assert_int_equal(stepper->step(method, &view, &target), RF_INVALID_ARGUMENT);
        StepperOptions zero = {0};
        void *none = NULL;
        assert_int_equal(stepper->create(exemplar, &zero, &none), RF_INVALID_ARGUMENT);
        assert_null(none);
#endif
        assert_memory_equal(g_last, g_other, sizeof g_last);
        scene_moments_free(&moments);
        stepper->destroy(method);
    }
    rf_exemplar_destroy(exemplar);
}

static void the_defaults_are_those_of_the_table(void **state)
{
    (void)state;
    for (int m = 0; m < METHODS; ++m)
    {
        const Stepper *stepper = stepper_find(g_names[m]);
        StepperOptions options = stepper->defaults();
        int count = 0;
        const RfOption *table = stepper->table(&count);
        assert_ptr_equal(table, stepper->table(NULL));
        for (int i = 0; i < count; ++i)
        {
            const uint8_t *field = (const uint8_t *)&options + table[i].offset;
            double value = 0;
            if (table[i].kind == RF_OPTION_FLOAT)
                value = (double)*(const float *)(const void *)field;
            else if (table[i].kind == RF_OPTION_UINT64)
                value = (double)*(const uint64_t *)(const void *)field;
            else if (table[i].kind == RF_OPTION_BOOL)
                value = *field;
            else
                value = *(const int *)(const void *)field;
            assert_true(fabs(value - table[i].default_value) < 1e-6);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_defaults_are_those_of_the_table),
        cmocka_unit_test(a_constant_exemplar_gives_a_constant_frame_where_much_flows_in_and_out),
        cmocka_unit_test(land_is_black_and_all_fluid_is_textured),
        cmocka_unit_test(absurd_speeds_give_finite_pixels),
        cmocka_unit_test(directions_turn_with_the_texture),
        cmocka_unit_test(any_number_of_threads_gives_the_same_bytes),
        cmocka_unit_test(passing_over_frames_changes_nothing),
        cmocka_unit_test(a_loaded_state_goes_on_with_the_same_bytes_and_a_wrong_one_is_refused),
        cmocka_unit_test(what_cannot_be_followed_is_refused_and_leaves_the_frame),
    };
    return cmocka_run_group_tests_name("steppers", tests, NULL, NULL);
}
