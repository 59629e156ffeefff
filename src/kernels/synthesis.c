// SPDX-License-Identifier: Apache-2.0
#include "kernels/synthesis.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/result.h"

#include <string.h>

RfResult rf_synthesis_exemplar_create(float *pixels, int width, int height, int channels, bool tiles, float scale,
                                      int similar, const RfSynthesisExemplar *coarse, RfSynthesisExemplar *out)
{
    *out = (RfSynthesisExemplar){
        .width = width, .height = height, .channels = channels, .tiles = tiles, .pixels = pixels, .scale = scale};
    RF_TRY(rf_fixed_create(width, height, channels, RF_SYNTHESIS_APRON, &out->fixed));
    rf_fixed_set(&out->fixed, pixels, scale);
    rf_fixed_extend(&out->fixed, tiles);
    return rf_similar_create(&out->fixed, tiles, similar, coarse ? &coarse->similar : NULL, &out->similar);
}

void rf_synthesis_exemplar_free(RfSynthesisExemplar *exemplar)
{
    rf_release(exemplar->pixels);
    rf_fixed_free(&exemplar->fixed);
    rf_similar_free(&exemplar->similar);
    *exemplar = (RfSynthesisExemplar){0};
}

RfResult rf_synthesis_frame_create(int width, int height, int channels, bool tiles, RfSynthesisFrame *out)
{
    *out = (RfSynthesisFrame){.width = width, .height = height, .tiles = tiles};
    out->sources = rf_allocate_zero((size_t)width * (size_t)height, sizeof *out->sources);
    RfResult result =
        out->sources ? rf_fixed_create(width, height, channels, RF_SYNTHESIS_APRON, &out->picture) : RF_OUT_OF_MEMORY;
    if (result != RF_OK)
        rf_synthesis_frame_free(out);
    return result;
}

void rf_synthesis_frame_free(RfSynthesisFrame *frame)
{
    rf_release(frame->windows);
    rf_release(frame->stirred);
    rf_release(frame->sources);
    rf_fixed_free(&frame->picture);
    *frame = (RfSynthesisFrame){0};
}

RfResult rf_synthesis_cut(RfSynthesisFrame *frame, int spacing)
{
    rf_release(frame->windows);
    rf_release(frame->stirred);
    frame->spacing = spacing;
    frame->columns = (frame->width + spacing - 1) / spacing;
    frame->rows = (frame->height + spacing - 1) / spacing;
    size_t cells = (size_t)frame->columns * (size_t)frame->rows;
    frame->windows = rf_allocate_zero(cells, sizeof *frame->windows);
    frame->stirred = rf_allocate(cells, 1);
    if (!frame->windows || !frame->stirred)
        return RF_OUT_OF_MEMORY;
    memset(frame->stirred, 1, cells);
    return RF_OK;
}

void rf_synthesis_place(RfSynthesisFrame *frame, const RfVec2 *turns)
{
    for (int j = 0; j < frame->rows; ++j)
        for (int i = 0; i < frame->columns; ++i)
        {
            RfVec2 at = rf_synthesis_cell_middle(frame, i, j);
            size_t pixel = (size_t)at.y * (size_t)frame->width + (size_t)at.x;
            frame->windows[(ptrdiff_t)j * frame->columns + i] = (RfSynthesisWindow){
                .at = at,
                .source = frame->sources[pixel],
                .turn = turns ? turns[pixel] : (RfVec2){1, 0},
                .exists = true,
                .changed = true,
            };
        }
}

void rf_synthesis_scatter(RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int side, uint64_t seed)
{
    int margin = exemplar->tiles ? 0 : side / 2;
    uint32_t width = (uint32_t)(exemplar->width - 2 * margin), height = (uint32_t)(exemplar->height - 2 * margin);
    for (int i = 0; i < frame->columns * frame->rows; ++i)
        frame->windows[i].source = (RfVec2){(float)(margin + (int)rf_random_below(width, seed, 0, (uint64_t)i, 0)),
                                            (float)(margin + (int)rf_random_below(height, seed, 0, (uint64_t)i, 1))};
}

