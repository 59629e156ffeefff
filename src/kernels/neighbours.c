// SPDX-License-Identifier: Apache-2.0
// Exact nearest windows at the price of principal components.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005 (the search this is for).
// Liang, Liu, Xu, Guo, Shum. Real-time texture synthesis by patch-based sampling. 2001 (windows on their components).
// Kaspar, Neubert, Lischinski, Pauly, Kopf. Self tuning texture optimization. 2015 (penalties that spread use).
//
// P projects a window (mean off, channels scaled by the roots of their weights) on orthonormal components, r is the
// norm of what they leave out. By Pythagoras and the triangle inequality
//
//     bound(q, c) = |Pq - Pc|^2 + (r_q - r_c)^2 <= |q - c|^2
//
// which is a distance of its own, in kept = components + 1 numbers, so a search is
//
//     1. all bounds of a block of queries, as a matrix product: bound / 2 - |q|^2 / 2 = |c|^2 / 2 - q.c
//     2. the full distance of the candidate with the least bound: no better one can be farther away
//     3. the full distance of every other candidate whose bound does not exceed the best so far
//
// Step 3 finds 2 to 40 candidates among thousands, and the residual's norm is what makes them so few: without it ten
// times as many are left. Candidates are walked in chunks, so that the bounds stay in the second cache; the best so far
// goes from chunk to chunk.
//
// Exact in spite of rounding. Steps 2 and 3 compare by direct differences in one order, whatever the instruction set.
// Bounds are rounded, so step 3 grants them a slack: sums of n products are taken to be off by n 2^-23 of their terms'
// sum, four times what n rounded operations of random sign leave at n = 16, sixteen times at n = 256 (Higham and Mary.
// A new approach to probabilistic rounding error analysis. 2019), and as much as they can ever leave. A residual's norm
// is the root of a difference; how far it can be off is kept with it (windows.c).
//
// Few numbers (w <= 3 or so) are compared as they are. Masked queries have no common components; they are compared in
// all numbers, and in one more a pixel, which makes the weighted square a product too:
//
//     sum m (q - c)^2 = sum m q^2 - 2 sum (m q) c + sum m c^2
//
// Penalties go on |c|^2 / 2. Excluded candidates get an infinite bound.
//
// Where many candidates are alike (large areas of one colour) as many are compared in full: the search is then as slow
// as a plain one, never wrong.

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/principal.h"
#include "kernels/windows.h"

#include <string.h>

enum
{
    // 12 rows of bounds are 200 KB.
    CHUNK = 4096,
    // Rows of bounds do not start a multiple of 4096 bytes apart: 24 stores of a tile would fall on one cache set.
    BOUNDS_MARGIN = RF_TILE_CANDIDATES,
    // Candidates to a minimum.
    FOLD = RF_GROUP_CANDIDATES / RF_GROUP_LANES,
    // Masked queries share a tile that is gathered for them.
    MASKED_PANELS = 8,
    MASKED_CHUNK = 512,
    MAX_PANELS = MASKED_PANELS
};

typedef struct Query
{
    RfWindowRows rows, weights;
    // Of the numbers compared; and in all that the slack is made of.
    float norm, slack, residual_error;
    bool valid;
    // distance + penalty of the best so far, its bare distance, and which it is
    float score, distance;
    int candidate;
    // Bounds above cannot be better.
    float limit;
} Query;

typedef struct Worker
{
    Query query[MAX_PANELS * RF_TILE_QUERIES];
    int list[CHUNK + 1];
    // panel[numbers][12], products[12][blocks * 32], kept[panels][kept][12], rows and weight rows of every query,
    // bounds, minima, and for masked queries a tile of candidates [kept][32] and its starts [32]
    float *panel, *products, *kept, *rows, *weights, *bounds, *minima, *tile;
} Worker;

typedef struct Search
{
    const RfWindowDatabase *database;
    const RfWindowQueries *queries;
    RfWindowMatch *matches;
    bool masked;
    int kept, panels, chunk;
    // Of a query's bounds and of their minima.
    size_t bounds_stride, minima_stride;
    // [tiles * 32]: what the sums start from
    const float *starts;
    float *own_starts;
    float least_penalty, largest_penalty;
    Worker *workers;
    float *scratch;
} Search;

// ---- queries -----------------------------------------------------------------------------------------------------

