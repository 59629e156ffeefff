// SPDX-License-Identifier: Apache-2.0
// Laying patches of the exemplar: in the first frame, in holes, and over what was blended too often (Wang et al. 2005,
// sections 2.1, 2.2.3 and 2.3).
//
// All three are one: a cell, the pixels of it to be made, and pixels round them or in them that the patch is to agree
// with. Cells that see each other are done in turn; all others at the same time.
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"
#include "methods/directional/directional.h"

#include <stdlib.h>
#include <string.h>

enum
{
    /// Side of the blocks by which it is told which cells see each other.
    BLOCK = 8
};

typedef enum LayingKind
{
    /// Whole cells of the first frame.
    LAY_FIRST,
    /// Holes.
    LAY_HOLES,
    /// Whole cells over texture that is there.
    LAY_OVER
} LayingKind;

// Of the exemplar's variance: what a patch costs whose look is shown as often as the exemplar has it. Canes in
// turbulence keep 89 % of their contrast for 60 frames with it, without 82 %; from 0.5 on patches fit visibly worse.
static const float PRICE = 0.2f;
// What is shown more often than this costs no more.
static const float MOST_SHARE = 4;

/// What is being laid.
typedef struct Laying
{
    RfDirectional *d;
    const RfCellList *list;
    /// Cells in the order they are done.
    const int *order;
    int first;
    LayingKind kind;
    /// Of this step's patches: drawn numbers differ.
    uint64_t laid;
} Laying;

// A cell and its surroundings, as far as the frame goes.
static RfCell box_of(const RfDirectional *d, RfCell cell, int margin)
{
    int x0 = rf_max_int(cell.x - margin, 0), x1 = rf_min_int(cell.x + cell.width + margin, d->width);
    int y0 = rf_max_int(cell.y - margin, 0), y1 = rf_min_int(cell.y + cell.height + margin, d->height);
    return (RfCell){x0, y0, x1 - x0, y1 - y0};
}

// ---- the best-fit patch

// Where the flow stands still: as the texture around, or as the exemplar is.
static int copy_around(const RfDirectional *d, RfCell box)
{
    for (int y = box.y; y < box.y + box.height; ++y)
        for (int x = box.x; x < box.x + box.width; ++x)
            if (d->texels[y * d->width + x].copy >= 0)
                return d->texels[y * d->width + x].copy;
    return rf_turned_copy_of(&d->copies, d->copies.direction);
}

// The numbers of the query, on the level of the copies. Returns its size.
static RfPatchQuery make_query(const RfDirectional *d, RfCell box, RfPatchScratch *s, float *weights)
{
    const RfComparison *k = &d->comparison;
    int size = d->copies.size, width = (box.width + size - 1) / size, height = (box.height + size - 1) / size;
    memset(s->pixels, 0, (size_t)(width * height * k->channels) * sizeof *s->pixels);
    memset(weights, 0, (size_t)(width * height) * sizeof *weights);
    for (int j = 0; j < box.height; ++j)
        for (int i = 0; i < box.width; ++i)
        {
            float weight = s->weights[j * box.width + i];
            if (weight == 0)
                continue;
            int to = j / size * width + i / size;
            const float *from =
                d->picture + ((ptrdiff_t)(box.y + j) * d->width + box.x + i) * (ptrdiff_t)d->exemplar->channels;
            weights[to] += weight;
            float values[RF_MAX_EXEMPLAR_CHANNELS];
            rf_turned_copies_compared(&d->copies, from, values);
            for (int c = 0; c < k->channels; ++c)
                s->pixels[to * k->channels + c] += weight * values[c];
        }
    for (int i = 0; i < width * height; ++i)
        for (int c = 0; c < k->channels && weights[i] > 0; ++c)
            s->pixels[i * k->channels + c] /= weights[i];
    return (RfPatchQuery){.width = width, .height = height, .pixels = s->pixels, .weights = weights};
}

