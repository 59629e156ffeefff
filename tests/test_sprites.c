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

static float g_first[VALUES], g_last[VALUES];

static RfImageView view_of(float *pixels)
{
    return (RfImageView){pixels, N, N, 3, N * 3};
}

static RfSprites *make(const RfExemplar *exemplar, bool turn)
{
    RfSpritesOptions options = rf_sprites_defaults();
    options.particle_radius = 16;
    options.turn = turn;
    RfSprites *sprites = NULL;
    assert_int_equal(rf_sprites_create(exemplar, &options, &sprites), RF_OK);
    return sprites;
}

// Steps through frames `from` to `to`; the first one made stays in g_first if from is 0.
static void run(RfSprites *sprites, SceneFlow *flow, int from, int to)
{
    SceneMoments moments = scene_moments(flow, N, N);
    for (int frame = from; frame <= to; ++frame)
    {
        RfFlowView view = scene_step(&moments, frame);
        RfImageView target = view_of(frame == 0 ? g_first : g_last);
        assert_int_equal(rf_sprites_step(sprites, &view, &target), RF_OK);
        assert_int_equal(rf_sprites_stats(sprites).holes, 0);
    }
    scene_moments_free(&moments);
}

// Rms difference inside a circle, over the standard deviation there, of the last frame and the first one, turned
// about the middle by half a turn if `turned`.
static double difference(bool turned, double radius)
{
    double sum = 0, squares = 0, mean = 0, n = 0;
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
            if (hypot(x + 0.5 - N / 2.0, y + 0.5 - N / 2.0) < radius)
            {
                int k = y * N + x;
                double p = (double)g_first[3 * (turned ? N * N - 1 - k : k)], q = (double)g_last[3 * k];
                sum += (p - q) * (p - q);
                squares += p * p;
                mean += p;
                n += 1;
            }
    return sqrt(sum / n) / sqrt(squares / n - mean / n * (mean / n));
}

static void in_a_rigid_rotation_sprites_turn_with_the_water_and_come_back(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfSprites *sprites = make(exemplar, true);
    run(sprites, scene_rotation, 0, 60);
    assert_true(difference(false, 34) > 0.5);
    assert_true(difference(true, 34) < 0.1);
    run(sprites, scene_rotation, 61, 120);
    assert_true(difference(false, 34) < 0.1);
    rf_sprites_destroy(sprites);
    rf_exemplar_destroy(exemplar);
}

static void without_turning_they_only_move(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfSprites *sprites = make(exemplar, false);
    run(sprites, scene_rotation, 0, 60);
    assert_true(difference(true, 34) > 0.5);
    run(sprites, scene_rotation, 61, 120);
    assert_true(difference(false, 34) < 0.1);
    rf_sprites_destroy(sprites);
    rf_exemplar_destroy(exemplar);
}

static void two_pixels_a_frame(int w, int h, double frame, float *velocity)
{
    (void)frame;
    scene_uniform(w, h, (RfVec2){2, -1}, velocity);
}

static void a_uniform_flow_shifts_the_frame(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfSprites *sprites = make(exemplar, true);
    run(sprites, two_pixels_a_frame, 0, 10);
    // Beyond two kernels from the sides where water comes in.
    for (int y = 0; y < N - 10 - 40; ++y)
        for (int x = 20 + 40; x < N; ++x)
            assert_true(fabsf(g_last[3 * (y * N + x)] - g_first[3 * ((y + 10) * N + x - 20)]) < 0.02f);
    rf_sprites_destroy(sprites);
    rf_exemplar_destroy(exemplar);
}

static void sheared(int w, int h, double frame, float *velocity)
{
    (void)frame;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            velocity[2 * (y * w + x)] = 0.06f * ((float)y + 0.5f - 0.5f * (float)h);
            velocity[2 * (y * w + x) + 1] = 0;
        }
}

static void a_shear_does_not_stretch_them(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfSprites *sprites = make(exemplar, true);
    run(sprites, sheared, 0, 50);
    // A texture that follows is sheared by 3: 3.3 times longer than wide.
    double elongation = scene_elongation(g_last, N, 2, 2, N - 2, N - 2);
    assert_true(elongation > 0.85 && elongation < 1.2);
    rf_sprites_destroy(sprites);
    rf_exemplar_destroy(exemplar);
}

static void an_unsteady_flow_leaves_no_hole(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfSprites *sprites = make(exemplar, true);
    run(sprites, scene_two_vortices, 0, 100);
    assert_true(rf_sprites_stats(sprites).live > 40);
    rf_sprites_destroy(sprites);
    rf_exemplar_destroy(exemplar);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(in_a_rigid_rotation_sprites_turn_with_the_water_and_come_back),
        cmocka_unit_test(without_turning_they_only_move),
        cmocka_unit_test(a_uniform_flow_shifts_the_frame),
        cmocka_unit_test(a_shear_does_not_stretch_them),
        cmocka_unit_test(an_unsteady_flow_leaves_no_hole),
    };
    return cmocka_run_group_tests_name("sprites", tests, NULL, NULL);
}
