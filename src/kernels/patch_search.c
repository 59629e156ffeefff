// SPDX-License-Identifier: Apache-2.0
// Places side by side are compared at once, one in each lane of some vectors: a picture lies in planes, so that a
// number of the query meets as many numbers in a row, whatever the mask looks like. With several vectors at a time no
// sum waits for itself.
//
//     query's numbers      q0    q1    q2 ...          channel by channel, in an order that jumps over the box
//     lane = place         x .. x + 63
//     partial sums         s[l] += weight (picture[x + l + offset] - q)^2
//
// Partial sums only grow. After each block of numbers the places are given up as soon as the least of their sums is
// above the best distance so far; and as the first numbers are from all over the box and, where the caller sees to it,
// from the channel that says most, most places are given up after some blocks. What is left is compared once more in
// plain order and in double, which decides.
#include "kernels/patch_search.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "core/simd.h"

#include <math.h>
#include <string.h>

enum
{
    VECTORS = 4,
    LANES = VECTORS * RF_WIDE_FLOATS,
    /// Numbers after which sums are looked at.
    BLOCK = 16,
    /// The group of pixels that no box may have in its middle.
    NO_ROOM = RF_PATCH_GROUPS
};

// Of RF_MAX_PATCH_TERMS sums in float: their rounding is less.
static const float SLACK = 1.01f;

RfResult rf_patch_picture_create(const float *pixels, int width, int height, int channels, const uint8_t *valid,
                                 const uint8_t *groups, RfPatchRoom room, RfPatchPicture *out)
{
    *out = (RfPatchPicture){width, height, channels, NULL, rf_whole_vectors(width) + LANES, NULL, room, NULL};
    size_t plane = (size_t)height * (size_t)out->stride, row = (size_t)width + 1;
    out->planes = rf_allocate_zero(plane * (size_t)channels + LANES, sizeof *out->planes);
    out->invalid = rf_allocate_zero(row * ((size_t)height + 1), sizeof *out->invalid);
    out->groups = rf_allocate_zero((size_t)width * (size_t)height, 1);
    if (!out->planes || !out->invalid || !out->groups)
    {
        rf_patch_picture_free(out);
        return RF_OUT_OF_MEMORY;
    }
    for (size_t i = 0; i < (size_t)width * (size_t)height; ++i)
    {
        bool closed = room == RF_ROOM_OF_MIDDLE && valid && !valid[i];
        out->groups[i] = closed ? NO_ROOM : groups ? groups[i] : 0;
    }
    for (size_t y = 0; y < (size_t)height; ++y)
        for (size_t x = 0; x < (size_t)width; ++x)
        {
            size_t pixel = y * (size_t)width + x;
            bool sound = !valid || valid[pixel];
            for (size_t c = 0; c < (size_t)channels && (sound || room == RF_ROOM_OF_MIDDLE); ++c)
                out->planes[c * plane + y * (size_t)out->stride + x] = pixels[pixel * (size_t)channels + c];
            int32_t *count = &out->invalid[(y + 1) * row + x + 1];
            *count = count[-1] + out->invalid[y * row + x + 1] - out->invalid[y * row + x] + !sound;
        }
    return RF_OK;
}

void rf_patch_picture_free(RfPatchPicture *picture)
{
    rf_release(picture->planes);
    rf_release(picture->invalid);
    rf_release(picture->groups);
    *picture = (RfPatchPicture){0};
}

// The pixels that must be valid for a box to have room, from the box's first one; and where their sums start.
typedef struct Room
{
    int width;
    const int32_t *top, *bottom;
} Room;

static Room room_at(const RfPatchPicture *p, const RfPatchQuery *q, int x, int y)
{
    bool all = p->room == RF_ROOM_OF_ALL;
    ptrdiff_t row = p->width + 1;
    int width = all ? q->width : 1, height = all ? q->height : 1;
    const int32_t *top = p->invalid + (all ? y * row + x : (y + q->height / 2) * row + x + q->width / 2);
    return (Room){width, top, top + height * row};
}