// Continues a piece that lies there already, if one of the same copy does.
static void guess(const RfDirectional *d, RfCell box, int copy, const RfPatchScratch *s, RfPatchQuery *query)
{
    query->guess_x = query->guess_y = -1;
    for (int i = 0; i < box.width * box.height; ++i)
    {
        const RfTexel *t = &d->texels[(box.y + i / box.width) * d->width + box.x + i % box.width];
        if (s->weights[i] == 0 || t->copy != copy)
            continue;
        RfVec2 point = rf_turned_copy_point(&d->copies, copy, t->source);
        query->guess_x = rf_nearest_int(point.x) - i % box.width / d->copies.size;
        query->guess_y = rf_nearest_int(point.y) - i / box.width / d->copies.size;
        return;
    }
}

// Any place where the box has room, as far as there is one.
static RfVec2 draw_place(const RfDirectional *d, int copy, RfCell box, uint64_t item)
{
    const RfExemplar *e = d->exemplar;
    float reach = 0.5f * sqrtf((float)(box.width * box.width + box.height * box.height));
    float x = rf_max((float)e->width - 2 * reach, 1), y = rf_max((float)e->height - 2 * reach, 1);
    float u = (float)rf_random_below(65536, d->options.seed, 0, item, 0) / 65536;
    float v = (float)rf_random_below(65536, d->options.seed, 0, item, 1) / 65536;
    RfVec2 middle = {0.5f * ((float)e->width - x) + u * x, 0.5f * ((float)e->height - y) + v * y};
    RfVec2 back = {-0.5f * (float)(box.width - 1), -0.5f * (float)(box.height - 1)};
    return rf_vec2_add(middle, rf_jacobian_step(rf_turned_copy_jacobian(&d->copies, copy), back));
}

static const float *nearest_pixel(const RfExemplar *e, RfVec2 source)
{
    int x = rf_border_int(rf_nearest_int(source.x - 0.5f), e->width, e->tiles);
    int y = rf_border_int(rf_nearest_int(source.y - 0.5f), e->height, e->tiles);
    return e->pixels + ((ptrdiff_t)y * e->width + x) * e->channels;
}

// Of a place on the coarse level: the cost on the finest.
static float cost_at(const RfDirectional *d, RfCell box, const RfPatchScratch *s, RfVec2 source, RfJacobian j,
                     float limit)
{
    const RfComparison *k = &d->comparison;
    const RfExemplar *e = d->exemplar;
    float cost = 0;
    for (int y = 0; y < box.height && cost < limit; ++y)
        for (int x = 0; x < box.width; ++x)
        {
            if (s->weights[y * box.width + x] == 0)
                continue;
            RfVec2 at = rf_vec2_add(source, rf_jacobian_step(j, (RfVec2){(float)x, (float)y}));
            const float *there = nearest_pixel(e, at);
            float turned[RF_SAMPLE_CHANNELS];
            if (d->sampler.turns)
            {
                rf_sampler_at(&d->sampler, at, j, turned);
                there = turned;
            }
            const float *here = d->picture + ((ptrdiff_t)(box.y + y) * d->width + box.x + x) * (ptrdiff_t)e->channels;
            for (int c = 0; c < k->channels; ++c)
            {
                float off = (there[k->from[c]] - here[k->from[c]]) * k->factor[c];
                cost += off * off;
            }
        }
    return cost;
}

static RfVec2 refine(const RfDirectional *d, RfCell box, const RfPatchScratch *s, RfVec2 source, RfJacobian j)
{
    int reach = d->copies.size / 2;
    RfVec2 best = source;
    float least = INFINITY;
    for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x)
        {
            RfVec2 place = rf_vec2_add(source, rf_jacobian_step(j, (RfVec2){(float)x, (float)y}));
            float cost = cost_at(d, box, s, place, j, least);
            if (cost < least)
            {
                least = cost;
                best = place;
            }
        }
    return best;
}

static void set_prices(const RfDirectional *d, RfCell box, RfPatchQuery *query, float *prices)
{
    int column = (box.x + box.width / 2) / RF_DIRECTIONAL_REGION,
        row = (box.y + box.height / 2) / RF_DIRECTIONAL_REGION;
    const float *shares = d->prices[row * d->region_columns + column];
    float known = 0;
    for (int i = 0; i < query->width * query->height; ++i)
        known += query->weights[i];
    for (int k = 0; k < RF_LOOKS; ++k)
        prices[k] = shares[k] * known * d->copies.variance;
    query->prices = prices;
}

