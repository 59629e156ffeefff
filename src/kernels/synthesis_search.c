// SPDX-License-Identifier: Apache-2.0
// The search step: every window of the frame looks for its like in the exemplar.
//
// The k-coherent search asks the pixels of the window where they come from. A pixel that comes from place s says that
// the window's centre, d pixels away, should come from s - d; what is most like that place is a candidate too, and so
// is one place picked at random. Only these are compared, in fixed point, whatever the exemplar's size. The exact
// search (kernels/neighbours.h) compares with all.
//
// A window that reaches over the frame's border is compared as the nearest one that does not; a turned or enlarged one
// may still reach over it, and sees there what continues the border's pixels.
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/result.h"
#include "kernels/synthesis.h"

#include <string.h>

enum
{
    // Pixels asked, a side of the window.
    ASKED = 5,
    MAX_CANDIDATES = ASKED * ASKED * (1 + RF_MAX_SIMILAR) + 2,
    // Of the table that keeps candidates apart; a power of two, at least twice as many.
    TABLE = 512,
    MAX_NUMBERS = RF_FIXED_SIDE * RF_FIXED_SIDE * RF_MAX_EXEMPLAR_CHANNELS,
    // Windows that an exact search is given at once: 64 MiB of queries at most.
    BATCH_NUMBERS = 1 << 24
};

// Part of its variation that a window's cost is lowered by. Of 3 x 3 times cracked earth of 96 x 96 pixels 0, 0.5, 0.75
// and 1 leave 0.23, 0.32, 0.93 and 0.94 of the contrast.
static const float VARIATION_PART = 0.75f;

typedef struct Candidates
{
    int count;
    /// Of the windows' centres.
    RfVec2 places[MAX_CANDIDATES];
    const int16_t *corners[MAX_CANDIDATES];
    float prices[MAX_CANDIDATES];
    /// Of the places in use, 0: none.
    uint32_t table[TABLE];
    uint16_t used[MAX_CANDIDATES];
} Candidates;

typedef struct Scratch
{
    Candidates candidates;
    int16_t window[MAX_NUMBERS + RF_FIXED_LANES];
} Scratch;

typedef struct Walk
{
    const RfSynthesisSearch *search;
    RfFixedQuery query;
    int half;
    int asked[ASKED];
    Scratch *scratch;
    /// Sums over each row: of all costs, of those compared, and how many these are.
    double (*sums)[3];
    /// Of the windows that are searched exactly.
    int first;
    const int *list;
    float *windows;
} Walk;

static void forget(Candidates *c)
{
    for (int i = 0; i < c->count; ++i)
        c->table[c->used[i]] = 0;
    c->count = 0;
}

static float bring_inside(float at, int n, int half, bool tiles)
{
    if (!tiles)
        return rf_clamp(at, (float)half, (float)(n - 1 - half));
    if (at >= -0.5f && at < (float)n - 0.5f)
        return at;
    at -= floorf((at + 0.5f) / (float)n) * (float)n;
    // A little under -1/2 is rounded to n - 1/2, whose pixel would be n.
    return at >= (float)n - 0.5f ? at - (float)n : rf_max(at, -0.5f);
}

// Adds the place unless its pixel is there already.
static void add(const Walk *walk, Candidates *c, RfVec2 place)
{
    const RfSynthesisExemplar *e = walk->search->exemplar;
    place = (RfVec2){bring_inside(place.x, e->width, walk->half, e->tiles),
                     bring_inside(place.y, e->height, walk->half, e->tiles)};
    int x = (int)(place.x + 0.5f), y = (int)(place.y + 0.5f); // nothing to be rounded is below 0
    uint32_t key = 1 + (uint32_t)y * (uint32_t)e->width + (uint32_t)x;
    uint32_t slot = key * 2654435761u >> 23;
    for (; c->table[slot]; slot = (slot + 1) % TABLE)
        if (c->table[slot] == key)
            return;
    c->table[slot] = key;
    c->used[c->count] = (uint16_t)slot;
    c->places[c->count] = place;
    c->corners[c->count] = rf_fixed_at(&e->fixed, x - walk->half, y - walk->half);
    c->prices[c->count] = walk->search->prices ? walk->search->prices[(ptrdiff_t)y * e->width + x] : 0;
    ++c->count;
}

