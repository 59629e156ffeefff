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
// Step 3 finds 2 to 20 candidates of 3136 on water and foam (9 x 9 x 2 numbers), 50 to 200 on what has no dominant
// components, such as bubbles; more components are kept there (window_projection.c). The residual's norm leaves 2 to 20
// times fewer where queries are blended or the exemplar is smooth, and is worth one more component elsewhere.
//
// Candidates are walked in chunks, so that the bounds stay in the second cache; the best so far goes from chunk to
// chunk.
//
// Tried and dropped: norms of groups of components, or of the residual's quarters, instead of components (more
// candidates are left for as many numbers); groups of 2 or 8 tiles instead of 4.
//
// Where the machine multiplies 16-bit integers twice as fast as floats, step 1 is done in these, and what it leaves is
// sieved by a second bound before step 3 (short_bounds.c has the proof). What cannot be done in them (masked queries,
// queries far larger than any candidate, penalties out of proportion) is done in floats.
//
// Exact in spite of rounding. Steps 2 and 3 compare by direct differences in one order, whatever the instruction set.
// Bounds are rounded, so step 3 grants them a slack: a sum of n products is taken to be off by n 2^-23 of the sum of
// their sizes, twice the worst that can be (n 2^-24), and many times what rounding of random sign leaves (sqrt(n)
// 2^-24; Higham and Mary. A new approach to probabilistic rounding error analysis. 2019). It costs nothing that could
// be measured. A residual's norm is the root of a difference; how far it can be off is kept with it
// (window_projection.c).
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
#include "kernels/searching.h"

#include <string.h>

enum
{
    // Rows of bounds do not start a multiple of 4096 bytes apart: 24 stores of a tile would fall on one cache set.
    BOUNDS_MARGIN = RF_TILE_CANDIDATES,
    // Candidates to a minimum.
    FOLD = RF_GROUP_CANDIDATES / RF_GROUP_LANES,
    MASKED_CHUNK = 512
};

// ---- bounds ------------------------------------------------------------------------------------------------------

// A tile for masked queries: negative numbers [numbers][32], then their squares, summed over a pixel's channels,
// [pixels][32].
static void gather_tile(const RfSearch *search, int first, RfSearchWorker *worker)
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
                worker->tile[k * RF_TILE_CANDIDATES + part + q] = -number;
                squares[k / d->channels * RF_TILE_CANDIDATES + part + q] += number * number;
            }
    }
}

// Queries come from memory once; the block that this worker is likely to take next comes while this one is searched,
// a few lines a group: all at once would have to be waited for.
static void plan_prefetch(const RfSearch *search, RfSearchWorker *worker, int64_t start, int count)
{
    int64_t numbers = search->database->numbers, left = search->queries->count - start,
            groups = (search->database->tiles_of_candidates - 1) / RF_GROUP_TILES + 1;
    worker->next = worker->next_end = search->queries->windows;
    if (left <= 0)
        return;
    worker->next += start * numbers;
    worker->next_end = worker->next + numbers * (left < count ? left : count);
    worker->lines_a_group = (int)((worker->next_end - worker->next) / (16 * groups)) + 1;
}

static void prefetch_queries(RfSearchWorker *worker)
{
    for (int i = 0; i < worker->lines_a_group && worker->next < worker->next_end; ++i, worker->next += 16)
        __builtin_prefetch(worker->next, 0, 2);
}

