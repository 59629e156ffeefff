// SPDX-License-Identifier: Apache-2.0
// Still synthesis with its defaults, beside four other tools on the same eight exemplars (data/reference/peers).
#include "support/peers.h"
#include "support/sanitized.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    // Measures in which a tool may be better than Riffle on one exemplar.
    MOST_WINS = 1
};

// A collage has a perfect residual; this is what keeps that from counting.
static const double MOST_VERBATIM = 0.1;

static PeerTable g_table;
static double g_most_verbatim;

static int synthesise_all(void **state)
{
    (void)state;
    if (TEST_SANITIZED)
        return print_message("skipped: pictures are not judged under sanitizers\n"), 0;
    if (!peers_read(RF_SOURCE_DIR "/../shared/data", &g_table))
        return print_message("skipped: no quality.csv in %s; set RIFFLE_DATA\n", g_table.folder), 0;
    RfOptimizeOptions options = rf_optimize_defaults();
    int others = g_table.count;
    for (int i = 0; i < others; ++i)
    {
        PeerOwn own;
        if (peers_find(&g_table, g_table.rows[i].name, "riffle"))
            continue;
        if (peers_synthesise(&g_table, g_table.rows[i].name, &options, 1, &own) != RF_OK)
            return print_message("%s: %s\n", g_table.rows[i].name, rf_last_error()->message), 1;
        print_message("%-18s residual %6.2f  share %.3f  spectrum %.2f  verbatim %.3f  %.2f s\n", own.row.name,
                      own.row.values[0], own.row.values[1], own.row.values[2], own.verbatim, own.row.seconds);
        g_most_verbatim = own.verbatim > g_most_verbatim ? own.verbatim : g_most_verbatim;
        peers_add(&g_table, &own.row);
        rf_image_destroy(own.picture);
    }
    return 0;
}

static void no_tool_is_better_in_more_than_one_measure_on_any_exemplar(void **state)
{
    (void)state;
    if (g_table.count == 0)
        skip();
    int compared = 0, wrong = 0;
    for (int i = 0; i < g_table.count; ++i)
    {
        const PeerRow *row = &g_table.rows[i], *own = peers_find(&g_table, row->name, "riffle");
        assert_non_null(own);
        int wins = peers_wins(row, own);
        compared += row != own;
        if (wins <= MOST_WINS)
            continue;
        ++wrong;
        print_message("%s: %s is better in %d\n", row->name, row->tool, wins);
    }
    assert_true(compared >= 4 * 8);
    assert_int_equal(wrong, 0);
}

static void the_mean_rank_is_the_best(void **state)
{
    (void)state;
    if (g_table.count == 0)
        skip();
    double own = peers_mean_rank(&g_table, "riffle");
    print_message("riffle: mean rank %.2f\n", own);
    for (int i = 0; i < g_table.count; ++i)
        if (strcmp(g_table.rows[i].tool, "riffle") != 0)
            assert_true(peers_mean_rank(&g_table, g_table.rows[i].tool) > own);
}

static void hardly_anything_is_a_copy_of_large_pieces(void **state)
{
    (void)state;
    if (g_table.count == 0)
        skip();
    assert_true(g_most_verbatim <= MOST_VERBATIM);
}

// The measure of copies itself: all of a piece is one, none of it is once every window has been touched.
static void a_piece_of_an_exemplar_is_a_copy_and_a_changed_one_is_not(void **state)
{
    (void)state;
    enum
    {
        SIDE = 128
    };
    static float pixels[SIDE * SIDE], changed[SIDE * SIDE];
    for (int i = 0; i < SIDE * SIDE; ++i)
    {
        pixels[i] = (float)(i * 2654435761u >> 24) / 255;
        changed[i] = pixels[i] + (i % 2 ? 0.01f : -0.01f);
    }
    RfImageView exemplar = {pixels, SIDE, SIDE, 1, SIDE}, other = {changed, SIDE, SIDE, 1, SIDE};
    RfImageView piece = {pixels + 7 * SIDE + 3, 100, 90, 1, SIDE};
    assert_true(peers_verbatim(&exemplar, &piece) == 1);
    assert_true(peers_verbatim(&exemplar, &other) == 0);
    for (int i = 0; i < SIDE * SIDE; ++i)
        changed[i] = pixels[i] + (i % 2 ? 0.007f : -0.007f);
    assert_true(peers_verbatim(&exemplar, &other) == 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_piece_of_an_exemplar_is_a_copy_and_a_changed_one_is_not),
        cmocka_unit_test(no_tool_is_better_in_more_than_one_measure_on_any_exemplar),
        cmocka_unit_test(the_mean_rank_is_the_best),
        cmocka_unit_test(hardly_anything_is_a_copy_of_large_pieces),
    };
    return cmocka_run_group_tests_name("synthesis quality", tests, synthesise_all, NULL);
}
