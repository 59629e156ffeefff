// SPDX-License-Identifier: Apache-2.0
// The queries of a search, 12 at a time: copied into rows that a full comparison can read in whole vectors, projected,
// and, where the machine multiplies them, rounded to integers. Masked ones are not projected: see neighbours.c.

#include "core/maths.h"
#include "core/simd.h"
#include "kernels/searching.h"

#include <string.h>

size_t rf_search_row_room(const RfSearch *search)
{
    return (size_t)search->database->side * (size_t)search->database->row_numbers;
}

RF_WIDE_BODY void rf_copy_in_range_body(const float *restrict from, int count, float *restrict to,
                                        int *restrict outside)
{
    int sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int k = 0; k < count; ++k)
    {
        to[k] = from[k];
        sum += !(fabsf(from[k]) <= RF_WINDOW_LARGEST);
    }
    *outside = sum;
}

// *outside: how many numbers are too large, or not finite.
RF_WIDE(rf_copy_in_range, (const float *restrict from, int count, float *restrict to, int *restrict outside),
        (from, count, to, outside))

// Rows of a masked query are padded with 0. Numbers of weight 0 become 0.
static void mask_row(const RfWindowDatabase *d, const float *mask, const float *from, float *row, float *weights)
{
    for (int i = 0; i < d->row_numbers; ++i)
    {
        float weight = i < d->side * d->channels ? mask[i / d->channels] : 0;
        weights[i] = weight * d->row_weights[i];
        row[i] = weight > 0 ? from[i] : 0;
    }
}

// Returns whether all numbers that count are in range.
static bool copy_masked(const RfSearch *search, int index, float *rows, float *weights)
{
    const RfWindowDatabase *d = search->database;
    const float *window = search->queries->windows + (size_t)index * (size_t)d->numbers,
                *mask = search->queries->weights + (size_t)index * (size_t)d->side * (size_t)d->side;
    int outside = 0;
    for (int j = 0; j < d->side; ++j, rows += d->row_numbers)
    {
        mask_row(d, mask + j * d->side, window + j * d->side * d->channels, rows, weights + j * d->row_numbers);
        for (int i = 0; i < d->row_numbers; ++i)
            outside += !(fabsf(rows[i]) <= RF_WINDOW_LARGEST);
    }
    return outside == 0;
}

// m s^2 q and m / 2: see the top. `panel` holds s q; sums[q] becomes sum m s^2 q^2.
static void mask_panel(const RfSearch *search, int first, int count, const float *panel, float *kept, float *sums)
{
    const RfWindowDatabase *d = search->database;
    int pixels = d->side * d->side;
    float *halves = kept + (size_t)d->numbers * RF_TILE_QUERIES;
    memset(halves, 0, (size_t)pixels * RF_TILE_QUERIES * sizeof *halves);
    memset(kept, 0, (size_t)d->numbers * RF_TILE_QUERIES * sizeof *kept);
    for (int q = 0; q < count; ++q)
    {
        const float *mask = search->queries->weights + (size_t)(first + q) * (size_t)pixels;
        sums[q] = 0;
        for (int k = 0; k < d->numbers; ++k)
        {
            float number = panel[k * RF_TILE_QUERIES + q], weight = mask[k / d->channels];
            kept[k * RF_TILE_QUERIES + q] = weight * number;
            sums[q] += weight * number * number;
        }
        for (int p = 0; p < pixels; ++p)
            halves[p * RF_TILE_QUERIES + q] = 0.5f * mask[p];
    }
}

static float most_weight(const RfSearch *search, int index)
{
    int pixels = search->database->side * search->database->side;
    float most = 0;
    for (int p = 0; p < pixels; ++p)
        most = rf_max(search->queries->weights[(size_t)index * (size_t)pixels + (size_t)p], most);
    return most;
}