static size_t row_room(const RfWindowDatabase *d)
{
    return (size_t)d->side * (size_t)d->row_numbers;
}

// Copies a query to rows that are padded with 0; numbers of weight 0 become 0.
static bool copy_query(const Search *search, int index, float *rows, float *weights)
{
    const RfWindowDatabase *d = search->database;
    const float *window = search->queries->windows + (size_t)index * (size_t)d->numbers,
                *mask = search->masked ? search->queries->weights + (size_t)index * (size_t)d->side * (size_t)d->side
                                       : NULL;
    int row = d->side * d->channels;
    bool valid = true;
    for (int j = 0; j < d->side; ++j, rows += d->row_numbers, window += row)
    {
        memcpy(rows, window, (size_t)row * sizeof *rows);
        for (int i = row; i < d->row_numbers; ++i)
            rows[i] = 0;
        for (int i = 0; mask && i < d->row_numbers; ++i)
        {
            float weight = i < row ? mask[j * d->side + i / d->channels] : 0;
            weights[j * d->row_numbers + i] = weight * d->row_weights[i];
            rows[i] = weight > 0 ? rows[i] : 0;
        }
        for (int i = 0; i < row; ++i)
            valid &= fabsf(rows[i]) <= RF_WINDOW_LARGEST;
    }
    return valid;
}

// -m s^2 q and m / 2: see the top. `panel` holds s q; sums[q] becomes sum m s^2 q^2.
static void mask_panel(const Search *search, int first, int count, const float *panel, float *kept, float *sums)
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
            kept[k * RF_TILE_QUERIES + q] = -weight * number;
            sums[q] += weight * number * number;
        }
        for (int p = 0; p < pixels; ++p)
            halves[p * RF_TILE_QUERIES + q] = 0.5f * mask[p];
    }
}

static void keep_queries(const RfWindowDatabase *d, const float *panel, const float *products,
                         const RfPanelNorms *norms, float *kept)
{
    for (int k = 0; k < d->kept; ++k)
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
            kept[k * RF_TILE_QUERIES + q] = d->complete          ? -panel[k * RF_TILE_QUERIES + q]
                                            : k == d->components ? -norms->residual[q]
                                                                 : -products[q * d->blocks * RF_BASIS_BLOCK + k];
}

static float most_weight(const Search *search, int index)
{
    int pixels = search->database->side * search->database->side;
    float most = 0;
    for (int p = 0; p < pixels; ++p)
        most = rf_max(search->queries->weights[(size_t)index * (size_t)pixels + (size_t)p], most);
    return most;
}

static void load_panel(const Search *search, Worker *worker, int panel_index, int first, int count)
{
    const RfWindowDatabase *d = search->database;
    Query *query = worker->query + panel_index * RF_TILE_QUERIES;
    float *kept = worker->kept + (size_t)panel_index * (size_t)search->kept * RF_TILE_QUERIES;
    RfWindowRows windows[RF_TILE_QUERIES];
    RfPanelNorms norms;
    for (int q = 0; q < count; ++q)
    {
        size_t place = (size_t)(panel_index * RF_TILE_QUERIES + q) * row_room(d);
        float *rows = worker->rows + place, *weights = search->masked ? worker->weights + place : NULL;
        query[q].valid = copy_query(search, first + q, rows, weights);
        if (!query[q].valid)
            memset(rows, 0, row_room(d) * sizeof *rows);
        query[q].rows = windows[q] = (RfWindowRows){rows, d->row_numbers};
        query[q].weights = search->masked ? (RfWindowRows){weights, d->row_numbers} : (RfWindowRows){d->row_weights, 0};
    }
    rf_pack_panel(d, windows, count, worker->panel);
    if (search->masked)
    {
        memset(&norms, 0, sizeof norms);
        mask_panel(search, first, count, worker->panel, kept, norms.norm);
    }
    else
    {
        rf_project_panel(worker->panel, d->numbers, d->basis, d->blocks, worker->products);
        rf_measure_panel(d, worker->panel, worker->products, &norms);
        keep_queries(d, worker->panel, worker->products, &norms, kept);
    }
    float rounding = rf_rounding_of(d->numbers + search->kept);
    for (int q = 0; q < count; ++q)
    {
        float weight = search->masked ? most_weight(search, first + q) : 1;
        query[q].norm = norms.norm[q];
        query[q].slack = 4 * rounding * (norms.norm[q] + weight * d->largest_norm + search->largest_penalty);
        query[q].residual_error = norms.residual_error[q] + (search->masked ? 0 : d->residual_error);
        query[q].score = query[q].distance = query[q].limit = INFINITY;
        query[q].candidate = -1;
    }
}

