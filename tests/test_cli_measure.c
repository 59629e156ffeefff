// SPDX-License-Identifier: Apache-2.0
// `riffle measure`: it judges frames of known faults rightly, from files alone, and its reports say what it found.
#include "riffle/riffle.h"
#include "support/cli_check.h"
#include "support/scenes.h"

#include <math.h>
#include <signal.h>

enum
{
    N = 96,
    FRAMES = 4
};

static TestFolder g_folder;
static float g_noise[N * N];

/// The texture moved by (x, y) pixels; it wraps, so that nothing is new. Holed: its corner is exactly black.
static void put_frame_of(const char *name, int side, int dx, int dy, bool holed)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_create(side, side, 3, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int y = 0; y < side; ++y)
        for (int x = 0; x < side; ++x)
            for (int c = 0; c < 3; ++c)
            {
                float value = g_noise[(y - dy + N) % N * N + (x - dx + N) % N];
                view.pixels[3 * (y * side + x) + c] = holed && x < 24 && y < 24 ? 0 : value;
            }
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    assert_int_equal(rf_image_write(test_folder_file(&g_folder, name), image), RF_OK);
    rf_image_destroy(image);
}

static void put_frame(const char *name, int dx, int dy, bool holed)
{
    put_frame_of(name, N, dx, dy, holed);
}

static void put_flow(const char *name, float x, float y)
{
    static float velocity[2 * N * N];
    scene_uniform(N, N, (RfVec2){x, y}, velocity);
    RfFlowView flow = {.width = N, .height = N, .velocity = velocity};
    assert_int_equal(rf_flow_write(test_folder_file(&g_folder, name), &flow, 24), RF_OK);
}

static int make_files(void **state)
{
    (void)state;
    g_folder = test_folder_make();
    scene_noise(N, N, 0.02f, 0.12f, 3, g_noise);
    for (int i = 1; i <= FRAMES; ++i)
    {
        char name[32];
        snprintf(name, sizeof name, "good.%04d.png", i);
        put_frame(name, 3 * i, i, false);
        snprintf(name, sizeof name, "frozen.%04d.png", i);
        put_frame(name, 3, 1, false);
    }
    put_frame("holed.png", 0, 0, true);
    put_flow("flow.flo", 3, 1);
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    test_folder_remove(&g_folder);
    return 0;
}

static char *read_text(const char *name)
{
    size_t size = 0;
    char *data = (char *)test_file_read(test_folder_file(&g_folder, name), &size);
    assert_non_null(data);
    char *text = realloc(data, size + 1);
    assert_non_null(text);
    text[size] = '\0';
    return text;
}

/// `"member":NUMBER` behind the first `"name":{`; NaN for null.
static double summary_value(const char *json, const char *name, const char *member)
{
    char key[64];
    snprintf(key, sizeof key, "\n\"%s\":{", name);
    const char *at = strstr(json, key);
    assert_non_null(at);
    snprintf(key, sizeof key, "\"%s\":", member);
    at = strstr(at, key);
    assert_non_null(at);
    at += strlen(key);
    return strncmp(at, "null", 4) == 0 ? (double)NAN : strtod(at, NULL);
}

#define GOOD "measure good.%04d.png --flow flow.flo --exemplar good.0001.png --flow-every 1 --patch-every 2 -q "

static void frames_that_follow_the_flow_read_like_the_floor_and_frozen_ones_do_not(void **state)
{
    (void)state;
    expect(&g_folder, GOOD "--report good.json", 0);
    expect(&g_folder, "measure frozen.%04d.png --flow flow.flo --flow-every 1 -q --report frozen.json", 0);
    char *good = read_text("good.json"), *frozen = read_text("frozen.json");
    double error = summary_value(good, "flow-error", "mean");
    assert_true(error < 0.1);
    assert_true(summary_value(good, "flow-error", "ratio") < 2);
    assert_true(summary_value(good, "flicker", "mean") < 0.02);
    assert_true(summary_value(good, "holes", "mean") == 0);
    // One velocity everywhere.
    assert_true(summary_value(good, "divergence", "mean") == 0 && summary_value(good, "divergence", "count") == FRAMES);
    // What stands still misses the whole motion: the square root of 10.
    assert_true(fabs(summary_value(frozen, "flow-error", "mean") - sqrt(10)) < 0.1);
    assert_true(summary_value(frozen, "flow-error", "ratio") > 20);
    assert_true(summary_value(frozen, "flicker", "mean") > 0.5);
    // Without an exemplar there is nothing to compare with.
    assert_true(isnan(summary_value(frozen, "spectrum", "mean")));
    free(good);
    free(frozen);
}

