// SPDX-License-Identifier: Apache-2.0
// What is kept of windows: coordinates on principal components, how many of them, and the norm of what they leave out
// (why: neighbours.c; in integers: short_bounds.c). Queries and candidates take the same way, 12 at a time.

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "core/simd.h"
#include "kernels/principal.h"
#include "kernels/windows.h"

#include <string.h>

enum
{
    // Windows that the principal components are found from, evenly over all: more move the kept variance by under 0.1
    // %.
    MAX_SAMPLES = 2048,
    // Up to here the numbers themselves are compared.
    COMPLETE_NUMBERS = 24,
    // In floats fastest are 11 on water, 23 to 27 on foam, 31 to 39 on gravel, 39 to 47 on bubbles, 47 to 63 on lava
    // (64 x 64 pixels, 9 x 9 x 2 numbers; bench/neighbours.c), in integers 11 to 15, 27 to 31, 31 to 39, 47 and 47 to
    // 59: the rules below are within 15 % of all of them.
    MOST_COMPONENTS = 47,
    LEAST_COMPONENTS = 11,
    PANELS_AN_ITEM = 8
};
// Parts of the variance. A second block of components doubles the time that a database takes, so what the first holds
// may be a little less.
#define WANTED_IN_FLOATS 0.93
#define WANTED_IN_SHORTS 0.955
#define ENOUGH_IN_SHORTS 0.94

float rf_rounding_of(int numbers)
{
    return (float)(numbers + 16) * 0x1p-23f;
}

void rf_pack_panel(const RfWindowDatabase *d, const RfWindowRows *windows, int count, float *panel)
{
    const float *from[RF_TILE_QUERIES];
    int row = d->side * d->channels;
    float mean[RF_MAX_WINDOW_SIDE * RF_MAX_WINDOW_CHANNELS], scale[RF_MAX_WINDOW_SIDE * RF_MAX_WINDOW_CHANNELS];
    for (int i = 0; i < row; ++i)
    {
        mean[i] = d->mean[i % d->channels];
        scale[i] = d->scale[i % d->channels];
    }
    for (int j = 0; j < d->side; ++j, panel += row * RF_TILE_QUERIES)
    {
        for (int q = 0; q < RF_TILE_QUERIES; ++q)
        {
            const RfWindowRows *window = &windows[rf_min_int(q, count - 1)];
            from[q] = window->numbers + j * window->stride;
        }
        for (int i = 0; i < row; ++i)
        {
            float *out = panel + i * RF_TILE_QUERIES;
            for (int q = 0; q < RF_TILE_QUERIES; ++q)
                out[q] = from[q][i];
            for (int q = 0; q < RF_TILE_QUERIES; ++q)
                out[q] = (out[q] - mean[i]) * scale[i];
            for (int q = count; q < RF_TILE_QUERIES; ++q)
                out[q] = 0;
        }
    }
}

int rf_block_numbers(const RfWindowDatabase *d)
{
    return (d->numbers + RF_WINDOW_BLOCK - 1) / RF_WINDOW_BLOCK * RF_WINDOW_BLOCK;
}

RF_WIDE_BODY void rf_centre_numbers_body(const float *restrict window, const float *restrict means,
                                         const float *restrict scales, int blocks, float *restrict out,
                                         float *restrict norm)
{
    float sums[RF_WINDOW_BLOCK] = {0}, sum = 0;
    for (int b = 0; b < blocks; ++b)
    {
#pragma omp simd
        for (int k = 0; k < RF_WINDOW_BLOCK; ++k)
        {
            float number = (window[k] - means[k]) * scales[k];
            out[k] = number;
            sums[k] += number * number;
        }
        window += RF_WINDOW_BLOCK;
        means += RF_WINDOW_BLOCK;
        scales += RF_WINDOW_BLOCK;
        out += RF_TILE_QUERIES * RF_WINDOW_BLOCK;
    }
    for (int k = 0; k < RF_WINDOW_BLOCK; ++k)
        sum += sums[k];
    *norm = sum;
}

RF_WIDE(rf_centre_numbers,
        (const float *restrict window, const float *restrict means, const float *restrict scales, int blocks,
         float *restrict out, float *restrict norm),
        (window, means, scales, blocks, out, norm))