// ---- bounds ------------------------------------------------------------------------------------------------------

// A tile for masked queries: numbers [numbers][32], then their squares, summed over a pixel's channels, [pixels][32].
static void gather_tile(const Search *search, int first, Worker *worker)
{
    const RfWindowDatabase *d = search->database;
    float *squares = worker->tile + (size_t)d->numbers * RF_TILE_CANDIDATES;
    memset(squares, 0, (size_t)d->side * (size_t)d->side * RF_TILE_CANDIDATES * sizeof *squares);
    for (int part = 0; part < RF_TILE_CANDIDATES; part += RF_TILE_QUERIES)
    {
        int count = rf_min_int(RF_TILE_QUERIES, RF_TILE_CANDIDATES - part);
        RfWindowRows windows[RF_TILE_QUERIES];
        for (int q = 0; q < count; ++q)
            windows[q] = rf_window_rows(d, rf_min_int(first + part + q, d->candidates - 1));
        rf_pack_panel(d, windows, count, worker->panel);
        for (int k = 0; k < d->numbers; ++k)
            for (int q = 0; q < count; ++q)
            {
                float number = worker->panel[k * RF_TILE_QUERIES + q];
                worker->tile[k * RF_TILE_CANDIDATES + part + q] = number;
                squares[k / d->channels * RF_TILE_CANDIDATES + part + q] += number * number;
            }
    }
}

// Bounds of `panels` panels against candidates first .. first + count - 1 (whole tiles), with their minima.
static void fill_bounds(const Search *search, Worker *worker, int panels, int first, int count)
{
    const RfWindowDatabase *d = search->database;
    size_t tile_room = (size_t)search->kept * RF_TILE_CANDIDATES;
    for (int group = 0; group < count; group += RF_GROUP_CANDIDATES)
    {
        int end = rf_min_int(group + RF_GROUP_CANDIDATES, count);
        for (int c = group; c < end; c += RF_TILE_CANDIDATES)
        {
            const float *tile = worker->tile;
            if (search->masked)
                gather_tile(search, first + c, worker);
            else
                tile = d->kept_numbers + (size_t)(first + c) / RF_TILE_CANDIDATES * tile_room;
            for (int p = 0; p < panels; ++p)
                rf_tile_products(worker->kept + (size_t)p * (size_t)search->kept * RF_TILE_QUERIES, tile, search->kept,
                                 search->starts + first + c,
                                 worker->bounds + (size_t)p * RF_TILE_QUERIES * search->bounds_stride + c,
                                 (ptrdiff_t)search->bounds_stride);
        }
        for (int q = 0; q < panels * RF_TILE_QUERIES; ++q)
        {
            float *bounds = worker->bounds + (size_t)q * search->bounds_stride + group;
            for (int c = end - group; c < RF_GROUP_CANDIDATES; ++c)
                bounds[c] = INFINITY;
            rf_fold_group(bounds, worker->minima + (size_t)q * search->minima_stride + group / FOLD);
        }
    }
}

static void exclude(const Search *search, RfWindowPlace place, int first, int count, float *bounds, float *minima)
{
    const RfWindowDatabase *d = search->database;
    RfExclusion exclusion = {.reach = (float)d->side, .period_x = d->period_x, .period_y = d->period_y};
    rf_window_centre(d, place, &exclusion.x, &exclusion.y);
    rf_exclude_bounds(&exclusion, d->centre_x + first, d->centre_y + first, count, bounds);
    for (int group = 0; group < count; group += RF_GROUP_CANDIDATES)
        rf_fold_group(bounds + group, minima + group / FOLD);
}

// ---- full comparisons --------------------------------------------------------------------------------------------

// No candidate whose bound (as stored: half of it, less half the query's norm) is above this can be as near as the
// best.
static float bound_limit(const Search *search, const Query *query)
{
    double apart = fmax((double)query->score - (double)search->least_penalty, 0), e = (double)query->residual_error,
           slack = (double)query->slack + 2 * sqrt(apart) * e + e * e +
                   4 * (double)rf_rounding_of(search->database->numbers) * apart;
    return (float)(0.5 * ((double)query->score + slack - (double)query->norm));
}

