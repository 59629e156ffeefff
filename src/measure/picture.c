// SPDX-License-Identifier: Apache-2.0
#include "measure/picture.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "kernels/cubic_spline.h"

#include <string.h>

enum
{
    /// Pixels of a walk that takes longer than threads take to wake.
    WORTH_THREADS = 1 << 15
};

typedef struct Rows
{
    RfRowsFn *function;
    void *context;
    int h;
} Rows;

static void run_band(void *context, int item, int worker)
{
    const Rows *rows = context;
    int y0 = item * RF_MEASURE_BAND;
    rows->function(rows->context, y0, rf_min_int(y0 + RF_MEASURE_BAND, rows->h), worker);
}

void rf_measure_rows(int w, int h, RfRowsFn *function, void *context)
{
    if ((int64_t)w * h < WORTH_THREADS)
    {
        function(context, 0, h, 0);
        return;
    }
    Rows rows = {function, context, h};
    rf_parallel_for((h + RF_MEASURE_BAND - 1) / RF_MEASURE_BAND, run_band, &rows);
}

void rf_measure_grey(const RfImageView *frame, float *grey)
{
    for (int y = 0; y < frame->height; ++y)
    {
        const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride;
        float *out = grey + (size_t)y * (size_t)frame->width;
        for (int x = 0; x < frame->width; ++x, p += frame->channels)
            out[x] = 255 * (frame->channels < 3 ? p[0] : 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2]);
    }
}

// ---- displacements -----------------------------------------------------------------------------------------------

typedef struct Displace
{
    const RfFlowView *view;
    double from;
    int w, h;
    float *out;
} Displace;

// One step of the classical fourth-order rule, in flow cells.
static RfVec2 advance(const RfFlowView *view, RfVec2 p, double time, float dt)
{
    float b0 = rf_flow_blend(view, time), b1 = rf_flow_blend(view, time + 0.5 * (double)dt);
    float b2 = rf_flow_blend(view, time + (double)dt);
    RfVec2 k1 = rf_flow_sample(view, p.x, p.y, b0);
    RfVec2 k2 = rf_flow_sample(view, p.x + 0.5f * dt * k1.x, p.y + 0.5f * dt * k1.y, b1);
    RfVec2 k3 = rf_flow_sample(view, p.x + 0.5f * dt * k2.x, p.y + 0.5f * dt * k2.y, b1);
    RfVec2 k4 = rf_flow_sample(view, p.x + dt * k3.x, p.y + dt * k3.y, b2);
    return (RfVec2){p.x + dt / 6 * (k1.x + 2 * k2.x + 2 * k3.x + k4.x),
                    p.y + dt / 6 * (k1.y + 2 * k2.y + 2 * k3.y + k4.y)};
}

static void displace_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Displace *d = context;
    float sx = (float)d->view->width / (float)d->w, sy = (float)d->view->height / (float)d->h;
    double span = d->view->time - d->from;
    // More than 32 frames at once are no frames of one film: the paths are then only roughly right.
    int steps = 2 * (span > 32 ? 32 : rf_max_int((int)ceil(span), 1));
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < d->w; ++x)
        {
            RfVec2 start = {((float)x + 0.5f) * sx, ((float)y + 0.5f) * sy}, end = start;
            for (int i = 0; i < steps; ++i)
                end = advance(d->view, end, d->from + span * i / steps, (float)(span / steps));
            float *out = d->out + 2 * ((size_t)y * (size_t)d->w + (size_t)x);
            out[0] = (end.x - start.x) / sx;
            out[1] = (end.y - start.y) / sy;
        }
}

void rf_measure_displacement(const RfFlowView *view, double from, int w, int h, float *displacement)
{
    Displace d = {view, from, w, h, displacement};
    rf_measure_rows(w, h, displace_rows, &d);
}

// What a spline is sampled at, and where to.
typedef struct Resample
{
    const float *spline, *offset;
    int w, h;
    float *out;
} Resample;

