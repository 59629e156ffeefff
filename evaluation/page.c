// SPDX-License-Identifier: Apache-2.0
// Puts the results of evaluation_run into a page: renews what stands between its markers, and draws the plots.
//
//   evaluation_page MAIN.csv SWEEP.csv PAGE.md PLOTS-FOLDER
//
// A marker is a line "<!-- table QUANTITY -->" or "<!-- points -->"; what follows up to "<!-- end -->" is replaced.
// QUANTITY is a column of the results, or "product": flow-ratio times spectrum-ratio. The page's prose stays.

#include "riffle/riffle.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    MAX_ROWS = 1024,
    MAX_COLUMNS = 80,
    MAX_NAMES = 16,
    LINE = 4096,
    STEPS = 64
};

typedef struct Row
{
    char flow[32], exemplar[32], label[32];
    double value, columns[MAX_COLUMNS];
} Row;

typedef struct Results
{
    char *names[MAX_COLUMNS];
    int column_count, count;
    Row rows[MAX_ROWS];
} Results;

static Results main_runs, sweep;

static void die(const char *what, const char *why)
{
    fprintf(stderr, "evaluation_page: %s: %s\n", what, why);
    exit(1);
}

static void read_results(const char *path, Results *r)
{
    FILE *file = fopen(path, "r");
    char line[LINE];
    if (!file || !fgets(line, sizeof line, file))
        die(path, "cannot be read");
    for (char *name = strtok(line, ",\n"); name && r->column_count < MAX_COLUMNS; name = strtok(NULL, ",\n"))
        r->names[r->column_count++] = strdup(name);
    while (r->count < MAX_ROWS && fgets(line, sizeof line, file))
    {
        Row *row = &r->rows[r->count++];
        char *rest = line;
        for (int c = 0; c < r->column_count; ++c)
        {
            const char *field = strsep(&rest, ",\n");
            if (!field)
                die(path, "a line is too short");
            if (c >= 1 && c <= 3)
                snprintf(c == 1 ? row->flow : c == 2 ? row->exemplar : row->label, sizeof row->flow, "%s", field);
            row->columns[c] = c >= 5 ? atof(field) : NAN;
        }
        row->value = row->columns[5];
    }
    fclose(file);
}

static double number(const Results *r, const Row *row, const char *name)
{
    if (strcmp(name, "product") == 0)
        return number(r, row, "flow-ratio") * number(r, row, "spectrum-ratio");
    for (int c = 0; c < r->column_count; ++c)
        if (strcmp(r->names[c], name) == 0)
            return row->columns[c];
    die(name, "no column of the results");
    return NAN;
}

// ---- tables

// How far a value is from what is best, for the choice of the best in a row.
static double badness(const char *name, double value)
{
    int count;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
            switch (table[i].sense)
            {
            case RF_MEASURE_HIGHER_IS_BETTER:
                return -value;
            case RF_MEASURE_ONE_IS_BEST:
                return fabs(log(value));
            case RF_MEASURE_ZERO_IS_BEST:
                return fabs(value);
            default:
                return value;
            }
    return value;
}

static int list_labels(const Results *r, const char *labels[MAX_NAMES])
{
    int count = 0;
    for (int i = 0; i < r->count; ++i)
    {
        bool known = false;
        for (int k = 0; k < count; ++k)
            known = known || strcmp(labels[k], r->rows[i].label) == 0;
        if (!known && count < MAX_NAMES)
            labels[count++] = r->rows[i].label;
    }
    return count;
}

static void print_cells(FILE *out, const char *name, const double *values, int count)
{
    char best[32] = "", text[32];
    double least = INFINITY;
    for (int k = 0; k < count; ++k)
        if (badness(name, values[k]) < least)
        {
            least = badness(name, values[k]);
            snprintf(best, sizeof best, "%.3g", values[k]);
        }
    for (int k = 0; k < count; ++k)
    {
        snprintf(text, sizeof text, "%.3g", values[k]);
        fprintf(out, strcmp(text, best) == 0 ? " **%s** |" : " %s |", isnan(values[k]) ? "" : text);
    }
    fprintf(out, "\n");
}