static void add_similar(const Walk *walk, Candidates *c)
{
    const RfSimilar *similar = &walk->search->exemplar->similar;
    int told = c->count;
    for (int i = 0; i < told; ++i)
    {
        RfVec2 place = c->places[i];
        int x = rf_nearest_int(place.x), y = rf_nearest_int(place.y);
        const RfPlace *list = rf_similar_at(similar, x, y);
        for (int k = 0; k < similar->count; ++k)
            add(walk, c, (RfVec2){place.x + (float)(list[k].x - x), place.y + (float)(list[k].y - y)});
    }
}

static void add_random(const Walk *walk, Candidates *c, int window)
{
    const RfSynthesisSearch *s = walk->search;
    int margin = s->exemplar->tiles ? 0 : walk->half;
    uint32_t width = (uint32_t)(s->exemplar->width - 2 * margin), height = (uint32_t)(s->exemplar->height - 2 * margin);
    uint64_t item = (uint64_t)window;
    add(walk, c,
        (RfVec2){(float)(margin + (int)rf_random_below(width, s->seed, s->round, item, 0)),
                 (float)(margin + (int)rf_random_below(height, s->seed, s->round, item, 1))});
}

// Where the window is compared: a whole pixel, and inside the frame by half a window.
static RfVec2 compared_at(const Walk *walk, const RfSynthesisWindow *window)
{
    const RfSynthesisFrame *f = walk->search->frame;
    int half = f->tiles ? 0 : walk->half;
    return (RfVec2){(float)rf_clamp_int(rf_nearest_int(window->at.x), half, f->width - 1 - half),
                    (float)rf_clamp_int(rf_nearest_int(window->at.y), half, f->height - 1 - half)};
}

static void add_coherent(const Walk *walk, Candidates *c, const RfSynthesisWindow *window, RfVec2 at)
{
    const RfSynthesisFrame *f = walk->search->frame;
    for (int j = 0; j < ASKED; ++j)
        for (int i = 0; i < ASKED; ++i)
        {
            RfVec2 step = {(float)walk->asked[i], (float)walk->asked[j]};
            RfVec2 point = rf_vec2_add(at, walk->search->plain ? step : rf_turn_back(window->turn, step));
            int x = rf_nearest_int(point.x), y = rf_nearest_int(point.y);
            RfVec2 source = f->sources[(ptrdiff_t)rf_border_int(y, f->height, f->tiles) * f->width +
                                       rf_border_int(x, f->width, f->tiles)];
            RfVec2 rest = rf_turn(window->turn, (RfVec2){point.x - (float)x, point.y - (float)y});
            add(walk, c, rf_vec2_sub(rf_vec2_add(source, rest), step));
        }
}

