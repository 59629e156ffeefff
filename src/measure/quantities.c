// SPDX-License-Identifier: Apache-2.0
#include "measure/quantities.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define AT(field) offsetof(RfMeasureFrame, field)

static const RfMeasureQuantity g_quantities[] = {
    {"flow-error", "px", AT(flow.error), RF_MEASURE_LOWER_IS_BETTER, "flow-floor",
     "Mean end-point distance between the motion seen in the frames and the flow's."},
    {"flow-floor", "px", AT(flow.floor), RF_MEASURE_NEUTRAL, NULL,
     "The same where nothing is wrong: the previous frame against itself warped by the flow."},
    {"flow-ratio", "", AT(flow.ratio), RF_MEASURE_LOWER_IS_BETTER, NULL, "Flow error over its floor."},
    {"flow-exemplar-floor", "px", AT(flow.exemplar_floor), RF_MEASURE_NEUTRAL, NULL,
     "The same where nothing is wrong: the exemplar against itself warped by the flow."},
    {"flow-exemplar-ratio", "", AT(flow.exemplar_ratio), RF_MEASURE_LOWER_IS_BETTER, NULL,
     "Flow error over the exemplar's floor."},
    {"flow-motion", "px", AT(flow.motion), RF_MEASURE_NEUTRAL, NULL,
     "Mean motion of the flow from frame to frame: what the flow error of a frozen texture would be."},
    {"flow-pixels", "px", AT(flow.pixels), RF_MEASURE_NEUTRAL, NULL, "Pixels whose motion was judged."},

    {"flicker", "", AT(flicker.whole), RF_MEASURE_LOWER_IS_BETTER, "flicker-floor",
     "Rms difference from the previous frame carried by the flow, over the rms contrast."},
    {"flicker-floor", "", AT(flicker.floor), RF_MEASURE_NEUTRAL, NULL, "The same for carrying there and back."},
    {"flicker-ratio", "", AT(flicker.ratio), RF_MEASURE_LOWER_IS_BETTER, NULL, "Flicker over its floor."},
    {"flicker-block", "", AT(flicker.block), RF_MEASURE_LOWER_IS_BETTER, "flicker-block-floor",
     "The largest flicker of any block of 32 x 32 pixels: a pop."},
    {"flicker-block-floor", "", AT(flicker.block_floor), RF_MEASURE_NEUTRAL, NULL,
     "The largest of any block for carrying there and back."},
    {"flicker-block-x", "px", AT(flicker.block_x), RF_MEASURE_NEUTRAL, NULL, "Left border of that block."},
    {"flicker-block-y", "px", AT(flicker.block_y), RF_MEASURE_NEUTRAL, NULL, "Top border of that block."},

    {"spectrum", "dB", AT(spectrum.distance), RF_MEASURE_LOWER_IS_BETTER, "spectrum-floor",
     "Rms difference of the radial power spectra of frame and exemplar."},
    {"spectrum-floor", "dB", AT(spectrum.floor), RF_MEASURE_NEUTRAL, NULL,
     "The same between pairs of random crops of the exemplar."},
    {"spectrum-ratio", "", AT(spectrum.ratio), RF_MEASURE_LOWER_IS_BETTER, NULL, "Spectrum distance over its floor."},
    {"spectrum-pair-ratio", "", AT(spectrum.pair_ratio), RF_MEASURE_ONE_IS_BEST, NULL,
     "Distance of single crops of frame and exemplar over that of two of the exemplar."},

    {"patch", "levels", AT(patch.residual), RF_MEASURE_LOWER_IS_BETTER, "patch-floor",
     "Rms residual of the frame's windows to their nearest exemplar windows."},
    {"patch-missing", "levels", AT(patch.missing), RF_MEASURE_LOWER_IS_BETTER, "patch-floor",
     "Rms residual of the exemplar's windows to their nearest frame windows."},
    {"patch-share", "", AT(patch.share), RF_MEASURE_HIGHER_IS_BETTER, "patch-share-floor",
     "Effective fraction of the exemplar that the frame's windows come from."},
    {"patch-share-floor", "", AT(patch.share_floor), RF_MEASURE_NEUTRAL, NULL,
     "The same for the exemplar's windows and its other, not overlapping ones."},
    {"patch-floor", "levels", AT(patch.floor), RF_MEASURE_NEUTRAL, NULL,
     "Rms residual of the exemplar's windows to its other, not overlapping ones."},
    {"patch-ratio", "", AT(patch.ratio), RF_MEASURE_LOWER_IS_BETTER, NULL, "Patch residual over its floor."},
    {"patch-missing-ratio", "", AT(patch.missing_ratio), RF_MEASURE_LOWER_IS_BETTER, NULL,
     "Missing residual over the floor."},
    {"patch-windows", "", AT(patch.windows), RF_MEASURE_NEUTRAL, NULL, "Windows of the frame that were compared."},

    {"contrast", "", AT(contrast.luma), RF_MEASURE_ONE_IS_BEST, NULL,
     "Standard deviation of grey, frame over exemplar."},
    {"contrast-floor", "", AT(contrast.luma_floor), RF_MEASURE_NEUTRAL, NULL,
     "Mean distance from 1 of the contrast of crops of the exemplar against the whole."},
    {"contrast-1", "", AT(contrast.channel[0]), RF_MEASURE_ONE_IS_BEST, NULL, "The same, first channel."},
    {"contrast-2", "", AT(contrast.channel[1]), RF_MEASURE_ONE_IS_BEST, NULL, "The same, second channel."},
    {"contrast-3", "", AT(contrast.channel[2]), RF_MEASURE_ONE_IS_BEST, NULL, "The same, third channel."},
    {"brightness", "levels", AT(contrast.brightness), RF_MEASURE_ZERO_IS_BEST, NULL,
     "Difference of the mean greys, frame minus exemplar."},
    {"brightness-floor", "levels", AT(contrast.brightness_floor), RF_MEASURE_NEUTRAL, NULL,
     "Mean size of that difference between crops of the exemplar and the whole."},
    {"histogram", "levels", AT(contrast.histogram_mover), RF_MEASURE_LOWER_IS_BETTER, "histogram-floor",
     "Earth mover's distance of the histograms of grey."},
    {"histogram-floor", "levels", AT(contrast.mover_floor), RF_MEASURE_NEUTRAL, NULL,
     "The same of crops of the exemplar against the whole."},
    {"histogram-l1", "", AT(contrast.histogram_l1), RF_MEASURE_LOWER_IS_BETTER, "histogram-l1-floor",
     "Part of the pixels that would have to change their grey: half the L1 distance over 64 bins."},
    {"histogram-l1-floor", "", AT(contrast.l1_floor), RF_MEASURE_NEUTRAL, NULL,
     "The same of crops of the exemplar against the whole."},

    {"fluid", "px", AT(coverage.fluid), RF_MEASURE_NEUTRAL, NULL, "Pixels in the fluid."},
    {"holes", "px", AT(coverage.holes), RF_MEASURE_LOWER_IS_BETTER, NULL, "Fluid pixels with no texture."},
    {"holes-share", "", AT(coverage.share), RF_MEASURE_LOWER_IS_BETTER, NULL, "Their part of the fluid."},

    {"divergence", "", AT(divergence), RF_MEASURE_LOWER_IS_BETTER, NULL,
     "Of the flow itself, its rms over the rms speed: the part of its speed that a cell gains or loses."},
};