static void print_table(FILE *out, const char *name)
{
    const Results *r = &main_runs;
    const char *labels[MAX_NAMES];
    int count = list_labels(r, labels), rows = 0;
    double sums[MAX_NAMES] = {0};
    fprintf(out, "| flow | exemplar |");
    for (int k = 0; k < count; ++k)
        fprintf(out, " %s |", labels[k]);
    fprintf(out, "\n| --- | --- |");
    for (int k = 0; k < count; ++k)
        fprintf(out, " --- |");
    fprintf(out, "\n");
    // Runs of one pair of flow and exemplar follow each other.
    for (int i = 0; i < r->count;)
    {
        const Row *first = &r->rows[i];
        double values[MAX_NAMES];
        for (int k = 0; k < count; ++k)
            values[k] = NAN;
        for (; i < r->count && strcmp(r->rows[i].flow, first->flow) == 0 &&
               strcmp(r->rows[i].exemplar, first->exemplar) == 0;
             ++i)
            for (int k = 0; k < count; ++k)
                if (strcmp(labels[k], r->rows[i].label) == 0)
                    values[k] = number(r, &r->rows[i], name);
        fprintf(out, "| %s | %s |", first->flow, first->exemplar);
        print_cells(out, name, values, count);
        for (int k = 0; k < count; ++k)
            sums[k] += values[k];
        ++rows;
    }
    for (int k = 0; k < count; ++k)
        sums[k] /= rows;
    fprintf(out, "| mean | |");
    print_cells(out, name, sums, count);
}

// ---- the curve

typedef struct Curve
{
    // Logarithms of the ratios.
    double flow[MAX_ROWS], spectrum[MAX_ROWS], value[MAX_ROWS];
    int count;
} Curve;

static Curve curve_of(const char *flow, const char *exemplar, const char *label)
{
    Curve c = {.count = 0};
    for (int i = 0; i < sweep.count; ++i)
    {
        const Row *row = &sweep.rows[i];
        if (strcmp(row->flow, flow) != 0 || strcmp(row->exemplar, exemplar) != 0 || strcmp(row->label, label) != 0)
            continue;
        c.flow[c.count] = log(number(&sweep, row, "flow-ratio"));
        c.spectrum[c.count] = log(number(&sweep, row, "spectrum-ratio"));
        c.value[c.count++] = row->value;
    }
    return c;
}

static double mix(double a, double b, double t)
{
    return a + t * (b - a);
}

typedef enum Place
{
    BEHIND, // a point of a curve of ours is at least as good in both
    AHEAD,  // it is at least as good in both as a point of a curve of ours, and not behind
    BEYOND  // neither: past the ends of our curves
} Place;

// Curves are straight between their settings.
static Place place_of(const Curve *curves, int count, double flow, double spectrum)
{
    Place place = BEYOND;
    for (int c = 0; c < count; ++c)
        for (int i = 0; i + 1 < curves[c].count; ++i)
            for (int k = 0; k <= STEPS; ++k)
            {
                double t = (double)k / STEPS;
                double f = mix(curves[c].flow[i], curves[c].flow[i + 1], t);
                double s = mix(curves[c].spectrum[i], curves[c].spectrum[i + 1], t);
                if (f <= flow && s <= spectrum)
                    return BEHIND;
                if (flow <= f && spectrum <= s)
                    place = AHEAD;
            }
    return place;
}

static bool is_ours(const char *label)
{
    return strncmp(label, "lagrangian", 10) == 0;
}