// What is seen at a point between pixels: what the nearest pixel shows, and by how much the exemplar differs from there
// to where the point comes from; of a pixel that is held to something else, as much of that as it shows of the
// exemplar. So a window that is one piece of the exemplar is seen as it is, however it is turned. From the nearest
// pixels alone it would be jagged, and smooth places would fit it better than its own. What is given, fixed pixels and
// guides, is seen as it is.
static void see(const Walk *walk, RfVec2 turn, RfVec2 point, int16_t *out)
{
    const RfSynthesisFrame *f = walk->search->frame;
    const RfSynthesisExemplar *e = walk->search->exemplar;
    int x = rf_nearest_int(point.x), y = rf_nearest_int(point.y);
    int px = rf_border_int(x, f->width, f->tiles), py = rf_border_int(y, f->height, f->tiles);
    const int16_t *pixel = rf_fixed_at(&f->picture, px, py);
    if (walk->search->plain)
    {
        memcpy(out, pixel, (size_t)f->picture.channels * sizeof *out);
        return;
    }
    RfVec2 source = f->sources[(ptrdiff_t)py * f->width + px];
    // Beyond the frame goes on what is at its border.
    RfVec2 from = f->tiles ? (RfVec2){(float)x, (float)y} : (RfVec2){(float)px, (float)py};
    RfVec2 rest = rf_turn(turn, rf_vec2_sub(point, from));
    const int16_t *own = rf_synthesis_pixel(e, source);
    const int16_t *there = rf_synthesis_pixel(e, rf_vec2_add(source, rest));
    const float *hold = walk->search->held.hold;
    float part = hold ? 1 / (1 + hold[(ptrdiff_t)py * f->width + px]) : 1;
    int made = f->picture.channels - walk->search->guides;
    for (int c = 0; c < made; ++c)
    {
        int value = pixel[c] + (int)lrintf(part * (float)(there[c] - own[c]));
        out[c] = (int16_t)rf_clamp_int(value, -RF_FIXED_RANGE / 2, RF_FIXED_RANGE / 2);
    }
    for (int c = made; c < f->picture.channels; ++c)
        out[c] = pixel[c];
}

// The window's pixels, turned back into the exemplar's frame.
static void gather(const Walk *walk, const RfSynthesisWindow *window, RfVec2 at, int16_t *out)
{
    for (int j = -walk->half; j <= walk->half; ++j)
        for (int i = -walk->half; i <= walk->half; ++i, out += walk->search->frame->picture.channels)
        {
            RfVec2 step = rf_turn_back(window->turn, (RfVec2){(float)i, (float)j});
            see(walk, window->turn, rf_vec2_add(at, step), out);
        }
}

static RfFixedQuery query_of(const Walk *walk, const RfSynthesisWindow *window, RfVec2 at, Scratch *scratch)
{
    RfFixedQuery query = walk->query;
    if (walk->search->plain)
    {
        query.window = rf_fixed_at(&walk->search->frame->picture, (int)at.x - walk->half, (int)at.y - walk->half);
        return query;
    }
    gather(walk, window, at, scratch->window);
    query.window = scratch->window;
    query.stride = query.numbers;
    return query;
}

// Takes the match.
static void settle(RfSynthesisWindow *window, RfVec2 at, RfVec2 place, float cost)
{
    RfVec2 source = rf_vec2_sub(place, rf_turn(window->turn, rf_vec2_sub(at, window->at)));
    window->changed = source.x != window->source.x || source.y != window->source.y || cost != window->cost;
    window->source = source;
    window->cost = cost;
}

// In cells. The corners of a turned window are the farthest, and a smaller turn is a larger window.
static int reach_of(const Walk *walk, const RfSynthesisWindow *window)
{
    const RfSynthesisFrame *f = walk->search->frame;
    if (walk->search->plain)
        return (walk->half + f->spacing - 1) / f->spacing;
    float pixels = 1.41421356f * (float)walk->half / rf_vec2_length(window->turn);
    return (int)ceilf(rf_min(pixels, RF_MAX_SIZE) / (float)f->spacing);
}

// True if what the window sees has changed.
static bool is_stirred(const Walk *walk, int column, int row)
{
    const RfSynthesisFrame *f = walk->search->frame;
    int reach = reach_of(walk, &f->windows[(ptrdiff_t)row * f->columns + column]);
    for (int j = row - reach; j <= row + reach; ++j)
        for (int i = column - reach; i <= column + reach; ++i)
        {
            bool outside = i < 0 || j < 0 || i >= f->columns || j >= f->rows;
            if (outside && !f->tiles)
                continue;
            if (f->stirred[rf_wrap_int(j, f->rows) * f->columns + rf_wrap_int(i, f->columns)])
                return true;
        }
    return false;
}

