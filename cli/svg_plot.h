// SPDX-License-Identifier: Apache-2.0
// Line plots as inline SVG. Colours and fonts come from the page's style sheet, so that a plot is as light or dark as
// the page: classes "s0" to "s5" are the series, "floor" is dashed, "band" an area.
#pragma once

#include <stdbool.h>
#include <stdio.h>

enum
{
    PLOT_SERIES = 6
};

typedef struct PlotSeries
{
    const char *label;
    /// The colour: 0 to 5.
    int colour;
    /// Drawn dashed: what the series of the same colour is read against.
    bool floor;
    /// Points whose y is NaN are left out, and the line goes on behind them.
    const double *x, *y;
    int count;
} PlotSeries;

typedef struct Plot
{
    const char *title, *x_label, *y_label;
    /// The whole width of the page instead of half of it.
    bool wide;
    bool logarithmic_x;
    /// The least range of x; NaN where the points decide.
    double x_low, x_high;
    /// The y axis begins at 0.
    bool from_zero;
    PlotSeries series[PLOT_SERIES];
    int series_count;
    /// An area behind the lines; band_count 0: none.
    const char *band_label;
    const double *band_x, *band_low, *band_high;
    int band_count;
    /// A thin line at this height, NaN: none.
    double reference;
} Plot;

/// Writes <svg>...</svg>; nothing if no point is known.
void svg_plot(FILE *stream, const Plot *plot);

/// A colour bar of `stops` CSS colours (written by `colour`) from 0 to `full`, with a mark where `floor` is (NaN:
/// none).
void svg_colour_bar(FILE *stream, double full, const char *unit, double floor,
                    void (*colour)(double part, float rgb[3]));
