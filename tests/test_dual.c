// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
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
    VALUES = 3 * N * N
};

static float g_first[VALUES], g_before[VALUES], g_last[VALUES];

static RfImageView view_of(float *pixels)
{
    return (RfImageView){pixels, N, N, 3, N * 3};
}

static void calm(int w, int h, double frame, float *velocity)
{
    (void)frame;
    scene_uniform(w, h, (RfVec2){0, 0}, velocity);
}

static RfDual *make(const RfExemplar *exemplar, RfDualOptions options)
{
    RfDual *dual = NULL;
    assert_int_equal(rf_dual_create(exemplar, &options, &dual), RF_OK);
    return dual;
}

static void step(RfDual *dual, SceneFlow *flow, int frame, float *out)
{
    SceneMoments moments = scene_moments(flow, N, N);
    RfFlowView view = scene_step(&moments, frame);
    RfImageView target = view_of(out);
    assert_int_equal(rf_dual_step(dual, &view, &target), RF_OK);
    scene_moments_free(&moments);
}

static float largest_difference(const float *a, const float *b)
{
    float largest = 0;
    for (int k = 0; k < VALUES; ++k)
        largest = rf_max(fabsf(a[k] - b[k]), largest);
    return largest;
}

static void a_layer_starts_afresh_unseen_whatever_the_period(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int period = 2; period <= 11; period += 3)
    {
        RfDualOptions options = rf_dual_defaults();
        options.reset_every = period;
        options.blend = RF_BLEND_PLAIN;
        RfDual *dual = make(exemplar, options);
        step(dual, calm, 0, g_first);
        memcpy(g_before, g_first, sizeof g_first);
        float renewed = 0, steepest = 2.0f / (float)period;
        for (int frame = 1; frame <= 3 * period; ++frame)
        {
            step(dual, calm, frame, g_last);
            // Values are 0 to 1, weights move by 2 / period. Where the two do not add to 1 (an odd period) the sum's
            // change comes on top.
            if (period > 3)
                assert_true(largest_difference(g_before, g_last) < steepest * (period % 2 ? 1.3f : 1.0f));
            renewed = rf_max(largest_difference(g_first, g_last), renewed);
            memcpy(g_before, g_last, sizeof g_last);
        }
        assert_true(renewed > 0.3f);
        rf_dual_destroy(dual);
    }
    rf_exemplar_destroy(exemplar);
}

static double contrast_of(float *pixels, const RfExemplar *exemplar)
{
    RfImageView frame = view_of(pixels), map = rf_exemplar_map(exemplar, 0, NULL).image;
    RfMeasureContrast contrast;
    rf_measure_contrast(&frame, NULL, &map, &contrast);
    return contrast.luma;
}

static void one_layer_shows_alone_when_the_other_starts_and_contrast_is_kept_between(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_CONTRAST; ++blend)
    {
        RfDualOptions options = rf_dual_defaults();
        options.reset_every = 8;
        options.blend = (RfBlend)blend;
        RfDual *dual = make(exemplar, options);
        for (int frame = 0; frame <= 16; ++frame)
        {
            step(dual, calm, frame, g_last);
            double contrast = contrast_of(g_last, exemplar);
            if (frame % 4 == 0 || blend == RF_BLEND_CONTRAST)
                assert_true(contrast > 0.94 && contrast < 1.06);
            else if (frame % 4 == 2)
                assert_true(contrast > 0.6 && contrast < 0.8); // About 1 / sqrt(2).
        }
        rf_dual_destroy(dual);
    }
    rf_exemplar_destroy(exemplar);
}

static void without_scatter_calm_water_stands_still(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfDualOptions options = rf_dual_defaults();
    options.scatter = false;
    options.blend = RF_BLEND_PLAIN;
    options.reset_every = 10;
    RfDual *dual = make(exemplar, options);
    step(dual, calm, 0, g_first);
    for (int frame = 1; frame <= 25; ++frame)
    {
        step(dual, calm, frame, g_last);
        assert_true(largest_difference(g_first, g_last) < 1e-5f);
    }
    rf_dual_destroy(dual);
    rf_exemplar_destroy(exemplar);
}

static void clamp_to(const RfExemplar *exemplar, float *pixels)
{
    RfImageView map = rf_exemplar_map(exemplar, 0, NULL).image;
    for (int c = 0; c < 3; ++c)
    {
        float low = 1, high = 0;
        for (int k = 0; k < map.width * map.height; ++k)
        {
            low = rf_min(map.pixels[3 * k + c], low);
            high = rf_max(map.pixels[3 * k + c], high);
        }
        for (int k = c; k < VALUES; k += 3)
            pixels[k] = rf_clamp(pixels[k], low, high);
    }
}

static void a_layer_that_never_starts_afresh_is_a_warp(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfDualOptions options = rf_dual_defaults();
    options.scatter = false;
    options.blend = RF_BLEND_PLAIN;
    options.reset_every = 100000;
    RfDual *dual = make(exemplar, options);
    RfWarpOptions warp_options = rf_warp_defaults();
    RfWarp *warp = NULL;
    assert_int_equal(rf_warp_create(exemplar, &warp_options, &warp), RF_OK);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfImageView other = view_of(g_before);
    for (int frame = 0; frame <= 20; ++frame)
    {
        step(dual, scene_two_vortices, frame, g_last);
        RfFlowView view = scene_step(&moments, frame);
        assert_int_equal(rf_warp_step(warp, &view, &other), RF_OK);
    }
    // What is blended stays within the exemplar's range, which a warp's filter may pass.
    clamp_to(exemplar, g_before);
    assert_true(largest_difference(g_before, g_last) < 1e-5f);
    scene_moments_free(&moments);
    rf_warp_destroy(warp);
    rf_dual_destroy(dual);
    rf_exemplar_destroy(exemplar);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_layer_starts_afresh_unseen_whatever_the_period),
        cmocka_unit_test(one_layer_shows_alone_when_the_other_starts_and_contrast_is_kept_between),
        cmocka_unit_test(without_scatter_calm_water_stands_still),
        cmocka_unit_test(a_layer_that_never_starts_afresh_is_a_warp),
    };
    return cmocka_run_group_tests_name("dual", tests, NULL, NULL);
}
