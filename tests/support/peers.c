// SPDX-License-Identifier: Apache-2.0
#include "support/peers.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum
{
    SIZE = 512,
    VERBATIM_SIDE = 64,
    VERBATIM_STEP = 16,
    MAX_RUNS = 99
};

const char *const peer_measures[PEER_MEASURES] = {"residual", "share", "spectrum"};

static const bool MORE_IS_BETTER[PEER_MEASURES] = {false, true, false};
static const double EQUAL = 0.03;
static const double SPECTRUM_FLOOR = 1;
static const int SPECTRUM = 2;
static const double VERBATIM_LEVELS = 2;

// ---- the figures of others

static FILE *open_table(const PeerTable *table, const char *file)
{
    char path[1200];
    snprintf(path, sizeof path, "%s/%s", table->folder, file);
    return fopen(path, "r");
}

static void read_quality(FILE *file, PeerTable *table)
{
    char line[256];
    while (table->count < PEER_MAX_ROWS && fgets(line, sizeof line, file))
    {
        PeerRow *r = &table->rows[table->count];
        r->seconds = NAN;
        table->count += sscanf(line, "%31[^,],%31[^,],%lf,%lf,%lf", r->name, r->tool, &r->values[0], &r->values[1],
                               &r->values[2]) == 5;
    }
}

static void read_times(FILE *file, PeerTable *table)
{
    char line[256];
    while (fgets(line, sizeof line, file))
    {
        PeerRow r;
        if (sscanf(line, "%31[^,],%31[^,],%*d,%*d,%*d,%lf", r.name, r.tool, &r.seconds) != 3)
            continue;
        for (int i = 0; i < table->count; ++i)
            if (strcmp(table->rows[i].name, r.name) == 0 && strcmp(table->rows[i].tool, r.tool) == 0)
                table->rows[i].seconds = r.seconds;
    }
}

bool peers_read(const char *data, PeerTable *out)
{
    const char *folder = getenv("RIFFLE_DATA");
    *out = (PeerTable){0};
    snprintf(out->folder, sizeof out->folder, "%s/reference/peers", folder ? folder : data);
    FILE *quality = open_table(out, "quality.csv"), *times = open_table(out, "times.csv");
    if (quality)
    {
        read_quality(quality, out);
        fclose(quality);
    }
    if (times)
    {
        read_times(times, out);
        fclose(times);
    }
    return out->count > 0;
}

RfResult peers_image(const PeerTable *table, const char *name, const char *file, RfImage **out)
{
    char path[1200];
    snprintf(path, sizeof path, "%s/%s/%s.png", table->folder, name, file);
    return rf_image_read(path, out);
}

// ---- judging

RfResult peers_judge(const RfImageView *exemplar, const RfImageView *picture, RfMeasureFrame *out)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_stride = 8;
    options.spectrum_crop = 128;
    options.spectrum_first = 2;
    RfMeasure *measure = NULL;
    RfResult result = rf_measure_create(exemplar, &options, &measure);
    if (result == RF_OK)
        result = rf_measure_step(measure, NULL, NULL, picture, out);
    rf_measure_destroy(measure);
    return result;
}

// True if the sum of squared differences is at most `limit`.
static bool is_copy(const float *a, ptrdiff_t a_stride, const float *b, ptrdiff_t b_stride, int numbers, float limit)
{
    float sum = 0;
    for (int y = 0; y < VERBATIM_SIDE && sum <= limit; ++y)
    {
        const float *from = a + y * a_stride, *to = b + y * b_stride;
#pragma omp simd reduction(+ : sum)
        for (int i = 0; i < numbers; ++i)
            sum += (from[i] - to[i]) * (from[i] - to[i]);
    }
    return sum <= limit;
}

static bool is_anywhere(const RfImageView *exemplar, const float *window, ptrdiff_t stride, float limit)
{
    for (int y = 0; y + VERBATIM_SIDE <= exemplar->height; ++y)
        for (int x = 0; x + VERBATIM_SIDE <= exemplar->width; ++x)
            if (is_copy(window, stride, exemplar->pixels + y * exemplar->row_stride + x * exemplar->channels,
                        exemplar->row_stride, VERBATIM_SIDE * exemplar->channels, limit))
                return true;
    return false;
}

double peers_verbatim(const RfImageView *exemplar, const RfImageView *picture)
{
    assert(exemplar->channels == picture->channels);
    double level = VERBATIM_LEVELS / 255;
    float limit = (float)(level * level * VERBATIM_SIDE * VERBATIM_SIDE * exemplar->channels);
    int windows = 0, copies = 0;
    for (int y = 0; y + VERBATIM_SIDE <= picture->height; y += VERBATIM_STEP)
        for (int x = 0; x + VERBATIM_SIDE <= picture->width; x += VERBATIM_STEP)
        {
            ++windows;
            copies += is_anywhere(exemplar, picture->pixels + y * picture->row_stride + x * picture->channels,
                                  picture->row_stride, limit);
        }
    return windows ? (double)copies / windows : 0;
}