static void invert_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Resample *r = context;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < r->w; ++x)
        {
            RfVec2 p = {0, 0};
            // Contracts by the flow's gradient, mostly under 0.3: 20 steps reach 1e-8 pixel.
            for (int i = 0; i < 20; ++i)
            {
                float d[2];
                rf_spline_sample(r->spline, r->w, r->h, 2, 2, (float)x + p.x, (float)y + p.y, d);
                float change = fabsf(p.x + d[0]) + fabsf(p.y + d[1]);
                p = (RfVec2){-d[0], -d[1]};
                if (change < 1e-5f)
                    break;
            }
            float *out = r->out + 2 * ((size_t)y * (size_t)r->w + (size_t)x);
            out[0] = p.x;
            out[1] = p.y;
        }
}

static void warp_rows(void *context, int y0, int y1, int worker)
{
    (void)worker;
    const Resample *r = context;
    for (int y = y0; y < y1; ++y)
        for (int x = 0; x < r->w; ++x)
        {
            size_t k = (size_t)y * (size_t)r->w + (size_t)x;
            rf_spline_sample(r->spline, r->w, r->h, 1, 1, (float)x + r->offset[2 * k], (float)y + r->offset[2 * k + 1],
                             &r->out[k]);
        }
}

static RfResult resample(const float *in, const float *offset, int w, int h, int channels, RfRowsFn *rows, float *out)
{
    size_t count = (size_t)channels * (size_t)w * (size_t)h;
    float *spline = rf_allocate(count, sizeof(float));
    if (!spline)
        return RF_OUT_OF_MEMORY;
    memcpy(spline, in, count * sizeof(float));
    rf_spline_prefilter(spline, w, h, channels);
    Resample r = {spline, offset, w, h, out};
    rf_measure_rows(w, h, rows, &r);
    rf_release(spline);
    return RF_OK;
}

RfResult rf_measure_invert(const float *forward, int w, int h, float *backward)
{
    return resample(forward, NULL, w, h, 2, invert_rows, backward);
}

RfResult rf_measure_warp(const float *in, const float *offset, int w, int h, float *out)
{
    return resample(in, offset, w, h, 1, warp_rows, out);
}

// ---- filling -----------------------------------------------------------------------------------------------------

enum
{
    // 32768 halves to 1 in 15 steps.
    MAX_FILL_LEVELS = 17
};

typedef struct FillLevel
{
    int w, h;
    /// weight 0: nothing known below.
    float *value, *weight;
} FillLevel;

static size_t pixels_of(const FillLevel *level)
{
    return (size_t)level->w * (size_t)level->h;
}

// Coarse values are means over what is known.
static void push(const FillLevel *fine, FillLevel *coarse)
{
    for (int y = 0; y < coarse->h; ++y)
        for (int x = 0; x < coarse->w; ++x)
        {
            float sum = 0, weight = 0;
            for (int i = 0; i < 4; ++i)
            {
                int u = 2 * x + i % 2, v = 2 * y + i / 2;
                if (u >= fine->w || v >= fine->h)
                    continue;
                size_t k = (size_t)v * (size_t)fine->w + (size_t)u;
                sum += fine->weight[k] > 0 ? fine->weight[k] * fine->value[k] : 0;
                weight += fine->weight[k];
            }
            size_t k = (size_t)y * (size_t)coarse->w + (size_t)x;
            coarse->value[k] = weight > 0 ? sum / weight : 0;
            coarse->weight[k] = 0.25f * weight;
        }
}

// Unknown values become the coarse level's, bilinear.
static void pull(const FillLevel *coarse, FillLevel *fine)
{
    for (int y = 0; y < fine->h; ++y)
        for (int x = 0; x < fine->w; ++x)
        {
            size_t k = (size_t)y * (size_t)fine->w + (size_t)x;
            if (fine->weight[k] > 0)
                continue;
            int i = x / 2, j = y / 2, i2 = rf_clamp_int(i + (x % 2 ? 1 : -1), 0, coarse->w - 1);
            int j2 = rf_clamp_int(j + (y % 2 ? 1 : -1), 0, coarse->h - 1);
            const float *p = coarse->value;
            size_t row = (size_t)j * (size_t)coarse->w, row2 = (size_t)j2 * (size_t)coarse->w;
            fine->value[k] =
                (9 * p[row + (size_t)i] + 3 * p[row + (size_t)i2] + 3 * p[row2 + (size_t)i] + p[row2 + (size_t)i2]) *
                0.0625f;
        }
}

