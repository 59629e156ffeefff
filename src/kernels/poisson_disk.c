// SPDX-License-Identifier: Apache-2.0
// Dunbar, Humphreys. A spatial data structure for fast Poisson-disk sample generation. SIGGRAPH 2006 (the aim: maximal,
// and cheap to mend).
//
// They keep the boundary of the free region exactly, as arcs. Here the region is a lattice of cells: a cell is closed
// once it lies within d of a point *altogether*, so when none is open no point of the domain is farther than d from a
// point, exactly as wanted. The price: a new point may be nearer than d to an old one, by a cell's diagonal: 0.06 d,
// and 0.18 d at d = 2, where cells are a quarter of a pixel. Both are within the slack alpha = 0.25 that retirement
// leaves.

#include "kernels/poisson_disk.h"
#include "core/maths.h"
#include "core/random.h"
#include "core/result.h"

#include <stdlib.h>
#include <string.h>

#define HALF_DIAGONAL 0.70711f

RfResult rf_disk_field_create(int width, int height, float radius, RfArena *arena, RfDiskField *out)
{
    float spacing = rf_clamp(radius / 24, 0.25f, 16);
    if (ceil((double)width / (double)spacing) * ceil((double)height / (double)spacing) > INT32_MAX)
        return rf_fail(RF_INVALID_ARGUMENT, NULL, NULL, "particle-radius %g: too small for a frame of %d x %d pixels",
                       (double)radius, width, height);
    *out = (RfDiskField){
        (int)ceilf((float)width / spacing), (int)ceilf((float)height / spacing), spacing, radius, NULL, NULL, 0};
    size_t cells = (size_t)out->columns * (size_t)out->rows;
    out->open = rf_arena_push(arena, cells, 1);
    if (!out->open)
        return RF_OUT_OF_MEMORY;
    memset(out->open, 1, cells);
    return RF_OK;
}

void rf_disk_field_mark(RfDiskField *field, RfVec2 point)
{
    float reach = field->radius / field->spacing - HALF_DIAGONAL, x = point.x / field->spacing - 0.5f,
          y = point.y / field->spacing - 0.5f;
    if (!(x > -reach && y > -reach && x < (float)field->columns + reach && y < (float)field->rows + reach))
        return;
    int first = rf_max_int((int)ceilf(y - reach), 0), last = rf_min_int((int)floorf(y + reach), field->rows - 1);
    for (int j = first; j <= last; ++j)
    {
        float dy = (float)j - y, half = sqrtf(fmaxf(reach * reach - dy * dy, 0));
        int begin = rf_max_int((int)ceilf(x - half), 0), end = rf_min_int((int)floorf(x + half), field->columns - 1);
        if (end >= begin)
            memset(field->open + (size_t)j * (size_t)field->columns + (size_t)begin, 0, (size_t)(end - begin + 1));
    }
}

RfResult rf_disk_field_list(RfDiskField *field, RfArena *arena)
{
    int cells = field->columns * field->rows, count = 0;
    for (int i = 0; i < cells; ++i)
        count += field->open[i];
    field->list = rf_arena_push(arena, (size_t)count, sizeof *field->list);
    if (!field->list)
        return RF_OUT_OF_MEMORY;
    field->list_count = 0;
    for (int i = 0; i < cells && count > 0; ++i)
        if (field->open[i])
            field->list[field->list_count++] = i;
    return RF_OK;
}

int rf_disk_field_pick(RfDiskField *field, uint64_t seed, uint64_t frame, uint64_t draw)
{
    for (uint64_t attempt = 0; field->list_count > 0; ++attempt)
    {
        uint32_t place = rf_random_below((uint32_t)field->list_count, seed, frame, draw, attempt);
        int cell = field->list[place];
        if (field->open[cell])
            return cell;
        field->list[place] = field->list[--field->list_count];
    }
    return -1;
}

RfVec2 rf_disk_field_centre(const RfDiskField *field, int cell)
{
    return (RfVec2){((float)(cell % field->columns) + 0.5f) * field->spacing,
                    ((float)(cell / field->columns) + 0.5f) * field->spacing};
}