// ---- Riffle's own

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static RfResult make_picture(const RfImageView *from, const RfOptimizeOptions *options, int runs, RfImage **out,
                             double *seconds)
{
    double times[MAX_RUNS];
    RfMapView map = {"colour", RF_MAP_COLOUR, *from, 1};
    RfExemplar *exemplar = NULL;
    RfResult result = rf_exemplar_create(&map, 1, RF_TILING_NO, &exemplar);
    if (result == RF_OK)
        result = rf_image_create(SIZE, SIZE, from->channels, out);
    runs = runs < 1 ? 1 : runs > MAX_RUNS ? MAX_RUNS : runs;
    for (int i = 0; i < runs && result == RF_OK; ++i)
    {
        RfImageView picture = rf_image_view(*out);
        double start = now();
        result = rf_optimize_still(exemplar, options, NULL, &picture);
        times[i] = now() - start;
    }
    if (result == RF_OK)
    {
        qsort(times, (size_t)runs, sizeof *times, by_size);
        *seconds = times[runs / 2];
    }
    rf_exemplar_destroy(exemplar);
    return result;
}

RfResult peers_synthesise(const PeerTable *table, const char *name, const RfOptimizeOptions *options, int runs,
                          PeerOwn *out)
{
    RfImage *exemplar = NULL;
    RfMeasureFrame m;
    *out = (PeerOwn){.row.tool = "riffle"};
    snprintf(out->row.name, sizeof out->row.name, "%s", name);
    RfResult result = peers_image(table, name, "exemplar", &exemplar);
    RfImageView from, picture;
    if (result == RF_OK)
    {
        from = rf_image_view(exemplar);
        result = make_picture(&from, options, runs, &out->picture, &out->row.seconds);
    }
    if (result == RF_OK)
    {
        picture = rf_image_view(out->picture);
        result = peers_judge(&from, &picture, &m);
    }
    if (result == RF_OK)
    {
        out->row.values[0] = m.patch.residual;
        out->row.values[1] = m.patch.share;
        out->row.values[2] = m.spectrum.distance;
        out->verbatim = peers_verbatim(&from, &picture);
    }
    else
    {
        rf_image_destroy(out->picture);
        out->picture = NULL;
    }
    rf_image_destroy(exemplar);
    return result;
}

// ---- standings

void peers_add(PeerTable *table, const PeerRow *row)
{
    assert(table->count < PEER_MAX_ROWS);
    table->rows[table->count++] = *row;
}

const PeerRow *peers_find(const PeerTable *table, const char *name, const char *tool)
{
    for (int i = 0; i < table->count; ++i)
        if (strcmp(table->rows[i].name, name) == 0 && strcmp(table->rows[i].tool, tool) == 0)
            return &table->rows[i];
    return NULL;
}

int peers_order(int measure, double a, double b)
{
    if (fabs(a - b) <= EQUAL * fmax(fabs(a), fabs(b)) ||
        (measure == SPECTRUM && a < SPECTRUM_FLOOR && b < SPECTRUM_FLOOR))
        return 0;
    return a < b ? -1 : 1;
}

int peers_compare(int measure, const PeerRow *a, const PeerRow *b)
{
    int order = peers_order(measure, a->values[measure], b->values[measure]);
    return MORE_IS_BETTER[measure] ? -order : order;
}

int peers_wins(const PeerRow *a, const PeerRow *b)
{
    int wins = 0;
    for (int m = 0; m < PEER_MEASURES; ++m)
        wins += peers_compare(m, a, b) < 0;
    return wins;
}

static double rank_of(const PeerTable *table, const PeerRow *row, int measure)
{
    double rank = 1;
    for (int i = 0; i < table->count; ++i)
    {
        const PeerRow *other = &table->rows[i];
        if (other == row || strcmp(other->name, row->name) != 0)
            continue;
        int order = peers_compare(measure, other, row);
        rank += order < 0 ? 1 : order == 0 ? 0.5 : 0;
    }
    return rank;
}

double peers_mean_rank(const PeerTable *table, const char *tool)
{
    double sum = 0;
    int cells = 0;
    for (int i = 0; i < table->count; ++i)
        for (int m = 0; m < PEER_MEASURES && strcmp(table->rows[i].tool, tool) == 0; ++m, ++cells)
            sum += rank_of(table, &table->rows[i], m);
    return sum / cells;
}
