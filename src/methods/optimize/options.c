// SPDX-License-Identifier: Apache-2.0
#include "core/options.h"
#include "core/result.h"
#include "methods/optimize/optimize.h"

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfOptimizeOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where the first windows start in the exemplar is drawn from it."},
    {"levels", RF_OPTION_INT, offsetof(RfOptimizeOptions, levels), "", 0, RF_SYNTHESIS_LEVELS, 0, NULL,
     "Levels of the pyramid; 0 picks them by the exemplar's size. More keep larger structures together."},
    {"windows", RF_OPTION_INTS, offsetof(RfOptimizeOptions, windows), "px", 5, RF_FIXED_SIDE, 17, "17,9",
     "Sides of the windows, odd, used one after the other on every level; large ones keep large structures together. "
     "In moving textures the first is the radius of the pieces; below 13 they are too small for most shapes."},
    {"iterations", RF_OPTION_INT, offsetof(RfOptimizeOptions, iterations), "", 1, 100, 6, NULL,
     "Of stills and first frames: search and assign steps with each window on the coarsest level; half as many on each "
     "finer one."},
    {"form", RF_OPTION_CHOICE, offsetof(RfOptimizeOptions, form), "", 0, 1, RF_FORM_DISCRETE, "discrete|mean",
     "Of stills: a pixel becomes one of the exemplar's (sharp), or the mean of what its windows say "
     "(smooth). Of moving textures: what the first frame is searched by; they show the exemplar's pixels."},
    {"spread", RF_OPTION_FLOAT, offsetof(RfOptimizeOptions, spread), "", 0, 10, 2, NULL,
     "Price of using one place of the exemplar more than others; 0 lets the result collapse to what fits itself best, "
     "above 4 what fits badly is taken for being new."},
    {"orient", RF_OPTION_CHOICE, offsetof(RfOptimizeOptions, orient), "", 0, 2, RF_ORIENT_FREE, "free|none|flow",
     "The exemplar is turned as the flow turns it, lies as it is, or its x axis points downstream."},
    {"search", RF_OPTION_CHOICE, offsetof(RfOptimizeOptions, search), "", 0, 1, RF_SEARCH_COHERENCE, "exact|coherence",
     "Of stills and first frames: all windows of the exemplar on every level, or k-coherent candidates on all but the "
     "coarsest."},
    {"similar", RF_OPTION_INT, offsetof(RfOptimizeOptions, similar), "", 1, RF_MAX_SIMILAR, 2, NULL,
     "Of stills and first frames: similar places listed for every pixel of the exemplar, as candidates of the "
     "k-coherent search."},
    {"tile", RF_OPTION_BOOL, offsetof(RfOptimizeOptions, tile), "", 0, 1, 0, NULL,
     "The result continues across its own borders."},
};

static_assert((int)RF_MAX_OPTIMIZE_WINDOWS == (int)RF_MAX_OPTION_INTS, "windows are an RF_OPTION_INTS");

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_optimize_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfOptimizeOptions rf_optimize_defaults(void)
{
    return (RfOptimizeOptions){.struct_size = sizeof(RfOptimizeOptions),
                               .seed = 1,
                               .windows = {17, 9},
                               .iterations = 6,
                               .spread = 2,
                               .search = RF_SEARCH_COHERENCE,
                               .similar = 2};
}

RfResult rf_optimize_check(const RfOptimizeOptions *options)
{
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_optimize_defaults", g_options,
                            OPTION_COUNT));
    for (int i = 0; i < RF_MAX_OPTIMIZE_WINDOWS && options->windows[i]; ++i)
        RF_REQUIRE(options->windows[i] % 2 == 1, "windows: %d is even; windows need a pixel in their middle",
                   options->windows[i]);
    return RF_OK;
}