static void search_window(const Walk *walk, RfSynthesisWindow *window, int index, Scratch *scratch)
{
    Candidates *c = &scratch->candidates;
    RfVec2 at = compared_at(walk, window);
    add(walk, c, rf_vec2_add(window->source, rf_turn(window->turn, rf_vec2_sub(at, window->at))));
    add_coherent(walk, c, window, at);
    add_similar(walk, c);
    add_random(walk, c, index);
    RfFixedQuery query = query_of(walk, window, at, scratch);
    float cost = 0;
    int best = rf_fixed_least(&query, c->corners, c->prices, c->count, &cost);
    settle(window, at, c->places[best], cost);
    forget(c);
}

static void search_row(void *context, int row, int worker)
{
    const Walk *walk = context;
    RfSynthesisFrame *f = walk->search->frame;
    double *sums = walk->sums[row];
    for (int i = 0; i < f->columns; ++i)
    {
        RfSynthesisWindow *window = &f->windows[(ptrdiff_t)row * f->columns + i];
        if (!window->exists)
            continue;
        window->changed = false;
        if (walk->search->all || is_stirred(walk, i, row))
        {
            search_window(walk, window, row * f->columns + i, &walk->scratch[worker]);
            sums[1] += (double)window->cost;
            sums[2] += 1;
        }
        sums[0] += (double)window->cost;
    }
}

// ---- the exact search

static void gather_exact(void *context, int item, int worker)
{
    const Walk *walk = context;
    const RfSynthesisWindow *window = &walk->search->frame->windows[walk->list[walk->first + item]];
    Scratch *scratch = &walk->scratch[worker];
    int side = 2 * walk->half + 1, numbers = side * side * walk->search->frame->picture.channels;
    gather(walk, window, compared_at(walk, window), scratch->window);
    float *out = walk->windows + (size_t)item * (size_t)numbers;
    float scale = 1 / walk->search->exemplar->scale;
    for (int i = 0; i < numbers; ++i)
        out[i] = scale * scratch->window[i];
}

static void set_penalties(const Walk *walk, float *penalties)
{
    const RfSynthesisSearch *s = walk->search;
    float unit = 1 / (s->exemplar->scale * s->exemplar->scale);
    rf_synthesis_penalties(s->exemplar, s->windows, s->side, s->prices, unit, s->variations, VARIATION_PART, penalties);
}

// The place between pixels that a match is: that which the window or one of its pixels tells of, if it is the same
// pixel, so that windows of one piece stay one to a part of a pixel. Else as far from its pixel as the window was.
static RfVec2 place_of_match(const Walk *walk, const RfSynthesisWindow *window, RfVec2 at, RfWindowPlace match)
{
    int x = match.x + walk->half, y = match.y + walk->half;
    if (walk->search->plain)
        return (RfVec2){(float)x, (float)y};
    Candidates *c = &walk->scratch->candidates;
    const RfSynthesisExemplar *e = walk->search->exemplar;
    x = rf_border_int(x, e->width, e->tiles);
    y = rf_border_int(y, e->height, e->tiles);
    RfVec2 own = rf_vec2_add(window->source, rf_turn(window->turn, rf_vec2_sub(at, window->at)));
    RfVec2 place = {(float)x + own.x - (float)rf_nearest_int(own.x), (float)y + own.y - (float)rf_nearest_int(own.y)};
    add(walk, c, own);
    add_coherent(walk, c, window, at);
    for (int i = 0; i < c->count; ++i)
        if (rf_nearest_int(c->places[i].x) == x && rf_nearest_int(c->places[i].y) == y)
            place = c->places[i];
    forget(c);
    return place;
}