float rf_centre_window(const RfWindowDatabase *d, const float *window, int q, float *windows)
{
    float norm;
    rf_centre_numbers(window, d->means, d->scales, rf_block_numbers(d) / RF_WINDOW_BLOCK, windows + q * RF_WINDOW_BLOCK,
                      &norm);
    return norm;
}

static float sum_squares(const float *numbers, int count)
{
    float sum = 0;
#pragma omp simd reduction(+ : sum)
    for (int k = 0; k < count; ++k)
        sum += numbers[k] * numbers[k];
    return sum;
}

// The residual's squared norm is a difference, off by at most e = rounding * norm^2; its root is then off by at most
// min(sqrt(e), e / root).
static float measure_residual(float norm, float inside, float rounding, float *off)
{
    float error = rounding * norm, residual = sqrtf(rf_max(norm - inside, 0));
    *off = residual > 0 ? rf_min(sqrtf(error), error / residual) : sqrtf(error);
    return residual;
}

static void keep_window(const RfWindowDatabase *d, float norm, float *kept, float *rest, float *residual_error,
                        float *rest_error)
{
    float inside = sum_squares(kept, d->components), rounding = rf_rounding_of(d->numbers + d->components),
          residual = measure_residual(norm, inside, rounding, residual_error);
    if (d->shorts.rests)
    {
        int more = rf_min_int(d->blocks * RF_BASIS_BLOCK - d->components, RF_REST_NUMBERS - 2);
        for (int k = 0; k < RF_REST_NUMBERS - 2; ++k)
            rest[k] = k < more ? kept[d->components + k] : 0;
        rest[RF_REST_NUMBERS - 2] = measure_residual(norm, inside + sum_squares(rest, more),
                                                     rf_rounding_of(d->numbers + d->components + more), rest_error);
        rest[RF_REST_NUMBERS - 1] = residual;
    }
    kept[d->components] = residual;
}

void rf_keep_windows(const RfWindowDatabase *d, const float *windows, RfKeptWindows *out)
{
    for (int b = 0; b < d->blocks; ++b)
        rf_project(windows, d->numbers, d->basis + (size_t)b * (size_t)d->numbers * RF_BASIS_BLOCK,
                   out->kept[0] + b * RF_BASIS_BLOCK, RF_KEPT_STRIDE);
    RfPanelNorms *norms = &out->norms;
    for (int q = 0; q < RF_TILE_QUERIES; ++q)
    {
        norms->residual_error[q] = norms->rest_error[q] = 0;
        if (!d->complete)
            keep_window(d, norms->norm[q], out->kept[q], out->rest[q], &norms->residual_error[q],
                        &norms->rest_error[q]);
        for (int k = 0; d->complete && k < d->numbers; ++k)
            out->kept[q][k] =
                windows[(k / RF_WINDOW_BLOCK * RF_TILE_QUERIES + q) * RF_WINDOW_BLOCK + k % RF_WINDOW_BLOCK];
    }
}

// ---- components --------------------------------------------------------------------------------------------------

typedef struct Samples
{
    const RfWindowDatabase *database;
    int count;
} Samples;

static void read_samples(const void *context, int item, float *panel)
{
    const Samples *samples = context;
    const RfWindowDatabase *d = samples->database;
    RfWindowRows windows[RF_TILE_QUERIES];
    int count = rf_min_int(samples->count - item, RF_TILE_QUERIES);
    for (int q = 0; q < count; ++q)
        windows[q] = rf_window_rows(d, (int)((int64_t)(item + q) * d->candidates / samples->count));
    rf_pack_panel(d, windows, count, panel);
}

// How many of the components found to keep where integers are compared. With the residual's norm they come in pairs, so
// an odd number; -1: more have to be found.
static int choose_for_shorts(const double *variances, int found, double total)
{
    double held = 0;
    if (found > RF_BASIS_BLOCK)
        return MOST_COMPONENTS;
    for (int count = 1; count < found; ++count)
    {
        held += variances[count - 1];
        if (count % 2 == 1 && count >= LEAST_COMPONENTS && held >= WANTED_IN_SHORTS * total)
            return count;
    }
    return held >= ENOUGH_IN_SHORTS * total ? found - 1 : -1;
}

