// SPDX-License-Identifier: Apache-2.0
// Lagrangian texture advection at its defaults, judged on the two-vortex scene over 200 frames: does it move like the
// flow, as far as an estimator of the class used in published work can tell, and does it still look like the exemplar.
// Each criterion is shown to fail on inputs made to fail it. Every test prints its numbers.
#include "measure/judgement.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 256,
    PIXELS = N * N,
    // Sanitizers need no more than every path: three channels and one.
    FRAMES = TEST_SANITIZED ? 60 : 200,
    EVERY = 20,
    EXEMPLARS = TEST_SANITIZED ? 2 : 3
};

// Of the flow error over its floor, and of the spectrum's distance over its floor.
static const double FLOW_LIMIT = 1.6, SPECTRUM_LIMIT = 1.3;
// Of the standard deviation's ratio from 1, with the contrast- and the histogram-preserving blend.
static const double CONTRAST_LIMIT = 0.05, HISTOGRAM_LIMIT = 0.03;

// Sums over the judged frames.
typedef struct Judged
{
    int64_t holes;
    int frames;
    double error, floor, exemplar_floor, spectrum, spectrum_floor, contrast, flicker;
} Judged;

typedef struct Subject
{
    const char *name;
    RfImage *image;
    RfExemplar *exemplar;
    float *grey;
    int w, h;
    RfMeasure *measure;
    Judged defaults, paper, histogram;
    // The last two frames at the defaults, and the motion between them.
    float *before, *after, *displacement;
} Subject;

static Subject g_subjects[] = {{.name = "builtin:foam"}, {.name = "builtin:noise"}, {.name = "builtin:bubbles"}};
static float g_pixels[RF_MAX_EXEMPLAR_CHANNELS * PIXELS], g_grey[2][PIXELS], g_displacement[2 * PIXELS];

static double flow_ratio(const Judged *j)
{
    return j->error / j->floor;
}

static double spectrum_ratio(const Judged *j)
{
    return j->spectrum / j->spectrum_floor;
}

static double contrast(const Judged *j)
{
    return j->contrast / j->frames;
}

static double ratio_of(const float *a, const float *b, const float *displacement, const uint8_t *mask)
{
    RfFramePair pair = {N, N, a, b, mask, mask};
    RfMeasureFlow flow;
    assert_int_equal(rf_measure_flow_error(RF_MEASURE_INVERSE_SEARCH, &pair, displacement, NULL, NULL, NULL, &flow),
                     RF_OK);
    return flow.ratio;
}

static RfMeasure *make_measure(const Subject *s)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = 1;
    options.patch_every = 0;
    RfImageView picture = rf_image_view(s->image);
    RfMeasure *measure = NULL;
    assert_int_equal(rf_measure_create(&picture, &options, &measure), RF_OK);
    return measure;
}

// The first frame of a pair only makes the second one's predecessor.
static void start_pair(const Subject *s, const RfImageView *frame)
{
    RfMeasureFrame unused;
    assert_int_equal(rf_measure_step(s->measure, NULL, NULL, frame, &unused), RF_OK);
}

static void judge_frame(const Subject *s, const RfImageView *frame, const RfFlowView *flow, bool contrast_only,
                        Judged *j)
{
    RfMeasureFrame m;
    assert_int_equal(rf_measure_step(s->measure, contrast_only ? NULL : flow, NULL, frame, &m), RF_OK);
    j->contrast += m.contrast.luma;
    ++j->frames;
    if (contrast_only)
        return;
    j->error += m.flow.error;
    j->floor += m.flow.floor;
    j->exemplar_floor += m.flow.exemplar_floor;
    j->spectrum += m.spectrum.distance;
    j->spectrum_floor += m.spectrum.floor;
    j->flicker += m.flicker.whole;
}

// Draws every frame where holes are counted, and else only those that are judged.
static Judged run(const Subject *s, RfLagrangianOptions options, bool every_frame, bool contrast_only)
{
    Judged j = {0};
    RfLagrangian *lagrangian = NULL;
    int channels = rf_exemplar_channels(s->exemplar);
    RfImageView frame = {g_pixels, N, N, channels, N * channels};
    options.particle_radius = (float)N / 8;
    assert_int_equal(rf_lagrangian_create(s->exemplar, &options, &lagrangian), RF_OK);
    SceneMoments scene = scene_moments(scene_two_vortices, N, N);
    for (int f = 1; f <= FRAMES; ++f)
    {
        RfFlowView flow = scene_step(&scene, f);
        bool second = f % EVERY == 0, first = f % EVERY == EVERY - 1 && !contrast_only;
        if (first || second || every_frame)
        {
            assert_int_equal(rf_lagrangian_step(lagrangian, &flow, &frame), RF_OK);
            j.holes += rf_lagrangian_stats(lagrangian).holes;
        }
        else
            assert_int_equal(rf_lagrangian_advance(lagrangian, &flow, N, N), RF_OK);
        if (first || second)
            rf_measure_grey(&frame, g_grey[second]);
        if (first)
            start_pair(s, &frame);
        if (second)
        {
            judge_frame(s, &frame, &flow, contrast_only, &j);
            rf_measure_displacement(&flow, f - 1, N, N, g_displacement);
        }
    }
    scene_moments_free(&scene);
    rf_lagrangian_destroy(lagrangian);
    return j;
}