void rf_synthesis_refine(const RfSynthesisFrame *coarse, const RfVec2 *turns, RfSynthesisFrame *fine)
{
    for (int y = 0; y < fine->height; ++y)
        for (int x = 0; x < fine->width; ++x)
        {
            size_t from = (size_t)rf_min_int(y / 2, coarse->height - 1) * (size_t)coarse->width +
                          (size_t)rf_min_int(x / 2, coarse->width - 1);
            size_t pixel = (size_t)y * (size_t)fine->width + (size_t)x;
            // From the middle of the coarse pixel, which lies between four of the fine ones, in frame and exemplar.
            RfVec2 step = {(float)(x & 1) - 0.5f, (float)(y & 1) - 0.5f};
            RfVec2 middle = {2 * coarse->sources[from].x + 0.5f, 2 * coarse->sources[from].y + 0.5f};
            fine->sources[pixel] = rf_vec2_add(middle, turns ? rf_turn(turns[pixel], step) : step);
        }
}

typedef struct Show
{
    RfSynthesisFrame *frame;
    const RfSynthesisExemplar *exemplar;
    RfSynthesisHeld held;
    int channels;
} Show;

static void show_row(void *context, int y, int worker)
{
    (void)worker;
    const Show *s = context;
    const RfSynthesisExemplar *e = s->exemplar;
    for (int x = 0; x < s->frame->width; ++x)
    {
        RfVec2 *source = &s->frame->sources[(ptrdiff_t)y * s->frame->width + x];
        if (!e->tiles) // a level of odd size is not quite half the next one
            *source =
                (RfVec2){rf_clamp(source->x, 0, (float)(e->width - 1)), rf_clamp(source->y, 0, (float)(e->height - 1))};
        int16_t *pixel = rf_fixed_at(&s->frame->picture, x, y);
        memcpy(pixel, rf_synthesis_pixel(e, *source), (size_t)s->channels * sizeof *pixel);
        for (int c = 0; c < s->channels && s->held.hold; ++c)
            pixel[c] = (int16_t)lrintf(rf_synthesis_hold(&s->held, s->frame->width, x, y, c, pixel[c]));
    }
}

void rf_synthesis_show(RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int guides, RfSynthesisHeld held)
{
    Show show = {frame, exemplar, held, exemplar->channels - guides};
    rf_parallel_for(frame->height, show_row, &show);
    rf_fixed_extend(&frame->picture, frame->tiles);
}

static int margin_of(const RfSynthesisExemplar *exemplar, int side)
{
    return exemplar->tiles ? 0 : side / 2;
}

void rf_synthesis_settle_prices(const RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int side,
                                RfUsage *usage)
{
    for (int i = 0; i < frame->columns * frame->rows; ++i)
        if (frame->windows[i].exists)
            rf_usage_add(usage, exemplar->width, exemplar->height, margin_of(exemplar, side),
                         frame->windows[i].source.x, frame->windows[i].source.y);
    rf_usage_settle(usage);
}

void rf_synthesis_prices(const RfSynthesisExemplar *exemplar, int side, const RfUsage *usage, float scale,
                         float *prices)
{
    rf_usage_prices(usage, exemplar->width, exemplar->height, margin_of(exemplar, side), scale, prices);
}

void rf_synthesis_penalties(const RfSynthesisExemplar *exemplar, const RfWindowDatabase *windows, int side,
                            const float *prices, float unit, const float *variations, float part, float *penalties)
{
    for (int i = 0; i < rf_windows_count(windows); ++i)
    {
        RfWindowPlace place = rf_windows_place(windows, i);
        int x = place.x + side / 2, y = place.y + side / 2;
        if (exemplar->tiles)
            x = rf_wrap_int(x, exemplar->width), y = rf_wrap_int(y, exemplar->height);
        penalties[i] = prices ? unit * prices[(ptrdiff_t)y * exemplar->width + x] : 0;
        if (variations)
            penalties[i] -= part * variations[i];
    }
}
