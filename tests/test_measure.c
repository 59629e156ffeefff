// SPDX-License-Identifier: Apache-2.0
// The measures over frames made to be right, or wrong by a known amount: what each answers, and that more damage is
// always told as more.
#include "core/random.h"
#include "measure/picture.h"
#include "riffle/measure.h"
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
    N = 128,
    PIXELS = N * N
};

static float g_texture[PIXELS], g_next[PIXELS], g_frame[PIXELS], g_velocity[2 * PIXELS], g_claimed[2 * PIXELS];
static float g_displacement[2 * PIXELS], g_backward[2 * PIXELS], g_map[2 * PIXELS];

static RfImageView grey(float *pixels)
{
    return (RfImageView){pixels, N, N, 1, N};
}

static RfFlowView flow_of(const float *velocity, double time)
{
    return (RfFlowView){.width = N, .height = N, .velocity = velocity, .time = time};
}

// g_texture, and g_next: carried one step by a steady flow in g_velocity.
static int make_inputs(void **state)
{
    (void)state;
    scene_noise(N, N, 0.02f, 0.25f, 3, g_texture);
    scene_two_vortices(N, N, 5, g_velocity);
    RfFlowView flow = flow_of(g_velocity, 1);
    rf_measure_displacement(&flow, 0, N, N, g_displacement);
    assert_int_equal(rf_measure_invert(g_displacement, N, N, g_backward), RF_OK);
    assert_int_equal(rf_measure_warp(g_texture, g_backward, N, N, g_next), RF_OK);
    return 0;
}

static RfMeasure *make(const RfImageView *exemplar, RfMeasureOptions options)
{
    RfMeasure *measure = NULL;
    assert_int_equal(rf_measure_create(exemplar, &options, &measure), RF_OK);
    return measure;
}

// One frame alone, against g_texture.
static RfMeasureFrame judge_with(RfMeasureOptions options, const RfImageView *frame, const uint8_t *mask)
{
    RfImageView exemplar = grey(g_texture);
    RfMeasure *measure = make(&exemplar, options);
    RfMeasureFrame result;
    assert_int_equal(rf_measure_step(measure, NULL, mask, frame, &result), RF_OK);
    rf_measure_destroy(measure);
    return result;
}

static RfMeasureFrame judge(float *pixels)
{
    RfImageView frame = grey(pixels);
    return judge_with(rf_measure_defaults(), &frame, NULL);
}

// Two frames, one step of `velocity` apart.
static RfMeasureFrame judge_pair(const float *velocity, float *first, float *second, const uint8_t *mask)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_every = 0;
    RfImageView exemplar = grey(g_texture), a = grey(first), b = grey(second);
    RfMeasure *measure = make(&exemplar, options);
    RfMeasureFrame result;
    RfFlowView flow = flow_of(velocity, 0);
    assert_int_equal(rf_measure_step(measure, &flow, mask, &a, &result), RF_OK);
    assert_true(isnan(result.flow.error) && isnan(result.flicker.whole));
    flow.time = 1;
    assert_int_equal(rf_measure_step(measure, &flow, mask, &b, &result), RF_OK);
    rf_measure_destroy(measure);
    return result;
}

// ---- does it follow, does it pop ---------------------------------------------------------------------------------

static void an_exact_warp_follows_the_flow_and_does_not_flicker(void **state)
{
    (void)state;
    RfMeasureFrame m = judge_pair(g_velocity, g_texture, g_next, NULL);
    print_message("flow error %.3f px, floor %.3f, motion %.2f, flicker %.4f\n", m.flow.error, m.flow.floor,
                  m.flow.motion, m.flicker.whole);
    assert_true(fabs(m.flow.ratio - 1) < 0.01 && fabs(m.flow.exemplar_ratio - 1) < 0.01);
    assert_true(m.flow.error < 0.2 && m.flow.motion > 0.9);
    assert_true(m.flicker.whole < 1e-3 && m.flicker.floor > m.flicker.whole);
}

static void a_flow_that_is_more_wrong_has_more_flow_error_and_more_flicker(void **state)
{
    (void)state;
    const float scales[] = {1, 1.1f, 1.3f, 2};
    double error = 0, flicker = 0;
    for (int i = 0; i < 4; ++i)
    {
        for (int k = 0; k < 2 * PIXELS; ++k)
            g_claimed[k] = scales[i] * g_velocity[k];
        RfMeasureFrame m = judge_pair(g_claimed, g_texture, g_next, NULL);
        print_message("flow times %.1f: error %.3f px, x%.2f, flicker %.3f\n", (double)scales[i], m.flow.error,
                      m.flow.ratio, m.flicker.whole);
        assert_true(m.flow.error > error && m.flicker.whole > flicker);
        // A tenth too fast is off by a tenth of the motion.
        double expected = (double)(scales[i] - 1) / (double)scales[i] * m.flow.motion;
        assert_true(i == 0 || fabs(m.flow.error - expected) < 0.15);
        error = m.flow.error;
        flicker = m.flicker.whole;
    }
    RfMeasureFrame frozen = judge_pair(g_velocity, g_texture, g_texture, NULL);
    assert_true(fabs(frozen.flow.error - frozen.flow.motion) < 0.05);
}