static float *copy_of(const float *values, size_t count)
{
    float *copy = malloc(count * sizeof(float));
    assert_non_null(copy);
    memcpy(copy, values, count * sizeof(float));
    return copy;
}

static void open_subject(Subject *s)
{
    assert_int_equal(rf_image_read(s->name, &s->image), RF_OK);
    RfImageView picture = rf_image_view(s->image);
    RfMapView map = {"colour", picture.channels == 1 || picture.channels == 3 ? RF_MAP_COLOUR : RF_MAP_DATA, picture,
                     1};
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &s->exemplar), RF_OK);
    s->w = picture.width;
    s->h = picture.height;
    s->grey = malloc((size_t)s->w * (size_t)s->h * sizeof(float));
    assert_non_null(s->grey);
    rf_measure_grey(&picture, s->grey);
    s->measure = make_measure(s);
}

static int run_all(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        Subject *s = &g_subjects[i];
        open_subject(s);
        RfLagrangianOptions histogram = rf_lagrangian_defaults();
        histogram.blend = RF_BLEND_HISTOGRAM;
        s->histogram = run(s, histogram, false, true);
        s->paper = run(s, rf_lagrangian_paper(), false, false);
        s->defaults = run(s, rf_lagrangian_defaults(), true, false);
        s->before = copy_of(g_grey[0], PIXELS);
        s->after = copy_of(g_grey[1], PIXELS);
        s->displacement = copy_of(g_displacement, 2 * PIXELS);
    }
    return 0;
}

static int free_all(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        Subject *s = &g_subjects[i];
        rf_measure_destroy(s->measure);
        rf_exemplar_destroy(s->exemplar);
        rf_image_destroy(s->image);
        free(s->grey);
        free(s->before);
        free(s->after);
        free(s->displacement);
    }
    return 0;
}

static void print(const char *name, const char *what, const Judged *j)
{
    print_message("%-16s %-8s flow error %.3f px, x%.2f (exemplar's floor x%.2f), spectrum x%.2f, product %.2f, "
                  "flicker %.3f, contrast %.3f\n",
                  name, what, j->error / j->frames, flow_ratio(j), j->error / j->exemplar_floor, spectrum_ratio(j),
                  flow_ratio(j) * spectrum_ratio(j), j->flicker / j->frames, contrast(j));
}

static void the_texture_moves_like_the_flow_and_looks_like_the_exemplar(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
        print(g_subjects[i].name, "defaults", &g_subjects[i].defaults);
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        const Judged *j = &g_subjects[i].defaults;
        // A blunt estimator would pass anything.
        assert_true(j->floor / j->frames < 0.1);
        assert_true(flow_ratio(j) <= FLOW_LIMIT);
        assert_true(spectrum_ratio(j) <= SPECTRUM_LIMIT);
    }
}

static void the_product_of_both_is_better_than_with_the_constants_of_the_paper(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
        print(g_subjects[i].name, "paper", &g_subjects[i].paper);
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        const Judged *ours = &g_subjects[i].defaults, *paper = &g_subjects[i].paper;
        double product = flow_ratio(ours) * spectrum_ratio(ours), theirs = flow_ratio(paper) * spectrum_ratio(paper);
        print_message("%-16s product %.2f, the paper's %.2f%s\n", g_subjects[i].name, product, theirs,
                      product < theirs ? "" : ": not better");
        assert_true(product < theirs);
        assert_true(ours->error <= 1.05 * paper->error);
    }
}

static void no_pixel_is_left_uncovered_in_200_frames(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
        assert_int_equal(g_subjects[i].defaults.holes, 0);
}

static void the_blends_keep_the_contrast(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
        print_message("%-16s contrast: blend contrast %.3f, histogram %.3f\n", g_subjects[i].name,
                      contrast(&g_subjects[i].defaults), contrast(&g_subjects[i].histogram));
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        assert_true(fabs(contrast(&g_subjects[i].defaults) - 1) <= CONTRAST_LIMIT);
        assert_true(fabs(contrast(&g_subjects[i].histogram) - 1) <= HISTOGRAM_LIMIT);
    }
}

static void a_frozen_texture_fails_the_flow_criterion(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        const Subject *s = &g_subjects[i];
        double ratio = ratio_of(s->before, s->before, s->displacement, NULL);
        print_message("%-16s frozen: flow x%.2f\n", s->name, ratio);
        assert_true(ratio > FLOW_LIMIT);
    }
}