// Exemplar coordinates of the box's first pixel.
static RfVec2 best_fit(const RfDirectional *d, RfCell box, int copy, uint64_t item, RfPatchScratch *s)
{
    float weights[RF_PATCH_BOX * RF_PATCH_BOX];
    RfPatchQuery query = make_query(d, box, s, weights);
    bool anything = false;
    for (int i = 0; i < query.width * query.height; ++i)
        anything |= weights[i] > 0;
    if (!anything)
        return draw_place(d, copy, box, item);
    guess(d, box, copy, s, &query);
    set_prices(d, box, &query, s->prices);
    RfPatchMatch match = rf_patch_search(&d->copies.pictures[copy], &query, &s->terms);
    if (match.x < 0)
        return draw_place(d, copy, box, item);
    RfVec2 source = rf_turned_copy_source(&d->copies, copy, (RfVec2){(float)match.x, (float)match.y});
    if (d->copies.size == 1)
        return source;
    RfJacobian j = rf_turned_copy_jacobian(&d->copies, copy);
    float half = 0.5f * (float)(1 - d->copies.size); // from a coarse pixel's middle to its first fine one
    return refine(d, box, s, rf_vec2_add(source, rf_jacobian_step(j, (RfVec2){half, half})), j);
}

// ---- laying it

static void lay(RfDirectional *d, RfCell box, int copy, RfVec2 source, LayingKind kind, const RfPatchScratch *s)
{
    RfJacobian j = rf_turned_copy_jacobian(&d->copies, copy);
    int channels = d->exemplar->channels;
    for (int i = 0; i < box.width * box.height; ++i)
    {
        float alpha = s->alpha[i], values[RF_SAMPLE_CHANNELS];
        if (!(alpha > 0))
            continue;
        int x = i % box.width, y = i / box.width, pixel = (box.y + y) * d->width + box.x + x;
        RfTexel *texel = &d->texels[pixel];
        RfVec2 from = rf_vec2_add(source, rf_jacobian_step(j, (RfVec2){(float)x, (float)y}));
        float *out = d->picture + (ptrdiff_t)pixel * channels;
        rf_sampler_at(&d->sampler, from, j, values);
        // Exactly where nothing is left of what was there: out + (value - out) would not be the value.
        if (texel->copy < 0 || alpha == 1)
            memcpy(out, values, (size_t)channels * sizeof *out);
        for (int c = 0; c < channels && alpha < 1; ++c)
            out[c] += alpha * (values[c] - out[c]);
        float blends = texel->copy < 0 || alpha == 1 ? 0 : kind == LAY_HOLES ? texel->blends + 1 : 1;
        if (alpha > 0.5f)
            *texel = (RfTexel){from, texel->rest, 0, copy};
        texel->blends = blends;
        if (alpha == 1)
            memset(d->blended + (ptrdiff_t)pixel * channels, 0, (size_t)channels * sizeof *d->blended);
        else
            rf_directional_keep(d, texel, out, d->blended + (ptrdiff_t)pixel * channels);
    }
}

static bool is_any_missing(const RfDirectional *d, RfCell cell)
{
    for (int y = cell.y; y < cell.y + cell.height; ++y)
        for (int x = cell.x; x < cell.x + cell.width; ++x)
            if (rf_directional_missing(d, y * d->width + x))
                return true;
    return false;
}

static void lay_one(void *context, int item, int worker)
{
    const Laying *l = context;
    RfDirectional *d = l->d;
    int index = l->order[l->first + item];
    RfCell cell = l->list->cells[index];
    RfPatchScratch *s = &d->scratch[worker];
    bool over = l->kind == LAY_OVER;
    RfCell box = box_of(d, cell, over ? 0 : d->options.mask_width);
    if (!over && !is_any_missing(d, cell)) // filled with a hole that lies in the same box
        return;
    if (over)
        rf_directional_mask_cell(d, cell, s);
    else
        rf_directional_mask_hole(d, cell, box, s);
    float direction = rf_directional_mean(d, cell, over ? rf_directional_fluid : rf_directional_missing);
    int copy = isnan(direction) ? copy_around(d, box) : rf_turned_copy_of(&d->copies, direction);
    RfVec2 source = best_fit(d, box, copy, l->laid + (uint64_t)index, s);
    if (l->kind == LAY_FIRST && d->options.seam == RF_SEAM_CUT)
        rf_directional_cut(d, cell, box, copy, source, s);
    lay(d, box, copy, source, l->kind, s);
}