static int choose_for_floats(const double *variances, int found, double total)
{
    double held = 0;
    for (int count = 1; count <= rf_min_int(found, MOST_COMPONENTS); ++count)
    {
        held += variances[count - 1];
        if (count >= LEAST_COMPONENTS && held >= WANTED_IN_FLOATS * total)
            return count;
    }
    return found >= MOST_COMPONENTS ? MOST_COMPONENTS : -1;
}

// Returns false if more have to be found.
static bool choose_components(RfWindowDatabase *d, int wanted, const double *variances, double total)
{
    int found = d->blocks * RF_BASIS_BLOCK;
    if (wanted == 0)
        wanted = (rf_simd_multiplies_shorts() ? choose_for_shorts : choose_for_floats)(variances, found, total);
    if (wanted < 0)
        return false;
    double held = 0;
    for (int k = 0; k < wanted; ++k)
        held += variances[k];
    d->components = wanted;
    d->kept = wanted + 1;
    d->variance_kept = total > 0 ? (float)fmin(held / total, 1) : 1;
    return true;
}

static RfResult find_blocks(RfWindowDatabase *d, int blocks, int wanted, bool *enough)
{
    rf_release(d->basis);
    d->blocks = blocks;
    d->basis = rf_allocate((size_t)blocks * (size_t)d->numbers, RF_BASIS_BLOCK * sizeof *d->basis);
    if (!d->basis)
        return RF_OUT_OF_MEMORY;
    double variances[RF_MAX_WINDOW_COMPONENTS], total;
    Samples samples = {d, rf_min_int(d->candidates, MAX_SAMPLES)};
    RfPanelReader reader = {read_samples, &samples, samples.count, d->numbers};
    RF_TRY(rf_principal_components(&reader, blocks, d->basis, variances, &total));
    *enough = choose_components(d, wanted, variances, total);
    return RF_OK;
}

RfResult rf_find_components(RfWindowDatabase *d, int wanted)
{
    d->complete = d->numbers <= (wanted > 0 ? wanted : COMPLETE_NUMBERS);
    if (d->complete)
    {
        d->components = d->kept = d->numbers;
        d->variance_kept = 1;
        return RF_OK;
    }
    bool enough = false;
    for (int blocks = wanted > RF_BASIS_BLOCK ? 2 : 1; blocks <= 2 && !enough; ++blocks)
        RF_TRY(find_blocks(d, blocks, wanted, &enough));
    return RF_OK;
}

// ---- candidates --------------------------------------------------------------------------------------------------

typedef struct Projection
{
    RfWindowDatabase *database;
    // a worker: windows[blocks][12][16], a window
    float *scratch;
    size_t scratch_size;
    // [items]
    float *largest_norm, *residual_error, *rest_error;
} Projection;

static void store_candidate(RfWindowDatabase *d, int i, const float *kept, const float *rest)
{
    float *out = d->kept_numbers + (size_t)(i / RF_TILE_CANDIDATES) * (size_t)d->kept * RF_TILE_CANDIDATES +
                 i % RF_TILE_CANDIDATES,
          half = 0;
    for (int k = 0; k < d->kept; ++k)
    {
        out[k * RF_TILE_CANDIDATES] = -kept[k];
        half += 0.5f * kept[k] * kept[k];
    }
    d->half_norms[i] = half;
    if (d->shorts.numbers)
        rf_shorten_candidate(&d->shorts, i, kept, rest);
}

static void read_windows(const Projection *projection, int worker, int first, int count, float *windows, float *norms)
{
    const RfWindowDatabase *d = projection->database;
    float *window =
        projection->scratch + (size_t)worker * projection->scratch_size + rf_block_numbers(d) * RF_TILE_QUERIES;
    for (int q = 0; q < count; ++q)
    {
        rf_windows_read(d, first + q, window);
        norms[q] = rf_centre_window(d, window, q, windows);
    }
}

static int item_end(const RfWindowDatabase *d, int item)
{
    return rf_min_int((item + 1) * PANELS_AN_ITEM * RF_TILE_QUERIES, d->candidates);
}