RfResult rf_measure_fill(const uint8_t *mask, int w, int h, float *grey)
{
    size_t unknown = 0, count = (size_t)w * (size_t)h;
    for (size_t k = 0; mask && k < count; ++k)
        unknown += !mask[k];
    if (unknown == 0)
        return RF_OK;
    RfArena arena = {0};
    FillLevel levels[MAX_FILL_LEVELS] = {{w, h, grey, rf_arena_push(&arena, count, sizeof(float))}};
    bool complete = levels[0].weight;
    for (size_t k = 0; complete && k < count; ++k)
        levels[0].weight[k] = mask[k] ? 1.0f : 0.0f;
    int top = 0;
    while (complete && (levels[top].w > 1 || levels[top].h > 1))
    {
        FillLevel *coarse = &levels[top + 1];
        *coarse = (FillLevel){(levels[top].w + 1) / 2, (levels[top].h + 1) / 2, NULL, NULL};
        coarse->value = rf_arena_push(&arena, pixels_of(coarse), sizeof(float));
        coarse->weight = rf_arena_push(&arena, pixels_of(coarse), sizeof(float));
        complete = coarse->value && coarse->weight;
        if (complete)
            push(&levels[top++], coarse);
    }
    if (complete && levels[top].weight[0] <= 0)
        levels[top].value[0] = 0;
    for (; complete && top > 0; --top)
        pull(&levels[top], &levels[top - 1]);
    rf_arena_free(&arena);
    return complete ? RF_OK : RF_OUT_OF_MEMORY;
}

// ---- which pixels count ------------------------------------------------------------------------------------------

// counted[k] = 1 where the square of side 2 * BORDER + 1 round pixel k lies in the frame and in the mask. The least of
// a square is the least of its columns' leasts: runs are counted along x, then along y.
static void inner_pixels(int w, int h, const uint8_t *mask, uint8_t *rows, uint8_t *inner)
{
    enum
    {
        BORDER = RF_MEASURE_BORDER
    };
    memset(rows, 0, (size_t)w * (size_t)h);
    memset(inner, 0, (size_t)w * (size_t)h);
    for (int y = 0; y < h; ++y)
        for (int x = 0, run = 0; x < w; ++x)
        {
            run = !mask || mask[(size_t)y * (size_t)w + (size_t)x] ? run + 1 : 0;
            if (run > 2 * BORDER)
                rows[(size_t)y * (size_t)w + (size_t)(x - BORDER)] = 1;
        }
    for (int x = 0; x < w; ++x)
        for (int y = 0, run = 0; y < h; ++y)
        {
            run = rows[(size_t)y * (size_t)w + (size_t)x] ? run + 1 : 0;
            if (run > 2 * BORDER)
                inner[(size_t)(y - BORDER) * (size_t)w + (size_t)x] = 1;
        }
}

RfResult rf_measure_counted(const RfFramePair *pair, const float *displacement, uint8_t *counted)
{
    int w = pair->w, h = pair->h;
    size_t count = (size_t)w * (size_t)h;
    uint8_t *rows = rf_allocate(count, 1), *ends = rf_allocate(count, 1);
    RfResult result = rows && ends ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
    {
        inner_pixels(w, h, pair->mask_a, rows, counted);
        inner_pixels(w, h, pair->mask_b, rows, ends);
    }
    for (size_t k = 0; result == RF_OK && k < count; ++k)
    {
        float x = (float)(k % (size_t)w) + displacement[2 * k], y = (float)(k / (size_t)w) + displacement[2 * k + 1];
        bool in_frame = x >= 0 && y >= 0 && x < (float)w - 0.5f && y < (float)h - 0.5f;
        counted[k] = counted[k] && in_frame && ends[(size_t)(y + 0.5f) * (size_t)w + (size_t)(x + 0.5f)];
    }
    rf_release(ends);
    rf_release(rows);
    return result;
}