// ---- in which order

/// Waves of cells none of which sees another of the same wave.
typedef struct Waves
{
    int *order, *wave, *blocks;
    /// Where each wave starts, and the end.
    int *starts;
    int count;
} Waves;

static void free_waves(Waves *w)
{
    rf_release(w->order);
    rf_release(w->wave);
    rf_release(w->blocks);
    rf_release(w->starts);
}

static int wave_of(const RfDirectional *d, RfCell cell, int *blocks)
{
    int columns = (d->width + BLOCK - 1) / BLOCK, wave = 0;
    RfCell box = box_of(d, cell, d->options.mask_width);
    int x0 = box.x / BLOCK, x1 = (box.x + box.width - 1) / BLOCK, y0 = box.y / BLOCK,
        y1 = (box.y + box.height - 1) / BLOCK;
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x)
            wave = rf_max_int(wave, blocks[y * columns + x]);
    for (int y = y0; y <= y1; ++y)
        for (int x = x0; x <= x1; ++x)
            blocks[y * columns + x] = wave + 1;
    return wave;
}

static RfResult make_waves(const RfDirectional *d, const RfCellList *list, Waves *w)
{
    size_t cells = (size_t)list->count;
    size_t blocks = (size_t)((d->width + BLOCK - 1) / BLOCK) * (size_t)((d->height + BLOCK - 1) / BLOCK);
    *w = (Waves){rf_allocate(cells, sizeof *w->order), rf_allocate(cells, sizeof *w->wave),
                 rf_allocate_zero(blocks, sizeof *w->blocks), rf_allocate_zero(cells + 2, sizeof *w->starts), 0};
    if (!w->order || !w->wave || !w->blocks || !w->starts)
        return RF_OUT_OF_MEMORY;
    for (int i = 0; i < list->count; ++i)
    {
        w->wave[i] = wave_of(d, list->cells[i], w->blocks);
        w->count = rf_max_int(w->count, w->wave[i] + 1);
        ++w->starts[w->wave[i] + 2];
    }
    for (int k = 2; k <= w->count; ++k)
        w->starts[k] += w->starts[k - 1];
    for (int i = 0; i < list->count; ++i)
        w->order[w->starts[w->wave[i] + 1]++] = i;
    return RF_OK;
}

// What is shown more often than the exemplar has it costs more.
static void set_region_prices(void *context, int region, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    int64_t count[RF_LOOKS] = {0};
    int x0 = region % d->region_columns * RF_DIRECTIONAL_REGION, x1 = rf_min_int(x0 + RF_DIRECTIONAL_REGION, d->width);
    int y0 = region / d->region_columns * RF_DIRECTIONAL_REGION, y1 = rf_min_int(y0 + RF_DIRECTIONAL_REGION, d->height);
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
        {
            const RfTexel *texel = &d->texels[y * d->width + x];
            if (texel->copy >= 0)
                ++count[rf_turned_copies_look(&d->copies, texel->source)];
        }
    rf_looks_shares(count, MOST_SHARE, d->prices[region]);
    for (int k = 0; k < RF_LOOKS; ++k)
        d->prices[region][k] *= d->options.spread * PRICE;
}

// The number of threads may have been raised since the last step.
static RfResult make_scratch(RfDirectional *d)
{
    int threads = rf_threads();
    if (threads <= d->scratch_count)
        return RF_OK;
    rf_release(d->scratch);
    d->scratch_count = 0;
    d->scratch = rf_allocate((size_t)threads, sizeof *d->scratch);
    if (!d->scratch)
        return RF_OUT_OF_MEMORY;
    d->scratch_count = threads;
    return RF_OK;
}

