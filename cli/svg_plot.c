// SPDX-License-Identifier: Apache-2.0
#include "svg_plot.h"
#include "report.h"

#include <math.h>
#include <string.h>

enum
{
    WIDTH = 480,
    WIDE = 980,
    HEIGHT = 262,
    LEFT = 52,
    RIGHT = 14,
    TOP = 62,
    BOTTOM = 40,
    MAX_TICKS = 16
};

/// Numbers to pixels.
typedef struct Axis
{
    double low, high, from, to;
    bool logarithmic;
} Axis;

static double place(const Axis *axis, double value)
{
    double a = axis->low, b = axis->high;
    if (axis->logarithmic)
    {
        a = log(a);
        b = log(b);
        value = log(value);
    }
    return axis->from + (value - a) / (b - a) * (axis->to - axis->from);
}

static void widen(double value, double *low, double *high)
{
    if (!isfinite(value))
        return;
    *low = fmin(*low, value);
    *high = fmax(*high, value);
}

/// 1, 2 or 5 times a power of ten.
static double tick_step(double range, int wanted)
{
    double raw = range / wanted, decade = pow(10, floor(log10(raw))), part = raw / decade;
    return decade * (part <= 1 ? 1 : part <= 2 ? 2 : part <= 5 ? 5 : 10);
}

static int linear_ticks(const Axis *axis, int wanted, bool whole, double ticks[MAX_TICKS])
{
    int count = 0;
    double step = tick_step(axis->high - axis->low, wanted);
    if (whole)
        step = fmax(step, 1);
    for (double k = ceil(axis->low / step - 1e-6); k * step <= axis->high + 1e-6 * step && count < MAX_TICKS; ++k)
        ticks[count++] = k * step + 0.0;
    return count;
}

static int logarithmic_ticks(const Axis *axis, double ticks[MAX_TICKS])
{
    static const double steps[] = {1, 2, 5};
    int count = 0;
    for (double decade = pow(10, floor(log10(axis->low))); decade <= axis->high && count < MAX_TICKS; decade *= 10)
        for (int i = 0; i < 3 && count < MAX_TICKS; ++i)
            if (decade * steps[i] >= axis->low * (1 - 1e-9) && decade * steps[i] <= axis->high * (1 + 1e-9))
                ticks[count++] = decade * steps[i];
    return count;
}

static Axis x_axis(const Plot *plot)
{
    Axis axis = {INFINITY, -INFINITY, LEFT, (plot->wide ? WIDE : WIDTH) - RIGHT, plot->logarithmic_x};
    for (int s = 0; s < plot->series_count; ++s)
        for (int i = 0; i < plot->series[s].count; ++i)
            if (isfinite(plot->series[s].y[i]))
                widen(plot->series[s].x[i], &axis.low, &axis.high);
    widen(plot->x_low, &axis.low, &axis.high);
    widen(plot->x_high, &axis.low, &axis.high);
    if (axis.low == axis.high && !axis.logarithmic)
    {
        axis.low -= 1;
        axis.high += 1;
    }
    return axis;
}

static Axis y_axis(const Plot *plot)
{
    Axis axis = {INFINITY, -INFINITY, HEIGHT - BOTTOM, TOP, false};
    for (int s = 0; s < plot->series_count; ++s)
        for (int i = 0; i < plot->series[s].count; ++i)
            widen(plot->series[s].y[i], &axis.low, &axis.high);
    for (int i = 0; i < plot->band_count; ++i)
    {
        widen(plot->band_low[i], &axis.low, &axis.high);
        widen(plot->band_high[i], &axis.low, &axis.high);
    }
    widen(plot->reference, &axis.low, &axis.high);
    if (plot->from_zero)
        axis.low = fmin(axis.low, 0);
    double room = 0.06 * (axis.high - axis.low);
    room = room > 0 ? room : fmax(0.1 * fabs(axis.high), 1e-3);
    axis.high += room;
    if (!plot->from_zero || axis.low < 0)
        axis.low -= room;
    return axis;
}