static void a_larger_pop_is_told_as_larger_and_where_it_is(void **state)
{
    (void)state;
    double whole = 0, block = 0;
    scene_noise(N, N, 0.02f, 0.25f, 9, g_frame);
    for (int side = 4; side <= 32; side *= 2)
    {
        static float popped[PIXELS];
        memcpy(popped, g_next, sizeof popped);
        for (int y = 48; y < 48 + side; ++y)
            memcpy(popped + y * N + 48, g_frame + y * N + 48, (size_t)side * sizeof(float));
        RfMeasureFrame m = judge_pair(g_velocity, g_texture, popped, NULL);
        print_message("pop of %d x %d: flicker %.3f, block %.3f at %g, %g\n", side, side, m.flicker.whole,
                      m.flicker.block, m.flicker.block_x, m.flicker.block_y);
        assert_true(m.flicker.whole > whole && m.flicker.block > block);
        assert_true(m.flicker.block > 2 * m.flicker.whole);
        assert_true(m.flicker.block_x <= 48 && m.flicker.block_x + 32 > 48 && m.flicker.block_y <= 48 &&
                    m.flicker.block_y + 32 > 48);
        whole = m.flicker.whole;
        block = m.flicker.block;
    }
    assert_true(block > 1);
}

static void a_frame_gone_flat_has_no_flicker_to_tell_and_one_that_stays_flat_has_none(void **state)
{
    (void)state;
    static float flat[PIXELS];
    for (int k = 0; k < PIXELS; ++k)
        flat[k] = 0.3f;
    RfMeasureFrame gone = judge_pair(g_velocity, g_texture, flat, NULL),
                   stays = judge_pair(g_velocity, flat, flat, NULL);
    assert_true(isnan(gone.flicker.whole) && isnan(gone.flicker.block) && isnan(gone.flicker.ratio));
    assert_true(gone.contrast.luma < 1e-3);
    assert_true(stays.flicker.whole == 0 && stays.flicker.block == 0 && isnan(stays.flicker.ratio));
    // Coming back is a change like any other.
    assert_true(judge_pair(g_velocity, flat, g_next, NULL).flicker.whole > 0.9);
}

static void what_happens_on_land_changes_nothing(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    static float a[PIXELS], b[PIXELS];
    for (int k = 0; k < PIXELS; ++k)
        mask[k] = hypot(k % N - 64, (double)(k / N) - 64) > 14;
    RfMeasureFrame fluid[2];
    for (int i = 0; i < 2; ++i)
    {
        for (int k = 0; k < PIXELS; ++k)
        {
            a[k] = mask[k] || i == 0 ? g_texture[k] : 7;
            b[k] = mask[k] || i == 0 ? g_next[k] : NAN;
        }
        fluid[i] = judge_pair(g_velocity, a, b, mask);
    }
    assert_memory_equal(&fluid[0], &fluid[1], sizeof fluid[0]);
    print_message("masked: error %.3f px, floor %.3f\n", fluid[0].flow.error, fluid[0].flow.floor);
    assert_true(fluid[0].flow.error < 0.15 && fluid[0].coverage.holes == 0);
    assert_true(fluid[0].coverage.fluid < PIXELS && fluid[0].flow.pixels < PIXELS * 0.75);
    RfMeasureFrame all = judge_pair(g_velocity, a, b, NULL);
    assert_true(all.coverage.holes > 0);
}

static void steps_of_two_frames_follow_twice_the_motion(void **state)
{
    (void)state;
    RfMeasureOptions options = rf_measure_defaults();
    RfMeasure *measure = make(NULL, options);
    RfFlowView flow = flow_of(g_velocity, 3);
    RfImageView frame = grey(g_texture);
    RfMeasureFrame m;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
    flow.time = 5;
    rf_measure_displacement(&flow, 3, N, N, g_displacement);
    assert_int_equal(rf_measure_invert(g_displacement, N, N, g_backward), RF_OK);
    assert_int_equal(rf_measure_warp(g_texture, g_backward, N, N, g_frame), RF_OK);
    frame.pixels = g_frame;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
    assert_true(fabs(m.flow.ratio - 1) < 0.01 && m.flow.motion > 1.8);
    assert_true(isnan(m.flow.exemplar_floor) && isnan(m.patch.residual) && isnan(m.spectrum.distance));
    rf_measure_destroy(measure);
}

// ---- is it that texture ------------------------------------------------------------------------------------------

static void blur(const float *in, float sigma, float *out)
{
    static float rows[PIXELS];
    float taps[17], sum = 0;
    for (int k = -8; k <= 8; ++k)
        sum += taps[k + 8] = expf(-0.5f * (float)(k * k) / (sigma * sigma));
    for (int pass = 0; pass < 2; ++pass)
        for (int y = 0; y < N; ++y)
            for (int x = 0; x < N; ++x)
            {
                float value = 0;
                for (int k = -8; k <= 8; ++k)
                    value +=
                        taps[k + 8] / sum * (pass == 0 ? in[y * N + (x + k + N) % N] : rows[(y + k + N) % N * N + x]);
                (pass == 0 ? rows : out)[y * N + x] = value;
            }
}

static void the_exemplar_itself_is_at_no_distance(void **state)
{
    (void)state;
    RfMeasureFrame m = judge(g_texture);
    assert_true(m.spectrum.distance < 1e-6 && m.spectrum.floor > 0.3 && fabs(m.spectrum.pair_ratio - 1) < 0.3);
    assert_true(m.patch.residual < 1e-3 && m.patch.missing < 1e-3 && m.patch.floor > 5 && m.patch.share > 0.9);
    assert_true(m.contrast.luma == 1 && m.contrast.histogram_mover == 0 && m.contrast.brightness == 0);
    assert_true(m.contrast.mover_floor > 0 && m.contrast.luma_floor > 0 && m.contrast.luma_floor < 0.2);
    assert_true(m.contrast.l1_floor > 0 && m.contrast.l1_floor < 0.5);
    // Grey values that move by more than the mean does.
    assert_true(m.contrast.brightness_floor > 0 && m.contrast.brightness_floor < m.contrast.mover_floor + 1e-9);
    assert_true(m.patch.share_floor > 0.3 && m.patch.share_floor < m.patch.share);
    assert_true(m.coverage.fluid == PIXELS && m.coverage.holes == 0);
}