static bool is_room(Room r, int lane)
{
    return r.bottom[lane + r.width] - r.bottom[lane] - r.top[lane + r.width] + r.top[lane] == 0;
}

static bool fits(const RfPatchPicture *p, const RfPatchQuery *q, int x, int y)
{
    if (x < 0 || y < 0 || x > p->width - q->width || y > p->height - q->height)
        return false;
    return is_room(room_at(p, q, x, y), 0);
}

// Infinite where only the middle is asked for and is not valid.
static float price_at(const RfPatchPicture *p, const RfPatchQuery *q, const RfPatchTerms *terms, int x, int y)
{
    return terms->prices[p->groups[(ptrdiff_t)(y + q->height / 2) * p->width + x + q->width / 2]];
}

static double distance_at(const RfPatchPicture *p, const RfPatchQuery *q, const RfPatchTerms *terms, int x, int y)
{
    double sum = (double)price_at(p, q, terms, x, y);
    for (int j = 0; j < q->height; ++j)
        for (int i = 0; i < q->width; ++i)
        {
            ptrdiff_t pixel = (ptrdiff_t)j * q->width + i;
            double weight = (double)q->weights[pixel];
            for (int c = 0; c < p->channels && weight > 0; ++c)
            {
                double there = (double)p->planes[((ptrdiff_t)c * p->height + y + j) * p->stride + x + i];
                double d = there - (double)q->pixels[pixel * p->channels + c];
                sum += weight * d * d;
            }
        }
    return sum;
}

static int count_terms(const RfPatchPicture *p, const RfPatchQuery *q)
{
    int count = 0;
    for (int i = 0; i < q->width * q->height; ++i)
        count += q->weights[i] > 0 ? p->channels : 0;
    return count;
}

// A step that meets all of `count` places once before it comes back, about 0.618 of them long.
static int step_of(int count)
{
    int step = rf_max_int((int)(0.618 * count), 1);
    for (;; ++step)
    {
        int a = count, b = step;
        while (b)
        {
            int rest = a % b;
            a = b;
            b = rest;
        }
        if (a <= 1)
            return step;
    }
}

static void set_terms(const RfPatchPicture *p, const RfPatchQuery *q, RfPatchTerms *terms)
{
    terms->count = count_terms(p, q);
    for (int k = 0; k < RF_PATCH_GROUPS; ++k)
        terms->prices[k] = q->prices ? q->prices[k] : 0;
    terms->prices[NO_ROOM] = INFINITY;
    int known = terms->count / p->channels, step = step_of(known), at = 0;
    for (int i = 0; i < q->width * q->height; ++i)
    {
        if (!(q->weights[i] > 0))
            continue;
        for (int c = 0; c < p->channels; ++c)
        {
            int term = c * known + at;
            terms->offset[term] = ((ptrdiff_t)c * p->height + i / q->width) * p->stride + i % q->width;
            terms->value[term] = q->pixels[(ptrdiff_t)i * p->channels + c];
            terms->weight[term] = q->weights[i];
        }
        at = (at + step) % known;
    }
}

// Unaligned where it is read through a pointer.
typedef float Vector __attribute__((vector_size(RF_WIDE_FLOATS * sizeof(float)), aligned(4), may_alias));

typedef int Bits __attribute__((vector_size(RF_WIDE_FLOATS * sizeof(int)), aligned(4)));

