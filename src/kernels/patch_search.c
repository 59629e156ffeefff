// SPDX-License-Identifier: Apache-2.0
// Sixteen places side by side are compared at once, one in each lane of a vector: a picture lies in planes, so that a
// number of the query meets sixteen numbers in a row, whatever the mask looks like.
//
//     query's numbers      q0    q1    q2 ...          in an order that jumps over the box
//     lane = place         x .. x + 15
//     partial sums         s[l] += weight (picture[x + l + offset] - q)^2
//
// Partial sums only grow. After each block of numbers sixteen places are given up as soon as the least of their sums is
// above the best distance so far; and as the first numbers are from all over the box, most places are given up after
// the first block or two. What is left is compared once more in plain order and in double, which decides.
#include "kernels/patch_search.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "core/simd.h"

#include <math.h>
#include <string.h>

enum
{
    LANES = RF_WIDE_FLOATS,
    /// Numbers after which sums are looked at.
    BLOCK = 24
};

// Of RF_MAX_PATCH_TERMS sums in float: their rounding is less.
static const float SLACK = 1.01f;

RfResult rf_patch_picture_create(const float *pixels, int width, int height, int channels, const uint8_t *valid,
                                 RfPatchPicture *out)
{
    *out = (RfPatchPicture){width, height, channels, NULL, rf_whole_vectors(width) + LANES, NULL};
    size_t plane = (size_t)height * (size_t)out->stride, row = (size_t)width + 1;
    out->planes = rf_allocate_zero(plane * (size_t)channels + LANES, sizeof *out->planes);
    out->invalid = rf_allocate_zero(row * ((size_t)height + 1), sizeof *out->invalid);
    if (!out->planes || !out->invalid)
    {
        rf_patch_picture_free(out);
        return RF_OUT_OF_MEMORY;
    }
    for (size_t y = 0; y < (size_t)height; ++y)
        for (size_t x = 0; x < (size_t)width; ++x)
        {
            size_t pixel = y * (size_t)width + x;
            bool sound = !valid || valid[pixel];
            for (size_t c = 0; c < (size_t)channels && sound; ++c)
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
    *picture = (RfPatchPicture){0};
}

static bool fits(const RfPatchPicture *p, const RfPatchQuery *q, int x, int y)
{
    if (x < 0 || y < 0 || x > p->width - q->width || y > p->height - q->height)
        return false;
    ptrdiff_t row = p->width + 1;
    const int32_t *top = p->invalid + y * row + x, *bottom = top + q->height * row;
    return bottom[q->width] - bottom[0] - top[q->width] + top[0] == 0;
}

static double distance_at(const RfPatchPicture *p, const RfPatchQuery *q, int x, int y)
{
    double sum = 0;
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
    int step = step_of(terms->count), at = 0;
    for (int i = 0; i < q->width * q->height; ++i)
        for (int c = 0; c < p->channels && q->weights[i] > 0; ++c, at = (at + step) % terms->count)
        {
            terms->offset[at] = ((ptrdiff_t)c * p->height + i / q->width) * p->stride + i % q->width;
            terms->value[at] = q->pixels[(ptrdiff_t)i * p->channels + c];
            terms->weight[at] = q->weights[i];
        }
}

RF_WIDE_BODY void rf_add_patch_terms_body(const float *first, const RfPatchTerms *terms, int from, int to, float *sums,
                                          float *least)
{
    float own[LANES];
    memcpy(own, sums, sizeof own);
    for (int k = from; k < to; ++k)
    {
        const float *there = first + terms->offset[k];
        float value = terms->value[k], weight = terms->weight[k];
        for (int l = 0; l < LANES; ++l)
        {
            float d = there[l] - value;
            own[l] += weight * d * d;
        }
    }
    float most = own[0];
    for (int l = 1; l < LANES; ++l)
        most = own[l] < most ? own[l] : most;
    *least = most;
    memcpy(sums, own, sizeof own);
}

RF_WIDE(rf_add_patch_terms,
        (const float *first, const RfPatchTerms *terms, int from, int to, float *sums, float *least),
        (first, terms, from, to, sums, least))

static void take(RfPatchMatch *best, int x, int y, double distance)
{
    bool before = y < best->y || (y == best->y && x < best->x);
    if (best->x < 0 || distance < best->distance || (distance == best->distance && before))
        *best = (RfPatchMatch){x, y, distance};
}

static void try_lanes(const RfPatchPicture *p, const RfPatchQuery *q, const RfPatchTerms *terms, int x, int y,
                      RfPatchMatch *best)
{
    float sums[LANES], least = INFINITY;
    bool any = false;
    for (int l = 0; l < LANES; ++l)
    {
        bool room = fits(p, q, x + l, y);
        sums[l] = room ? 0 : INFINITY;
        any |= room;
    }
    float limit = best->x < 0 ? INFINITY : (float)best->distance * SLACK;
    if (!any)
        return;
    for (int k = 0; k < terms->count; k += BLOCK)
    {
        rf_add_patch_terms(p->planes + y * p->stride + x, terms, k, rf_min_int(k + BLOCK, terms->count), sums, &least);
        if (least > limit)
            return;
    }
    for (int l = 0; l < LANES; ++l)
        if (sums[l] <= limit && fits(p, q, x + l, y))
            take(best, x + l, y, distance_at(p, q, x + l, y));
}

RfPatchMatch rf_patch_search(const RfPatchPicture *p, const RfPatchQuery *q, RfPatchTerms *terms)
{
    assert(q->width >= 1 && q->height >= 1 && q->width <= RF_PATCH_BOX && q->height <= RF_PATCH_BOX);
    RfPatchMatch best = {-1, -1, INFINITY};
    set_terms(p, q, terms);
    if (fits(p, q, q->guess_x, q->guess_y))
        take(&best, q->guess_x, q->guess_y, distance_at(p, q, q->guess_x, q->guess_y));
    for (int y = 0; y <= p->height - q->height; ++y)
        for (int x = 0; x <= p->width - q->width; x += LANES)
            try_lanes(p, q, terms, x, y, &best);
    return best;
}