static void more_blur_is_told_as_more_by_every_measure_of_the_texture(void **state)
{
    (void)state;
    const float sigmas[] = {0.5f, 1, 2};
    RfMeasureFrame last = judge(g_texture);
    for (int i = 0; i < 3; ++i)
    {
        blur(g_texture, sigmas[i], g_frame);
        RfMeasureFrame m = judge(g_frame);
        print_message("blur %.1f px: spectrum %.2f dB, x%.2f, patch %.2f missing %.2f levels, contrast %.3f, "
                      "histogram %.2f\n",
                      (double)sigmas[i], m.spectrum.distance, m.spectrum.ratio, m.patch.residual, m.patch.missing,
                      m.contrast.luma, m.contrast.histogram_mover);
        assert_true(m.spectrum.distance > last.spectrum.distance && m.spectrum.ratio > last.spectrum.ratio);
        assert_true(m.patch.missing > last.patch.missing);
        assert_true(m.contrast.luma < last.contrast.luma);
        assert_true(m.contrast.histogram_mover > last.contrast.histogram_mover);
        last = m;
    }
    assert_true(last.spectrum.ratio > 3 && last.contrast.luma < 0.8);
}

static void another_sample_of_the_texture_is_as_good_as_the_floors_and_white_noise_is_not(void **state)
{
    (void)state;
    scene_noise(N, N, 0.02f, 0.25f, 4, g_frame);
    RfMeasureFrame alike = judge(g_frame);
    assert_true(alike.spectrum.ratio < 1 && fabs(alike.spectrum.pair_ratio - 1) < 0.3);
    assert_true(fabs(alike.patch.ratio - 1) < 0.1 && fabs(alike.patch.missing_ratio - 1) < 0.1);
    assert_true(fabs(alike.patch.share / alike.patch.share_floor - 1) < 0.1);
    assert_true(alike.contrast.histogram_l1 < 2 * alike.contrast.l1_floor);
    for (int k = 0; k < PIXELS; ++k)
        g_frame[k] = rf_random_float(5, 0, (uint64_t)k, 0);
    RfMeasureFrame white = judge(g_frame);
    print_message("alike: spectrum x%.2f, patch x%.2f; white: spectrum x%.2f, patch x%.2f\n", alike.spectrum.ratio,
                  alike.patch.ratio, white.spectrum.ratio, white.patch.ratio);
    assert_true(white.spectrum.ratio > 5 && white.patch.ratio > 1.5 && white.patch.missing_ratio > 1.2);
}

// Tiles of the texture, each from the place that `seed` says, or all from one place.
static void lay_tiles(int side, bool shuffled)
{
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
        {
            int tile = y / side * (N / side) + x / side, tiles = (N / side) * (N / side);
            int from = shuffled ? (tile * 37 + 11) % tiles : 0;
            int u = from % (N / side) * side + x % side, v = from / (N / side) * side + y % side;
            g_frame[y * N + x] = g_texture[v * N + u];
        }
}

static void shuffled_tiles_use_all_of_the_exemplar_and_one_repeated_tile_does_not(void **state)
{
    (void)state;
    lay_tiles(32, true);
    RfMeasureFrame shuffled = judge(g_frame);
    lay_tiles(32, false);
    RfMeasureFrame repeated = judge(g_frame);
    lay_tiles(16, true);
    RfMeasureFrame small = judge(g_frame);
    print_message("shuffled by 32: residual %.2f missing %.2f share %.2f; by 16: residual %.2f; repeated: residual "
                  "%.2f missing %.2f share %.2f\n",
                  shuffled.patch.residual, shuffled.patch.missing, shuffled.patch.share, small.patch.residual,
                  repeated.patch.residual, repeated.patch.missing, repeated.patch.share);
    // Windows inside a tile are pasted; those over seams are not in the exemplar. Smaller tiles have more seams.
    assert_true(shuffled.patch.residual > 1 && shuffled.patch.residual < small.patch.residual);
    assert_true(small.patch.ratio < 1);
    assert_true(shuffled.patch.share > 0.8 && repeated.patch.share < 0.5);
    assert_true(repeated.patch.missing > 2 * shuffled.patch.missing);
    assert_true(shuffled.contrast.histogram_mover < 0.01);
}

static void half_pixel_shifts_and_turns_are_found_when_they_are_asked_for(void **state)
{
    (void)state;
    for (int k = 0; k < PIXELS; ++k)
    {
        g_displacement[2 * k] = 0.5f;
        g_displacement[2 * k + 1] = 0;
    }
    RfMeasureOptions options = rf_measure_defaults();
    RfImageView frame = grey(g_frame);
    assert_int_equal(rf_measure_warp(g_texture, g_displacement, N, N, g_frame), RF_OK);
    RfMeasureFrame without = judge_with(options, &frame, NULL);
    options.half_pixel = true;
    RfMeasureFrame with = judge_with(options, &frame, NULL);
    print_message("half a pixel: residual %.2f, asked for %.2f, missing %.2f and %.2f\n", without.patch.residual,
                  with.patch.residual, without.patch.missing, with.patch.missing);
    assert_true(without.patch.residual > 3 && with.patch.residual < 0.6);
    assert_true(without.patch.missing > 3 && with.patch.missing < 0.6);
    assert_true(with.patch.floor < without.patch.floor);
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
            g_frame[y * N + x] = g_texture[(N - 1 - x) * N + y];
    options = rf_measure_defaults();
    without = judge_with(options, &frame, NULL);
    options.rotations = 4;
    with = judge_with(options, &frame, NULL);
    print_message("quarter turn: residual %.2f, asked for %.2f, share %.2f\n", without.patch.residual,
                  with.patch.residual, with.patch.share);
    assert_true(without.patch.ratio > 0.9 && with.patch.residual < 0.01 && with.patch.missing < 0.01);
    assert_true(with.patch.share > 0.9);
}

