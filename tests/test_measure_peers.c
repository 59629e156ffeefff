// SPDX-License-Identifier: Apache-2.0
// The measures agree with figures computed elsewhere, by other code, for results of four other tools on eight
// exemplars (data/reference/peers/quality.csv): whoever is better there is better here.
#include "support/peers.h"
#include "support/sanitized.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static PeerTable g_theirs, g_ours;

enum
{
    // All tools on each exemplar; sanitizers see two.
    MOST_ROWS = TEST_SANITIZED ? 8 : 64,
    FEWEST_PAIRS = TEST_SANITIZED ? 30 : 100
};

static int read_table(void **state)
{
    (void)state;
    if (!peers_read(RF_SOURCE_DIR "/../shared/data", &g_theirs))
        print_message("no quality.csv in %s: set RIFFLE_DATA\n", g_theirs.folder);
    g_theirs.count = g_theirs.count > MOST_ROWS ? MOST_ROWS : g_theirs.count;
    g_ours = g_theirs;
    return 0;
}

static void judge_row(const PeerRow *theirs, PeerRow *ours)
{
    RfImage *exemplar = NULL, *result = NULL;
    assert_int_equal(peers_image(&g_theirs, theirs->name, "exemplar", &exemplar), RF_OK);
    assert_int_equal(peers_image(&g_theirs, theirs->name, theirs->tool, &result), RF_OK);
    RfImageView from = rf_image_view(exemplar), frame = rf_image_view(result);
    RfMeasureFrame m;
    assert_int_equal(peers_judge(&from, &frame, &m), RF_OK);
    assert_true(m.patch.windows == 63 * 63);
    ours->values[0] = m.patch.residual;
    ours->values[1] = m.patch.share;
    ours->values[2] = m.spectrum.distance;
    print_message(
        "%-18s %-9s residual %6.2f (%6.2f)  share %.3f (%.3f)  spectrum %.2f (%.2f)  missing %.2f floor %.2f\n",
        theirs->name, theirs->tool, ours->values[0], theirs->values[0], ours->values[1], theirs->values[1],
        ours->values[2], theirs->values[2], m.patch.missing, m.patch.floor);
    rf_image_destroy(exemplar);
    rf_image_destroy(result);
}

static void every_pair_of_results_is_in_the_order_that_others_found(void **state)
{
    (void)state;
    if (g_theirs.count == 0)
        skip();
    for (int i = 0; i < g_theirs.count; ++i)
        judge_row(&g_theirs.rows[i], &g_ours.rows[i]);
    int pairs = 0, wrong = 0;
    for (int i = 0; i < g_theirs.count; ++i)
        for (int j = 0; j < i; ++j)
            for (int v = 0; v < PEER_MEASURES && strcmp(g_theirs.rows[i].name, g_theirs.rows[j].name) == 0; ++v)
            {
                const PeerRow *a = &g_ours.rows[i], *b = &g_ours.rows[j];
                int theirs = peers_compare(v, &g_theirs.rows[i], &g_theirs.rows[j]);
                ++pairs;
                // Equal for one of the two is no contradiction.
                if (theirs * peers_compare(v, a, b) >= 0)
                    continue;
                ++wrong;
                print_message("%s: %s of %s and %s: %g %g here, %g %g there\n", a->name, peer_measures[v], a->tool,
                              b->tool, a->values[v], b->values[v], g_theirs.rows[i].values[v],
                              g_theirs.rows[j].values[v]);
            }
    print_message("%d comparisons, %d in another order\n", pairs, wrong);
    assert_true(pairs >= FEWEST_PAIRS);
    assert_int_equal(wrong, 0);
}

// The windows are defined alike, so that the numbers are too.
static void residuals_and_shares_are_theirs_to_half_a_percent(void **state)
{
    (void)state;
    if (g_theirs.count == 0)
        skip();
    for (int i = 0; i < g_theirs.count; ++i)
    {
        const double *theirs = g_theirs.rows[i].values, *ours = g_ours.rows[i].values;
        assert_true(fabs(ours[0] - theirs[0]) < 0.005 * theirs[0] + 0.005);
        assert_true(fabs(ours[1] - theirs[1]) < 0.005);
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
