// SPDX-License-Identifier: Apache-2.0
// The measures over frames made to be right, or wrong by a known amount: what each answers, and that more damage is
// always told as more.
#include "core/random.h"
#include "riffle/riffle.h"
#include "support/measure_check.h"

static float g_frame[PIXELS], g_claimed[2 * PIXELS];

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
    };
    return cmocka_run_group_tests_name("measure", tests, make_inputs, NULL);
}