static void an_exemplar_is_found_wherever_it_lies_in_a_large_frame(void **state)
{
    (void)state;
    enum
    {
        WIDTH = 2048,
        HEIGHT = 600,
        SIDE = 16
    };
    float *pixels = malloc((size_t)WIDTH * HEIGHT * sizeof *pixels);
    assert_non_null(pixels);
    RfImageView exemplar = {g_texture, SIDE, SIDE, 1, N}, frame = {pixels, WIDTH, HEIGHT, 1, WIDTH};
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_size = 5;
    for (int place = 500; place <= HEIGHT - SIDE; place += (HEIGHT - SIDE - 500) / 4)
    {
        for (int k = 0; k < WIDTH * HEIGHT; ++k)
            pixels[k] = rf_random_float(3, 0, (uint64_t)k, 0);
        for (int y = 0; y < SIDE; ++y)
            memcpy(pixels + (place + y) * WIDTH + 1900, g_texture + y * N, SIDE * sizeof *pixels);
        RfMeasure *measure = make(&exemplar, options);
        RfMeasureFrame m;
        assert_int_equal(rf_measure_step(measure, NULL, NULL, &frame, &m), RF_OK);
        assert_true(m.patch.missing < 1e-3 && m.patch.residual > 10);
        rf_measure_destroy(measure);
    }
    free(pixels);
}

// ---- holes -------------------------------------------------------------------------------------------------------

static void holes_are_counted_to_the_pixel_however_they_are_marked(void **state)
{
    (void)state;
    static float pixels[4 * PIXELS];
    const float marks[3] = {0, NAN, INFINITY};
    for (int mark = 0; mark < 4; ++mark)
    {
        bool alpha = mark == 3;
        RfImageView frame = {pixels, N, N, alpha ? 4 : 3, N * (alpha ? 4 : 3)};
        for (int k = 0; k < PIXELS; ++k)
        {
            bool hole = k % N >= 40 && k % N < 47 && k / N >= 60 && k / N < 65;
            float *p = pixels + k * frame.channels;
            p[0] = p[1] = p[2] = hole && !alpha ? marks[mark] : g_texture[k];
            if (alpha)
                p[3] = hole ? 0 : 1;
        }
        RfMeasureOptions options = rf_measure_defaults();
        options.alpha = alpha;
        RfMeasureFrame m = judge_with(options, &frame, NULL);
        assert_true(m.coverage.holes == 35 && fabs(m.coverage.share - 35.0 / PIXELS) < 1e-9);
        // Holes are told once; the rest of the frame is the exemplar.
        assert_true(m.patch.residual < 1e-3 && fabs(m.contrast.luma - 1) < 0.02 && m.spectrum.ratio < 0.5);
    }
}

static void black_is_no_hole_where_the_exemplar_has_black(void **state)
{
    (void)state;
    static float black[PIXELS];
    for (int k = 0; k < PIXELS; ++k)
        black[k] = fmaxf(g_texture[k] - 0.5f, 0);
    RfImageView exemplar = grey(black), frame = grey(black);
    RfMeasureFrame m;
    RfMeasureOptions options = rf_measure_defaults();
    for (int i = 0; i < 2; ++i)
    {
        options.holes = i == 0 ? RF_MEASURE_HOLES_AUTO : RF_MEASURE_HOLES_ZERO;
        RfMeasure *measure = make(&exemplar, options);
        assert_int_equal(rf_measure_step(measure, NULL, NULL, &frame, &m), RF_OK);
        assert_true(i == 0 ? m.coverage.holes == 0 : m.coverage.holes > PIXELS / 3);
        rf_measure_destroy(measure);
    }
}

static void a_frame_of_nothing_but_holes_gives_no_other_number(void **state)
{
    (void)state;
    memset(g_frame, 0, sizeof g_frame);
    RfMeasureFrame m = judge(g_frame);
    assert_true(m.coverage.share == 1 && m.patch.windows == 0);
    assert_true(isnan(m.patch.residual) && isnan(m.patch.missing) && isnan(m.patch.share));
    assert_true(isnan(m.contrast.luma) && isnan(m.contrast.histogram_mover) && isnan(m.spectrum.distance));
}

// ---- divergence --------------------------------------------------------------------------------------------------

static void a_source_diverges_by_its_strength_and_a_rotation_does_not(void **state)
{
    (void)state;
    for (int k = 0; k < PIXELS; ++k)
    {
        g_claimed[2 * k] = 0.1f * (float)(k % N - N / 2);
        g_claimed[2 * k + 1] = 0.1f * (float)(k / N - N / 2);
    }
    RfFlowView flow = flow_of(g_claimed, 0);
    RfMeasureDivergence d;
    assert_int_equal(rf_measure_divergence(&flow, &d), RF_OK);
    assert_true(fabs(d.rms_divergence - 0.2) < 1e-5 && d.cells == (N - 2) * (N - 2));
    assert_true(fabs(d.relative - d.rms_divergence / d.rms_speed) < 1e-9);
    scene_rotation(N, N, 0, g_claimed);
    assert_int_equal(rf_measure_divergence(&flow, &d), RF_OK);
    assert_true(d.relative < 1e-5 && d.rms_speed > 1);
    memset(g_claimed, 0, sizeof g_claimed);
    assert_int_equal(rf_measure_divergence(&flow, &d), RF_OK);
    assert_true(isnan(d.relative) && d.rms_speed == 0);
}