RF_WIDE_BODY void rf_sum_patch_terms_body(const float *first, const RfPatchTerms *terms, float limit, float *sums,
                                          bool *whole)
{
    Vector own[VECTORS];
    int above;
    memcpy(own, sums, sizeof own);
    memcpy(&above, &limit, sizeof above);
    ++above;
    *whole = false;
    for (int k = 0; k < terms->count; k += BLOCK)
    {
        int to = k + BLOCK < terms->count ? k + BLOCK : terms->count;
        for (int i = k; i < to; ++i)
        {
            const Vector *there = (const Vector *)(const void *)(first + terms->offset[i]);
            float value = terms->value[i], weight = terms->weight[i];
            for (int v = 0; v < VECTORS; ++v)
            {
                Vector d = there[v] - value;
                own[v] += weight * d * d;
            }
        }
        // Numbers of one sign are ordered as their bits are: a difference of bits is negative where a sum is at most
        // the limit. (Compared as floats they would be taken apart, lane by lane.)
        Bits now[VECTORS], below = {0};
        memcpy(now, own, sizeof now);
        for (int v = 0; v < VECTORS; ++v)
            below |= now[v] - above;
        int any = 0;
        for (int l = 0; l < RF_WIDE_FLOATS; ++l)
            any |= below[l];
        if (any >= 0)
            return;
    }
    memcpy(sums, own, sizeof own);
    *whole = true;
}

RF_WIDE(rf_sum_patch_terms, (const float *first, const RfPatchTerms *terms, float limit, float *sums, bool *whole),
        (first, terms, limit, sums, whole))

static void take(RfPatchMatch *best, int x, int y, double distance)
{
    bool before = y < best->y || (y == best->y && x < best->x);
    if (best->x < 0 || distance < best->distance || (distance == best->distance && before))
        *best = (RfPatchMatch){x, y, distance};
}

// The price where the box has room, else infinity. False: it has room nowhere.
static bool start_sums(const RfPatchPicture *p, const RfPatchQuery *q, const RfPatchTerms *terms, int x, int y,
                       float *sums)
{
    Room there = room_at(p, q, x, y);
    const uint8_t *groups = p->groups + (ptrdiff_t)(y + q->height / 2) * p->width + x + q->width / 2;
    int count = rf_min_int(LANES, p->width - q->width + 1 - x);
    bool room = false;
    for (int l = 0; l < count; ++l)
        sums[l] = terms->prices[groups[l]];
    for (int l = 0; l < count && p->room == RF_ROOM_OF_ALL; ++l)
        sums[l] = is_room(there, l) ? sums[l] : INFINITY;
    for (int l = 0; l < count; ++l)
        room |= sums[l] < INFINITY;
    for (int l = count; l < LANES; ++l)
        sums[l] = INFINITY;
    return room;
}

static void try_lanes(const RfPatchPicture *p, const RfPatchQuery *q, const RfPatchTerms *terms, int x, int y,
                      RfPatchMatch *best)
{
    float sums[LANES];
    float limit = best->x < 0 ? INFINITY : (float)best->distance * SLACK;
    if (!start_sums(p, q, terms, x, y, sums))
        return;
    bool whole;
    rf_sum_patch_terms(p->planes + y * p->stride + x, terms, limit, sums, &whole);
    if (!whole)
        return;
    for (int l = 0; l < LANES; ++l)
        if (sums[l] <= limit && sums[l] < INFINITY)
        {
            take(best, x + l, y, distance_at(p, q, terms, x + l, y));
            limit = (float)best->distance * SLACK;
        }
}

RfPatchMatch rf_patch_search(const RfPatchPicture *p, const RfPatchQuery *q, RfPatchTerms *terms)
{
    assert(q->width >= 1 && q->height >= 1 && q->width <= RF_PATCH_BOX && q->height <= RF_PATCH_BOX);
    RfPatchMatch best = {-1, -1, INFINITY};
    set_terms(p, q, terms);
    if (fits(p, q, q->guess_x, q->guess_y))
        take(&best, q->guess_x, q->guess_y, distance_at(p, q, terms, q->guess_x, q->guess_y));
    for (int y = 0; y <= p->height - q->height; ++y)
        for (int x = 0; x <= p->width - q->width; x += LANES)
            try_lanes(p, q, terms, x, y, &best);
    return best;
}