// Bounds of `panels` panels against candidates first .. first + count - 1 (whole tiles), with their minima.
static void fill_bounds(const RfSearch *search, RfSearchWorker *worker, int panels, int first, int count)
{
    const RfWindowDatabase *d = search->database;
    size_t tile_room = (size_t)search->kept * RF_TILE_CANDIDATES;
    for (int group = 0; group < count; group += RF_GROUP_CANDIDATES)
    {
        int end = rf_min_int(group + RF_GROUP_CANDIDATES, count);
        prefetch_queries(worker);
        for (int c = group; c < end; c += RF_TILE_CANDIDATES)
        {
            if (worker->in_shorts)
            {
                rf_short_products(worker->shorts[0],
                                  d->shorts.numbers + (size_t)(first + c) * (size_t)d->shorts.pairs * 2,
                                  d->shorts.pairs, search->short_starts + first + c, worker->bounds + c,
                                  (ptrdiff_t)search->bounds_stride);
                continue;
            }
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
        int queries = panels * RF_TILE_QUERIES;
        float *bounds = worker->bounds + group;
        for (int q = 0; q < queries && end - group < RF_GROUP_CANDIDATES; ++q)
            for (int c = end - group; c < RF_GROUP_CANDIDATES; ++c)
                bounds[(size_t)q * search->bounds_stride + (size_t)c] = INFINITY;
        rf_fold_group(bounds, (ptrdiff_t)search->bounds_stride, queries, worker->minima + group / FOLD,
                      (ptrdiff_t)search->minima_stride);
    }
}

static void exclude(const RfSearch *search, RfWindowPlace place, int first, int count, float *bounds, float *minima)
{
    const RfWindowDatabase *d = search->database;
    RfExclusion exclusion = {.reach = (float)d->side, .period_x = d->period_x, .period_y = d->period_y};
    rf_window_centre(d, place, &exclusion.x, &exclusion.y);
    rf_exclude_bounds(&exclusion, d->centre_x + first, d->centre_y + first, count, bounds);
    for (int group = 0; group < count; group += RF_GROUP_CANDIDATES)
        rf_fold_group(bounds + group, 0, 1, minima + group / FOLD, 0);
}

// ---- full comparisons --------------------------------------------------------------------------------------------

// No candidate whose bound (as stored: half of it, less half the query's norm, or as integers have it) is above this
// can be as near as the best.
static float bound_limit(const RfSearch *search, const RfSearchQuery *query, double e, bool in_shorts)
{
    double apart = fmax((double)query->score - (double)search->least_penalty, 0),
           slack = (double)query->slack + 2 * sqrt(apart) * e + e * e +
                   4 * (double)rf_rounding_of(search->database->numbers) * apart;
    if (in_shorts)
        return rf_short_limit(&search->database->shorts, apart + slack, query->square);
    return (float)(0.5 * ((double)query->score + slack - (double)query->norm));
}

static void compare(const RfSearch *search, const RfSearchWorker *worker, RfSearchQuery *query, int candidate)
{
    const RfWindowDatabase *d = search->database;
    float distance = rf_window_distance(query->rows, rf_window_rows(d, candidate), query->weights, d->side,
                                        d->side * d->channels),
          score = search->queries->penalties ? distance + search->queries->penalties[candidate] : distance;
    if (score > query->score || (score == query->score && candidate > query->candidate))
        return;
    query->score = score;
    query->distance = distance;
    query->candidate = candidate;
    query->limit = bound_limit(search, query, query->error, worker->in_shorts);
    if (worker->in_shorts)
        query->rest_limit = bound_limit(search, query, query->rest_error, true);
}

// Sets query->nearest, -1 if nothing in the chunk can be nearer than the best.
static void find_nearest(RfSearchQuery *query, const float *bounds, const float *minima, int folded)
{
    float least;
    query->nearest = rf_find_least(bounds, minima, folded, &least);
    if (!query->valid || least == INFINITY || least > query->limit)
        query->nearest = -1;
}

static void compare_others(const RfSearch *search, RfSearchWorker *worker, RfSearchQuery *query, const float *bounds,
                           const float *minima, int folded, int first)
{
    int *list = worker->list, listed = rf_list_below(bounds, minima, folded, query->limit, list);
    if (worker->in_shorts && search->database->shorts.rests)
        listed = rf_short_sieve(&search->database->shorts, worker->rests[query - worker->query], bounds, first,
                                query->rest_limit, list, listed);
    for (int i = 0; i < listed; ++i)
        if (list[i] != query->nearest && bounds[list[i]] <= query->limit)
            compare(search, worker, query, first + list[i]);
}

// RfSearchQuery by query in three passes: within one, a processor can begin a query before it has ended the one before.
static void visit_chunk(const RfSearch *search, RfSearchWorker *worker, int start, int queries, int first, int count)
{
    int folded = (count + RF_GROUP_CANDIDATES - 1) / RF_GROUP_CANDIDATES * RF_GROUP_LANES;
    const RfWindowPlace *excluded = search->queries->excluded;
    for (int q = 0; q < queries; ++q)
    {
        float *bounds = worker->bounds + (size_t)q * search->bounds_stride,
              *minima = worker->minima + (size_t)q * search->minima_stride;
        if (excluded && excluded[start + q].copy >= 0)
            exclude(search, excluded[start + q], first, count, bounds, minima);
        find_nearest(&worker->query[q], bounds, minima, folded);
    }
    for (int q = 0; q < queries; ++q)
        if (worker->query[q].nearest >= 0)
            compare(search, worker, &worker->query[q], first + worker->query[q].nearest);
    for (int q = 0; q < queries; ++q)
        if (worker->query[q].nearest >= 0)
            compare_others(search, worker, &worker->query[q], worker->bounds + (size_t)q * search->bounds_stride,
                           worker->minima + (size_t)q * search->minima_stride, folded, first);
}

// ---- the walk ----------------------------------------------------------------------------------------------------

static void write_matches(const RfSearch *search, const RfSearchQuery *query, int first, int count)
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
    const RfSearch *search = context;
    const RfWindowDatabase *d = search->database;
    RfSearchWorker *worker = &search->workers[index];
    int block = search->panels * RF_TILE_QUERIES, start = item * block,
        queries = rf_min_int(block, search->queries->count - start),
        panels = (queries + RF_TILE_QUERIES - 1) / RF_TILE_QUERIES, all = d->tiles_of_candidates * RF_TILE_CANDIDATES;
    for (int p = 0; p < panels; ++p)
        rf_search_load(search, worker, p, start + p * RF_TILE_QUERIES,
                       rf_min_int(RF_TILE_QUERIES, queries - p * RF_TILE_QUERIES));
    plan_prefetch(search, worker, start + (int64_t)block * rf_threads(), block);
    for (int first = 0; first < all; first += search->chunk)
    {
        int count = rf_min_int(search->chunk, all - first);
        fill_bounds(search, worker, panels, first, count);
        visit_chunk(search, worker, start, queries, first, count);
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
static RfResult make_starts(RfSearch *search)
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

// Integers serve where all numbers of a window are known and penalties are not out of all proportion.
static RfResult make_short_starts(RfSearch *search)
{
    const RfWindowDatabase *d = search->database;
    const float *penalties = search->queries->penalties;
    if (search->masked || !d->shorts.numbers ||
        !rf_short_fits(&d->shorts, (double)search->largest_penalty - (double)search->least_penalty))
        return RF_OK;
    search->short_starts = d->shorts.starts;
    if (!penalties)
        return RF_OK;
    size_t room = (size_t)d->tiles_of_candidates * RF_TILE_CANDIDATES;
    search->short_starts = search->own_short_starts = rf_allocate(room, sizeof *search->own_short_starts);
    if (!search->own_short_starts)
        return RF_OUT_OF_MEMORY;
    memcpy(search->own_short_starts, d->shorts.starts, room * sizeof *search->own_short_starts);
    for (int i = 0; i < d->candidates; ++i)
        search->own_short_starts[i] =
            rf_short_start(&d->shorts, i, (double)penalties[i] - (double)search->least_penalty);
    return RF_OK;
}

static float *take(float **memory, size_t count)
{
    float *start = *memory;
    *memory += (count + 15) / 16 * 16;
    return start;
}

static RfResult make_workers(RfSearch *search)
{
    const RfWindowDatabase *d = search->database;
    size_t threads = (size_t)rf_threads(), queries = (size_t)search->panels * RF_TILE_QUERIES,
           kept = (size_t)search->kept, rows = queries * rf_search_row_room(search),
           bounds = queries * search->bounds_stride, minima = queries * search->minima_stride,
           panel = (size_t)rf_block_numbers(d) * RF_TILE_QUERIES, tile = search->masked ? kept * RF_TILE_CANDIDATES : 0,
           each = panel + kept * queries + 2 * rows + bounds + minima + tile;
    each = (each + 8 * 16 + 15) / 16 * 16;
    search->workers = rf_allocate(threads, sizeof *search->workers);
    search->scratch = rf_allocate_zero(threads, each * sizeof *search->scratch);
    if (!search->workers || !search->scratch)
        return RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < threads; ++i)
    {
        RfSearchWorker *worker = &search->workers[i];
        float *memory = search->scratch + i * each;
        worker->panel = take(&memory, panel);
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
    RfSearch search = {
        .database = database, .queries = queries, .matches = matches, .masked = queries->weights != NULL};
    search.kept = search.masked ? database->numbers + database->side * database->side : database->kept;
    search.panels = search.masked ? RF_MASKED_PANELS : 1;
    search.chunk = search.masked ? MASKED_CHUNK : RF_SEARCH_CHUNK;
    search.bounds_stride = (size_t)search.chunk + BOUNDS_MARGIN;
    search.minima_stride = (size_t)search.chunk / FOLD;
    RfResult result = make_starts(&search);
    if (result == RF_OK)
        result = make_short_starts(&search);
    if (result == RF_OK)
        result = make_workers(&search);
    if (result == RF_OK)
        rf_parallel_for((queries->count - 1) / (search.panels * RF_TILE_QUERIES) + 1, search_block, &search);
    rf_release(search.own_starts);
    rf_release(search.own_short_starts);
    rf_release(search.workers);
    rf_release(search.scratch);
    return result;
}
