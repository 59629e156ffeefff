// SPDX-License-Identifier: Apache-2.0
// Does it pop? The difference between a frame and the previous one carried there by the flow, over the frame's own
// contrast, on the whole and in blocks: a pop of one place drowns in the mean of the frame.
//
// The floor is what carrying alone costs: there and back, compared with where it began.
#include "measure/judgement.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

enum
{
    BLOCK = 32
};

// Grey levels that rounding alone may leave.
static const double g_nothing = 1e-3;

static double rms_contrast(const float *grey, const uint8_t *counted, size_t count)
{
    double sum = 0, squares = 0, n = 0;
    for (size_t k = 0; k < count; ++k)
        if (counted[k])
        {
            sum += (double)grey[k];
            squares += (double)grey[k] * (double)grey[k];
            n += 1;
        }
    return n > 0 ? sqrt(fmax(squares / n - sum / n * (sum / n), 0)) : 0;
}

// What is compared, where it counts, and the maps to fill with `scale` times it (NULL: none).
typedef struct Comparison
{
    const float *a, *b;
    const uint8_t *counted;
    int w, h;
    double scale;
    float *difference_map, *block_map;
} Comparison;

typedef struct Difference
{
    double whole, block;
    int block_x, block_y;
} Difference;

static double whole_difference(const Comparison *c)
{
    double total = 0, pixels = 0;
    for (size_t k = 0; k < (size_t)c->w * (size_t)c->h; ++k)
    {
        double d = (double)(c->a[k] - c->b[k]);
        if (c->difference_map)
            c->difference_map[k] = c->counted[k] ? (float)(d * c->scale) : NAN;
        if (!c->counted[k])
            continue;
        total += d * d;
        pixels += 1;
    }
    return pixels > 0 ? sqrt(total / pixels) * c->scale : (double)NAN;
}

// Rms over one block; negative if less than half of it counts.
static double block_difference(const Comparison *c, int block, int x0, int y0)
{
    double sum = 0;
    int n = 0;
    for (int i = 0; i < block * block; ++i)
    {
        size_t k = (size_t)(y0 + i / block) * (size_t)c->w + (size_t)(x0 + i % block);
        if (!c->counted[k])
            continue;
        sum += (double)(c->a[k] - c->b[k]) * (double)(c->a[k] - c->b[k]);
        ++n;
    }
    return 2 * n >= block * block ? sqrt(sum / n) * c->scale : -1;
}

static void raise_block(const Comparison *c, int x0, int y0, float value)
{
    for (int i = 0; i < BLOCK * BLOCK; ++i)
    {
        size_t k = (size_t)(y0 + i / BLOCK) * (size_t)c->w + (size_t)(x0 + i % BLOCK);
        if (!(c->block_map[k] >= value))
            c->block_map[k] = value;
    }
}

// On the whole, and the largest of the blocks that overlap by half.
static Difference difference(const Comparison *c)
{
    Difference result = {whole_difference(c), (double)NAN, 0, 0};
    for (size_t k = 0; c->block_map && k < (size_t)c->w * (size_t)c->h; ++k)
        c->block_map[k] = NAN;
    for (int y0 = 0; y0 + BLOCK <= c->h; y0 += BLOCK / 2)
        for (int x0 = 0; x0 + BLOCK <= c->w; x0 += BLOCK / 2)
        {
            double value = block_difference(c, BLOCK, x0, y0);
            if (value < 0)
                continue;
            if (c->block_map)
                raise_block(c, x0, y0, (float)value);
            if (!(result.block >= value))
                result = (Difference){result.whole, value, x0, y0};
        }
    return result;
}

// A frame with no contrast is like the previous one if nothing changed; otherwise no number says how much did.
static void compare(const RfFramePair *pair, const float *carried, const float *back, const uint8_t *counted,
                    float *difference_map, float *block_map, RfMeasureFlicker *out)
{
    double contrast = rms_contrast(pair->b, counted, (size_t)pair->w * (size_t)pair->h);
    Comparison bare = {pair->b, carried, counted, pair->w, pair->h, 1, NULL, NULL};
    double scale = contrast > g_nothing ? 1 / contrast : whole_difference(&bare) <= g_nothing ? 0 : (double)NAN;
    Comparison step = {pair->b, carried, counted, pair->w, pair->h, scale, difference_map, block_map};
    Comparison there_and_back = {pair->a, back, counted, pair->w, pair->h, scale, NULL, NULL};
    Difference now = difference(&step), floor = difference(&there_and_back);
    bool block = now.block >= 0;
    *out = (RfMeasureFlicker){.whole = now.whole,
                              .floor = floor.whole,
                              .ratio = floor.whole > 0 ? now.whole / floor.whole : (double)NAN,
                              .block = now.block,
                              .block_floor = floor.block,
                              .block_x = block ? now.block_x : (double)NAN,
                              .block_y = block ? now.block_y : (double)NAN};
}

// a carried to b, and the pixels that count there: seen from b, since that is where frames are compared.
static RfResult carry(const RfFramePair *pair, const float *displacement, float *backward, float *carried,
                      uint8_t *counted)
{
    RfFramePair turned = {pair->w, pair->h, pair->b, pair->a, pair->mask_b, pair->mask_a};
    RF_TRY(rf_measure_invert(displacement, pair->w, pair->h, backward));
    RF_TRY(rf_measure_counted(&turned, backward, counted));
    return rf_measure_warp(pair->a, backward, pair->w, pair->h, carried);
}

RfResult rf_measure_flicker(const RfFramePair *pair, const float *displacement, float *difference_map, float *block_map,
                            RfMeasureFlicker *out)
{
    int w = pair->w, h = pair->h;
    size_t count = (size_t)w * (size_t)h;
    float *backward = rf_allocate(count, 2 * sizeof(float));
    float *carried = rf_allocate(count, sizeof(float)), *back = rf_allocate(count, sizeof(float));
    uint8_t *counted = rf_allocate(count, 1);
    RfResult result = backward && carried && back && counted ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
        result = carry(pair, displacement, backward, carried, counted);
    if (result == RF_OK)
        result = rf_measure_warp(carried, displacement, w, h, back);
    if (result == RF_OK)
        compare(pair, carried, back, counted, difference_map, block_map, out);
    rf_release(counted);
    rf_release(back);
    rf_release(carried);
    rf_release(backward);
    return result;
}

RfResult rf_measure_block_changes(const RfFramePair *pair, const float *displacement, int block, float *changes)
{
    size_t count = (size_t)pair->w * (size_t)pair->h;
    float *backward = rf_allocate(count, 2 * sizeof(float)), *carried = rf_allocate(count, sizeof(float));
    uint8_t *counted = rf_allocate(count, 1);
    RfResult result = backward && carried && counted ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
        result = carry(pair, displacement, backward, carried, counted);
    Comparison c = {pair->b, carried, counted, pair->w, pair->h, 1, NULL, NULL};
    int columns = pair->w / block, rows = pair->h / block;
    for (int k = 0; k < columns * rows && result == RF_OK; ++k)
        changes[k] = (float)block_difference(&c, block, k % columns * block, k / columns * block);
    rf_release(counted);
    rf_release(carried);
    rf_release(backward);
    return result;
}
