// SPDX-License-Identifier: Apache-2.0
// One object: inputs, options, what each quantity is, the summary, every frame, the spectra. What is not known is null.
#include "errors.h"
#include "report.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// The shortest of two forms that reads back as the same number.
static void print_number(FILE *stream, double value)
{
    char text[40];
    if (!isfinite(value))
    {
        fputs("null", stream);
        return;
    }
    snprintf(text, sizeof text, "%.15g", value);
    if (strtod(text, NULL) != value)
        snprintf(text, sizeof text, "%.17g", value);
    fputs(text, stream);
}

static void print_member(FILE *stream, const char *name, double value)
{
    print_json_text(stream, name);
    fputc(':', stream);
    print_number(stream, value);
}

static void print_input(FILE *stream, const char *name, const char *value)
{
    print_json_text(stream, name);
    fputc(':', stream);
    if (value)
        print_json_text(stream, value);
    else
        fputs("null", stream);
}

static void print_inputs(const Report *report, FILE *stream)
{
    const Settings *settings = report->settings;
    fputs("{\n\"riffle\":", stream);
    print_json_text(stream, rf_version());
    fputs(",\n\"inputs\":{", stream);
    print_input(stream, "frames", settings->words[0]);
    fputc(',', stream);
    print_input(stream, "flow", settings->flow);
    fputc(',', stream);
    print_input(stream, "exemplar", settings->exemplar);
    fputc(',', stream);
    print_input(stream, "mask", settings->mask);
    fprintf(stream,
            "},\n\"frames\":{\"count\":%d,\"first\":%d,\"last\":%d,\"width\":%d,\"height\":%d,\"channels\":%d},\n",
            report->count, report->numbers[0], report->numbers[report->count - 1], report->width, report->height,
            report->channels);
}

static void print_options(const Report *report, FILE *stream)
{
    int count = 0;
    const RfOption *table = rf_measure_option_table(&count);
    fputs("\"options\":{", stream);
    print_member(stream, "fps", report->settings->fps);
    fputc(',', stream);
    print_member(stream, "velocity-scale", report->settings->velocity_scale);
    fprintf(stream, ",\"moment-every\":%d", report->settings->moment_every);
    for (int i = 0; i < count; ++i)
    {
        bool named = table[i].kind == RF_OPTION_CHOICE;
        fprintf(stream, ",\"%s\":%s", table[i].name, named ? "\"" : "");
        report_print_option(stream, &report->options, &table[i]);
        fputs(named ? "\"" : "", stream);
    }
    fputs("},\n", stream);
}

/// With its floor and ratio where it has them.
static void print_statistic(const Report *report, int index, FILE *stream)
{
    static const char *const senses[] = {"neutral", "lower-is-better", "higher-is-better", "one-is-best",
                                         "zero-is-best"};
    const RfMeasureQuantity *quantity = &rf_measure_quantity_table(NULL)[index];
    const RfMeasureStatistic *statistic = &report->summary.quantities[index];
    int floor = report_quantity(quantity->floor);
    print_json_text(stream, quantity->name);
    fputs(":{", stream);
    print_member(stream, "mean", statistic->mean);
    if (floor >= 0)
    {
        double mean = report->summary.quantities[floor].mean;
        fputc(',', stream);
        print_member(stream, "floor", mean);
        fputc(',', stream);
        print_member(stream, "ratio", statistic->mean / mean);
    }
    fputc(',', stream);
    print_member(stream, "worst", statistic->worst);
    fputs(",\"worst_frame\":", stream);
    if (statistic->worst_frame >= 0)
        fprintf(stream, "%d", report->numbers[statistic->worst_frame]);
    else
        fputs("null", stream);
    fprintf(stream, ",\"count\":%lld,", (long long)statistic->count);
    print_json_member(stream, "unit", quantity->unit);
    fprintf(stream, ",\"sense\":\"%s\",", senses[quantity->sense]);
    print_json_member(stream, "sentence", quantity->sentence);
    fputc('}', stream);
}

static void print_summary(const Report *report, FILE *stream)
{
    int count = 0;
    rf_measure_quantity_table(&count);
    fputs("\"summary\":{\n", stream);
    for (int i = 0; i < count; ++i)
    {
        print_statistic(report, i, stream);
        fputs(i + 1 < count ? ",\n" : "\n},\n", stream);
    }
}

static void print_frames(const Report *report, FILE *stream)
{
    int count = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    fputs("\"per_frame\":[\n", stream);
    for (int f = 0; f < report->count; ++f)
    {
        fprintf(stream, "{\"frame\":%d", report->numbers[f]);
        for (int i = 0; i < count; ++i)
        {
            fputc(',', stream);
            print_member(stream, table[i].name, report_value(report, f, i));
        }
        fputs(f + 1 < report->count ? "},\n" : "}\n],\n", stream);
    }
}

static void print_bins(FILE *stream, const char *name, const RfMeasureSpectra *spectra, const double *values)
{
    fprintf(stream, ",\n\"%s\":[", name);
    for (int k = spectra->first; k <= spectra->last && spectra->crop; ++k)
    {
        if (k > spectra->first)
            fputc(',', stream);
        print_number(stream, values ? values[k] : (double)k / spectra->crop);
    }
    fputc(']', stream);
}

static void print_spectra(const RfMeasureSpectra *spectra, FILE *stream)
{
    fprintf(stream, "\"spectra\":{\"crop\":%d,\"unit\":\"dB\"", spectra->crop);
    print_bins(stream, "cycles_per_pixel", spectra, NULL);
    print_bins(stream, "frames", spectra, spectra->all_frames);
    print_bins(stream, "exemplar", spectra, spectra->exemplar);
    print_bins(stream, "exemplar_low", spectra, spectra->low);
    print_bins(stream, "exemplar_high", spectra, spectra->high);
    fputs("}\n}\n", stream);
}

void report_write_json(const Report *report, FILE *stream)
{
    print_inputs(report, stream);
    print_options(report, stream);
    print_summary(report, stream);
    print_frames(report, stream);
    print_spectra(&report->spectra, stream);
}
