// SPDX-License-Identifier: Apache-2.0
// One page that needs nothing else: style, plots (inline SVG) and pictures (PNG in base64) are all in it.
#include "errors.h"
#include "report.h"
#include "svg_plot.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char g_style[] =
    ":root{color-scheme:light dark;--paper:#fff;--panel:#f5f7f9;--ink:#1b2430;--soft:#5a6675;--line:#d8dee6;"
    "--c0:#0a6a94;--c1:#c4531a;--c2:#6a4ba3;--c3:#2e7d4f;--c4:#a02c5a;--c5:#5a6675;--band:#0a6a9420}\n"
    "@media (prefers-color-scheme:dark){:root{--paper:#12161c;--panel:#1a2028;--ink:#e4e9ef;--soft:#98a4b3;"
    "--line:#2f3944;--c0:#5cbbe6;--c1:#f2955f;--c2:#b79cf0;--c3:#6fcf97;--c4:#f07fae;--c5:#98a4b3;--band:#5cbbe62e}}\n"
    "@media print{:root{color-scheme:light;--paper:#fff;--panel:#fff;--ink:#000;--soft:#444;--line:#bbb;--c0:#0a6a94;"
    "--c1:#c4531a;--c2:#6a4ba3;--c3:#2e7d4f;--c4:#a02c5a;--c5:#444;--band:#0a6a9420}body{font-size:10pt}}\n"
    "*{box-sizing:border-box}\n"
    "body{margin:0;background:var(--paper);color:var(--ink);font:15px/1.5 system-ui,-apple-system,'Segoe UI',Roboto,"
    "'Helvetica Neue',Arial,sans-serif}\n"
    "main{max-width:1100px;margin:0 auto;padding:32px 24px 56px}\n"
    "h1{font-size:25px;line-height:1.25;margin:0 0 2px;font-weight:650;letter-spacing:-.01em;overflow-wrap:anywhere}\n"
    "h2{font-size:18px;margin:40px 0 10px;font-weight:650;break-after:avoid}\n"
    "p{margin:0 0 12px;max-width:80ch}.note{margin-top:10px}.soft,figcaption,dt,footer{color:var(--soft)}\n"
    "dl{display:grid;grid-template-columns:max-content 1fr;gap:2px 18px;margin:14px 0 0}dd{margin:0;"
    "overflow-wrap:anywhere}\n"
    ".scroll{overflow-x:auto}\n"
    "table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}\n"
    "th{font-weight:600;color:var(--soft);font-size:13px;text-align:left;padding:6px 10px;border-bottom:2px solid "
    "var(--line)}\n"
    "td{padding:6px 10px;border-bottom:1px solid var(--line);vertical-align:top}tr{break-inside:avoid}\n"
    ".n{text-align:right;white-space:nowrap}td.name{font-weight:600;white-space:nowrap}td.what{color:var(--soft);"
    "font-size:13px;min-width:200px}\n"
    "td.unit{color:var(--soft);white-space:nowrap}\n"
    ".plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,420px),1fr));gap:16px}\n"
    ".plot{display:block;width:100%;height:auto;background:var(--panel);border-radius:8px;break-inside:avoid}"
    ".plot.wide{grid-column:1/-1}\n"
    "svg text{fill:var(--soft);font-size:12px;font-family:inherit}svg .title{fill:var(--ink);font-weight:600;"
    "font-size:13.5px}svg .legend{fill:var(--ink)}\n"
    ".end{text-anchor:end}.middle{text-anchor:middle}.grid{stroke:var(--line);stroke-width:1}"
    ".axis{stroke:var(--soft);stroke-width:1}\n"
    ".line{fill:none;stroke-width:1.8;stroke-linejoin:round}.floor{stroke-dasharray:5 4;stroke-width:1.4;opacity:.85}"
    ".band{fill:var(--band)}.swatch{stroke:var(--band);stroke-width:11}.reference{stroke:var(--soft);stroke-width:1;"
    "stroke-dasharray:1 3}\n"
    ".line.s0{stroke:var(--c0)}.line.s1{stroke:var(--c1)}.line.s2{stroke:var(--c2)}.line.s3{stroke:var(--c3)}"
    ".line.s4{stroke:var(--c4)}.line.s5{stroke:var(--c5)}\n"
    ".dot.s0{fill:var(--c0)}.dot.s1{fill:var(--c1)}.dot.s2{fill:var(--c2)}.dot.s3{fill:var(--c3)}.dot.s4{"
    "fill:var(--c4)}.dot.s5{fill:var(--c5)}\n"
    ".pictures{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,380px),1fr));gap:24px 16px;"
    "align-items:start}\n"
    "figure{margin:0;break-inside:avoid}figure img{display:block;max-width:100%;height:auto;border-radius:4px}"
    "figure img.map{background:var(--panel);image-rendering:pixelated}figcaption{font-size:13px;margin-top:6px}"
    "figcaption b{color:var(--ink);font-weight:600}\n"
    ".bar{display:block;width:360px;max-width:100%;margin-top:6px}.mark{stroke:var(--ink);stroke-width:1.5}\n"
    "details{margin-top:28px}summary{cursor:pointer;font-weight:600}details table{width:auto;margin-top:8px;"
    "font-size:13px}\n"
    "footer{margin-top:44px;font-size:13px;border-top:1px solid var(--line);padding-top:12px}\n";

