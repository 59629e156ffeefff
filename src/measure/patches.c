// SPDX-License-Identifier: Apache-2.0
// Is the local structure of a frame from the exemplar, all of it? Nearest windows both ways, exactly.
//
// Frame to exemplar finds what the exemplar never had: smears, seams, wrong scales. Exemplar to frame finds what got
// lost. One without the other is easily fooled: a frame that repeats one spot has no residual, and noise misses
// nothing. The pair is the measure of bidirectional similarity (Simakov, Caspi, Shechtman, Irani. Summarizing visual
// data using bidirectional similarity. 2008), the first alone the energy of texture optimisation (Kwatra, Essa, Bobick,
// Kwatra. Texture optimization for example-based synthesis. 2005).
//
// The floor: the exemplar's own windows to its other ones that do not overlap them, since the window itself, shifted by
// a pixel, is no other sample of the texture. A texture of large unlike parts has a high floor.
//
// Turned and shifted copies of the exemplar are made once by cubic splines and searched together with it. The other way
// round, a place of the exemplar has a window in every copy, and the frame need only have one of them.
#include "measure/patches.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/cubic_spline.h"
#include "kernels/neighbours.h"

#include <string.h>

enum
{
    MAX_WINDOWS = 4096,
    MAX_COPIES = 72 * 4,
    STRIP_WINDOWS = 1 << 20,
    CELLS = RF_MEASURE_USE_CELLS
};

// Windows of one picture on a grid: the corners that are wholly known.
typedef struct Grid
{
    int stride, across, down, count;
    /// First pixel of each, and its place in the grid.
    int (*corners)[2];
    int *cell;
} Grid;

struct RfPatchJudge
{
    int width, height, channels, size, stride;
    int copies;
    /// For each copy, where its pixels lie in the exemplar (see RfWindowSource).
    float to_exemplar[MAX_COPIES][6];
    RfWindowDatabase *database;
    /// Of the exemplar's own windows.
    Grid grid;
    double floor, share_floor;
};

// ---- grids of windows --------------------------------------------------------------------------------------------

static int64_t windows_at_stride(int w, int h, int size, int stride)
{
    return (int64_t)((w - size) / stride + 1) * ((h - size) / stride + 1);
}

static int pick_stride(int w, int h, int size)
{
    int stride = 1;
    while (windows_at_stride(w, h, size, stride) > MAX_WINDOWS)
        ++stride;
    return stride;
}

static bool is_known(const uint8_t *known, int w, int x0, int y0, int size)
{
    for (int y = 0; known && y < size; ++y)
        if (memchr(known + (size_t)(y0 + y) * (size_t)w + (size_t)x0, 0, (size_t)size))
            return false;
    return true;
}

static RfResult make_grid(int w, int h, const uint8_t *known, int size, int stride, Grid *grid)
{
    *grid = (Grid){.stride = stride ? stride : pick_stride(w, h, size)};
    grid->across = (w - size) / grid->stride + 1;
    grid->down = (h - size) / grid->stride + 1;
    size_t most = (size_t)grid->across * (size_t)grid->down;
    grid->corners = rf_allocate(most, sizeof *grid->corners);
    grid->cell = rf_allocate(most, sizeof *grid->cell);
    if (!grid->corners || !grid->cell)
        return RF_OUT_OF_MEMORY;
    for (int j = 0; j < grid->down; ++j)
        for (int i = 0; i < grid->across; ++i)
        {
            int x = i * grid->stride, y = j * grid->stride;
            if (!is_known(known, w, x, y, size))
                continue;
            grid->corners[grid->count][0] = x;
            grid->corners[grid->count][1] = y;
            grid->cell[grid->count++] = j * grid->across + i;
        }
    return RF_OK;
}

static void free_grid(Grid *grid)
{
    rf_release(grid->corners);
    rf_release(grid->cell);
}

// ---- copies of the exemplar --------------------------------------------------------------------------------------

// A copy being made, in the exemplar's channels.
typedef struct Copy
{
    float *pixels;
    uint8_t *valid;
    int w, h;
} Copy;

