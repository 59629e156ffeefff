// SPDX-License-Identifier: Apache-2.0
// Rows and headings that all forms of a report share, and the files they go to.
#include "report.h"
#include "errors.h"
#include "inputs.h"
#include "pattern.h"
#include "text.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int report_quantity(const char *name)
{
    int count = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    for (int i = 0; i < count && name; ++i)
        if (strcmp(table[i].name, name) == 0)
            return i;
    return -1;
}

double report_value(const Report *report, int frame, int quantity)
{
    double value = 0;
    memcpy(&value, (const char *)&report->values[frame] + rf_measure_quantity_table(NULL)[quantity].offset,
           sizeof value);
    return value;
}

/// What the column of ratios says already.
static bool is_ratio_column(const char *name)
{
    static const char ratios[] = "flow-ratio|flicker-ratio|spectrum-ratio|patch-ratio|patch-missing-ratio";
    return text_choice(ratios, name) >= 0;
}

/// The floor's index; `spread` where it tells how far from 1 or 0 a good value may be.
static int floor_of(const RfMeasureQuantity *quantity, bool *spread)
{
    char name[64];
    *spread =
        !quantity->floor && (quantity->sense == RF_MEASURE_ONE_IS_BEST || quantity->sense == RF_MEASURE_ZERO_IS_BEST);
    snprintf(name, sizeof name, "%s-floor", quantity->name);
    return report_quantity(*spread ? name : quantity->floor);
}

int report_rows(const Report *report, ReportRow rows[MAX_REPORT_ROWS])
{
    int count = 0, kept = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    for (int i = 0; i < count; ++i)
    {
        const RfMeasureStatistic *statistic = &report->summary.quantities[i];
        if (statistic->count == 0 || table[i].sense == RF_MEASURE_NEUTRAL || is_ratio_column(table[i].name))
            continue;
        ReportRow *row = &rows[kept++];
        *row = (ReportRow){.quantity = &table[i], .index = i, .mean = statistic->mean, .worst = statistic->worst};
        row->worst_frame = report->numbers[statistic->worst_frame];
        row->floor_index = floor_of(&table[i], &row->spread);
        row->floor = row->floor_index < 0 ? (double)NAN : report->summary.quantities[row->floor_index].mean;
        row->ratio = row->spread ? (double)NAN : row->mean / row->floor;
    }
    return kept;
}

void report_heading(const Report *report, char *text, size_t size)
{
    int count = report->count;
    char which[96];
    if (count == 1)
        snprintf(which, sizeof which, "one frame");
    else
        snprintf(which, sizeof which, "%d frames, %d to %d", count, report->numbers[0], report->numbers[count - 1]);
    snprintf(text, size, "%s: %s, %d x %d pixels", report->settings->words[0], which, report->width, report->height);
}

void report_missing(const Report *report, char *text, size_t size)
{
    const Settings *settings = report->settings;
    bool no_motion = !settings->flow || report->count < 2;
    const char *motion = !settings->flow ? "flow error and flicker (no --flow)" : "flow error and flicker (one frame)";
    snprintf(text, size, "%s%s%s%s", no_motion || !settings->exemplar ? "Not judged: " : "", no_motion ? motion : "",
             no_motion && !settings->exemplar ? "; " : "",
             settings->exemplar ? "" : "spectrum, patches and contrast (no --exemplar)");
}