static RfResult lay_all(RfDirectional *d, const RfCellList *list, LayingKind kind, const char *stage)
{
    if (list->count == 0)
        return RF_OK;
    RF_TRY(make_scratch(d));
    Waves waves;
    RfResult result = make_waves(d, list, &waves);
    Laying laying = {d, list, waves.order, 0, kind, d->laid};
    for (int k = 0; k < waves.count && result == RF_OK; ++k)
    {
        laying.first = waves.starts[k];
        rf_parallel_for(waves.starts[k + 1] - waves.starts[k], lay_one, &laying);
        if (stage)
            result = rf_progress(stage, (double)(k + 1) / waves.count);
    }
    d->laid += (uint64_t)list->count;
    free_waves(&waves);
    return result;
}

// ---- the first frame

static int by_row(const void *a, const void *b)
{
    const RfCell *p = a, *q = b;
    return p->y != q->y ? p->y - q->y : p->x - q->x;
}

RfResult rf_directional_start(RfDirectional *d)
{
    for (int i = 0; i < d->width * d->height; ++i)
        d->texels[i] = (RfTexel){.copy = -1};
    RF_TRY(rf_directional_split_frame(d, &d->holes));
    if (d->holes.count > 0)
        qsort(d->holes.cells, (size_t)d->holes.count, sizeof *d->holes.cells, by_row);
    return lay_all(d, &d->holes, LAY_FIRST, "first frame");
}

// ---- holes

// The box of all missing pixels that hang together with this one, which are marked.
static RfCell flood(RfDirectional *d, int start, uint8_t *seen)
{
    int count = 1, left = d->width, right = -1, top = d->height, bottom = -1;
    d->stack[0] = start;
    seen[start] = 1;
    while (count > 0)
    {
        int pixel = d->stack[--count], x = pixel % d->width, y = pixel / d->width;
        left = rf_min_int(left, x), right = rf_max_int(right, x);
        top = rf_min_int(top, y), bottom = rf_max_int(bottom, y);
        for (int j = rf_max_int(y - 1, 0); j <= rf_min_int(y + 1, d->height - 1); ++j)
            for (int i = rf_max_int(x - 1, 0); i <= rf_min_int(x + 1, d->width - 1); ++i)
                if (!seen[j * d->width + i] && rf_directional_missing(d, j * d->width + i))
                {
                    seen[j * d->width + i] = 1;
                    d->stack[count++] = j * d->width + i;
                }
    }
    return (RfCell){left, top, right - left + 1, bottom - top + 1};
}

RfResult rf_directional_fill(RfDirectional *d)
{
    size_t pixels = (size_t)d->width * (size_t)d->height;
    uint8_t *seen = rf_allocate_zero(pixels, 1);
    RfResult result = seen ? RF_OK : RF_OUT_OF_MEMORY;
    d->holes.count = 0;
    rf_parallel_for(d->region_rows * d->region_columns, set_region_prices, d);
    for (int i = 0; i < (int)pixels && result == RF_OK; ++i)
    {
        d->filled += rf_directional_missing(d, i);
        if (!seen[i] && rf_directional_missing(d, i))
            result = rf_directional_split_hole(d, flood(d, i, seen), &d->holes);
    }
    rf_release(seen);
    RF_TRY(result);
    return lay_all(d, &d->holes, LAY_HOLES, NULL);
}

// ---- what was blended too often

// Returns how many pixels of the fluid it has if it is, else 0.
static int over_blended(const RfDirectional *d, RfCell cell)
{
    float blends = 0;
    int count = 0;
    for (int y = cell.y; y < cell.y + cell.height; ++y)
        for (int x = cell.x; x < cell.x + cell.width; ++x)
            if (d->inside[y * d->width + x])
            {
                blends += d->texels[y * d->width + x].blends;
                ++count;
            }
    return blends > d->options.renew_after * (float)count ? count : 0;
}

RfResult rf_directional_renew(RfDirectional *d)
{
    if (d->options.renew_after == 0)
        return RF_OK;
    RF_TRY(rf_directional_split_frame(d, &d->cells));
    int kept = 0;
    for (int i = 0; i < d->cells.count; ++i)
    {
        RfCell cell = d->cells.cells[i];
        int pixels = over_blended(d, cell);
        d->renewed += pixels;
        if (pixels > 0)
            d->cells.cells[kept++] = cell;
    }
    d->cells.count = kept;
    return lay_all(d, &d->cells, LAY_OVER, NULL);
}
