// SPDX-License-Identifier: Apache-2.0
// The measures agree with figures computed elsewhere, by other code, for results of four other tools on eight
// exemplars (data/reference/peers/quality.csv): whoever is better there is better here.
#include "riffle/riffle.h"
#include "support/sanitized.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    // All tools on each exemplar; sanitizers see two.
    MAX_ROWS = TEST_SANITIZED ? 8 : 64,
    FEWEST_PAIRS = TEST_SANITIZED ? 30 : 100,
    VALUES = 3
};

static const char *const g_names[VALUES] = {"residual", "share", "spectrum"};
// Relative difference up to which two results count as equal.
static const double EQUAL = 0.03;
// Spectra that are both under it, in dB, count as equal: one crop of the exemplar alone is off by that much.
static const double SPECTRUM_FLOOR = 1;

typedef struct Row
{
    char name[32], tool[32];
    double theirs[VALUES], ours[VALUES];
} Row;

static Row g_rows[MAX_ROWS];
static int g_count;
static char g_folder[1024];

static int read_table(void **state)
{
    (void)state;
    const char *data = getenv("RIFFLE_DATA");
    char path[1200];
    snprintf(g_folder, sizeof g_folder, "%s/reference/peers", data ? data : RF_SOURCE_DIR "/../shared/data");
    snprintf(path, sizeof path, "%s/quality.csv", g_folder);
    FILE *file = fopen(path, "r");
    if (!file)
        return 0;
    char line[256];
    while (g_count < MAX_ROWS && fgets(line, sizeof line, file))
    {
        Row *r = &g_rows[g_count];
        g_count += sscanf(line, "%31[^,],%31[^,],%lf,%lf,%lf", r->name, r->tool, &r->theirs[0], &r->theirs[1],
                          &r->theirs[2]) == 5;
    }
    fclose(file);
    return 0;
}

static RfImage *read_image(const char *name, const char *file)
{
    char path[1200];
    RfImage *image = NULL;
    snprintf(path, sizeof path, "%s/%s/%s.png", g_folder, name, file);
    assert_int_equal(rf_image_read(path, &image), RF_OK);
    return image;
}

// Their windows: 9 x 9 in colour at multiples of 8; their spectra: crops as large as the exemplar, from ring 2 on.
static void judge_row(Row *r)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_stride = 8;
    options.spectrum_crop = 128;
    options.spectrum_first = 2;
    RfImage *exemplar = read_image(r->name, "exemplar"), *result = read_image(r->name, r->tool);
    RfImageView from = rf_image_view(exemplar), frame = rf_image_view(result);
    RfMeasure *measure = NULL;
    RfMeasureFrame m;
    assert_int_equal(rf_measure_create(&from, &options, &measure), RF_OK);
    assert_int_equal(rf_measure_step(measure, NULL, NULL, &frame, &m), RF_OK);
    assert_true(m.patch.windows == 63 * 63);
    r->ours[0] = m.patch.residual;
    r->ours[1] = m.patch.share;
    r->ours[2] = m.spectrum.distance;
    print_message(
        "%-18s %-9s residual %6.2f (%6.2f)  share %.3f (%.3f)  spectrum %.2f (%.2f)  missing %.2f floor %.2f\n",
        r->name, r->tool, r->ours[0], r->theirs[0], r->ours[1], r->theirs[1], r->ours[2], r->theirs[2], m.patch.missing,
        m.patch.floor);
    rf_measure_destroy(measure);
    rf_image_destroy(exemplar);
    rf_image_destroy(result);
}

// -1, 0 or 1: which is the larger.
static int order(int value, double a, double b)
{
    if (fabs(a - b) <= EQUAL * fmax(fabs(a), fabs(b)) || (value == 2 && a < SPECTRUM_FLOOR && b < SPECTRUM_FLOOR))
        return 0;
    return a < b ? -1 : 1;
}

static void every_pair_of_results_is_in_the_order_that_others_found(void **state)
{
    (void)state;
    if (g_count == 0)
        skip();
    for (int i = 0; i < g_count; ++i)
        judge_row(&g_rows[i]);
    int pairs = 0, wrong = 0;
    for (int i = 0; i < g_count; ++i)
        for (int j = 0; j < i; ++j)
            for (int v = 0; v < VALUES && strcmp(g_rows[i].name, g_rows[j].name) == 0; ++v)
            {
                int theirs = order(v, g_rows[i].theirs[v], g_rows[j].theirs[v]);
                int ours = order(v, g_rows[i].ours[v], g_rows[j].ours[v]);
                ++pairs;
                // Equal for one of the two is no contradiction.
                if (theirs * ours >= 0)
                    continue;
                ++wrong;
                print_message("%s: %s of %s and %s: %g %g here, %g %g there\n", g_rows[i].name, g_names[v],
                              g_rows[i].tool, g_rows[j].tool, g_rows[i].ours[v], g_rows[j].ours[v], g_rows[i].theirs[v],
                              g_rows[j].theirs[v]);
            }
    print_message("%d comparisons, %d in another order\n", pairs, wrong);
    assert_true(pairs >= FEWEST_PAIRS);
    assert_int_equal(wrong, 0);
}

// The windows are defined alike, so that the numbers are too.
static void residuals_and_shares_are_theirs_to_half_a_percent(void **state)
{
    (void)state;
    if (g_count == 0)
        skip();
    for (int i = 0; i < g_count; ++i)
    {
        assert_true(fabs(g_rows[i].ours[0] - g_rows[i].theirs[0]) < 0.005 * g_rows[i].theirs[0] + 0.005);
        assert_true(fabs(g_rows[i].ours[1] - g_rows[i].theirs[1]) < 0.005);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_pair_of_results_is_in_the_order_that_others_found),
        cmocka_unit_test(residuals_and_shares_are_theirs_to_half_a_percent),
    };
    return cmocka_run_group_tests_name("measure peers", tests, read_table, NULL);
}
