// SPDX-License-Identifier: Apache-2.0
#include "support/measures.h"

#include "core/maths.h"
#include "core/memory.h"
#include "data/flow_field.h"
#include "kernels/cubic_spline.h"

#include <assert.h>
#include <string.h>

enum
{
    BORDER = 8,
    BLOCK = 32,
    GREY_BINS = 256,
    L1_BINS = 64
};

static float *floats(size_t count)
{
    float *p = rf_allocate(count, sizeof(float));
    assert(p);
    return p;
}

static float luma_at(const RfImageView *frame, int x, int y)
{
    const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
    return 255 * (frame->channels < 3 ? p[0] : 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2]);
}

void measure_grey(const RfImageView *frame, float *grey)
{
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
            grey[(size_t)y * (size_t)frame->width + (size_t)x] = luma_at(frame, x, y);
}

// ---- displacements -----------------------------------------------------------------------------------------------

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

void measure_displacement(const RfFlowView *view, int w, int h, float *displacement)
{
    float sx = (float)view->width / (float)w, sy = (float)view->height / (float)h;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            RfVec2 start = {((float)x + 0.5f) * sx, ((float)y + 0.5f) * sy};
            RfVec2 end = advance(view, advance(view, start, view->time - 1, 0.5f), view->time - 0.5, 0.5f);
            float *out = displacement + 2 * ((size_t)y * (size_t)w + (size_t)x);
            out[0] = (end.x - start.x) / sx;
            out[1] = (end.y - start.y) / sy;
        }
}

void measure_invert(const float *forward, int w, int h, float *backward)
{
    size_t count = 2 * (size_t)w * (size_t)h;
    float *spline = floats(count);
    memcpy(spline, forward, count * sizeof(float));
    rf_spline_prefilter(spline, w, h, 2);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            RfVec2 p = {0, 0};
            // Contracts by the flow's gradient, mostly under 0.3: 20 steps reach 1e-8 pixel.
            for (int i = 0; i < 20; ++i)
            {
                float d[2], px = (float)x + p.x, py = (float)y + p.y;
                rf_spline_sample(spline, w, h, 2, 2, px, py, d);
                float change = fabsf(p.x + d[0]) + fabsf(p.y + d[1]);
                p = (RfVec2){-d[0], -d[1]};
                if (change < 1e-5f)
                    break;
            }
            float *out = backward + 2 * ((size_t)y * (size_t)w + (size_t)x);
            out[0] = p.x;
            out[1] = p.y;
        }
    rf_release(spline);
}

void measure_warp(const float *in, const float *offset, int w, int h, float *out)
{
    size_t count = (size_t)w * (size_t)h;
    float *spline = floats(count);
    memcpy(spline, in, count * sizeof(float));
    rf_spline_prefilter(spline, w, h, 1);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            rf_spline_sample(spline, w, h, 1, 1, (float)x + offset[2 * k], (float)y + offset[2 * k + 1], &out[k]);
        }
    rf_release(spline);
}

// ---- which pixels count ------------------------------------------------------------------------------------------

// counted[k] = 1 where the square of side 2 * BORDER + 1 round pixel k lies in the frame and in the fluid. The least of
// a square is the least of its columns' leasts: runs of fluid are counted along x, then along y.
static void inner_pixels(int w, int h, const uint8_t *mask, uint8_t *counted)
{
    uint8_t *rows = rf_allocate((size_t)w * (size_t)h, 1);
    assert(rows);
    for (int y = 0; y < h; ++y)
        for (int x = 0, run = 0; x < w + BORDER; ++x)
        {
            run = x < w && (!mask || mask[(size_t)y * (size_t)w + (size_t)x]) ? run + 1 : 0;
            if (x >= BORDER)
                rows[(size_t)y * (size_t)w + (size_t)(x - BORDER)] = run > 2 * BORDER;
        }
    for (int x = 0; x < w; ++x)
        for (int y = 0, run = 0; y < h + BORDER; ++y)
        {
            run = y < h && rows[(size_t)y * (size_t)w + (size_t)x] ? run + 1 : 0;
            if (y >= BORDER)
                counted[(size_t)(y - BORDER) * (size_t)w + (size_t)x] = run > 2 * BORDER;
        }
    rf_release(rows);
}

// Pixels that are inner ones, and whose other end is one too.
static uint8_t *counted_pixels(int w, int h, const uint8_t *mask, const float *displacement)
{
    size_t count = (size_t)w * (size_t)h;
    uint8_t *inner = rf_allocate(count, 1), *counted = rf_allocate(count, 1);
    assert(inner && counted);
    inner_pixels(w, h, mask, inner);
    for (size_t k = 0; k < count; ++k)
    {
        float x = (float)(k % (size_t)w) + displacement[2 * k], y = (float)(k / (size_t)w) + displacement[2 * k + 1];
        bool in_frame = x >= 0 && y >= 0 && x < (float)w - 0.5f && y < (float)h - 0.5f;
        counted[k] = inner[k] && in_frame && inner[(size_t)(y + 0.5f) * (size_t)w + (size_t)(x + 0.5f)];
    }
    rf_release(inner);
    return counted;
}