static void load_masked(const RfSearch *search, RfSearchWorker *worker, int panel, int first, int count,
                        RfPanelNorms *norms)
{
    const RfWindowDatabase *d = search->database;
    RfSearchQuery *query = worker->query + panel * RF_TILE_QUERIES;
    RfWindowRows windows[RF_TILE_QUERIES];
    for (int q = 0; q < count; ++q)
    {
        size_t place = (size_t)(panel * RF_TILE_QUERIES + q) * rf_search_row_room(search);
        float *rows = worker->rows + place, *weights = worker->weights + place;
        query[q].valid = copy_masked(search, first + q, rows, weights);
        if (!query[q].valid)
            memset(rows, 0, rf_search_row_room(search) * sizeof *rows);
        query[q].rows = windows[q] = (RfWindowRows){rows, d->row_numbers};
        query[q].weights = (RfWindowRows){weights, d->row_numbers};
    }
    worker->in_shorts = false;
    rf_pack_panel(d, windows, count, worker->panel);
    mask_panel(search, first, count, worker->panel,
               worker->kept + (size_t)panel * (size_t)search->kept * RF_TILE_QUERIES, norms->norm);
}

static bool shorten_panel(const RfWindowDatabase *d, const RfKeptWindows *kept, RfSearchWorker *worker)
{
    bool fit = true;
    int32_t unused;
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        fit &= rf_shorten_query(&d->shorts, kept->kept[q], d->kept, worker->shorts[q], &worker->query[q].square);
        if (d->shorts.rests)
            rf_shorten_query(&d->shorts, kept->rest[q], RF_REST_NUMBERS, worker->rests[q], &unused);
    }
    return fit;
}

// Rows follow each other without padding: past a row's end there are the next one's numbers, or 0.
static void load_plain(const RfSearch *search, RfSearchWorker *worker, int first, int count, RfPanelNorms *norms)
{
    const RfWindowDatabase *d = search->database;
    RfKeptWindows windows;
    memset(windows.norms.norm, 0, sizeof windows.norms.norm);
    for (int q = 0; q < count; ++q)
    {
        float *rows = worker->rows + (size_t)q * rf_search_row_room(search);
        int outside;
        rf_copy_in_range(search->queries->windows + (size_t)(first + q) * (size_t)d->numbers, d->numbers, rows,
                         &outside);
        worker->query[q].valid = outside == 0;
        if (outside > 0)
            memset(rows, 0, rf_search_row_room(search) * sizeof *rows);
        worker->query[q].rows = (RfWindowRows){rows, (ptrdiff_t)d->side * d->channels};
        worker->query[q].weights = (RfWindowRows){d->bare ? NULL : d->row_weights, 0};
        windows.norms.norm[q] = rf_centre_window(d, rows, q, worker->panel);
    }
    rf_keep_windows(d, worker->panel, &windows);
    worker->in_shorts = search->short_starts && shorten_panel(d, &windows, worker);
    for (int k = 0; !worker->in_shorts && k < d->kept; ++k)
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            worker->kept[k * RF_TILE_QUERIES + q] = windows.kept[q][k];
    *norms = windows.norms;
    for (int q = 0; q < count; ++q)
    {
        norms->residual_error[q] += d->residual_error;
        norms->rest_error[q] += d->rest_error;
    }
}

void rf_search_load(const RfSearch *search, RfSearchWorker *worker, int panel, int first, int count)
{
    const RfWindowDatabase *d = search->database;
    RfSearchQuery *query = worker->query + panel * RF_TILE_QUERIES;
    RfPanelNorms norms = {0};
    if (search->masked)
        load_masked(search, worker, panel, first, count, &norms);
    else
        load_plain(search, worker, first, count, &norms);
    float rounding = rf_rounding_of(d->numbers + search->kept);
    double short_error = worker->in_shorts ? rf_short_error(&d->shorts, d->kept) : 0,
           rest_error = worker->in_shorts ? rf_short_error(&d->shorts, d->kept + RF_REST_NUMBERS) : 0;
    for (int q = 0; q < count; ++q)
    {
        float weight = search->masked ? most_weight(search, first + q) : 1;
        query[q].norm = norms.norm[q];
        query[q].slack = 4 * rounding * (norms.norm[q] + weight * d->largest_norm + search->largest_penalty);
        query[q].error = (double)norms.residual_error[q] + short_error;
        query[q].rest_error = (double)norms.rest_error[q] + rest_error;
        query[q].score = query[q].distance = query[q].limit = query[q].rest_limit = INFINITY;
        query[q].candidate = -1;
    }
}