void report_html_text(FILE *stream, const char *text)
{
    for (const unsigned char *c = (const unsigned char *)text; *c; ++c)
    {
        const char *entity = *c == '<'   ? "&lt;"
                             : *c == '>' ? "&gt;"
                             : *c == '&' ? "&amp;"
                             : *c == '"' ? "&quot;"
                             : *c < 32   ? " "
                                         : NULL;
        if (entity)
            fputs(entity, stream);
        else
            fputc(*c, stream);
    }
}

// ---- pictures ----------------------------------------------------------------------------------------------------

static void write_base64(FILE *stream, const unsigned char *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (size_t i = 0; i < size; i += 3)
    {
        size_t left = size - i;
        unsigned group = (unsigned)bytes[i] << 16 | (left > 1 ? (unsigned)bytes[i + 1] << 8 : 0) |
                         (left > 2 ? (unsigned)bytes[i + 2] : 0);
        char four[4] = {digits[group >> 18], digits[group >> 12 & 63], left > 1 ? digits[group >> 6 & 63] : '=',
                        left > 2 ? digits[group & 63] : '='};
        fwrite(four, 1, sizeof four, stream);
    }
}

/// The picture as an <img> that holds it, small ones shown at least `least` pixels wide.
static RfResult write_image(FILE *stream, const RfImage *image, const char *style, const char *what, int least)
{
    void *block = NULL;
    size_t size = 0;
    RfImageView view = rf_image_view(image);
    int zoom = (least + view.width - 1) / view.width > 1 ? (least + view.width - 1) / view.width : 1;
    RfResult result = rf_image_encode_png(image, &block, &size);
    if (result != RF_OK)
        return result;
    fprintf(stream, "<img class=\"%s\" width=\"%d\" height=\"%d\" alt=\"", style, zoom * view.width,
            zoom * view.height);
    report_html_text(stream, what);
    fputs("\" src=\"data:image/png;base64,", stream);
    write_base64(stream, block, size);
    fputs("\">\n", stream);
    rf_free(block);
    return RF_OK;
}

static RfResult write_figure(FILE *stream, const RfImage *image, const char *title, const char *text)
{
    if (!image)
        return RF_OK;
    fputs("<figure>", stream);
    RfResult result = write_image(stream, image, "picture", title, 0);
    fputs("<figcaption><b>", stream);
    report_html_text(stream, title);
    fputs("</b>", stream);
    report_html_text(stream, text);
    fputs("</figcaption></figure>\n", stream);
    return result;
}

/// The error's map beside the frame it is of.
static RfResult write_worst(const Report *report, const WorstShot *worst, FILE *stream)
{
    if (!worst->error)
        return RF_OK;
    char title[64], text[512];
    RfImage *painted = NULL;
    double full = gallery_full_scale(worst->error);
    RfResult result = gallery_paint(worst->error, full, &painted);
    if (result != RF_OK)
        return result;
    snprintf(title, sizeof title, "Frame %d", worst->shot.number);
    char floor[40] = "";
    if (isfinite(worst->floor_value))
        snprintf(floor, sizeof floor, " (floor %.3g)", worst->floor_value);
    snprintf(text, sizeof text, ", the worst in %s: %.3g %s%s.", worst->quantity, worst->value, worst->unit, floor);
    if (report->count > 1)
        result = write_figure(stream, worst->shot.image, title, text);
    fputs("<figure>", stream);
    if (result == RF_OK)
        result = write_image(stream, painted, "map", worst->title, 0);
    svg_colour_bar(stream, full, worst->unit, worst->floor_value, gallery_colour);
    fputs("<figcaption><b>", stream);
    report_html_text(stream, worst->title);
    snprintf(text, sizeof text, "</b> in frame %d. ", worst->shot.number);
    fputs(text, stream);
    report_html_text(stream, worst->sentence);
    fputs(" Brightest: that much or more; blank: not judged.</figcaption></figure>\n", stream);
    rf_image_destroy(painted);
    return result;
}

