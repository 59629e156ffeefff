// SPDX-License-Identifier: Apache-2.0
// What `riffle measure` found, and the ways to tell it: a table for the terminal, JSON, a page.
#pragma once

#include "options.h"
#include "report_gallery.h"

#include <stdio.h>

typedef struct Report
{
    const Settings *settings;
    RfMeasureOptions options;
    int width, height, channels;
    /// Frames judged, their numbers, and what each gave.
    int count;
    int *numbers;
    RfMeasureFrame *values;
    RfMeasureSummary summary;
    RfMeasureSpectra spectra;
    Gallery gallery;
} Report;

/// One measure, its floor beside it.
typedef struct ReportRow
{
    const RfMeasureQuantity *quantity;
    /// Index of the quantity and of its floor in the table; no floor: -1.
    int index, floor_index;
    /// The floor is a distance from what is best, not a value of the same kind.
    bool spread;
    double mean, floor, ratio, worst;
    /// A frame's number, not its index.
    int worst_frame;
} ReportRow;

enum
{
    MAX_REPORT_ROWS = RF_MEASURE_MAX_QUANTITIES
};

/// The measures that could be computed for any frame, without floors and what the ratio column says anyway.
int report_rows(const Report *report, ReportRow rows[MAX_REPORT_ROWS]);
/// Index in the table of quantities, -1 if there is none of the name.
int report_quantity(const char *name);
/// The index-th frame's value of a quantity.
double report_value(const Report *report, int frame, int quantity);
/// "a.%04d.png: 60 frames, 1 to 60, 512 x 512 pixels".
void report_heading(const Report *report, char *text, size_t size);
/// What could not be judged and why, one line; empty where nothing is missing.
void report_missing(const Report *report, char *text, size_t size);

/// The field's value: a number, true or false, or a choice's name.
void report_print_option(FILE *stream, const RfMeasureOptions *options, const RfOption *option);

void report_print_table(const Report *report);
void report_write_json(const Report *report, FILE *stream);
int report_write_html(const Report *report, FILE *stream);
/// One element of the page: as HTML text, with < & > " escaped.
void report_html_text(FILE *stream, const char *text);

/// Refuses reports that exist (without -y), are inputs or have no folder, before anything is computed.
int report_check_files(const Settings *settings, const char *const *inputs, int input_count);
/// All of them, each under a temporary name until it is whole.
int report_write_files(const Report *report);