static void compare(const Search *search, Query *query, int candidate)
{
    const RfWindowDatabase *d = search->database;
    float distance =
              rf_window_distance(query->rows, rf_window_rows(d, candidate), query->weights, d->side, d->row_numbers),
          score = search->queries->penalties ? distance + search->queries->penalties[candidate] : distance;
    if (score > query->score || (score == query->score && candidate > query->candidate))
        return;
    query->score = score;
    query->distance = distance;
    query->candidate = candidate;
    query->limit = bound_limit(search, query);
}

static void visit_chunk(const Search *search, Worker *worker, Query *query, const float *bounds, const float *minima,
                        int first, int count)
{
    RfLeast least;
    int folded = (count + RF_GROUP_CANDIDATES - 1) / RF_GROUP_CANDIDATES * RF_GROUP_LANES;
    rf_find_least(minima, folded, &least);
    if (least.value == INFINITY || least.value > query->limit)
        return;
    int nearest = least.index / RF_GROUP_LANES * RF_GROUP_CANDIDATES + least.index % RF_GROUP_LANES;
    while (bounds[nearest] != least.value)
        nearest += RF_GROUP_LANES;
    compare(search, query, first + nearest);
    int listed = rf_list_below(bounds, minima, folded, query->limit, worker->list);
    for (int i = 0; i < listed; ++i)
    {
        int candidate = worker->list[i];
        if (candidate != nearest && bounds[candidate] <= query->limit)
            compare(search, query, first + candidate);
    }
}

// ---- the walk ----------------------------------------------------------------------------------------------------

static void write_matches(const Search *search, const Query *query, int first, int count)
{
    for (int q = 0; q < count; ++q, ++query)
    {
        RfWindowMatch *match = &search->matches[first + q];
        match->candidate = query->candidate;
        match->distance = query->distance;
        match->place = query->candidate < 0 ? (RfWindowPlace){-1, 0, 0} : search->database->places[query->candidate];
    }
}

static void search_block(void *context, int item, int index)
{
    const Search *search = context;
    const RfWindowDatabase *d = search->database;
    Worker *worker = &search->workers[index];
    int block = search->panels * RF_TILE_QUERIES, start = item * block,
        queries = rf_min_int(block, search->queries->count - start),
        panels = (queries + RF_TILE_QUERIES - 1) / RF_TILE_QUERIES, all = d->tiles_of_candidates * RF_TILE_CANDIDATES;
    for (int p = 0; p < panels; ++p)
        load_panel(search, worker, p, start + p * RF_TILE_QUERIES,
                   rf_min_int(RF_TILE_QUERIES, queries - p * RF_TILE_QUERIES));
    for (int first = 0; first < all; first += search->chunk)
    {
        int count = rf_min_int(search->chunk, all - first);
        fill_bounds(search, worker, panels, first, count);
        for (int q = 0; q < queries; ++q)
        {
            float *bounds = worker->bounds + (size_t)q * search->bounds_stride,
                  *minima = worker->minima + (size_t)q * search->minima_stride;
            const RfWindowPlace *excluded = search->queries->excluded;
            if (excluded && excluded[start + q].copy >= 0)
                exclude(search, excluded[start + q], first, count, bounds, minima);
            if (worker->query[q].valid)
                visit_chunk(search, worker, &worker->query[q], bounds, minima, first, count);
        }
    }
    write_matches(search, worker->query, start, queries);
}

static RfResult check_queries(const RfWindowDatabase *d, const RfWindowQueries *queries, const RfWindowMatch *matches)
{
    RF_REQUIRE(d && queries && queries->count >= 0, "no database, or less than no queries");
    RF_REQUIRE(queries->count == 0 || (queries->windows && matches), "queries without windows or room for matches");
    size_t weights = queries->weights ? (size_t)queries->count * (size_t)d->side * (size_t)d->side : 0;
    for (size_t i = 0; i < weights; ++i)
        RF_REQUIRE(queries->weights[i] >= 0 && queries->weights[i] <= RF_WINDOW_LARGEST_WEIGHT,
                   "weight %g of a query is not in 0 to %g", (double)queries->weights[i],
                   (double)RF_WINDOW_LARGEST_WEIGHT);
    for (int i = 0; queries->penalties && i < d->candidates; ++i)
        RF_REQUIRE(fabsf(queries->penalties[i]) <= 1e30f, "penalty %g of candidate %d is beyond 1e30",
                   (double)queries->penalties[i], i);
    for (int i = 0; queries->excluded && i < queries->count; ++i)
        RF_REQUIRE(queries->excluded[i].copy < d->copies, "query %d excludes copy %d of %d", i,
                   queries->excluded[i].copy, d->copies);
    return RF_OK;
}