static RfResult write_use(FILE *stream, const Gallery *gallery)
{
    if (!gallery->used || !gallery->exemplar)
        return RF_OK;
    double full = 1;
    RfImage *painted = NULL;
    RfResult result = gallery_paint_use(gallery, &full, &painted);
    if (result != RF_OK)
        return result;
    fputs("<figure>", stream);
    result = write_image(stream, painted, "map", "Use of the exemplar", 240);
    svg_colour_bar(stream, full, "times the mean", (double)NAN, gallery_colour);
    fputs("<figcaption><b>Use of the exemplar.</b> How often windows of the frames matched each part of it; 1 is an "
          "even use, dark is never used.</figcaption></figure>\n",
          stream);
    rf_image_destroy(painted);
    return result;
}

static RfResult write_pictures(const Report *report, FILE *stream)
{
    static const char *const titles[GALLERY_SHOTS] = {", the first.", ", in the middle.", ", the last."};
    const Gallery *gallery = &report->gallery;
    char title[64];
    fputs("<h2>Pictures</h2>\n<div class=\"pictures\">\n", stream);
    RfResult result = write_figure(stream, gallery->exemplar, "Exemplar", ", in the scale of the frames.");
    for (int i = 0; i < GALLERY_SHOTS && result == RF_OK; ++i)
    {
        snprintf(title, sizeof title, "Frame %d", gallery->shots[i].number);
        result = write_figure(stream, gallery->shots[i].image, title, report->count > 1 ? titles[i] : ".");
    }
    fputs("</div>\n", stream);
    bool any = gallery->used;
    for (int i = 0; i < GALLERY_WORST; ++i)
        any = any || gallery->worst[i].error;
    if (!any)
        return result;
    fprintf(stream, "<h2>Where it is %s</h2>\n<div class=\"pictures\">\n", report->count > 1 ? "worst" : "off");
    for (int i = 0; i < GALLERY_WORST && result == RF_OK; ++i)
        result = write_worst(report, &gallery->worst[i], stream);
    if (result == RF_OK)
        result = write_use(stream, gallery);
    fputs("</div>\n", stream);
    return result;
}

// ---- numbers -----------------------------------------------------------------------------------------------------

static void write_number(FILE *stream, const char *before, double value)
{
    fputs("<td class=\"n\">", stream);
    if (isfinite(value))
        fprintf(stream, "%s%.3g", before, value);
    fputs("</td>", stream);
}

static void write_row(const ReportRow *row, FILE *stream)
{
    bool differs = row->worst != row->mean;
    fprintf(stream, "<tr><td class=\"name\">%s</td>", row->quantity->name);
    write_number(stream, "", row->mean);
    write_number(stream, row->spread ? "&plusmn;" : "", row->floor);
    write_number(stream, "", row->ratio);
    write_number(stream, "", differs ? row->worst : (double)NAN);
    fputs("<td class=\"n\">", stream);
    if (differs)
        fprintf(stream, "%d", row->worst_frame);
    fprintf(stream, "</td><td class=\"unit\">%s</td><td class=\"what\">", row->quantity->unit);
    report_html_text(stream, row->quantity->sentence);
    fputs("</td></tr>\n", stream);
}

static void write_table(const Report *report, FILE *stream)
{
    ReportRow rows[MAX_REPORT_ROWS];
    char missing[256];
    int count = report_rows(report, rows);
    fputs(
        "<h2>Summary</h2>\n<p class=\"soft\">Means over all frames judged. The floor is the same measure, in the same "
        "run, where nothing is wrong; the ratio to it compares across scenes, the bare number does not.</p>\n"
        "<div class=\"scroll\"><table>\n<thead><tr><th>measure</th><th class=\"n\">mean</th><th "
        "class=\"n\">floor</th><th class=\"n\">ratio</th><th class=\"n\">worst</th><th class=\"n\">frame</th>"
        "<th>unit</th><th>what it is</th></tr></thead>\n<tbody>\n",
        stream);
    for (int i = 0; i < count; ++i)
        write_row(&rows[i], stream);
    fputs("</tbody></table></div>\n", stream);
    report_missing(report, missing, sizeof missing);
    if (missing[0])
        fprintf(stream, "<p class=\"soft\">%s.</p>\n", missing);
}