// ---- flow error --------------------------------------------------------------------------------------------------

typedef void FlowEstimator(const float *a, const float *b, int w, int h, float *flow);

// The frame, its true motion, the pixels that count, and who estimates.
typedef struct FlowJudge
{
    FlowEstimator *estimator;
    int w, h;
    const float *truth;
    const uint8_t *counted;
} FlowJudge;

static double end_point_error(const FlowJudge *judge, const float *a, const float *b, int64_t *pixels)
{
    const float *truth = judge->truth;
    size_t count = (size_t)judge->w * (size_t)judge->h;
    float *flow = floats(2 * count);
    judge->estimator(a, b, judge->w, judge->h, flow);
    double sum = 0;
    int64_t n = 0;
    for (size_t k = 0; k < count; ++k)
        if (judge->counted[k])
        {
            sum += hypot((double)(flow[2 * k] - truth[2 * k]), (double)(flow[2 * k + 1] - truth[2 * k + 1]));
            ++n;
        }
    rf_release(flow);
    *pixels = n;
    return n ? sum / (double)n : 0;
}

static void fill_by_mirroring(const float *exemplar, int exemplar_w, int exemplar_h, int w, int h, float *out)
{
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t row = (size_t)rf_mirror_int(y, exemplar_h), column = (size_t)rf_mirror_int(x, exemplar_w);
            out[(size_t)y * (size_t)w + (size_t)x] = exemplar[row * (size_t)exemplar_w + column];
        }
}

static MeasureFlowError flow_error(FlowEstimator *estimator, const float *a, const float *b, int w, int h,
                                   const float *displacement, const uint8_t *mask, const float *exemplar,
                                   int exemplar_w, int exemplar_h)
{
    size_t count = (size_t)w * (size_t)h;
    float *backward = floats(2 * count), *warped = floats(count), *filled = floats(count);
    uint8_t *counted = counted_pixels(w, h, mask, displacement);
    FlowJudge judge = {estimator, w, h, displacement, counted};
    MeasureFlowError result = {0};
    measure_invert(displacement, w, h, backward);
    result.error = end_point_error(&judge, a, b, &result.pixels);
    measure_warp(a, backward, w, h, warped);
    result.floor = end_point_error(&judge, a, warped, &result.pixels);
    result.ratio = result.floor > 0 ? result.error / result.floor : 0;
    if (exemplar)
    {
        fill_by_mirroring(exemplar, exemplar_w, exemplar_h, w, h, filled);
        measure_warp(filled, backward, w, h, warped);
        result.exemplar_floor = end_point_error(&judge, filled, warped, &result.pixels);
        result.exemplar_ratio = result.exemplar_floor > 0 ? result.error / result.exemplar_floor : 0;
    }
    rf_release(counted);
    rf_release(filled);
    rf_release(warped);
    rf_release(backward);
    return result;
}

MeasureFlowError measure_flow_error(const float *a, const float *b, int w, int h, const float *displacement,
                                    const uint8_t *mask, const float *exemplar, int exemplar_w, int exemplar_h)
{
    return flow_error(measure_optical_flow, a, b, w, h, displacement, mask, exemplar, exemplar_w, exemplar_h);
}

MeasureFlowError measure_inverse_search_error(const float *a, const float *b, int w, int h, const float *displacement,
                                              const uint8_t *mask, const float *exemplar, int exemplar_w,
                                              int exemplar_h)
{
    return flow_error(measure_inverse_search, a, b, w, h, displacement, mask, exemplar, exemplar_w, exemplar_h);
}

// ---- contrast ----------------------------------------------------------------------------------------------------

typedef struct Statistics
{
    double mean[5], deviation[5];
    double bins[GREY_BINS];
} Statistics;

// Channels 0 to 3, and luma as the fifth.
static void gather_statistics(const RfImageView *frame, const uint8_t *mask, Statistics *s)
{
    double sum[5] = {0}, squares[5] = {0}, n = 0;
    int channels = rf_min_int(frame->channels, 4);
    *s = (Statistics){0};
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
        {
            if (mask && !mask[(size_t)y * (size_t)frame->width + (size_t)x])
                continue;
            const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            double values[5] = {0, 0, 0, 0, (double)luma_at(frame, x, y)};
            for (int c = 0; c < channels; ++c)
                values[c] = 255 * (double)p[c];
            for (int c = 0; c < 5; ++c)
            {
                sum[c] += values[c];
                squares[c] += values[c] * values[c];
            }
            s->bins[rf_clamp_int((int)(values[4] + 0.5), 0, GREY_BINS - 1)] += 1;
            n += 1;
        }
    for (int c = 0; c < 5 && n > 0; ++c)
    {
        s->mean[c] = sum[c] / n;
        s->deviation[c] = sqrt(fmax(squares[c] / n - s->mean[c] * s->mean[c], 0));
    }
    for (int i = 0; i < GREY_BINS && n > 0; ++i)
        s->bins[i] /= n;
}