// The scale of integers needs the largest norm before anything is stored.
static void measure_item(void *context, int item, int worker)
{
    const Projection *projection = context;
    const RfWindowDatabase *d = projection->database;
    float *windows = projection->scratch + (size_t)worker * projection->scratch_size, largest = 0;
    for (int i = item * PANELS_AN_ITEM * RF_TILE_QUERIES; i < item_end(d, item); ++i)
    {
        float norm;
        read_windows(projection, worker, i, 1, windows, &norm);
        largest = rf_max(norm, largest);
    }
    projection->largest_norm[item] = largest;
}

static void project_item(void *context, int item, int worker)
{
    const Projection *projection = context;
    RfWindowDatabase *d = projection->database;
    float *windows = projection->scratch + (size_t)worker * projection->scratch_size;
    RfPanelNorms most = {0};
    for (int first = item * PANELS_AN_ITEM * RF_TILE_QUERIES, end = item_end(d, item); first < end;
         first += RF_TILE_QUERIES)
    {
        RfKeptWindows kept = {0};
        int count = rf_min_int(end - first, RF_TILE_QUERIES);
        read_windows(projection, worker, first, count, windows, kept.norms.norm);
        rf_keep_windows(d, windows, &kept);
        for (int q = 0; q < count; ++q)
        {
            store_candidate(d, first + q, kept.kept[q], kept.rest[q]);
            most.residual_error[0] = rf_max(kept.norms.residual_error[q], most.residual_error[0]);
            most.rest_error[0] = rf_max(kept.norms.rest_error[q], most.rest_error[0]);
        }
    }
    projection->residual_error[item] = most.residual_error[0];
    projection->rest_error[item] = most.rest_error[0];
}

static float largest_of(const float *numbers, int count)
{
    float largest = 0;
    for (int i = 0; i < count; ++i)
        largest = rf_max(numbers[i], largest);
    return largest;
}

RfResult rf_project_candidates(RfWindowDatabase *d)
{
    int chunk = PANELS_AN_ITEM * RF_TILE_QUERIES, items = (d->candidates - 1) / chunk + 1;
    Projection p = {.database = d};
    p.scratch_size = (size_t)(rf_block_numbers(d) * (RF_TILE_QUERIES + 1));
    p.scratch = rf_allocate_zero((size_t)rf_threads() * p.scratch_size, sizeof *p.scratch);
    p.largest_norm = rf_allocate((size_t)items, 3 * sizeof *p.largest_norm);
    RfResult result = p.scratch && p.largest_norm ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
    {
        p.residual_error = p.largest_norm + items;
        p.rest_error = p.residual_error + items;
        rf_parallel_for(items, measure_item, &p);
        d->largest_norm = largest_of(p.largest_norm, items);
        d->shorts.scale = rf_short_scale(sqrt((double)d->largest_norm));
        rf_parallel_for(items, project_item, &p);
        d->residual_error = largest_of(p.residual_error, items);
        d->rest_error = largest_of(p.rest_error, items);
    }
    rf_release(p.scratch);
    rf_release(p.largest_norm);
    return result;
}

// A second bound is made where there is a second block of components to make it of.
RfResult rf_allocate_shorts(RfWindowDatabase *d)
{
    RfShortNumbers *shorts = &d->shorts;
    if (!rf_simd_multiplies_shorts())
        return RF_OK;
    size_t room = (size_t)d->tiles_of_candidates * RF_TILE_CANDIDATES;
    bool second = !d->complete && d->blocks > 1 && d->components < d->blocks * RF_BASIS_BLOCK;
    shorts->kept = d->kept;
    shorts->pairs = (d->kept + 1) / 2;
    shorts->numbers = rf_allocate_zero(room, (size_t)shorts->pairs * 2 * sizeof *shorts->numbers);
    shorts->starts = rf_allocate(room, sizeof *shorts->starts);
    shorts->rests = second ? rf_allocate(room, RF_REST_NUMBERS * sizeof *shorts->rests) : NULL;
    if (!shorts->numbers || !shorts->starts || (second && !shorts->rests))
        return RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < room; ++i)
        shorts->starts[i] = RF_SHORT_INFINITE;
    return RF_OK;
}