/// The same as the command, by the library's own functions.
static void judge_here(RfMeasureFrame values[FRAMES], RfMeasureSummary *summary)
{
    RfFlow *flow = NULL;
    RfImage *exemplar = NULL;
    RfMeasure *measure = NULL;
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = 1;
    options.patch_every = 2;
    assert_int_equal(rf_flow_open(test_folder_file(&g_folder, "flow.flo"), NULL, &flow), RF_OK);
    assert_int_equal(rf_image_read(test_folder_file(&g_folder, "good.0001.png"), &exemplar), RF_OK);
    RfImageView view = rf_image_view(exemplar);
    assert_int_equal(rf_measure_create(&view, &options, &measure), RF_OK);
    for (int i = 1; i <= FRAMES; ++i)
    {
        char name[32];
        RfImage *frame = NULL;
        RfFlowView moment;
        snprintf(name, sizeof name, "good.%04d.png", i);
        assert_int_equal(rf_image_read(test_folder_file(&g_folder, name), &frame), RF_OK);
        assert_int_equal(rf_flow_at(flow, i, &moment), RF_OK);
        RfImageView pixels = rf_image_view(frame);
        assert_int_equal(rf_measure_step(measure, &moment, NULL, &pixels, &values[i - 1]), RF_OK);
        rf_image_destroy(frame);
    }
    rf_measure_summary(measure, summary);
    rf_measure_destroy(measure);
    rf_image_destroy(exemplar);
    rf_flow_close(flow);
}

static bool same_number(double a, double b)
{
    return a == b || (isnan(a) && isnan(b));
}

static void every_number_of_the_json_is_the_librarys_own(void **state)
{
    (void)state;
    RfMeasureFrame values[FRAMES];
    RfMeasureSummary summary;
    judge_here(values, &summary);
    expect(&g_folder, GOOD "--report numbers.json", 0);
    char *json = read_text("numbers.json");
    assert_true(json_is_well_formed(json, strlen(json)));
    int count = 0, known = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    const char *frame = strstr(json, "\"per_frame\":[");
    assert_non_null(frame);
    for (int f = 0; f < FRAMES; ++f)
    {
        char key[64];
        snprintf(key, sizeof key, "{\"frame\":%d,", f + 1);
        frame = strstr(frame, key);
        assert_non_null(frame);
        for (int q = 0; q < count; ++q)
        {
            double value = 0;
            memcpy(&value, (const char *)&values[f] + table[q].offset, sizeof value);
            snprintf(key, sizeof key, "\"%s\":", table[q].name);
            const char *at = strstr(frame, key) + strlen(key);
            assert_true(same_number(value, strncmp(at, "null", 4) == 0 ? (double)NAN : strtod(at, NULL)));
            known += isfinite(value);
        }
    }
    assert_true(known > 80);
    for (int q = 0; q < count; ++q)
    {
        assert_true(same_number(summary_value(json, table[q].name, "mean"), summary.quantities[q].mean));
        assert_true(same_number(summary_value(json, table[q].name, "worst"), summary.quantities[q].worst));
    }
    free(json);
}

static void the_report_is_the_same_for_any_number_of_threads(void **state)
{
    (void)state;
    static const char *const estimators[] = {"inverse-search", "lucas-kanade"};
    // So large that threads share them, at half resolution too.
    put_frame_of("large.1.png", 4 * N, 0, 0, false);
    put_frame_of("large.2.png", 4 * N, 12, 4, false);
    for (int i = 0; i < 2; ++i)
    {
        char line[256];
        for (int threads = 1; threads <= 3; threads += 2)
        {
            snprintf(line, sizeof line,
                     "measure large.%%d.png --flow flow.flo --exemplar good.0001.png --estimator %s -q -y --report "
                     "threads%d.json --threads %d",
                     estimators[i], threads, threads);
            expect(&g_folder, line, 0);
        }
        assert_same_file(&g_folder, "threads1.json", &g_folder, "threads3.json");
        char *json = read_text("threads1.json");
        assert_true(summary_value(json, "flow-error", "count") == 1 && summary_value(json, "flicker", "count") == 1);
        free(json);
    }
}