// The copy's pixel (x, y) shows the exemplar's centre + R (pixel - its own centre) + shift.
static void place_copy(const RfPatchJudge *judge, int turn, int turns, float shift_x, float shift_y, float map[6],
                       Copy *copy)
{
    double angle = 2 * 3.14159265358979323846 * turn / turns;
    float c = (float)cos(angle), s = (float)sin(angle);
    // Quarter turns exactly, so that they copy pixels.
    c = fabsf(c) < 1e-6f ? 0 : c;
    s = fabsf(s) < 1e-6f ? 0 : s;
    float w = (float)(judge->width - 1), h = (float)(judge->height - 1);
    copy->w = (int)ceilf(fabsf(c) * w + fabsf(s) * h - 1e-3f) + 1;
    copy->h = (int)ceilf(fabsf(s) * w + fabsf(c) * h - 1e-3f) + 1;
    float cx = 0.5f * (float)(copy->w - 1), cy = 0.5f * (float)(copy->h - 1);
    map[0] = c;
    map[1] = -s;
    map[2] = 0.5f * w - c * cx + s * cy + shift_x;
    map[3] = s;
    map[4] = c;
    map[5] = 0.5f * h - s * cx - c * cy + shift_y;
}

static void draw_copy(const RfPatchJudge *judge, const float *spline, const float map[6], Copy *copy)
{
    for (int y = 0; y < copy->h; ++y)
        for (int x = 0; x < copy->w; ++x)
        {
            size_t k = (size_t)y * (size_t)copy->w + (size_t)x;
            float u = map[0] * (float)x + map[1] * (float)y + map[2],
                  v = map[3] * (float)x + map[4] * (float)y + map[5];
            const float slack = 1e-3f;
            copy->valid[k] = u >= -slack && v >= -slack && u <= (float)(judge->width - 1) + slack &&
                             v <= (float)(judge->height - 1) + slack;
            rf_spline_sample(spline, judge->width, judge->height, judge->channels, judge->channels, u, v,
                             copy->pixels + k * (size_t)judge->channels);
        }
}

static RfResult make_copy(RfPatchJudge *judge, const float *spline, int index, int turns, RfArena *arena,
                          RfWindowSource *source)
{
    int shifts = judge->copies / turns, shift = index % shifts;
    Copy copy;
    float *map = judge->to_exemplar[index];
    place_copy(judge, index / shifts, turns, shift % 2 ? 0.5f : 0, shift / 2 ? 0.5f : 0, map, &copy);
    size_t pixels = (size_t)copy.w * (size_t)copy.h;
    copy.pixels = rf_arena_push(arena, pixels, (size_t)judge->channels * sizeof(float));
    copy.valid = rf_arena_push(arena, pixels, 1);
    if (!copy.pixels || !copy.valid)
        return RF_OUT_OF_MEMORY;
    draw_copy(judge, spline, map, &copy);
    *source = (RfWindowSource){
        {copy.pixels, copy.w, copy.h, judge->channels, (ptrdiff_t)copy.w * judge->channels}, copy.valid, map};
    return RF_OK;
}

static RfResult make_database(RfPatchJudge *judge, const RfImageView *exemplar, int turns)
{
    size_t numbers = (size_t)judge->width * (size_t)judge->height * (size_t)judge->channels;
    RfArena arena = {0};
    RfWindowSource sources[MAX_COPIES];
    float *spline = rf_arena_push(&arena, numbers, sizeof(float));
    RfResult result = spline ? RF_OK : RF_OUT_OF_MEMORY;
    if (spline)
    {
        memcpy(spline, exemplar->pixels, numbers * sizeof(float));
        rf_spline_prefilter(spline, judge->width, judge->height, judge->channels);
    }
    for (int i = 0; i < judge->copies && result == RF_OK; ++i)
        result = make_copy(judge, spline, i, turns, &arena, &sources[i]);
    // The exemplar itself goes in untouched.
    if (result == RF_OK)
        memcpy(sources[0].image.pixels, exemplar->pixels, numbers * sizeof(float));
    RfWindowOptions options = {.side = judge->size};
    if (result == RF_OK)
        result = rf_windows_create(sources, judge->copies, &options, &judge->database);
    rf_arena_free(&arena);
    return result;
}

// ---- searching ---------------------------------------------------------------------------------------------------

static double levels(double squares, double windows, int numbers)
{
    return windows > 0 ? 255 * sqrt(squares / (windows * numbers)) : (double)NAN;
}