static void text_at(FILE *stream, double x, double y, const char *style, const char *text)
{
    fprintf(stream, "<text x=\"%.1f\" y=\"%.1f\" class=\"%s\">", x, y, style);
    report_html_text(stream, text);
    fputs("</text>\n", stream);
}

static void draw_axes(FILE *stream, const Plot *plot, const Axis *x, const Axis *y)
{
    double ticks[MAX_TICKS];
    char label[40];
    int count = linear_ticks(y, 4, false, ticks);
    for (int i = 0; i < count; ++i)
    {
        double at = place(y, ticks[i]);
        fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\" class=\"grid\"/>\n", x->from, x->to, at,
                at);
        snprintf(label, sizeof label, "%.4g", ticks[i]);
        text_at(stream, x->from - 7, at + 4, "tick end", label);
    }
    count = x->logarithmic ? logarithmic_ticks(x, ticks) : linear_ticks(x, plot->wide ? 10 : 6, true, ticks);
    for (int i = 0; i < count; ++i)
    {
        double at = place(x, ticks[i]);
        fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\" class=\"axis\"/>\n", at, at, HEIGHT - BOTTOM,
                HEIGHT - BOTTOM + 4);
        snprintf(label, sizeof label, "%.7g", ticks[i]);
        text_at(stream, at, HEIGHT - BOTTOM + 17, "tick middle", label);
    }
    fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%d\" y2=\"%d\" class=\"axis\"/>\n", x->from, x->to,
            HEIGHT - BOTTOM, HEIGHT - BOTTOM);
    text_at(stream, (x->from + x->to) / 2, HEIGHT - 6, "label middle", plot->x_label);
}

static void draw_band(FILE *stream, const Plot *plot, const Axis *x, const Axis *y)
{
    if (plot->band_count == 0)
        return;
    fputs("<path class=\"band\" d=\"", stream);
    char command = 'M';
    for (int i = 0; i < plot->band_count; ++i)
        if (isfinite(plot->band_low[i]) && isfinite(plot->band_high[i]))
        {
            fprintf(stream, "%c%.1f %.1f", command, place(x, plot->band_x[i]), place(y, plot->band_low[i]));
            command = 'L';
        }
    for (int i = plot->band_count - 1; i >= 0; --i)
        if (isfinite(plot->band_low[i]) && isfinite(plot->band_high[i]))
            fprintf(stream, "L%.1f %.1f", place(x, plot->band_x[i]), place(y, plot->band_high[i]));
    fputs("Z\"/>\n", stream);
}

static int known_points(const PlotSeries *series)
{
    int count = 0;
    for (int i = 0; i < series->count; ++i)
        count += isfinite(series->y[i]);
    return count;
}

static void draw_series(FILE *stream, const PlotSeries *series, const Axis *x, const Axis *y)
{
    // Single values are shown as points where there is room for them.
    const int sparse = 40;
    int known = known_points(series);
    if (known > 1)
    {
        fprintf(stream, "<path class=\"line s%d%s\" d=\"", series->colour, series->floor ? " floor" : "");
        char command = 'M';
        for (int i = 0; i < series->count; ++i)
            if (isfinite(series->y[i]))
            {
                fprintf(stream, "%c%.1f %.1f", command, place(x, series->x[i]), place(y, series->y[i]));
                command = 'L';
            }
        fputs("\"/>\n", stream);
    }
    for (int i = 0; i < series->count && known <= sparse && !series->floor; ++i)
        if (isfinite(series->y[i]))
            fprintf(stream, "<circle class=\"dot s%d\" cx=\"%.1f\" cy=\"%.1f\" r=\"2.4\"/>\n", series->colour,
                    place(x, series->x[i]), place(y, series->y[i]));
}

/// Of text of the legend's size: no measuring without the font, and a little too much does no harm.
static double text_width(const char *text)
{
    return 6.4 * (double)strlen(text);
}