static void print_points(FILE *out)
{
    const char *labels[MAX_NAMES];
    int count = list_labels(&sweep, labels);
    fprintf(out, "| flow | exemplar | method | points | behind | ahead | beyond the ends |\n"
                 "| --- | --- | --- | --- | --- | --- | --- |\n");
    for (int i = 0; i < sweep.count; ++i)
    {
        const Row *row = &sweep.rows[i];
        if (i > 0 && strcmp(row->flow, row[-1].flow) == 0 && strcmp(row->exemplar, row[-1].exemplar) == 0)
            continue;
        static Curve ours[MAX_NAMES];
        int our_count = 0;
        for (int k = 0; k < count; ++k)
            if (is_ours(labels[k]))
                ours[our_count++] = curve_of(row->flow, row->exemplar, labels[k]);
        for (int k = 0; k < count; ++k)
        {
            if (is_ours(labels[k]))
                continue;
            Curve theirs = curve_of(row->flow, row->exemplar, labels[k]);
            int places[3] = {0};
            for (int p = 0; p < theirs.count; ++p)
                ++places[place_of(ours, our_count, theirs.flow[p], theirs.spectrum[p])];
            fprintf(out, "| %s | %s | %s | %d | %d | %d | %d |\n", row->flow, row->exemplar, labels[k], theirs.count,
                    places[BEHIND], places[AHEAD], places[BEYOND]);
        }
    }
}

// ---- plots

enum
{
    WIDTH = 640,
    HEIGHT = 480,
    LEFT = 70,
    TOP = 40,
    RIGHT = 20,
    BOTTOM = 55
};

typedef struct Axes
{
    double x0, x1, y0, y1;
} Axes;

static double plot_x(const Axes *a, double v)
{
    return LEFT + (v - a->x0) / (a->x1 - a->x0) * (WIDTH - LEFT - RIGHT);
}

static double plot_y(const Axes *a, double v)
{
    return HEIGHT - BOTTOM - (v - a->y0) / (a->y1 - a->y0) * (HEIGHT - TOP - BOTTOM);
}

static void draw_axes(FILE *out, const Axes *a, const char *title)
{
    static const double ticks[] = {0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32};
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" "
            "font-size=\"13\">\n<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n",
            WIDTH, HEIGHT, WIDTH, HEIGHT);
    fprintf(out, "<text x=\"%d\" y=\"24\" font-size=\"16\">%s</text>\n", LEFT, title);
    for (size_t k = 0; k < sizeof ticks / sizeof ticks[0]; ++k)
    {
        double v = log(ticks[k]), x = plot_x(a, v), y = plot_y(a, v);
        if (v >= a->x0 && v <= a->x1)
            fprintf(out,
                    "<path d=\"M%.1f %dV%d\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%d\" "
                    "text-anchor=\"middle\">%g</text>\n",
                    x, TOP, HEIGHT - BOTTOM, x, HEIGHT - BOTTOM + 18, ticks[k]);
        if (v >= a->y0 && v <= a->y1)
            fprintf(out,
                    "<path d=\"M%d %.1fH%d\" stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" "
                    "text-anchor=\"end\">%g</text>\n",
                    LEFT, y, WIDTH - RIGHT, LEFT - 8, y + 4, ticks[k]);
    }
    fprintf(out,
            "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">flow error over its floor</text>\n"
            "<text transform=\"translate(20 %d) rotate(-90)\" text-anchor=\"middle\">spectrum distance over its "
            "floor</text>\n",
            (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, (TOP + HEIGHT - BOTTOM) / 2);
}