static void each_frame_has_the_divergence_of_its_own_moment(void **state)
{
    (void)state;
    RfImageView frame = grey(g_texture);
    RfMeasure *measure = make(NULL, rf_measure_defaults());
    RfMeasureFrame m;
    RfMeasureDivergence d;
    assert_int_equal(rf_measure_step(measure, NULL, NULL, &frame, &m), RF_OK);
    assert_true(isnan(m.divergence));
    for (int moment = 1; moment <= 2; ++moment)
    {
        // A rotation and a source that grows.
        for (int k = 0; k < PIXELS; ++k)
        {
            float x = 0.01f * (float)(k % N - N / 2), y = 0.01f * (float)(k / N - N / 2);
            g_claimed[2 * k] = -y + 0.1f * (float)moment * x;
            g_claimed[2 * k + 1] = x + 0.1f * (float)moment * y;
        }
        RfFlowView flow = flow_of(g_claimed, moment);
        assert_int_equal(rf_measure_divergence(&flow, &d), RF_OK);
        assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
        assert_true(m.divergence == d.relative && d.rms_divergence > 0.0019 * moment);
    }
    rf_measure_destroy(measure);
}

// ---- the stepper -------------------------------------------------------------------------------------------------

static void every_double_of_a_frame_has_its_line_in_the_table(void **state)
{
    (void)state;
    int count;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    bool seen[sizeof(RfMeasureFrame) / sizeof(double)] = {false};
    for (int i = 0; i < count; ++i)
    {
        assert_true(table[i].offset % sizeof(double) == 0 && !seen[table[i].offset / sizeof(double)]);
        seen[table[i].offset / sizeof(double)] = true;
        int same = 0, floors = table[i].floor ? 0 : 1;
        for (int j = 0; j < count; ++j)
        {
            same += strcmp(table[i].name, table[j].name) == 0;
            floors += table[i].floor && strcmp(table[i].floor, table[j].name) == 0;
        }
        assert_int_equal(same, 1);
        assert_int_equal(floors, 1);
    }
    // All but the index.
    assert_int_equal(count, sizeof seen / sizeof *seen - 1);
    assert_true(!seen[offsetof(RfMeasureFrame, index) / sizeof(double)]);
}

static void the_option_table_has_the_defaults_and_every_option(void **state)
{
    (void)state;
    int count;
    const RfOption *table = rf_measure_option_table(&count);
    RfMeasureOptions options = rf_measure_defaults();
    for (int i = 0; i < count; ++i)
    {
        const uint8_t *field = (const uint8_t *)&options + table[i].offset;
        double value = table[i].kind == RF_OPTION_UINT64 ? (double)*(const uint64_t *)(const void *)field
                       : table[i].kind == RF_OPTION_BOOL ? *(const bool *)field
                                                         : *(const int *)(const void *)field;
        assert_true(value == table[i].default_value);
        assert_true(table[i].minimum <= value && value <= table[i].maximum);
    }
    assert_int_equal(count, 13);
}

static RfMeasureStatistic statistic(const RfMeasure *measure, const char *name)
{
    RfMeasureSummary summary;
    int count;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    rf_measure_summary(measure, &summary);
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
            return summary.quantities[i];
    fail_msg("no quantity %s", name);
    return summary.quantities[0];
}

static void the_summary_has_means_ratios_of_means_and_the_worst_frame(void **state)
{
    (void)state;
    RfImageView exemplar = grey(g_texture), frame = grey(g_frame);
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = 2;
    options.flicker_every = 4;
    options.patch_every = 3;
    RfMeasure *measure = make(&exemplar, options);
    assert_true(statistic(measure, "contrast").count == 0 && isnan(statistic(measure, "contrast").mean));
    double error = 0, floor = 0, contrast = 0;
    for (int f = 0; f < 7; ++f)
    {
        // Frame 4 is the flattest.
        for (int k = 0; k < PIXELS; ++k)
            g_frame[k] = 0.5f + (f == 4 ? 0.6f : 0.9f) * ((f % 2 ? g_next : g_texture)[k] - 0.5f);
        RfFlowView flow = flow_of(g_velocity, f);
        RfMeasureFrame m;
        assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
        assert_true(m.index == f);
        assert_true(isnan(m.flow.error) == (f % 2 == 0) && isnan(m.patch.residual) == (f % 3 != 0));
        assert_true(rf_measure_has_map(measure, RF_MEASURE_MAP_FLOW_ERROR) == !isnan(m.flow.error));
        // The first frame with a predecessor, and the fourth behind it.
        assert_true(isnan(m.flicker.whole) == (f != 1 && f != 5));
        assert_true(rf_measure_has_map(measure, RF_MEASURE_MAP_FLICKER) == !isnan(m.flicker.whole));
        assert_true(rf_measure_has_map(measure, RF_MEASURE_MAP_BLOCKS) == !isnan(m.flicker.whole));
        error += f % 2 ? m.flow.error : 0;
        floor += f % 2 ? m.flow.floor : 0;
        contrast += m.contrast.luma / 7;
    }
    assert_true(statistic(measure, "flow-error").count == 3 && statistic(measure, "patch").count == 3);
    assert_true(statistic(measure, "flicker").count == 2);
    assert_true(fabs(statistic(measure, "flow-error").mean - error / 3) < 1e-12);
    assert_true(fabs(statistic(measure, "flow-ratio").mean - error / floor) < 1e-12);
    assert_true(fabs(statistic(measure, "contrast").mean - contrast) < 1e-12);
    assert_int_equal(statistic(measure, "contrast").worst_frame, 4);
    assert_true(fabs(statistic(measure, "contrast").worst - 0.6) < 0.03);
    rf_measure_destroy(measure);
}