void report_print_option(FILE *stream, const RfMeasureOptions *options, const RfOption *option)
{
    const char *field = (const char *)options + option->offset;
    int whole = 0;
    uint64_t wide = 0;
    float single = 0;
    memcpy(&whole, field, option->kind == RF_OPTION_BOOL ? sizeof(bool) : sizeof whole);
    switch (option->kind)
    {
    case RF_OPTION_FLOAT:
        memcpy(&single, field, sizeof single);
        fprintf(stream, "%.9g", (double)single);
        break;
    case RF_OPTION_UINT64:
        memcpy(&wide, field, sizeof wide);
        fprintf(stream, "%llu", (unsigned long long)wide);
        break;
    case RF_OPTION_BOOL:
        fputs(*(const bool *)field ? "true" : "false", stream);
        break;
    case RF_OPTION_INT:
        fprintf(stream, "%d", whole);
        break;
    case RF_OPTION_CHOICE:
    {
        const char *at = option->choices;
        for (int i = 0; i < whole && strchr(at, '|'); ++i)
            at = strchr(at, '|') + 1;
        fprintf(stream, "%.*s", (int)strcspn(at, "|"), at);
        break;
    }
    case RF_OPTION_INTS: // the measures have none
        fputs("null", stream);
        break;
    }
}

// ---- files -------------------------------------------------------------------------------------------------------

static int check_file(const Settings *settings, const char *path, const InputFiles *inputs)
{
    struct stat status;
    char folder[PATH_SIZE];
    int length = (int)(text_base_name(path) - path);
    if (strlen(path) + 32 >= PATH_SIZE)
        return fail(CODE_USAGE, NULL, NULL, "--report: a name is longer than %d characters", PATH_SIZE - 32);
    snprintf(folder, sizeof folder, "%.*s", length, path);
    if (stat(length ? folder : ".", &status) != 0)
        return fail(CODE_FAILED, path, NULL, "cannot be written: %s%s", strerror(errno),
                    errno == ENOENT ? "; make its folder first" : "");
    if (lstat(path, &status) != 0)
        return CODE_DONE;
    if (inputs_contain(inputs, path))
        return fail(CODE_USAGE, path, NULL, "is an input of this run and is never replaced; choose another name");
    if (S_ISDIR(status.st_mode))
        return fail(CODE_USAGE, path, NULL, "is a directory; name a file");
    return settings->replace ? CODE_DONE : fail(CODE_USAGE, path, NULL, "exists; -y replaces it");
}

int report_check_files(const Settings *settings, const char *const *inputs, int input_count)
{
    InputFiles files = {0};
    int code = CODE_DONE;
    for (int i = 0; i < input_count; ++i)
        if (inputs[i])
            inputs_add(&files, inputs[i], FLOW_EXTENSIONS "," IMAGE_EXTENSIONS);
    for (int i = 0; i < settings->report_count && !code; ++i)
    {
        code = check_file(settings, settings->reports[i], &files);
        for (int j = 0; j < i && !code; ++j)
            if (strcmp(settings->reports[i], settings->reports[j]) == 0)
                code = fail(CODE_USAGE, settings->reports[i], NULL, "is a report twice");
    }
    inputs_free(&files);
    return code;
}

static int write_failed(const char *path)
{
    return fail(CODE_FAILED, path, NULL, "cannot be written: %s", strerror(errno));
}

static int write_file(const Report *report, const char *path)
{
    char temporary[PATH_SIZE + 64];
    int folder = (int)(text_base_name(path) - path);
    snprintf(temporary, sizeof temporary, "%.*s.tmp%ld.%s", folder, path, (long)getpid(), path + folder);
    FILE *stream = fopen(temporary, "wbe");
    if (!stream)
        return write_failed(path);
    int code = CODE_DONE;
    if (text_extension_in(path, "json"))
        report_write_json(report, stream);
    else
        code = report_write_html(report, stream);
    if (!code && (fflush(stream) != 0 || ferror(stream) || fsync(fileno(stream)) != 0))
        code = write_failed(path);
    if (fclose(stream) != 0 && !code)
        code = write_failed(path);
    if (!code && rename(temporary, path) != 0)
        code = write_failed(path);
    if (code)
        unlink(temporary);
    return code;
}

int report_write_files(const Report *report)
{
    int code = CODE_DONE;
    for (int i = 0; i < report->settings->report_count && !code; ++i)
        code = write_file(report, report->settings->reports[i]);
    return code;
}