static void draw_curve(FILE *out, const Axes *a, const Curve *c, const char *label, int index)
{
    static const char *const colours[] = {"#d1242f", "#0969da", "#1a7f37", "#9a6700", "#8250df",
                                          "#57606a", "#bf3989", "#1b7c83", "#bc4c00", "#4d2d00"};
    const char *colour = colours[index % 10];
    fprintf(out, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"%d\" points=\"", colour, is_ours(label) ? 3 : 1);
    for (int p = 0; p < c->count; ++p)
        fprintf(out, "%.1f,%.1f ", plot_x(a, c->flow[p]), plot_y(a, c->spectrum[p]));
    fprintf(out, "\"/>\n");
    for (int p = 0; p < c->count; ++p)
    {
        double x = plot_x(a, c->flow[p]), y = plot_y(a, c->spectrum[p]);
        fprintf(out,
                "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\"/><text x=\"%.1f\" y=\"%.1f\" font-size=\"11\" "
                "fill=\"%s\">%g</text>\n",
                x, y, colour, x + 6, y - 5, colour, c->value[p]);
    }
    fprintf(out, "<text x=\"%d\" y=\"%d\" text-anchor=\"end\" fill=\"%s\" font-weight=\"bold\">%s</text>\n",
            WIDTH - RIGHT - 8, TOP + 18 + 18 * index, colour, label);
}

static void draw_plot(const char *folder, const Row *row)
{
    const char *labels[MAX_NAMES];
    int count = list_labels(&sweep, labels);
    char path[LINE], title[128];
    snprintf(path, sizeof path, "%s/%s-%s.svg", folder, row->flow, row->exemplar);
    snprintf(title, sizeof title, "%s carried by %s", row->exemplar, row->flow);
    Axes a = {INFINITY, -INFINITY, INFINITY, -INFINITY};
    for (int k = 0; k < count; ++k)
    {
        Curve c = curve_of(row->flow, row->exemplar, labels[k]);
        for (int p = 0; p < c.count; ++p)
        {
            a.x0 = fmin(a.x0, c.flow[p] - 0.1);
            a.x1 = fmax(a.x1, c.flow[p] + 0.2);
            a.y0 = fmin(a.y0, c.spectrum[p] - 0.1);
            a.y1 = fmax(a.y1, c.spectrum[p] + 0.1);
        }
    }
    FILE *out = fopen(path, "w");
    if (!out)
        die(path, "cannot be written");
    draw_axes(out, &a, title);
    for (int k = 0; k < count; ++k)
    {
        Curve c = curve_of(row->flow, row->exemplar, labels[k]);
        draw_curve(out, &a, &c, labels[k], k);
    }
    fprintf(out, "</svg>\n");
    if (fclose(out) != 0)
        die(path, "cannot be written");
}

// ---- the page

static void renew_page(const char *path)
{
    char line[LINE], name[64], temporary[LINE];
    snprintf(temporary, sizeof temporary, "%s.new", path);
    FILE *in = fopen(path, "r"), *out = fopen(temporary, "w");
    if (!in || !out)
        die(path, "cannot be read or written");
    bool skipping = false;
    while (fgets(line, sizeof line, in))
    {
        if (strncmp(line, "<!-- end -->", 12) == 0)
            skipping = false;
        if (skipping)
            continue;
        fputs(line, out);
        if (sscanf(line, "<!-- table %63s -->", name) == 1)
            print_table(out, name);
        else if (strncmp(line, "<!-- points -->", 15) == 0)
            print_points(out);
        else
            continue;
        skipping = true;
    }
    fclose(in);
    if (fclose(out) != 0 || rename(temporary, path) != 0)
        die(path, "cannot be written");
    if (skipping)
        die(path, "its last table has no <!-- end -->");
}

int main(int argc, char **argv)
{
    if (argc != 5)
    {
        fprintf(stderr, "evaluation_page MAIN.csv SWEEP.csv PAGE.md PLOTS-FOLDER\n");
        return 2;
    }
    read_results(argv[1], &main_runs);
    read_results(argv[2], &sweep);
    for (int i = 0; i < sweep.count; ++i)
        if (i == 0 || strcmp(sweep.rows[i].flow, sweep.rows[i - 1].flow) != 0 ||
            strcmp(sweep.rows[i].exemplar, sweep.rows[i - 1].exemplar) != 0)
            draw_plot(argv[4], &sweep.rows[i]);
    renew_page(argv[3]);
    return 0;
}