// The nearest window to each of the picture's on the grid. excluded: see RfWindowQueries.
static RfResult search_grid(const RfWindowDatabase *database, const RfImageView *picture, int size, const Grid *grid,
                            const RfWindowPlace *excluded, RfWindowMatch *matches)
{
    RfWindowSource source = {*picture, NULL, NULL};
    size_t numbers = (size_t)size * (size_t)size * (size_t)picture->channels;
    float *windows = rf_allocate((size_t)grid->count, numbers * sizeof(float));
    if (!windows)
        return RF_OUT_OF_MEMORY;
    RfWindowQueries queries = {.count = grid->count, .windows = windows, .excluded = excluded};
    RfResult result =
        rf_windows_gather(&source, size, false, (const int(*)[2])grid->corners, grid->count, windows, NULL);
    if (result == RF_OK)
        result = rf_windows_search(database, &queries, matches);
    rf_release(windows);
    return result;
}

// Centre of a matched window, in exemplar pixels.
static RfVec2 source_of(const RfPatchJudge *judge, RfWindowPlace place)
{
    const float *m = judge->to_exemplar[place.copy], half = 0.5f * (float)(judge->size - 1);
    float x = (float)place.x + half, y = (float)place.y + half;
    return (RfVec2){m[0] * x + m[1] * y + m[2], m[3] * x + m[4] * y + m[5]};
}

// Cells divide the places that corners can have, not the pixels: those are fewer by a window.
static int cell_of(float centre, int side, int size)
{
    float corner = centre - 0.5f * (float)(size - 1);
    return rf_clamp_int((int)floorf((corner + 1e-3f) * CELLS / (float)(side - size + 1)), 0, CELLS - 1);
}

static double effective_share(const int64_t *counts, int64_t total)
{
    double entropy = 0;
    for (int i = 0; i < CELLS * CELLS; ++i)
        if (counts[i])
        {
            double p = (double)counts[i] / (double)total;
            entropy -= p * log(p);
        }
    return total ? exp(entropy) / (CELLS * CELLS) : (double)NAN;
}

// What the matches of a grid are: residual, share and number of those that have one.
static void count_matches(const RfPatchJudge *judge, const Grid *grid, const RfWindowMatch *matches, int64_t *counts,
                          RfMeasurePatch *out)
{
    double squares = 0;
    int64_t total = 0;
    memset(counts, 0, CELLS * CELLS * sizeof *counts);
    for (int i = 0; i < grid->count; ++i)
    {
        if (matches[i].candidate < 0)
            continue;
        RfVec2 p = source_of(judge, matches[i].place);
        ++counts[cell_of(p.y, judge->height, judge->size) * CELLS + cell_of(p.x, judge->width, judge->size)];
        squares += (double)matches[i].distance;
        ++total;
    }
    out->windows = (double)total;
    out->residual = levels(squares, (double)total, rf_windows_numbers(judge->database));
    out->share = effective_share(counts, total);
}

// The exemplar against itself.
static RfResult find_floor(RfPatchJudge *judge, const RfImageView *exemplar)
{
    const Grid *grid = &judge->grid;
    RfWindowMatch *matches = rf_allocate((size_t)grid->count, sizeof *matches);
    RfWindowPlace *own = rf_allocate((size_t)grid->count, sizeof *own);
    RfResult result = matches && own ? RF_OK : RF_OUT_OF_MEMORY;
    for (int i = 0; i < grid->count && result == RF_OK; ++i)
        own[i] = (RfWindowPlace){0, grid->corners[i][0], grid->corners[i][1]};
    if (result == RF_OK)
        result = search_grid(judge->database, exemplar, judge->size, grid, own, matches);
    if (result == RF_OK)
    {
        int64_t counts[CELLS * CELLS];
        RfMeasurePatch own_matches;
        count_matches(judge, grid, matches, counts, &own_matches);
        judge->floor = own_matches.residual;
        judge->share_floor = own_matches.share;
    }
    rf_release(own);
    rf_release(matches);
    return result;
}

RfResult rf_patches_check(int width, int height, int size, int rotations, bool half_pixel)
{
    int64_t candidates = windows_at_stride(width, height, size, 1) * rotations * (half_pixel ? 4 : 1);
    if (candidates > RF_MAX_WINDOW_CANDIDATES)
        return rf_fail(
            RF_UNSUPPORTED, NULL, "patch distance",
            "%lld windows of the exemplar in all its copies, at most %d are possible: take fewer rotations, a "
            "smaller exemplar, or patch-every 0",
            (long long)candidates, RF_MAX_WINDOW_CANDIDATES);
    return RF_OK;
}

