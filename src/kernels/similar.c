// SPDX-License-Identifier: Apache-2.0
// Lists of similar places, from coarse to fine.
//
// On the coarsest picture every place is compared with every other. A finer picture takes its candidates from the
// list of the pixel that it was halved to, doubled, and from the four pixels round each: places that are alike here
// were alike there. So lists for a picture of a million pixels cost a few dozen comparisons a pixel.
//
// Places of a list keep a distance from the pixel and from each other, or all of them would be neighbours of the best.
#include "kernels/similar.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"

enum
{
    // In pixels: half a window, so that no two share most of what was compared.
    APART = RF_SIMILAR_SIDE / 2 + 1,
    // Places tried on the coarsest picture at most.
    MAX_TRIED = 2048
};

typedef struct Lists
{
    const RfFixedPicture *picture;
    bool tiles;
    int side;
    const RfSimilar *coarse;
    RfSimilar *similar;
    RfFixedQuery query;
} Lists;

typedef struct Found
{
    RfPlace place;
    float distance;
} Found;

static int16_t bring_inside(const Lists *l, int i, int n)
{
    int half = l->side / 2;
    return (int16_t)(l->tiles ? rf_wrap_int(i, n) : rf_clamp_int(i, half, n - 1 - half));
}

static RfPlace inside(const Lists *l, int x, int y)
{
    return (RfPlace){bring_inside(l, x, l->picture->width), bring_inside(l, y, l->picture->height)};
}

// Of two indices, round the border if the picture tiles.
static int distance_along(const Lists *l, int a, int b, int n)
{
    int d = a < b ? b - a : a - b;
    return l->tiles ? rf_min_int(d, n - d) : d;
}

static bool is_near(const Lists *l, RfPlace a, RfPlace b)
{
    return distance_along(l, a.x, b.x, l->picture->width) < APART &&
           distance_along(l, a.y, b.y, l->picture->height) < APART;
}

static const int16_t *corner(const Lists *l, RfPlace centre)
{
    return rf_fixed_at(l->picture, centre.x - l->side / 2, centre.y - l->side / 2);
}

// Keeps found[0 .. *count) sorted by distance, at most as many as wanted and no two near each other.
static void consider(const Lists *l, RfPlace own, const RfFixedQuery *query, RfPlace place, Found *found, int *count)
{
    int wanted = l->similar->count;
    if (is_near(l, place, own))
        return;
    const int16_t *candidate = corner(l, place);
    float distance = 0;
    rf_fixed_least(query, &candidate, NULL, 1, &distance);
    int kept = 0;
    for (int i = 0; i < *count; ++i)
        if (is_near(l, found[i].place, place) && found[i].distance <= distance)
            return;
    for (int i = 0; i < *count; ++i)
        if (!is_near(l, found[i].place, place))
            found[kept++] = found[i];
    int at = kept;
    while (at > 0 && found[at - 1].distance > distance)
        --at;
    if (at == wanted)
    {
        *count = kept;
        return;
    }
    int last = rf_min_int(kept, wanted - 1);
    for (int i = last; i > at; --i)
        found[i] = found[i - 1];
    found[at] = (Found){place, distance};
    *count = last + 1;
}

static void consider_all(const Lists *l, RfPlace own, const RfFixedQuery *query, Found *found, int *count)
{
    int64_t pixels = (int64_t)l->picture->width * l->picture->height;
    int step = rf_max_int(1, (int)ceil(sqrt((double)pixels / MAX_TRIED)));
    int half = l->tiles ? 0 : l->side / 2;
    for (int y = half; y < l->picture->height - half; y += step)
        for (int x = half; x < l->picture->width - half; x += step)
            consider(l, own, query, (RfPlace){(int16_t)x, (int16_t)y}, found, count);
}

static void consider_coarse(const Lists *l, RfPlace own, const RfFixedQuery *query, Found *found, int *count)
{
    static const int round[5][2] = {{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}};
    const RfPlace *list = rf_similar_at(l->coarse, own.x / 2, own.y / 2);
    for (int i = 0; i < l->coarse->count; ++i)
        for (int j = 0; j < 5; ++j)
            consider(l, own, query,
                     inside(l, 2 * list[i].x + own.x % 2 + round[j][0], 2 * list[i].y + own.y % 2 + round[j][1]), found,
                     count);
}

static void list_row(void *context, int y, int worker)
{
    (void)worker;
    const Lists *l = context;
    RfSimilar *similar = l->similar;
    for (int x = 0; x < similar->width; ++x)
    {
        // Near the border of one that does not tile, the nearest place that has a whole window stands for the pixel.
        RfPlace own = inside(l, x, y);
        RfFixedQuery query = l->query;
        query.window = corner(l, own);
        Found found[RF_MAX_SIMILAR];
        int count = 0;
        if (l->coarse)
            consider_coarse(l, own, &query, found, &count);
        else
            consider_all(l, own, &query, found, &count);
        RfPlace *list = similar->places + ((size_t)y * (size_t)similar->width + (size_t)x) * (size_t)similar->count;
        for (int i = 0; i < similar->count; ++i)
            list[i] = i < count ? found[i].place : own;
    }
}

RfResult rf_similar_create(const RfFixedPicture *picture, bool tiles, int count, const RfSimilar *coarse,
                           RfSimilar *out)
{
    assert(count >= 1 && count <= RF_MAX_SIMILAR && picture->apron >= RF_SIMILAR_SIDE / 2);
    *out = (RfSimilar){.width = picture->width, .height = picture->height, .count = count};
    out->places = rf_allocate((size_t)picture->width * (size_t)picture->height * (size_t)count, sizeof *out->places);
    if (!out->places)
        return RF_OUT_OF_MEMORY;
    int room = rf_min_int(picture->width, picture->height);
    Lists lists = {.picture = picture, .tiles = tiles, .coarse = coarse, .similar = out};
    lists.side = tiles ? RF_SIMILAR_SIDE : rf_min_int(RF_SIMILAR_SIDE, room - 1 + room % 2);
    int16_t mask[RF_FIXED_SIDE * RF_MAX_EXEMPLAR_CHANNELS + RF_FIXED_LANES];
    rf_fixed_query(picture, picture, lists.side, mask, &lists.query);
    rf_parallel_for(picture->height, list_row, &lists);
    return RF_OK;
}

void rf_similar_free(RfSimilar *similar)
{
    rf_release(similar->places);
    *similar = (RfSimilar){0};
}