static double deviation_ratio(double frame, double exemplar)
{
    return exemplar > 1e-3 ? frame / exemplar : frame > 1e-3 ? HUGE_VAL : 1;
}

MeasureContrast measure_contrast(const RfImageView *frame, const uint8_t *mask, const RfImageView *exemplar)
{
    Statistics f, e;
    gather_statistics(frame, mask, &f);
    gather_statistics(exemplar, NULL, &e);
    MeasureContrast result = {.channels = rf_min_int(rf_min_int(frame->channels, exemplar->channels), 4)};
    for (int c = 0; c < result.channels; ++c)
        result.channel[c] = deviation_ratio(f.deviation[c], e.deviation[c]);
    result.luma = deviation_ratio(f.deviation[4], e.deviation[4]);
    result.brightness = f.mean[4] - e.mean[4];
    double carried = 0, bin = 0;
    for (int i = 0; i < GREY_BINS; ++i)
    {
        carried += f.bins[i] - e.bins[i];
        bin += f.bins[i] - e.bins[i];
        result.histogram_mover += fabs(carried);
        if ((i + 1) % (GREY_BINS / L1_BINS) == 0)
        {
            result.histogram_l1 += 0.5 * fabs(bin);
            bin = 0;
        }
    }
    return result;
}

// ---- flicker -----------------------------------------------------------------------------------------------------

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

typedef struct Difference
{
    double whole, block;
    int block_x, block_y;
} Difference;

// Rms difference over the counted pixels, and the largest of the blocks that overlap by half.
static Difference rms_difference(const float *a, const float *b, const uint8_t *counted, int w, int h)
{
    Difference result = {0};
    double total = 0, pixels = 0;
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
        if (counted[k])
        {
            total += (double)(a[k] - b[k]) * (double)(a[k] - b[k]);
            pixels += 1;
        }
    result.whole = pixels > 0 ? sqrt(total / pixels) : 0;
    for (int y0 = 0; y0 + BLOCK <= h; y0 += BLOCK / 2)
        for (int x0 = 0; x0 + BLOCK <= w; x0 += BLOCK / 2)
        {
            double sum = 0;
            int n = 0;
            for (int i = 0; i < BLOCK * BLOCK; ++i)
            {
                size_t k = (size_t)(y0 + i / BLOCK) * (size_t)w + (size_t)(x0 + i % BLOCK);
                if (!counted[k])
                    continue;
                sum += (double)(a[k] - b[k]) * (double)(a[k] - b[k]);
                ++n;
            }
            if (n >= BLOCK * BLOCK / 2 && sqrt(sum / n) > result.block)
                result = (Difference){result.whole, sqrt(sum / n), x0, y0};
        }
    return result;
}

MeasureFlicker measure_flicker(const float *a, const float *b, int w, int h, const float *displacement,
                               const uint8_t *mask)
{
    size_t count = (size_t)w * (size_t)h;
    float *backward = floats(2 * count), *carried = floats(count), *back = floats(count);
    measure_invert(displacement, w, h, backward);
    // Seen from frame n + 1, since that is where frames are compared.
    uint8_t *counted = counted_pixels(w, h, mask, backward);
    measure_warp(a, backward, w, h, carried);
    measure_warp(carried, displacement, w, h, back);
    double contrast = rms_contrast(b, counted, count);
    Difference step = rms_difference(b, carried, counted, w, h), floor = rms_difference(a, back, counted, w, h);
    rf_release(counted);
    rf_release(back);
    rf_release(carried);
    rf_release(backward);
    double scale = contrast > 1e-6 ? 1 / contrast : 0;
    return (MeasureFlicker){.whole = step.whole * scale,
                            .floor = floor.whole * scale,
                            .pop = step.block * scale,
                            .block_floor = floor.block * scale,
                            .pop_x = step.block_x,
                            .pop_y = step.block_y};
}

void measure_block_changes(const float *a, const float *b, int w, int h, const float *displacement, const uint8_t *mask,
                           int block, float *changes)
{
    size_t count = (size_t)w * (size_t)h;
    float *backward = floats(2 * count), *carried = floats(count);
    measure_invert(displacement, w, h, backward);
    uint8_t *counted = counted_pixels(w, h, mask, backward);
    measure_warp(a, backward, w, h, carried);
    int columns = w / block, rows = h / block;
    for (int k = 0; k < columns * rows; ++k)
    {
        double sum = 0;
        int n = 0;
        for (int i = 0; i < block * block; ++i)
        {
            size_t place =
                (size_t)(k / columns * block + i / block) * (size_t)w + (size_t)(k % columns * block + i % block);
            double difference = (double)(b[place] - carried[place]);
            sum += counted[place] ? difference * difference : 0;
            n += counted[place];
        }
        changes[k] = 2 * n >= block * block ? (float)sqrt(sum / n) : -1;
    }
    rf_release(counted);
    rf_release(carried);
    rf_release(backward);
}