RfResult rf_patches_create(const RfImageView *exemplar, int size, int stride, int rotations, bool half_pixel,
                           RfPatchJudge **out)
{
    *out = NULL;
    RfPatchJudge *judge = rf_allocate_zero(1, sizeof *judge);
    if (!judge)
        return RF_OUT_OF_MEMORY;
    judge->width = exemplar->width;
    judge->height = exemplar->height;
    judge->channels = exemplar->channels;
    judge->size = size;
    judge->stride = stride;
    judge->copies = rotations * (half_pixel ? 4 : 1);
    assert(judge->copies <= MAX_COPIES);
    RfResult result = make_grid(judge->width, judge->height, NULL, size, stride, &judge->grid);
    if (result == RF_OK)
        result = make_database(judge, exemplar, rotations);
    if (result == RF_OK)
        result = find_floor(judge, exemplar);
    if (result != RF_OK)
    {
        rf_patches_destroy(judge);
        return result;
    }
    *out = judge;
    return RF_OK;
}

void rf_patches_destroy(RfPatchJudge *judge)
{
    if (!judge)
        return;
    rf_windows_destroy(judge->database);
    free_grid(&judge->grid);
    rf_release(judge);
}

// ---- frame to exemplar -------------------------------------------------------------------------------------------

// Each pixel holds what the window nearest to it has.
static void draw_maps(const RfPatchJudge *judge, const Grid *grid, const RfWindowMatch *matches, int *window_at, int w,
                      int h, float *residual_map, float *source_map)
{
    for (int i = 0; i < grid->across * grid->down; ++i)
        window_at[i] = -1;
    for (int i = 0; i < grid->count; ++i)
        window_at[grid->cell[i]] = matches[i].candidate < 0 ? -1 : i;
    int half = judge->size / 2;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            int column = rf_clamp_int((x - half + grid->stride / 2) / grid->stride, 0, grid->across - 1);
            int row = rf_clamp_int((y - half + grid->stride / 2) / grid->stride, 0, grid->down - 1);
            int i = window_at[row * grid->across + column];
            RfVec2 p = i < 0 ? (RfVec2){NAN, NAN} : source_of(judge, matches[i].place);
            double distance = i < 0 ? (double)NAN : (double)matches[i].distance;
            residual_map[k] = (float)levels(distance, 1, rf_windows_numbers(judge->database));
            source_map[2 * k] = p.x;
            source_map[2 * k + 1] = p.y;
        }
}

// ---- exemplar to frame -------------------------------------------------------------------------------------------

// The candidate of a copy that shows the window of the exemplar at this corner, as nearly as pixels go; -1: none.
static int candidate_at(const RfPatchJudge *judge, int copy, const int corner[2])
{
    const float *m = judge->to_exemplar[copy], half = 0.5f * (float)(judge->size - 1);
    // The map is a rotation and a shift, so that its transpose turns back.
    float u = (float)corner[0] + half - m[2], v = (float)corner[1] + half - m[5];
    float x = m[0] * u + m[3] * v - half, y = m[1] * u + m[4] * v - half;
    return rf_windows_at(judge->database, (RfWindowPlace){copy, (int)floorf(x + 0.5f), (int)floorf(y + 0.5f)});
}

// Lowers the least distances by one copy's windows; `windows` and `matches` have room for the grid.
static RfResult search_copy(const RfPatchJudge *judge, const RfWindowDatabase *frame, int copy, float *windows,
                            RfWindowMatch *matches, double *least)
{
    int numbers = rf_windows_numbers(judge->database), count = 0;
    for (int i = 0; i < judge->grid.count; ++i)
    {
        int candidate = candidate_at(judge, copy, judge->grid.corners[i]);
        if (candidate >= 0)
            rf_windows_read(judge->database, candidate, windows + (size_t)count++ * (size_t)numbers);
    }
    RfWindowQueries queries = {.count = count, .windows = windows};
    RfResult result = count ? rf_windows_search(frame, &queries, matches) : RF_OK;
    for (int i = 0, j = 0; i < judge->grid.count && result == RF_OK; ++i)
        if (candidate_at(judge, copy, judge->grid.corners[i]) >= 0)
        {
            least[i] = fmin(least[i], (double)matches[j].distance);
            ++j;
        }
    return result;
}