static void maps_hold_what_the_numbers_are_made_of(void **state)
{
    (void)state;
    RfImageView exemplar = grey(g_texture), a = grey(g_texture), b = grey(g_next), map = grey(g_map);
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_every = 1;
    RfMeasure *measure = make(&exemplar, options);
    RfFlowView flow = flow_of(g_velocity, 0);
    RfMeasureFrame m;
    RfMeasureSpectra spectra;
    rf_measure_spectra(measure, &spectra);
    assert_int_equal(spectra.crop, 0);
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &a, &m), RF_OK);
    assert_true(!rf_measure_has_map(measure, RF_MEASURE_MAP_FLICKER));
    // Each window of the exemplar is its own nearest.
    RfImageView source = {g_map, N, N, 2, 2 * N};
    assert_int_equal(rf_measure_map(measure, RF_MEASURE_MAP_SOURCE, &source), RF_OK);
    for (int y = 8; y < N - 8; ++y)
        for (int x = 8; x < N - 8; ++x)
            assert_true(fabsf(g_map[2 * (y * N + x)] - (float)x) <= 2 &&
                        fabsf(g_map[2 * (y * N + x) + 1] - (float)y) <= 2);
    int64_t counts[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS], total = 0;
    rf_measure_use(measure, counts);
    for (int i = 0; i < RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS; ++i)
        total += counts[i];
    assert_true((double)total == m.patch.windows);

    flow.time = 1;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &b, &m), RF_OK);
    assert_int_equal(rf_measure_map(measure, RF_MEASURE_MAP_FLOW_ERROR, &map), RF_OK);
    double sum = 0, n = 0;
    for (int k = 0; k < PIXELS; ++k)
        if (!isnan(g_map[k]))
        {
            sum += (double)g_map[k];
            n += 1;
        }
    assert_true(n == m.flow.pixels && fabs(sum / n - m.flow.error) < 1e-5);
    assert_int_equal(rf_measure_map(measure, RF_MEASURE_MAP_FLICKER, &map), RF_OK);
    for (int k = sum = n = 0; k < PIXELS; ++k)
        if (!isnan(g_map[k]))
        {
            sum += (double)g_map[k] * (double)g_map[k];
            n += 1;
        }
    assert_true(fabs(sqrt(sum / n) - m.flicker.whole) < 1e-5);
    assert_int_equal(rf_measure_map(measure, RF_MEASURE_MAP_BLOCKS, &map), RF_OK);
    float most = 0;
    for (int k = 0; k < PIXELS; ++k)
        most = fmaxf(most, g_map[k]);
    assert_true(fabs((double)most - m.flicker.block) < 1e-5);

    rf_measure_spectra(measure, &spectra);
    assert_true(spectra.crop == N / 2 && spectra.first == 1 && spectra.last == N / 4);
    sum = 0;
    for (int k = 1; k <= spectra.last; ++k)
    {
        assert_true(spectra.low[k] <= spectra.exemplar[k] + 0.5 && spectra.high[k] >= spectra.exemplar[k] - 0.5);
        sum += pow(spectra.frame[k] - spectra.exemplar[k], 2) / spectra.last;
    }
    // The noise floor under both makes the distance a little smaller than that of the bare curves.
    assert_true(sqrt(sum) >= m.spectrum.distance);
    rf_measure_destroy(measure);
}

enum
{
    // Walks are shared among threads from 2^15 pixels on, and inverse search walks at half resolution.
    LARGE = 384
};

static float g_large[LARGE * LARGE], g_large_next[LARGE * LARGE];

static RfMeasureFrame judge_coloured(RfMeasureEstimator estimator, int threads)
{
    static float pixels[3 * LARGE * LARGE];
    RfImageView exemplar = {pixels, N, N, 3, 3 * LARGE}, frame = {pixels, LARGE, LARGE, 3, 3 * LARGE};
    RfMeasureFrame m;
    rf_set_threads(threads);
    for (int k = 0; k < 3 * LARGE * LARGE; ++k)
        pixels[k] = g_large[k / 3] * (0.5f + 0.2f * (float)(k % 3));
    RfMeasureOptions options = rf_measure_defaults();
    options.estimator = estimator;
    options.patch_stride = 24;
    options.rotations = 3;
    RfMeasure *measure = make(&exemplar, options);
    RfFlowView flow = flow_of(g_velocity, 0);
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
    assert_false(isnan(m.patch.residual));
    RfMeasureFrame first = m;
    for (int k = 0; k < 3 * LARGE * LARGE; ++k)
        pixels[k] = g_large_next[k / 3] * (0.6f + 0.2f * (float)(k % 3));
    flow.time = 1;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
    m.patch = first.patch;
    rf_measure_destroy(measure);
    rf_set_threads(0);
    return m;
}