// The claimed motion is the true one turned; the frames are as they were.
static double ratio_turned(const Subject *s, double degrees)
{
    float c = (float)cos(degrees * 3.14159265358979 / 180), d = (float)sin(degrees * 3.14159265358979 / 180);
    for (size_t k = 0; k < 2 * PIXELS; k += 2)
    {
        g_displacement[k] = c * s->displacement[k] - d * s->displacement[k + 1];
        g_displacement[k + 1] = d * s->displacement[k] + c * s->displacement[k + 1];
    }
    return ratio_of(s->before, s->after, g_displacement, NULL);
}

static void a_flow_turned_by_30_degrees_or_negated_fails_the_flow_criterion(void **state)
{
    (void)state;
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        const Subject *s = &g_subjects[i];
        double right = ratio_turned(s, 0), turned = ratio_turned(s, 30), negated = ratio_turned(s, 180);
        print_message("%-16s true flow: x%.2f, turned x%.2f, negated x%.2f\n", s->name, right, turned, negated);
        assert_true(right < turned && turned < negated);
        assert_true(turned > FLOW_LIMIT);
    }
}

static void an_obstacle_fails_the_flow_criterion_and_masked_changes_nothing(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        const Subject *s = &g_subjects[i];
        memcpy(g_grey[0], s->before, sizeof g_grey[0]);
        memcpy(g_grey[1], s->after, sizeof g_grey[1]);
        // In the jet between the vortices, textured like the rest.
        for (int k = 0; k < PIXELS; ++k)
        {
            mask[k] = hypot(k % N - N / 2, k / N - N / 2) > N / 6.0;
            if (!mask[k])
                g_grey[0][k] = g_grey[1][k] = s->grey[(k / N % s->h) * s->w + k % N % s->w];
        }
        double counted = ratio_of(g_grey[0], g_grey[1], s->displacement, NULL);
        double masked = ratio_of(g_grey[0], g_grey[1], s->displacement, mask);
        double without = ratio_of(s->before, s->after, s->displacement, NULL);
        print_message("%-16s obstacle: none x%.2f, counted x%.2f, masked x%.2f\n", s->name, without, counted, masked);
        assert_true(counted > FLOW_LIMIT);
        assert_true(fabs(masked / without - 1) < 0.1);
    }
}

static double warped_spectrum_ratio(const Subject *s)
{
    RfWarpOptions options = rf_warp_defaults();
    RfWarp *warp = NULL;
    int channels = rf_exemplar_channels(s->exemplar);
    RfImageView frame = {g_pixels, N, N, channels, N * channels};
    assert_int_equal(rf_warp_create(s->exemplar, &options, &warp), RF_OK);
    SceneMoments scene = scene_moments(scene_two_vortices, N, N);
    for (int f = 1; f <= FRAMES; ++f)
    {
        RfFlowView flow = scene_step(&scene, f);
        RfResult result = f < FRAMES ? rf_warp_advance(warp, &flow, N, N) : rf_warp_step(warp, &flow, &frame);
        assert_int_equal(result, RF_OK);
    }
    scene_moments_free(&scene);
    rf_warp_destroy(warp);
    RfMeasureFrame m;
    assert_int_equal(rf_measure_step(s->measure, NULL, NULL, &frame, &m), RF_OK);
    return m.spectrum.ratio;
}

static void a_texture_warped_for_ever_fails_the_spectrum_criterion_by_frame_200(void **state)
{
    (void)state;
    if (TEST_SANITIZED)
    {
        print_message("skipped: it judges pictures, which sanitizers do not change, for minutes\n");
        skip();
    }
    for (int i = 0; i < EXEMPLARS; ++i)
    {
        double ratio = warped_spectrum_ratio(&g_subjects[i]);
        print_message("%-16s warp: spectrum x%.2f\n", g_subjects[i].name, ratio);
        assert_true(ratio > SPECTRUM_LIMIT);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_texture_moves_like_the_flow_and_looks_like_the_exemplar),
        cmocka_unit_test(the_product_of_both_is_better_than_with_the_constants_of_the_paper),
        cmocka_unit_test(no_pixel_is_left_uncovered_in_200_frames),
        cmocka_unit_test(the_blends_keep_the_contrast),
        cmocka_unit_test(a_frozen_texture_fails_the_flow_criterion),
        cmocka_unit_test(a_flow_turned_by_30_degrees_or_negated_fails_the_flow_criterion),
        cmocka_unit_test(an_obstacle_fails_the_flow_criterion_and_masked_changes_nothing),
        cmocka_unit_test(a_texture_warped_for_ever_fails_the_spectrum_criterion_by_frame_200),
    };
    return cmocka_run_group_tests(tests, run_all, free_all);
}