enum
{
    QUANTITIES = sizeof g_quantities / sizeof *g_quantities
};

_Static_assert((int)QUANTITIES <= (int)RF_MEASURE_MAX_QUANTITIES, "the summary has no room for them");

// Ratios whose mean is the ratio of two means, so that one frame with hardly any floor does not decide it.
static const struct
{
    const char *ratio, *over, *under;
} g_ratios[] = {
    {"flow-ratio", "flow-error", "flow-floor"},    {"flow-exemplar-ratio", "flow-error", "flow-exemplar-floor"},
    {"flicker-ratio", "flicker", "flicker-floor"}, {"spectrum-ratio", "spectrum", "spectrum-floor"},
    {"patch-ratio", "patch", "patch-floor"},       {"patch-missing-ratio", "patch-missing", "patch-floor"},
};

const RfMeasureQuantity *rf_measure_quantity_table(int *count)
{
    if (count)
        *count = QUANTITIES;
    return g_quantities;
}

static int index_of(const char *name)
{
    for (int i = 0; i < QUANTITIES; ++i)
        if (strcmp(g_quantities[i].name, name) == 0)
            return i;
    assert(!"a quantity's name is spelled alike everywhere");
    return 0;
}

static double value_of(const RfMeasureFrame *frame, int quantity)
{
    double value;
    memcpy(&value, (const uint8_t *)frame + g_quantities[quantity].offset, sizeof value);
    return value;
}

// The larger, the worse.
static double badness(RfMeasureSense sense, double value)
{
    switch (sense)
    {
    case RF_MEASURE_NEUTRAL:
    case RF_MEASURE_LOWER_IS_BETTER:
        return value;
    case RF_MEASURE_HIGHER_IS_BETTER:
        return -value;
    case RF_MEASURE_ONE_IS_BEST:
        // Half the contrast is as bad as twice as much.
        return value > 0 ? fabs(log(value)) : HUGE_VAL;
    case RF_MEASURE_ZERO_IS_BEST:
        return fabs(value);
    }
    return value;
}

void rf_measure_clear(RfMeasureFrame *frame)
{
    double nan = (double)NAN;
    for (int i = 0; i < QUANTITIES; ++i)
        memcpy((uint8_t *)frame + g_quantities[i].offset, &nan, sizeof nan);
    frame->index = nan;
}

void rf_measure_tally(RfMeasureTally *tally, const RfMeasureFrame *frame)
{
    for (int i = 0; i < QUANTITIES; ++i)
    {
        double value = value_of(frame, i);
        if (isnan(value))
            continue;
        RfMeasureSense sense = g_quantities[i].sense;
        if (tally->count[i] == 0 || badness(sense, value) > badness(sense, tally->worst[i]))
        {
            tally->worst[i] = value;
            tally->worst_frame[i] = (int64_t)frame->index;
        }
        tally->sum[i] += value;
        ++tally->count[i];
    }
}

void rf_measure_tally_summary(const RfMeasureTally *tally, RfMeasureSummary *out)
{
    for (int i = 0; i < RF_MEASURE_MAX_QUANTITIES; ++i)
    {
        bool any = i < QUANTITIES && tally->count[i] > 0;
        out->quantities[i] = any ? (RfMeasureStatistic){tally->count[i], tally->sum[i] / (double)tally->count[i],
                                                        tally->worst[i], tally->worst_frame[i]}
                                 : (RfMeasureStatistic){0, (double)NAN, (double)NAN, -1};
    }
    for (size_t r = 0; r < sizeof g_ratios / sizeof *g_ratios; ++r)
    {
        RfMeasureStatistic *ratio = &out->quantities[index_of(g_ratios[r].ratio)];
        if (ratio->count > 0)
            ratio->mean =
                out->quantities[index_of(g_ratios[r].over)].mean / out->quantities[index_of(g_ratios[r].under)].mean;
    }
}
