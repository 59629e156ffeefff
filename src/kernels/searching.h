// SPDX-License-Identifier: Apache-2.0
// A search for nearest windows while it runs: see neighbours.c.
#pragma once

#include "kernels/windows.h"

enum
{
    /// Candidates a chunk: 12 rows of bounds are 200 KB.
    RF_SEARCH_CHUNK = RF_MAX_LANES / RF_GROUP_LANES * RF_GROUP_CANDIDATES,
    /// Masked queries share a tile that is gathered for them.
    RF_MASKED_PANELS = 8
};

typedef struct RfSearchQuery
{
    RfWindowRows rows, weights;
    /// Of the numbers compared; and in all that the slack is made of.
    float norm, slack;
    /// How far the distance of kept numbers can be off, and of those of the second bound.
    double error, rest_error;
    /// Sum of squares in integers.
    int32_t square;
    bool valid;
    /// The candidate of the chunk with the least bound.
    int nearest;
    /// distance + penalty of the best so far, its bare distance, and which it is
    float score, distance;
    int candidate;
    /// Bounds above cannot be better; nor second ones.
    float limit, rest_limit;
} RfSearchQuery;

typedef struct RfSearchWorker
{
    RfSearchQuery query[RF_MASKED_PANELS * RF_TILE_QUERIES];
    int list[RF_SEARCH_CHUNK + 1];
    /// panel (of masked queries: [numbers][12], else [blocks][12][16]), kept[panels][kept][12], rows and weight rows of
    /// every query, bounds, minima, and for masked queries a tile of candidates [kept][32]
    float *panel, *kept, *rows, *weights, *bounds, *minima, *tile;
    /// The kept numbers of a panel in integers, and whether these are compared.
    _Alignas(64) int16_t shorts[RF_TILE_QUERIES][RF_KEPT_STRIDE];
    _Alignas(64) int16_t rests[RF_TILE_QUERIES][RF_REST_NUMBERS];
    bool in_shorts;
    /// What is still to be fetched of the next queries.
    const float *next, *next_end;
    int lines_a_group;
} RfSearchWorker;

typedef struct RfSearch
{
    const RfWindowDatabase *database;
    const RfWindowQueries *queries;
    RfWindowMatch *matches;
    bool masked;
    int kept, panels, chunk;
    /// Of a query's bounds and of their minima.
    size_t bounds_stride, minima_stride;
    /// [tiles * 32]: what the sums start from
    const float *starts;
    float *own_starts;
    /// The same in integers; NULL where they do not serve.
    const int32_t *short_starts;
    int32_t *own_short_starts;
    float least_penalty, largest_penalty;
    RfSearchWorker *workers;
    float *scratch;
} RfSearch;

/// Copies `count` queries from `first` on, as panel `panel` of the worker, and projects them. Nothing is found yet.
void rf_search_load(const RfSearch *search, RfSearchWorker *worker, int panel, int first, int count);

/// Floats between the rows of one query and the next one's.
size_t rf_search_row_room(const RfSearch *search);