static void write_input(FILE *stream, const char *name, const char *value)
{
    if (!value)
        return;
    fprintf(stream, "<dt>%s</dt><dd>", name);
    report_html_text(stream, value);
    fputs("</dd>", stream);
}

static void write_heading(const Report *report, FILE *stream)
{
    const Settings *settings = report->settings;
    int count = report->count;
    fputs("<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
          "content=\"width=device-width,initial-scale=1\">\n<title>Measures of ",
          stream);
    report_html_text(stream, settings->words[0]);
    fprintf(stream, "</title>\n<style>\n%s</style>\n</head>\n<body>\n<main>\n<h1>Measures of ", g_style);
    report_html_text(stream, settings->words[0]);
    fputs("</h1>\n<p class=\"soft\">", stream);
    if (count == 1)
        fprintf(stream, "One frame, number %d", report->numbers[0]);
    else
        fprintf(stream, "%d frames, %d to %d", count, report->numbers[0], report->numbers[count - 1]);
    fprintf(stream, ", %d &times; %d pixels</p>\n<dl>", report->width, report->height);
    write_input(stream, "Flow", settings->flow);
    write_input(stream, "Exemplar", settings->exemplar);
    write_input(stream, "Mask", settings->mask);
    fputs("</dl>\n", stream);
}

// ---- plots -------------------------------------------------------------------------------------------------------

/// A quantity over time, as `series` of a plot.
typedef struct Curve
{
    const char *quantity, *label;
    int colour;
    bool floor;
} Curve;

typedef struct TimePlot
{
    const char *title, *unit;
    bool from_zero;
    double reference;
    Curve curves[4];
} TimePlot;

static void write_time_plot(const Report *report, const TimePlot *wanted, const double *x, double *values, FILE *stream)
{
    Plot plot = {.title = wanted->title,
                 .x_label = "frame",
                 .y_label = wanted->unit,
                 .x_low = x[0],
                 .x_high = x[report->count - 1],
                 .from_zero = wanted->from_zero,
                 .reference = wanted->reference};
    bool any = false, zero = true;
    for (int c = 0; c < 4 && wanted->curves[c].quantity; ++c)
    {
        const Curve *curve = &wanted->curves[c];
        double *y = values + (size_t)c * (size_t)report->count;
        int quantity = report_quantity(curve->quantity);
        for (int i = 0; i < report->count; ++i)
        {
            y[i] = report_value(report, i, quantity);
            any = any || isfinite(y[i]);
            zero = zero && !(fabs(y[i]) > 0);
        }
        plot.series[plot.series_count++] = (PlotSeries){curve->label, curve->colour, curve->floor, x, y, report->count};
    }
    // What is 0 all the time, such as holes, is no picture.
    if (any && !zero)
        svg_plot(stream, &plot);
}