static void the_page_holds_everything_it_shows(void **state)
{
    (void)state;
    static const char *const absent[] = {"http:", "https:", "<script", "<link", "@import",
                                         "url(",  "srcset", "nan",     "inf "};
    static const char *const present[] = {
        "<!doctype html>", "Flow error", "Radial power spectrum", "Patch residual",        "Use of the exemplar",
        "</html>",         "flow-error", "prefers-color-scheme",  "Frame 4</b>, the last", ">divergence</td>"};
    expect(&g_folder, GOOD "--report page.html", 0);
    char *page = read_text("page.html");
    for (size_t i = 0; i < sizeof present / sizeof present[0]; ++i)
        if (!strstr(page, present[i]))
            fail_msg("the page has no %s", present[i]);
    int pictures = 0;
    for (char *at = page; (at = strstr(at, "src=\"")); ++at, ++pictures)
    {
        assert_true(strncmp(at, "src=\"data:image/png;base64,iVBOR", 32) == 0);
        // What follows are letters and digits, in which any word may turn up.
        memset(at + 5, ' ', strcspn(at + 5, "\""));
    }
    // Exemplar, three frames, three pairs of a frame and its errors, the use of the exemplar.
    assert_int_equal(pictures, 11);
    for (size_t i = 0; i < sizeof absent / sizeof absent[0]; ++i)
        if (strstr(page, absent[i]))
            fail_msg("the page has %s", absent[i]);
    free(page);
}

static void a_still_picture_is_judged_by_its_exemplar_alone(void **state)
{
    (void)state;
    CommandResult result = run_in(&g_folder, "measure good.0002.png --exemplar good.0001.png -q --report still.html");
    assert_int_equal(result.code, 0);
    assert_non_null(strstr(result.out, "good.0002.png: one frame, 96 x 96 pixels\n"));
    assert_non_null(strstr(result.out, "\nspectrum "));
    assert_non_null(strstr(result.out, "\npatch-share "));
    assert_null(strstr(result.out, "\npatch-share-floor "));
    assert_null(strstr(result.out, "\ndivergence "));
    assert_null(strstr(result.out, "\nflow-error "));
    assert_non_null(strstr(result.out, "Not judged: flow error and flicker (no --flow)\n"));
    assert_true(count_lines(result.out) <= 25);
    command_free(&result);
    // With a flow, but no second frame.
    expect_text(&g_folder, "measure good.0002.png --flow flow.flo", 0, "is one frame: flow error and flicker need two");
}

static void what_is_blank_is_a_hole_and_what_is_masked_is_none(void **state)
{
    (void)state;
    expect(&g_folder, "measure holed.png -q --report holes.json", 0);
    char *json = read_text("holes.json");
    assert_true(summary_value(json, "holes", "mean") == 24 * 24);
    assert_true(summary_value(json, "fluid", "mean") == N * N);
    free(json);
    // A mask of half the size whose corner is land.
    char pgm[64 + 48 * 48];
    int head = snprintf(pgm, sizeof pgm, "P5\n48 48\n255\n");
    for (int k = 0; k < 48 * 48; ++k)
        pgm[head + k] = (char)(k % 48 < 12 && k / 48 < 12 ? 0 : 255);
    assert_true(test_file_write(test_folder_file(&g_folder, "mask.pgm"), pgm, (size_t)head + 48 * 48));
    expect(&g_folder, "measure holed.png -q --mask mask.pgm --report masked.json", 0);
    json = read_text("masked.json");
    assert_true(summary_value(json, "holes", "mean") == 0);
    assert_true(summary_value(json, "fluid", "mean") == N * N - 24 * 24);
    free(json);
}

static void json_events_go_to_stderr_and_the_numbers_to_stdout(void **state)
{
    (void)state;
    CommandResult result = run_in(&g_folder, "measure good.%04d.png --flow flow.flo --json");
    assert_int_equal(result.code, 0);
    assert_json_lines(result.err);
    assert_non_null(strstr(result.err, "{\"event\":\"frame\",\"frame\":4,"));
    assert_non_null(strstr(result.err, "{\"event\":\"done\",\"frames\":4,"));
    assert_true(json_is_well_formed(result.out, strlen(result.out)));
    assert_non_null(strstr(result.out, "\"flow-error\":{"));
    assert_non_null(strstr(result.out, "\"divergence\":0"));
    command_free(&result);
}

static void a_report_that_is_there_stays_without_y(void **state)
{
    (void)state;
    assert_true(test_file_write(test_folder_file(&g_folder, "old.json"), "old", 3));
    expect_text(&g_folder, "measure good.0001.png --report old.json", 2, "old.json: exists; -y replaces it");
    expect_text(&g_folder, "measure good.0001.png --report new.json --report new.json", 2, "is a report twice");
    char *text = read_text("old.json");
    assert_string_equal(text, "old");
    free(text);
    expect(&g_folder, "measure good.0001.png --report old.json -y -q", 0);
    text = read_text("old.json");
    assert_true(json_is_well_formed(text, strlen(text)));
    free(text);
}

