// SPDX-License-Identifier: Apache-2.0
// The moving form of texture optimisation at its defaults, judged between two vortices: does it follow the flow, does
// it keep still where the flow does not ask for more, and is it still made of the exemplar's shapes. Coordinates that
// are carried for ever (warp) follow as well, and fail the last.
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 192,
    FRAMES = TEST_SANITIZED ? 20 : 60,
    EVERY = 20
};

// Of the flow error over its floor; of the flicker over its own; of the windows' distance to the exemplar's over that
// of warp; of the contrast from the exemplar's. The frame is small and the flow in it fast: at 512 x 512 all are lower.
static const double FLOW_LIMIT = 1.7, FLICKER_LIMIT = 0.22, PATCH_LIMIT = 0.95, CONTRAST_LIMIT = 0.1;

typedef struct Judged
{
    int frames, flickers;
    double error, floor, flicker, contrast, patch, patch_floor;
} Judged;

typedef RfResult StepFn(void *method, const RfFlowView *flow, const RfImageView *frame);

static RfResult step_optimize(void *method, const RfFlowView *flow, const RfImageView *frame)
{
    return rf_optimize_step(method, flow, frame);
}

static RfResult step_warp(void *method, const RfFlowView *flow, const RfImageView *frame)
{
    return rf_warp_step(method, flow, frame);
}

static float g_pixels[N * N * 3];

static Judged judge(const RfImage *image, void *method, StepFn *step)
{
    Judged j = {0};
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = options.patch_every = EVERY;
    options.flicker_every = 4;
    options.rotations = 24;
    RfImageView picture = rf_image_view(image), frame = {g_pixels, N, N, 3, (ptrdiff_t)N * 3};
    RfMeasure *measure = NULL;
    assert_int_equal(rf_measure_create(&picture, &options, &measure), RF_OK);
    SceneMoments scene = scene_moments(scene_two_vortices, N, N);
    for (int f = 0; f <= FRAMES; ++f)
    {
        RfFlowView flow = scene_step(&scene, f);
        RfMeasureFrame m;
        assert_int_equal(step(method, &flow, &frame), RF_OK);
        assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
        if (f > 0 && isfinite(m.flow.error))
        {
            j.error += m.flow.error;
            j.floor += m.flow.floor;
        }
        if (f > 0 && isfinite(m.flicker.whole))
        {
            j.flicker += m.flicker.whole - m.flicker.floor;
            ++j.flickers;
        }
        if (f > 0 && isfinite(m.patch.residual))
        {
            j.patch += m.patch.residual;
            j.patch_floor += m.patch.floor;
        }
        if (f > 0)
        {
            j.contrast += m.contrast.luma;
            ++j.frames;
        }
    }
    rf_measure_destroy(measure);
    scene_moments_free(&scene);
    return j;
}

static void moving_textures_follow_the_flow_and_keep_their_shapes(void **state)
{
    (void)state;
    static const char *const names[] = {"builtin:lava?size=128", "builtin:pebbles?size=128"};
    for (int i = 0; i < (TEST_SANITIZED ? 1 : 2); ++i)
    {
        RfImage *image = NULL;
        RfExemplar *exemplar = NULL;
        assert_int_equal(rf_image_read(names[i], &image), RF_OK);
        RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
        assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar), RF_OK);
        RfOptimizeOptions options = rf_optimize_defaults();
        RfWarpOptions warping = rf_warp_defaults();
        RfOptimize *optimize = NULL;
        RfWarp *warp = NULL;
        assert_int_equal(rf_optimize_create(exemplar, &options, &optimize), RF_OK);
        assert_int_equal(rf_warp_create(exemplar, &warping, &warp), RF_OK);
        Judged o = judge(image, optimize, step_optimize), w = judge(image, warp, step_warp);
        rf_optimize_destroy(optimize);
        rf_warp_destroy(warp);
        rf_exemplar_destroy(exemplar);
        rf_image_destroy(image);
        double flicker = o.flicker / o.flickers, contrast = o.contrast / o.frames;
        printf("%s: flow error %.2f of its floor, flicker %.3f over its own, contrast %.2f, windows %.2f of the floor "
               "(warp %.2f)\n",
               names[i], o.error / o.floor, flicker, contrast, o.patch / o.patch_floor, w.patch / w.patch_floor);
        assert_true(o.error < FLOW_LIMIT * o.floor);
        assert_true(flicker < FLICKER_LIMIT);
        assert_true(contrast > 1 - CONTRAST_LIMIT && contrast < 1 + CONTRAST_LIMIT);
        assert_true(TEST_SANITIZED || o.patch < PATCH_LIMIT * w.patch);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(moving_textures_follow_the_flow_and_keep_their_shapes)};
    return cmocka_run_group_tests_name("optimize quality", tests, NULL, NULL);
}