static void results_are_the_same_bytes_for_any_number_of_threads(void **state)
{
    (void)state;
    scene_noise(LARGE, LARGE, 0.02f, 0.25f, 3, g_large);
    for (int k = 0; k < LARGE * LARGE; ++k)
        g_large_next[k] = g_large[k / LARGE * LARGE + (k % LARGE + LARGE - 2) % LARGE];
    for (int estimator = 0; estimator < 2; ++estimator)
    {
        RfMeasureFrame one = judge_coloured((RfMeasureEstimator)estimator, 1);
        RfMeasureFrame three = judge_coloured((RfMeasureEstimator)estimator, 3);
        assert_memory_equal(&one, &three, sizeof one);
        assert_true(!isnan(one.flow.error) && !isnan(one.flicker.whole) && !isnan(one.contrast.channel[2]));
    }
}

static void misuse_is_refused_and_a_refused_step_does_not_count(void **state)
{
    (void)state;
#ifdef RF_STOP_ON_MISUSE
    skip();
#endif
    RfMeasureOptions options = rf_measure_defaults();
    RfImageView frame = grey(g_texture), other = {g_texture, N / 2, N, 1, N / 2}, small = {g_texture, 12, 12, 1, 12};
    RfMeasure *measure = NULL;
    RfMeasureFrame m = {.index = 77}, kept = m;
    options.struct_size = 0;
    assert_int_equal(rf_measure_create(&frame, &options, &measure), RF_INVALID_ARGUMENT);
    options = rf_measure_defaults();
    options.spectrum_crop = 17;
    assert_int_equal(rf_measure_create(&frame, &options, &measure), RF_INVALID_ARGUMENT);
    options.spectrum_crop = 256;
    assert_int_equal(rf_measure_create(&frame, &options, &measure), RF_INVALID_ARGUMENT);
    options = rf_measure_defaults();
    assert_int_equal(rf_measure_create(&small, &options, &measure), RF_BAD_INPUT);
    // Too many in so many copies; without the patches nobody looks for them.
    static float wide[512 * 512];
    RfImageView large = {wide, 512, 512, 1, 512};
    options.rotations = 72;
    assert_int_equal(rf_measure_create(&large, &options, &measure), RF_UNSUPPORTED);
    assert_null(measure);
    options.patch_every = 0;
    measure = make(&large, options);
    rf_measure_destroy(measure);
    measure = NULL;
    options = rf_measure_defaults();
    assert_int_equal(rf_measure_create(&small, &options, &measure), RF_BAD_INPUT);
    assert_null(measure);
    measure = make(&frame, options);
    assert_int_equal(rf_measure_step(measure, NULL, NULL, &small, &m), RF_INVALID_ARGUMENT);
    RfFlowView flow = flow_of(g_velocity, 4);
    RfMeasureFrame first;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &first), RF_OK);
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_INVALID_ARGUMENT);
    flow.time = 5;
    assert_int_equal(rf_measure_step(measure, &flow, NULL, &other, &m), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_measure_map(measure, RF_MEASURE_MAP_FLOW_ERROR, &frame), RF_INVALID_ARGUMENT);
    assert_memory_equal(&m, &kept, sizeof m);
    RfMeasureSummary summary;
    rf_measure_summary(measure, &summary);
    assert_int_equal(summary.frames, 1);
    rf_measure_destroy(measure);
    rf_measure_destroy(NULL);
}

typedef struct Patience
{
    int left;
} Patience;

static bool lose_patience(void *user, const char *stage, double fraction)
{
    (void)fraction;
    Patience *patience = user;
    assert_string_equal(stage, "judging");
    return patience->left-- > 0;
}

// Three steps, of which number `stopped` is stopped at its report number `patience` and then taken again. True if it
// had fewer.
static bool judge_impatiently(int stopped, int patience, RfMeasureFrame *last, RfMeasureSpectra *spectra)
{
    Patience state = {patience};
    const RfProgress progress = {lose_patience, &state};
    float *pixels[3] = {g_texture, g_next, g_texture};
    RfImageView exemplar = {g_texture, 32, 32, 1, N};
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = options.patch_every = 1;
    RfMeasure *measure = make(&exemplar, options);
    RfMeasureSummary summary;
    bool through = stopped < 0;
    for (int f = 0; f < 3; ++f)
    {
        RfFlowView flow = flow_of(g_velocity, f);
        RfImageView frame = {pixels[f], 48, 48, 1, N};
        RfMeasureFrame m = {.index = 77}, kept = m;
        rf_set_progress(f == stopped ? &progress : NULL);
        RfResult result = rf_measure_step(measure, &flow, NULL, &frame, &m);
        rf_set_progress(NULL);
        through |= f == stopped && result == RF_OK;
        if (result != RF_OK)
        {
            assert_int_equal(result, RF_CANCELLED);
            assert_memory_equal(&m, &kept, sizeof m);
            rf_measure_summary(measure, &summary);
            assert_int_equal(summary.frames, f);
            assert_false(rf_measure_has_map(measure, RF_MEASURE_MAP_HOLES));
            assert_int_equal(rf_measure_step(measure, &flow, NULL, &frame, &m), RF_OK);
        }
        *last = m;
    }
    rf_measure_spectra(measure, spectra);
    rf_measure_destroy(measure);
    return through;
}

static void a_step_stopped_anywhere_is_as_if_it_had_not_been(void **state)
{
    (void)state;
    static RfMeasureSpectra whole_spectra, spectra;
    RfMeasureFrame whole, m;
    judge_impatiently(-1, 0, &whole, &whole_spectra);
    for (int stopped = 0; stopped < 3; stopped += 2)
    {
        int reports = 0;
        while (!judge_impatiently(stopped, reports, &m, &spectra))
        {
            assert_memory_equal(&m, &whole, sizeof m);
            assert_memory_equal(&spectra, &whole_spectra, sizeof spectra);
            ++reports;
        }
        // At its start, between flicker and flow error, before spectrum and patches, and for a strip of the frame.
        assert_int_equal(reports, stopped == 0 ? 4 : 5);
    }
}