static int write_time_plots(const Report *report, FILE *stream)
{
    static const TimePlot plots[] = {
        {"Flow error",
         "pixels",
         true,
         NAN,
         {{"flow-error", "error", 0, false},
          {"flow-floor", "floor", 0, true},
          {"flow-exemplar-floor", "exemplar's floor", 2, true}}},
        {"Flicker",
         "of the contrast",
         true,
         NAN,
         {{"flicker", "whole", 0, false},
          {"flicker-floor", "floor", 0, true},
          {"flicker-block", "worst block", 1, false},
          {"flicker-block-floor", "floor", 1, true}}},
        {"Spectrum distance",
         "dB",
         true,
         NAN,
         {{"spectrum", "distance", 0, false}, {"spectrum-floor", "floor", 0, true}}},
        {"Patch distance",
         "grey levels",
         true,
         NAN,
         {{"patch", "frame to exemplar", 0, false},
          {"patch-missing", "exemplar to frame", 1, false},
          {"patch-floor", "floor", 0, true}}},
        {"Greys",
         "grey levels",
         true,
         NAN,
         {{"histogram", "distance of histograms", 0, false},
          {"histogram-floor", "floor", 0, true},
          {"brightness", "brightness", 1, false}}},
        {"Contrast",
         "frame over exemplar",
         false,
         1,
         {{"contrast", "grey", 5, false},
          {"contrast-1", "channel 1", 4, false},
          {"contrast-2", "channel 2", 3, false},
          {"contrast-3", "channel 3", 0, false}}},
        {"Holes", "share of the fluid", true, NAN, {{"holes-share", "without texture", 0, false}}},
    };
    if (report->count < 2)
        return CODE_DONE;
    size_t count = (size_t)report->count;
    double *x = malloc(5 * count * sizeof *x);
    if (!x)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    for (int i = 0; i < report->count; ++i)
        x[i] = report->numbers[i];
    fputs("<h2>Over time</h2>\n<div class=\"plots\">\n", stream);
    for (size_t i = 0; i < sizeof plots / sizeof plots[0]; ++i)
        write_time_plot(report, &plots[i], x, x + count, stream);
    fputs("</div>\n", stream);
    free(x);
    return CODE_DONE;
}

static void write_spectrum(const Report *report, FILE *stream)
{
    const RfMeasureSpectra *spectra = &report->spectra, *worst = &report->gallery.spectra;
    int first = spectra->first, count = spectra->crop ? spectra->last - first + 1 : 0;
    double x[RF_MEASURE_MAX_BINS + 1];
    char label[64];
    for (int k = 0; k < count; ++k)
        x[k] = (double)(first + k) / spectra->crop;
    Plot plot = {.title = "Radial power spectrum",
                 .x_label = "cycles a pixel",
                 .y_label = "dB",
                 .wide = true,
                 .logarithmic_x = true,
                 .x_low = (double)NAN,
                 .x_high = (double)NAN,
                 .reference = (double)NAN};
    plot.series[plot.series_count++] = (PlotSeries){
        report->count > 1 ? "mean of the frames" : "frame", 1, false, x, spectra->all_frames + first, count};
    snprintf(label, sizeof label, "frame %d, the farthest off", report->gallery.spectrum_number);
    if (worst->crop == spectra->crop && report->count > 1 && report->gallery.spectrum_distance >= 0)
        plot.series[plot.series_count++] = (PlotSeries){label, 4, true, x, worst->frame + first, count};
    if (report->settings->exemplar)
    {
        plot.series[plot.series_count++] = (PlotSeries){"exemplar", 0, false, x, spectra->exemplar + first, count};
        plot.band_label = "single crops of the exemplar";
        plot.band_x = x;
        plot.band_low = spectra->low + first;
        plot.band_high = spectra->high + first;
        plot.band_count = count;
    }
    if (count < 2)
        return;
    fputs("<h2>Frequencies</h2>\n<div class=\"plots\">\n", stream);
    svg_plot(stream, &plot);
    fputs("</div>\n<p class=\"soft note\">Below the exemplar at the right: blurred; above it: seams or noise. Crops of "
          "the "
          "exemplar itself lie within the band.</p>\n",
          stream);
}

// ---- the page ----------------------------------------------------------------------------------------------------

static void write_options(const Report *report, FILE *stream)
{
    int count = 0;
    const RfOption *table = rf_measure_option_table(&count);
    fputs("<details><summary>How it was measured</summary>\n<table>\n", stream);
    for (int i = 0; i < count; ++i)
    {
        fprintf(stream, "<tr><td class=\"name\">%s</td><td class=\"n\">", table[i].name);
        report_print_option(stream, &report->options, &table[i]);
        fprintf(stream, "</td><td class=\"unit\">%s</td><td class=\"what\">", table[i].unit);
        report_html_text(stream, table[i].sentence);
        fputs("</td></tr>\n", stream);
    }
    fputs("</table>\n</details>\n", stream);
}

int report_write_html(const Report *report, FILE *stream)
{
    write_heading(report, stream);
    write_table(report, stream);
    int code = write_time_plots(report, stream);
    write_spectrum(report, stream);
    RfResult result = code ? RF_OK : write_pictures(report, stream);
    write_options(report, stream);
    fprintf(stream, "<footer>riffle measure %s</footer>\n</main>\n</body>\n</html>\n", rf_version());
    return result == RF_OK ? code : fail_result(result, NULL);
}
