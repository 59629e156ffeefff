// SPDX-License-Identifier: Apache-2.0
#include "report.h"

#include <math.h>
#include <string.h>

/// Three digits that count, no exponent where none is needed; "" for what is not known.
static void format_number(double value, char *text, size_t size)
{
    double magnitude = fabs(value);
    if (isnan(value))
        snprintf(text, size, "%s", "");
    else if (magnitude >= 1e6 || (magnitude > 0 && magnitude < 1e-4))
        snprintf(text, size, "%.2e", value);
    else
    {
        int digits = magnitude >= 100 ? 0 : magnitude >= 10 ? 1 : magnitude >= 1 ? 2 : magnitude >= 0.1 ? 3 : 4;
        snprintf(text, size, "%.*f", value == 0 ? 0 : digits, value);
    }
}

static void print_row(const ReportRow *row)
{
    char line[256], frame[16], mean[32], floor[40] = "", number[32], ratio[32], worst[32];
    format_number(row->mean, mean, sizeof mean);
    format_number(row->floor, number, sizeof number);
    if (number[0])
        snprintf(floor, sizeof floor, "%s%s", row->spread ? "+-" : "", number);
    format_number(row->ratio, ratio, sizeof ratio);
    // Where all frames are alike none is the worst.
    bool differs = row->worst != row->mean;
    format_number(differs ? row->worst : (double)NAN, worst, sizeof worst);
    snprintf(frame, sizeof frame, "%d", row->worst_frame);
    int length = snprintf(line, sizeof line, "%-20s %9s %9s %9s %9s %7s  %s", row->quantity->name, mean, floor, ratio,
                          worst, differs ? frame : "", row->quantity->unit);
    while (length > 0 && line[length - 1] == ' ')
        line[--length] = '\0';
    puts(line);
}

void report_print_table(const Report *report)
{
    ReportRow rows[MAX_REPORT_ROWS];
    char heading[1024], missing[256];
    int count = report_rows(report, rows);
    report_heading(report, heading, sizeof heading);
    report_missing(report, missing, sizeof missing);
    printf("%s\n%-20s %9s %9s %9s %9s %7s  %s\n", heading, "measure", "mean", "floor", "ratio", "worst", "frame",
           "unit");
    for (int i = 0; i < count; ++i)
        print_row(&rows[i]);
    if (missing[0])
        printf("%s\n", missing);
}