// Rows y0 to y1 of a frame as a picture of its own; false if no whole window of it is known.
static bool cut_strip(const RfPatchJudge *judge, const RfImageView *frame, const uint8_t *known, int y0, int y1,
                      RfWindowSource *strip)
{
    *strip = (RfWindowSource){*frame, known ? known + (size_t)y0 * (size_t)frame->width : NULL, NULL};
    strip->image.pixels += (ptrdiff_t)y0 * frame->row_stride;
    strip->image.height = y1 - y0;
    for (int y = 0; y + judge->size <= y1 - y0; ++y)
        for (int x = 0; x + judge->size <= frame->width; ++x)
            if (is_known(strip->valid, frame->width, x, y, judge->size))
                return true;
    return false;
}

// Lowers the least distances by the windows of a strip.
static RfResult search_strip(const RfPatchJudge *judge, const RfWindowSource *strip, float *windows,
                             RfWindowMatch *matches, double *least)
{
    RfWindowOptions options = {.side = judge->size};
    RfWindowDatabase *database = NULL;
    RfResult result = rf_windows_create(strip, 1, &options, &database);
    for (int copy = 0; copy < judge->copies && result == RF_OK; ++copy)
        result = search_copy(judge, database, copy, windows, matches, least);
    rf_windows_destroy(database);
    return result;
}

// A database of windows takes some 150 bytes each, so that large frames are searched strip by strip.
static RfResult find_missing(const RfPatchJudge *judge, const RfImageView *frame, const uint8_t *known,
                             RfMeasurePatch *out)
{
    size_t count = (size_t)judge->grid.count, numbers = (size_t)rf_windows_numbers(judge->database);
    float *windows = rf_allocate(count, numbers * sizeof(float));
    RfWindowMatch *matches = rf_allocate(count, sizeof *matches);
    double *least = rf_allocate(count, sizeof *least), squares = 0;
    RfResult result = windows && matches && least ? RF_OK : RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < count && result == RF_OK; ++i)
        least[i] = HUGE_VAL;
    int rows = rf_max_int(STRIP_WINDOWS / frame->width, 1), overlap = judge->size - 1;
    for (int y = 0; y + overlap < frame->height && result == RF_OK; y += rows)
    {
        RfWindowSource strip;
        result = rf_progress("judging", 0.7 + 0.3 * y / frame->height);
        if (result == RF_OK && cut_strip(judge, frame, known, y, rf_min_int(y + rows + overlap, frame->height), &strip))
            result = search_strip(judge, &strip, windows, matches, least);
    }
    for (size_t i = 0; i < count && result == RF_OK; ++i)
        squares += least[i];
    if (result == RF_OK)
        out->missing = levels(squares, (double)count, (int)numbers);
    rf_release(least);
    rf_release(matches);
    rf_release(windows);
    return result;
}

// ---- both --------------------------------------------------------------------------------------------------------

static RfResult judge_grid(const RfPatchJudge *judge, const RfImageView *frame, const uint8_t *known, const Grid *grid,
                           float *residual_map, float *source_map, int64_t *counts, RfMeasurePatch *out)
{
    RfWindowMatch *matches = rf_allocate((size_t)grid->count, sizeof *matches);
    int *window_at = rf_allocate((size_t)grid->across * (size_t)grid->down, sizeof *window_at);
    RfResult result = matches && window_at ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK && grid->count)
        result = search_grid(judge->database, frame, judge->size, grid, NULL, matches);
    if (result == RF_OK)
    {
        count_matches(judge, grid, matches, counts, out);
        draw_maps(judge, grid, matches, window_at, frame->width, frame->height, residual_map, source_map);
    }
    if (result == RF_OK && grid->count)
        result = find_missing(judge, frame, known, out);
    rf_release(window_at);
    rf_release(matches);
    return result;
}

RfResult rf_patches_measure(RfPatchJudge *judge, const RfImageView *frame, const uint8_t *known, float *residual_map,
                            float *source_map, int64_t *counts, RfMeasurePatch *out)
{
    double nan = (double)NAN;
    Grid grid;
    *out = (RfMeasurePatch){.residual = nan,
                            .missing = nan,
                            .share = nan,
                            .share_floor = judge->share_floor,
                            .floor = judge->floor,
                            .ratio = nan,
                            .missing_ratio = nan};
    RfResult result = make_grid(frame->width, frame->height, known, judge->size, judge->stride, &grid);
    if (result == RF_OK)
        result = judge_grid(judge, frame, known, &grid, residual_map, source_map, counts, out);
    free_grid(&grid);
    if (judge->floor > 0)
    {
        out->ratio = out->residual / judge->floor;
        out->missing_ratio = out->missing / judge->floor;
    }
    return result;
}