static int compare_pairs(const void *left, const void *right)
{
    const RfPair *p = left, *q = right;
    if (p->distance != q->distance)
        return p->distance < q->distance ? -1 : 1;
    if (p->a != q->a)
        return p->a - q->a;
    return p->b - q->b;
}

typedef struct Bins
{
    float x0, y0, inverse;
    int columns, rows, *first, *items, *bin_of;
} Bins;

static RfResult fill_bins(const RfVec2 *points, int count, float limit, RfArena *arena, Bins *bins)
{
    float x0 = points[0].x, x1 = x0, y0 = points[0].y, y1 = y0;
    for (int i = 1; i < count; ++i)
    {
        x0 = fminf(x0, points[i].x);
        x1 = fmaxf(x1, points[i].x);
        y0 = fminf(y0, points[i].y);
        y1 = fmaxf(y1, points[i].y);
    }
    // Never more than 512 x 512 bins: points may be far apart.
    float side = fmaxf(limit, fmaxf(x1 - x0, y1 - y0) / 511);
    *bins = (Bins){x0,
                   y0,
                   1 / side,
                   rf_min_int((int)((x1 - x0) / side) + 1, 512),
                   rf_min_int((int)((y1 - y0) / side) + 1, 512),
                   NULL,
                   NULL,
                   NULL};
    int cells = bins->columns * bins->rows;
    bins->first = rf_arena_push(arena, (size_t)cells + 1, sizeof(int));
    bins->items = rf_arena_push(arena, (size_t)count, sizeof(int));
    bins->bin_of = rf_arena_push(arena, (size_t)count, sizeof(int));
    if (!bins->first || !bins->items || !bins->bin_of)
        return RF_OUT_OF_MEMORY;
    memset(bins->first, 0, ((size_t)cells + 1) * sizeof(int));
    for (int i = 0; i < count; ++i)
    {
        int column = rf_clamp_int((int)((points[i].x - x0) * bins->inverse), 0, bins->columns - 1);
        int row = rf_clamp_int((int)((points[i].y - y0) * bins->inverse), 0, bins->rows - 1);
        bins->bin_of[i] = row * bins->columns + column;
        ++bins->first[bins->bin_of[i] + 1];
    }
    for (int i = 0; i < cells; ++i)
        bins->first[i + 1] += bins->first[i];
    for (int i = count - 1; i >= 0; --i)
        bins->items[--bins->first[bins->bin_of[i] + 1]] = i;
    // first[b + 1] now starts bin b; shift back.
    memmove(bins->first, bins->first + 1, (size_t)cells * sizeof(int));
    bins->first[cells] = count;
    return RF_OK;
}

int rf_close_pairs(const RfVec2 *points, int count, float limit, RfArena *arena, RfPair **pairs)
{
    *pairs = NULL;
    if (count < 2)
        return 0;
    Bins bins;
    if (fill_bins(points, count, limit, arena, &bins) != RF_OK)
        return -1;
    int found = 0;
    // First counted, then stored.
    for (int pass = 0; pass < 2; ++pass)
    {
        if (pass == 1 && !(*pairs = rf_arena_push(arena, (size_t)found, sizeof **pairs)))
            return -1;
        found = 0;
        for (int a = 0; a < count; ++a)
        {
            int column = bins.bin_of[a] % bins.columns, row = bins.bin_of[a] / bins.columns;
            for (int j = rf_max_int(row - 1, 0); j <= rf_min_int(row + 1, bins.rows - 1); ++j)
                for (int i = rf_max_int(column - 1, 0); i <= rf_min_int(column + 1, bins.columns - 1); ++i)
                    for (int k = bins.first[j * bins.columns + i]; k < bins.first[j * bins.columns + i + 1]; ++k)
                    {
                        int b = bins.items[k];
                        float distance = b > a ? rf_vec2_length(rf_vec2_sub(points[a], points[b])) : limit;
                        if (!(distance < limit))
                            continue;
                        if (pass == 1)
                            (*pairs)[found] = (RfPair){distance, a, b};
                        ++found;
                    }
        }
        if (found == 0)
            return 0;
    }
    qsort(*pairs, (size_t)found, sizeof **pairs, compare_pairs);
    return found;
}