// |c|^2 / 2 (not for masked queries, whose product holds it) plus half the penalty.
static RfResult make_starts(Search *search)
{
    const RfWindowDatabase *d = search->database;
    const float *penalties = search->queries->penalties;
    search->starts = d->half_norms;
    if (!penalties && !search->masked)
        return RF_OK;
    size_t room = (size_t)d->tiles_of_candidates * RF_TILE_CANDIDATES;
    float *starts = search->own_starts = rf_allocate(room, sizeof *starts);
    if (!starts)
        return RF_OUT_OF_MEMORY;
    search->starts = starts;
    search->least_penalty = penalties ? penalties[0] : 0;
    for (size_t i = 0; i < room; ++i)
    {
        bool real = i < (size_t)d->candidates;
        float penalty = penalties && real ? penalties[i] : 0;
        starts[i] = real ? (search->masked ? 0 : d->half_norms[i]) + 0.5f * penalty : INFINITY;
        search->largest_penalty = rf_max(fabsf(penalty), search->largest_penalty);
        if (real && penalties)
            search->least_penalty = rf_min(penalty, search->least_penalty);
    }
    return RF_OK;
}

static float *take(float **memory, size_t count)
{
    float *start = *memory;
    *memory += (count + 15) / 16 * 16;
    return start;
}

static RfResult make_workers(Search *search)
{
    const RfWindowDatabase *d = search->database;
    size_t threads = (size_t)rf_threads(), queries = (size_t)search->panels * RF_TILE_QUERIES,
           kept = (size_t)search->kept, rows = queries * row_room(d), bounds = queries * search->bounds_stride,
           minima = queries * search->minima_stride, panel = (size_t)d->numbers * RF_TILE_QUERIES,
           products = (size_t)d->blocks * RF_BASIS_BLOCK * RF_TILE_QUERIES,
           tile = search->masked ? kept * RF_TILE_CANDIDATES : 0,
           each = panel + products + kept * queries + 2 * rows + bounds + minima + tile;
    each = (each + 8 * 16 + 15) / 16 * 16;
    search->workers = rf_allocate(threads, sizeof *search->workers);
    search->scratch = rf_allocate_zero(threads, each * sizeof *search->scratch);
    if (!search->workers || !search->scratch)
        return RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < threads; ++i)
    {
        Worker *worker = &search->workers[i];
        float *memory = search->scratch + i * each;
        worker->panel = take(&memory, panel);
        worker->products = take(&memory, products);
        worker->kept = take(&memory, kept * queries);
        worker->rows = take(&memory, rows);
        worker->weights = take(&memory, rows);
        worker->bounds = take(&memory, bounds);
        worker->minima = take(&memory, minima);
        worker->tile = take(&memory, tile);
    }
    return RF_OK;
}

RfResult rf_windows_search(const RfWindowDatabase *database, const RfWindowQueries *queries, RfWindowMatch *matches)
{
    RF_TRY(check_queries(database, queries, matches));
    if (queries->count == 0)
        return RF_OK;
    Search search = {.database = database, .queries = queries, .matches = matches, .masked = queries->weights != NULL};
    search.kept = search.masked ? database->numbers + database->side * database->side : database->kept;
    search.panels = search.masked ? MASKED_PANELS : 1;
    search.chunk = search.masked ? MASKED_CHUNK : CHUNK;
    search.bounds_stride = (size_t)search.chunk + BOUNDS_MARGIN;
    search.minima_stride = (size_t)search.chunk / FOLD;
    RfResult result = make_starts(&search);
    if (result == RF_OK)
        result = make_workers(&search);
    if (result == RF_OK)
        rf_parallel_for((queries->count - 1) / (search.panels * RF_TILE_QUERIES) + 1, search_block, &search);
    rf_release(search.own_starts);
    rf_release(search.workers);
    rf_release(search.scratch);
    return result;
}