static double legend_entry(FILE *stream, double x, const char *style, const char *label)
{
    fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"42\" y2=\"42\" class=\"%s\"/>\n", x, x + 20, style);
    text_at(stream, x + 26, 46, "legend", label);
    return x + 26 + text_width(label) + 14;
}

static void draw_legend(FILE *stream, const Plot *plot)
{
    double x = LEFT;
    char style[40];
    for (int s = 0; s < plot->series_count; ++s)
    {
        const PlotSeries *series = &plot->series[s];
        snprintf(style, sizeof style, "line s%d%s", series->colour, series->floor ? " floor" : "");
        if (known_points(series) > 0)
            x = legend_entry(stream, x, style, series->label);
    }
    if (plot->band_count > 0)
        legend_entry(stream, x, "swatch", plot->band_label);
}

void svg_plot(FILE *stream, const Plot *plot)
{
    Axis x = x_axis(plot), y = y_axis(plot);
    if (!(x.high > x.low) || !(y.high > y.low))
        return;
    int width = plot->wide ? WIDE : WIDTH;
    fprintf(stream, "<svg class=\"plot%s\" viewBox=\"0 0 %d %d\" role=\"img\" aria-label=\"", plot->wide ? " wide" : "",
            width, HEIGHT);
    report_html_text(stream, plot->title);
    fputs("\">\n", stream);
    text_at(stream, LEFT, 22, "title", plot->title);
    text_at(stream, width - RIGHT, 22, "label end", plot->y_label);
    draw_axes(stream, plot, &x, &y);
    draw_band(stream, plot, &x, &y);
    if (isfinite(plot->reference))
        fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"%.1f\" y2=\"%.1f\" class=\"reference\"/>\n", x.from, x.to,
                place(&y, plot->reference), place(&y, plot->reference));
    for (int s = plot->series_count - 1; s >= 0; --s)
        draw_series(stream, &plot->series[s], &x, &y);
    draw_legend(stream, plot);
    fputs("</svg>\n", stream);
}

void svg_colour_bar(FILE *stream, double full, const char *unit, double floor,
                    void (*colour)(double part, float rgb[3]))
{
    const int width = 360, bar = 220, steps = 55;
    const Axis axis = {0, full, 0, bar, false};
    char label[40];
    fprintf(stream, "<svg class=\"bar\" viewBox=\"0 0 %d 46\" role=\"img\" aria-label=\"0 to %g ", width, full);
    report_html_text(stream, unit);
    fputs("\">\n", stream);
    for (int i = 0; i < steps; ++i)
    {
        float rgb[3];
        colour((i + 0.5) / steps, rgb);
        // A little wider than the step, so that no gaps show.
        fprintf(stream, "<rect x=\"%d\" y=\"6\" width=\"%.1f\" height=\"12\" fill=\"rgb(%.0f,%.0f,%.0f)\"/>\n",
                i * bar / steps, (double)bar / steps + (i + 1 < steps ? 0.4 : 0), (double)rgb[0] * 255,
                (double)rgb[1] * 255, (double)rgb[2] * 255);
    }
    text_at(stream, 0, 32, "tick", "0");
    snprintf(label, sizeof label, "%.4g", full / 2);
    text_at(stream, bar / 2, 32, "tick middle", label);
    snprintf(label, sizeof label, "%.4g", full);
    text_at(stream, bar, 32, "tick end", label);
    text_at(stream, bar + 8, 17, "tick", unit);
    if (isfinite(floor) && floor >= 0 && floor <= full)
    {
        double at = place(&axis, floor);
        fprintf(stream, "<line x1=\"%.1f\" x2=\"%.1f\" y1=\"2\" y2=\"22\" class=\"mark\"/>\n", at, at);
        text_at(stream, at, 44, at < 30 ? "tick" : "tick middle", "floor");
    }
    fputs("</svg>\n", stream);
}
