// SPDX-License-Identifier: Apache-2.0
#include "core/options.h"
#include "core/result.h"
#include "methods/directional/directional.h"

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfDirectionalOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where the first patches come from in the exemplar is drawn from it."},
    {"rotations", RF_OPTION_INT, offsetof(RfDirectionalOptions, rotations), "", 4, 180, 24, NULL,
     "Turned copies of the exemplar, n. Texture that lies off the flow by more than 360 / n degrees is replaced: with "
     "more it lies closer along the flow, and more is replaced."},
    {"direction", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, direction), "degrees", -1, 360, -1, NULL,
     "The exemplar's main direction, which points downstream: 0 along its x axis, clockwise; below 0 it is found."},
    {"cell-min", RF_OPTION_INT, offsetof(RfDirectionalOptions, cell_min), "px", 2, 48, 4, NULL,
     "Least side of moving cells and of patches."},
    {"cell-max", RF_OPTION_INT, offsetof(RfDirectionalOptions, cell_max), "px", 2, 48, 32, NULL,
     "Greatest side of moving cells and of patches."},
    {"cells", RF_OPTION_CHOICE, offsetof(RfDirectionalOptions, cells), "", 0, 1, RF_CELLS_NEAR, "near|least",
     "Velocities in a moving cell differ from their mean by --velocity-spread at most, or by the least speed in it "
     "(the "
     "paper's rule)."},
    {"velocity-spread", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, velocity_spread), "px/frame", 0.05, 100, 0.5,
     NULL, "How far velocities in a moving cell may differ from their mean, with --cells near."},
    {"mask-width", RF_OPTION_INT, offsetof(RfDirectionalOptions, mask_width), "px", 1, 8, 4, NULL,
     "Pixels round a hole that a patch is matched with and fades into."},
    {"renew-after", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, renew_after), "", 0, 1000, 2, NULL,
     "A cell is replaced when its pixels were blended more often than this in the mean; 0: never."},
    {"speed-min", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, speed_min), "px/frame", 0, 1000, 0, NULL,
     "What moves slower moves as fast as this; 0: no limit."},
    {"speed-max", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, speed_max), "px/frame", 0, 1000, 0, NULL,
     "What moves faster moves as slowly as this; 0: no limit. Texture that moves by more than half a shape a frame "
     "seems to go backwards."},
    {"spread", RF_OPTION_FLOAT, offsetof(RfDirectionalOptions, spread), "", 0, 20, 1, NULL,
     "How dear patches are of a look that is shown too often already; 0: they are chosen by fit alone, as in the "
     "paper, and plain ones crowd out the others."},
    {"seam", RF_OPTION_CHOICE, offsetof(RfDirectionalOptions, seam), "", 0, 1, RF_SEAM_FEATHER, "feather|cut",
     "How patches meet in the first frame: they fade into each other, or are cut where they differ least."},
};

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_directional_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfDirectionalOptions rf_directional_defaults(void)
{
    return (RfDirectionalOptions){.struct_size = sizeof(RfDirectionalOptions),
                                  .seed = 1,
                                  .rotations = 24,
                                  .direction = -1,
                                  .cell_min = 4,
                                  .cell_max = 32,
                                  .velocity_spread = 0.5f,
                                  .mask_width = 4,
                                  .renew_after = 2,
                                  .spread = 1};
}

RfResult rf_directional_check(const RfDirectionalOptions *options)
{
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_directional_defaults", g_options,
                            OPTION_COUNT));
    RF_REQUIRE(options->cell_min <= options->cell_max, "cell-min: %d is more than cell-max %d", options->cell_min,
               options->cell_max);
    RF_REQUIRE(options->speed_max == 0 || options->speed_min <= options->speed_max,
               "speed-min: %g is more than speed-max %g", (double)options->speed_min, (double)options->speed_max);
    return RF_OK;
}