static RfResult search_batch(Walk *walk, int count, const float *penalties, RfWindowMatch *matches)
{
    RfWindowQueries queries = {.count = count, .windows = walk->windows, .penalties = penalties};
    rf_parallel_for(count, gather_exact, walk);
    RF_TRY(rf_windows_search(walk->search->windows, &queries, matches));
    float unit = walk->search->exemplar->scale * walk->search->exemplar->scale;
    for (int i = 0; i < count; ++i)
    {
        RfSynthesisWindow *window = &walk->search->frame->windows[walk->list[walk->first + i]];
        RfVec2 at = compared_at(walk, window);
        RfVec2 place = place_of_match(walk, window, at, matches[i].place);
        settle(window, at, place, matches[i].distance * unit);
        walk->sums[0][0] += (double)window->cost;
        walk->sums[0][1] += (double)window->cost;
        walk->sums[0][2] += 1;
    }
    return RF_OK;
}

static RfResult search_all(Walk *walk, int *list, int count, int batch)
{
    RfWindowMatch *matches = rf_allocate((size_t)batch, sizeof *matches);
    int numbers = rf_windows_numbers(walk->search->windows);
    walk->windows = rf_allocate((size_t)batch * (size_t)numbers, sizeof *walk->windows);
    float *penalties = rf_allocate((size_t)rf_windows_count(walk->search->windows), sizeof *penalties);
    bool enough = matches && walk->windows && penalties;
    RfResult result = enough ? RF_OK : RF_OUT_OF_MEMORY;
    walk->list = list;
    if (enough)
        set_penalties(walk, penalties);
    for (walk->first = 0; walk->first < count && result == RF_OK; walk->first += batch)
        result = search_batch(walk, rf_min_int(batch, count - walk->first), penalties, matches);
    rf_release(matches);
    rf_release(walk->windows);
    rf_release(penalties);
    return result;
}

static RfResult search_exactly(Walk *walk)
{
    const RfSynthesisFrame *f = walk->search->frame;
    int cells = f->columns * f->rows, count = 0;
    int *list = rf_allocate((size_t)cells, sizeof *list);
    if (!list)
        return RF_OUT_OF_MEMORY;
    for (int i = 0; i < cells; ++i)
        if (f->windows[i].exists)
            list[count++] = i;
    int batch = rf_clamp_int(BATCH_NUMBERS / rf_windows_numbers(walk->search->windows), 1, rf_max_int(count, 1));
    RfResult result = search_all(walk, list, count, batch);
    rf_release(list);
    return result;
}

static int count_windows(const RfSynthesisFrame *f)
{
    int count = 0;
    for (int i = 0; i < f->columns * f->rows; ++i)
        count += f->windows[i].exists;
    return count;
}

RfResult rf_synthesis_search(const RfSynthesisSearch *search, RfSynthesisEnergy *energy)
{
    RfSynthesisFrame *f = search->frame;
    assert(search->side <= RF_FIXED_SIDE && search->side % 2 == 1);
    assert(f->tiles || (search->side <= f->width && search->side <= f->height));
    Walk walk = {.search = search, .half = search->side / 2};
    int16_t mask[RF_FIXED_SIDE * RF_MAX_EXEMPLAR_CHANNELS + RF_FIXED_LANES];
    rf_fixed_query(&f->picture, &search->exemplar->fixed, search->side, mask, &walk.query);
    for (int i = 0; i < ASKED; ++i)
        walk.asked[i] = (int)lrint((double)walk.half * (2 * i - (ASKED - 1)) / (ASKED - 1));
    walk.scratch = rf_allocate_zero((size_t)rf_threads(), sizeof *walk.scratch);
    walk.sums = rf_allocate_zero((size_t)f->rows, sizeof *walk.sums);
    RfResult result = walk.scratch && walk.sums ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK && search->windows)
        result = search_exactly(&walk);
    else if (result == RF_OK)
        rf_parallel_for(f->rows, search_row, &walk);
    double sums[3] = {0};
    for (int j = 0; j < f->rows && result == RF_OK; ++j)
        for (int k = 0; k < 3; ++k)
            sums[k] += walk.sums[j][k];
    *energy = (RfSynthesisEnergy){sums[0] / rf_max_int(count_windows(f), 1), sums[2] > 0 ? sums[1] / sums[2] : 0};
    rf_release(walk.scratch);
    rf_release(walk.sums);
    return result;
}