static void frames_pair_with_moments_by_number(void **state)
{
    (void)state;
    // From moment n - 1 to moment n the velocity grows from 2n - 2 to 2n pixels a frame: a path of 2n - 1.
    for (int n = 1, x = 0; n <= FRAMES; ++n)
    {
        char name[32];
        snprintf(name, sizeof name, "faster.%04d.flo", 10 + n);
        put_flow(name, (float)(2 * n), 0);
        x += n > 1 ? 2 * n - 1 : 0;
        snprintf(name, sizeof name, "faster.%04d.png", 10 + n);
        put_frame(name, x, 0, false);
    }
    expect(&g_folder,
           "measure faster.%04d.png --flow faster.%04d.flo --flow-every 1 --estimator lucas-kanade -q --report "
           "paired.json",
           0);
    expect(&g_folder, "measure faster.%04d.png --frames 13-14 --flow faster.%04d.flo -q --report late.json", 0);
    char *paired = read_text("paired.json"), *late = read_text("late.json");
    assert_true(summary_value(paired, "flow-error", "worst") < 0.05);
    assert_true(summary_value(paired, "flicker", "worst") < 0.01);
    assert_true(fabs(summary_value(paired, "flow-motion", "mean") - 5) < 1e-3);
    assert_true(fabs(summary_value(late, "flow-motion", "mean") - 7) < 1e-3);
    assert_true(summary_value(paired, "flow-error", "worst_frame") >= 12);
    assert_true(summary_value(late, "flow-error", "worst_frame") == 14);
    free(paired);
    free(late);
}

static void numbers_that_do_not_pair_are_told(void **state)
{
    (void)state;
    put_flow("moments.0003.flo", 3, 1);
    put_flow("moments.0004.flo", 3, 1);
    expect_text(&g_folder, "measure good.%04d.png --flow moments.%04d.flo --flow-every 0", 0,
                "has the frames 3 to 4, those to judge are 1 to 4");
    expect_text(&g_folder, "measure good.%04d.png --frames 1-2 --flow moments.%04d.flo", 3,
                "has the frames 1 to 2, but moments.%04d.flo has 3 to 4");
    expect_text(&g_folder, "measure good.%04d.png --frames 1-4x2 --flow moments.%04d.flo", 2, "leave x2 out");
    rename(test_folder_file(&g_folder, "good.0003.png"), test_folder_file(&g_folder, "away.png"));
    expect_text(&g_folder, "measure good.%04d.png --flow moments.%04d.flo", 3, "has no frame 3, between 2 and 4");
    expect_text(&g_folder, "measure good.%04d.png --exemplar good.0001.png", 0, "go from 2 to 4: is a frame missing?");
    rename(test_folder_file(&g_folder, "away.png"), test_folder_file(&g_folder, "good.0003.png"));
}

static void a_signal_ends_it_amid_a_frame_and_without_a_report(void **state)
{
    (void)state;
    // Two million candidates for each window: the first frame alone would take many seconds.
    Command command = command_start(PROGRAM, g_folder.path,
                                    "measure good.%04d.png --exemplar good.0001.png --patch-stride 1 --rotations 72 "
                                    "--half-pixel --report stopped.html",
                                    NULL);
    usleep(1500000);
    kill(command.pid, SIGTERM);
    CommandResult result = command_finish(&command);
    assert_int_equal(result.code, 143);
    assert_non_null(strstr(result.err, "stopped by signal 15 with 0 of 4 frames judged; nothing is written"));
    assert_string_equal(result.out, "");
    assert_false(exists(&g_folder, "stopped.html"));
    command_free(&result);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_that_follow_the_flow_read_like_the_floor_and_frozen_ones_do_not),
        cmocka_unit_test(every_number_of_the_json_is_the_librarys_own),
        cmocka_unit_test(the_report_is_the_same_for_any_number_of_threads),
        cmocka_unit_test(the_page_holds_everything_it_shows),
        cmocka_unit_test(a_still_picture_is_judged_by_its_exemplar_alone),
        cmocka_unit_test(what_is_blank_is_a_hole_and_what_is_masked_is_none),
        cmocka_unit_test(json_events_go_to_stderr_and_the_numbers_to_stdout),
        cmocka_unit_test(a_report_that_is_there_stays_without_y),
        cmocka_unit_test(frames_pair_with_moments_by_number),
        cmocka_unit_test(numbers_that_do_not_pair_are_told),
        cmocka_unit_test(a_signal_ends_it_amid_a_frame_and_without_a_report),
    };
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
