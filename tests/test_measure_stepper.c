// SPDX-License-Identifier: Apache-2.0
// The stepper that judges frames: its tables, summary and maps, threads, misuse, stopping, memory.
#include "riffle/riffle.h"
#include "support/measure_check.h"
#include "support/sanitized.h"
#include "support/scarce.h"

static float g_frame[PIXELS], g_map[2 * PIXELS];

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

// A first frame of another size, larger than the one that found no memory, is judged after all.
static void judge_larger(RfMeasure *measure)
{
    RfImageView larger = {g_texture, 96, 80, 1, N};
    RfMeasureFrame m;
    scarce_allow(100000);
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
    scarce_allow(allocations);
    RfResult result = rf_measure_create(&exemplar, &options, &measure);
    if (result == RF_OK && (result = rf_measure_step(measure, &flow, mask, &a, &m)) != RF_OK)
        judge_larger(measure);
    flow.time = 1;
    if (result == RF_OK)
        result = rf_measure_step(measure, &flow, mask, &b, &m);
    rf_measure_destroy(measure);
    assert_true(result == RF_OK || result == RF_OUT_OF_MEMORY);
    assert_int_equal(scarce_live(), 0);
    return result == RF_OK;
}

static void any_allocation_may_fail_and_nothing_leaks(void **state)
{
    (void)state;
    rf_set_threads(1);
    scarce_begin(SCARCE_PLENTY);
    int needed = 0;
    while (needed < 2000 && !judge_scarcely(needed))
        needed += TEST_SANITIZED ? 4 : 1;
    scarce_end();
    rf_set_threads(0);
    print_message("%d allocations\n", needed);
    assert_true(needed > 50 && needed < 2000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_double_of_a_frame_has_its_line_in_the_table),
        cmocka_unit_test(the_option_table_has_the_defaults_and_every_option),
        cmocka_unit_test(the_summary_has_means_ratios_of_means_and_the_worst_frame),
        cmocka_unit_test(maps_hold_what_the_numbers_are_made_of),
        cmocka_unit_test(results_are_the_same_bytes_for_any_number_of_threads),
        cmocka_unit_test(misuse_is_refused_and_a_refused_step_does_not_count),
        cmocka_unit_test(a_step_stopped_anywhere_is_as_if_it_had_not_been),
        cmocka_unit_test(any_allocation_may_fail_and_nothing_leaks),
    };
    return cmocka_run_group_tests_name("measure stepper", tests, make_inputs, NULL);
}