// ---- memory ------------------------------------------------------------------------------------------------------

static int g_left, g_live;

static void *scarce_allocate(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    void *memory = NULL;
    if (__atomic_fetch_sub(&g_left, 1, __ATOMIC_RELAXED) <= 0 || posix_memalign(&memory, alignment, bytes) != 0)
        return NULL;
    __atomic_fetch_add(&g_live, 1, __ATOMIC_RELAXED);
    return memory;
}

static void scarce_release(void *memory, void *user)
{
    (void)user;
    __atomic_fetch_sub(&g_live, 1, __ATOMIC_RELAXED);
    free(memory);
}

// A first frame of another size, larger than the one that found no memory, is judged after all.
static void judge_larger(RfMeasure *measure)
{
    RfImageView larger = {g_texture, 96, 80, 1, N};
    RfMeasureFrame m;
    g_left = 100000;
    assert_int_equal(rf_measure_step(measure, NULL, NULL, &larger, &m), RF_OK);
    assert_true(m.index == 0 && m.coverage.fluid == 96 * 80 && !isnan(m.patch.residual));
}

// Two steps with at most `allocations` allocations. True if they sufficed.
static bool judge_scarcely(int allocations)
{
    RfImageView exemplar = {g_texture, 32, 32, 1, N}, a = {g_texture, 48, 48, 1, N}, b = {g_next, 48, 48, 1, N};
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_every = 1;
    RfMeasure *measure = NULL;
    RfMeasureFrame m;
    RfFlowView flow = {.width = 48, .height = 48, .velocity = g_velocity};
    static uint8_t mask[48 * 48];
    memset(mask, 1, sizeof mask);
    mask[5 * 48 + 5] = 0;
    g_left = allocations;
    RfResult result = rf_measure_create(&exemplar, &options, &measure);
    if (result == RF_OK && (result = rf_measure_step(measure, &flow, mask, &a, &m)) != RF_OK)
        judge_larger(measure);
    flow.time = 1;
    if (result == RF_OK)
        result = rf_measure_step(measure, &flow, mask, &b, &m);
    rf_measure_destroy(measure);
    assert_true(result == RF_OK || result == RF_OUT_OF_MEMORY);
    assert_int_equal(g_live, 0);
    return result == RF_OK;
}

static void any_allocation_may_fail_and_nothing_leaks(void **state)
{
    (void)state;
    const RfAllocator scarce = {scarce_allocate, scarce_release, NULL};
    rf_set_threads(1);
    rf_set_allocator(&scarce);
    int needed = 0;
    while (needed < 2000 && !judge_scarcely(needed))
        needed += TEST_SANITIZED ? 4 : 1;
    rf_set_allocator(NULL);
    rf_set_threads(0);
    print_message("%d allocations\n", needed);
    assert_true(needed > 50 && needed < 2000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_exact_warp_follows_the_flow_and_does_not_flicker),
        cmocka_unit_test(a_flow_that_is_more_wrong_has_more_flow_error_and_more_flicker),
        cmocka_unit_test(a_larger_pop_is_told_as_larger_and_where_it_is),
        cmocka_unit_test(a_frame_gone_flat_has_no_flicker_to_tell_and_one_that_stays_flat_has_none),
        cmocka_unit_test(what_happens_on_land_changes_nothing),
        cmocka_unit_test(steps_of_two_frames_follow_twice_the_motion),
        cmocka_unit_test(the_exemplar_itself_is_at_no_distance),
        cmocka_unit_test(more_blur_is_told_as_more_by_every_measure_of_the_texture),
        cmocka_unit_test(another_sample_of_the_texture_is_as_good_as_the_floors_and_white_noise_is_not),
        cmocka_unit_test(shuffled_tiles_use_all_of_the_exemplar_and_one_repeated_tile_does_not),
        cmocka_unit_test(half_pixel_shifts_and_turns_are_found_when_they_are_asked_for),
        cmocka_unit_test(an_exemplar_is_found_wherever_it_lies_in_a_large_frame),
        cmocka_unit_test(holes_are_counted_to_the_pixel_however_they_are_marked),
        cmocka_unit_test(black_is_no_hole_where_the_exemplar_has_black),
        cmocka_unit_test(a_frame_of_nothing_but_holes_gives_no_other_number),
        cmocka_unit_test(a_source_diverges_by_its_strength_and_a_rotation_does_not),
        cmocka_unit_test(each_frame_has_the_divergence_of_its_own_moment),
        cmocka_unit_test(every_double_of_a_frame_has_its_line_in_the_table),
        cmocka_unit_test(the_option_table_has_the_defaults_and_every_option),
        cmocka_unit_test(the_summary_has_means_ratios_of_means_and_the_worst_frame),
        cmocka_unit_test(maps_hold_what_the_numbers_are_made_of),
        cmocka_unit_test(results_are_the_same_bytes_for_any_number_of_threads),
        cmocka_unit_test(misuse_is_refused_and_a_refused_step_does_not_count),
        cmocka_unit_test(a_step_stopped_anywhere_is_as_if_it_had_not_been),
        cmocka_unit_test(any_allocation_may_fail_and_nothing_leaks),
    };
    return cmocka_run_group_tests_name("measure", tests, make_inputs, NULL);
}
