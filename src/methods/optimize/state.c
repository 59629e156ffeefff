// SPDX-License-Identifier: Apache-2.0
// Saved states of a moving texture: a header, the windows, the pixels' sources.
#include "core/hash.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/options.h"
#include "core/result.h"
#include "core/simd.h"
#include "methods/optimize/moving.h"

#include <string.h>

enum
{
    STATE_VERSION = 1,
    WINDOW_FLOATS = 8
};

typedef struct StateHeader
{
    char magic[8];
    uint32_t version, simd;
    /// Of exemplar and options; and of the whole block with this field 0.
    uint64_t inputs, content;
    int32_t width, height, side, placed;
    double time, mean, compared;
    uint64_t round;
    RfUsage usage;
} StateHeader;

static const char g_magic[8] = "rf-opti";

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfOptimizeOptions *options)
{
    int count;
    const RfOption *table = rf_optimize_option_table(&count);
    return rf_options_hash(options, table, count, exemplar->hash);
}

static uint64_t content_hash(StateHeader header, const void *rest, size_t size)
{
    header.content = 0;
    return rf_hash_bytes(rest, size, rf_hash_bytes(&header, sizeof header, 0));
}

static size_t rest_size(int width, int height, int spacing)
{
    size_t columns = (size_t)((width + spacing - 1) / spacing), rows = (size_t)((height + spacing - 1) / spacing);
    return columns * rows * WINDOW_FLOATS * sizeof(float) + (size_t)width * (size_t)height * sizeof(RfVec2);
}

static void write_windows(const RfSynthesisFrame *f, float *out)
{
    for (int i = 0; i < f->columns * f->rows; ++i, out += WINDOW_FLOATS)
    {
        const RfSynthesisWindow *w = &f->windows[i];
        float values[WINDOW_FLOATS] = {w->at.x,   w->at.y,   w->source.x, w->source.y,
                                       w->turn.x, w->turn.y, w->cost,     w->exists ? 1.0f : 0.0f};
        memcpy(out, values, sizeof values);
    }
}

static void read_windows(const float *in, RfSynthesisFrame *f)
{
    for (int i = 0; i < f->columns * f->rows; ++i, in += WINDOW_FLOATS)
        f->windows[i] = (RfSynthesisWindow){
            .at = {in[0], in[1]}, .source = {in[2], in[3]}, .turn = {in[4], in[5]}, .cost = in[6], .exists = in[7] > 0};
}

RfResult rf_optimize_save(const RfOptimize *o, void **block, size_t *size)
{
    RF_REQUIRE(o && block && size, "rf_optimize_save: optimize, block or size is NULL");
    *block = NULL;
    const RfSynthesisFrame *f = &o->start.frame;
    StateHeader header;
    memset(&header, 0, sizeof header);
    memcpy(header.magic, g_magic, sizeof header.magic);
    header.version = STATE_VERSION;
    header.simd = (uint32_t)rf_simd_level();
    header.inputs = inputs_hash(o->exemplar, &o->options);
    header.placed = o->placed;
    header.width = f->width;
    header.height = f->height;
    header.side = o->start.side;
    header.time = o->time;
    header.mean = o->energy.mean;
    header.compared = o->energy.compared;
    header.round = o->round;
    header.usage = o->start.usage;
    size_t rest = o->placed ? rest_size(f->width, f->height, f->spacing) : 0;
    uint8_t *bytes = rf_allocate(sizeof header + rest, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    if (rest)
    {
        size_t sources = (size_t)f->width * (size_t)f->height * sizeof(RfVec2);
        write_windows(f, (float *)(void *)(bytes + sizeof header));
        memcpy(bytes + sizeof header + rest - sources, f->sources, sources);
    }
    header.content = content_hash(header, bytes + sizeof header, rest);
    memcpy(bytes, &header, sizeof header);
    *block = bytes;
    *size = sizeof header + rest;
    return RF_OK;
}

static RfResult check_state(const StateHeader *h, uint64_t inputs, const void *block, size_t size)
{
    if (memcmp(h->magic, g_magic, sizeof g_magic) != 0)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "not a saved state of optimize");
    if (h->version != STATE_VERSION)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved by version %u of the format, this is %d: start again",
                       h->version, STATE_VERSION);
    if (h->simd != (uint32_t)rf_simd_level())
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved under another instruction set: set RF_SIMD as it was");
    if (h->inputs != inputs)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved with another exemplar or other options: start again");
    bool sized = h->placed == 1 && h->width >= 8 && h->width <= RF_MAX_SIZE && h->height >= 8 &&
                 h->height <= RF_MAX_SIZE && h->side >= 1 && h->side <= RF_FIXED_SIDE && isfinite(h->time);
    size_t rest = size - sizeof *h;
    bool whole = sized ? rest == rest_size(h->width, h->height, rf_max_int(h->side / 4, 1)) : h->placed == 0 && !rest;
    if (!whole || h->content != content_hash(*h, (const uint8_t *)block + sizeof *h, rest))
        return rf_fail(RF_BAD_INPUT, NULL, "saved state", "damaged: start again");
    return RF_OK;
}

static RfResult restore(RfOptimize *o, const StateHeader *h, const uint8_t *rest, size_t size)
{
    RfSynthesisFrame *f = &o->start.frame;
    RF_TRY(rf_synthesis_material_create(o->exemplar, o->options.levels, o->options.similar, &o->start.material));
    RF_TRY(rf_synthesis_frame_create(h->width, h->height, o->start.material.channels, o->options.tile, f));
    o->start.side = h->side;
    o->start.usage = h->usage;
    RF_TRY(rf_optimize_make_room(o));
    size_t sources = (size_t)f->width * (size_t)f->height * sizeof(RfVec2);
    float *windows = rf_allocate(size - sources, 1);
    if (!windows)
        return RF_OUT_OF_MEMORY;
    memcpy(windows, rest, size - sources);
    read_windows(windows, f);
    rf_release(windows);
    memcpy(f->sources, rest + size - sources, sources);
    o->time = h->time;
    o->energy = (RfSynthesisEnergy){h->mean, h->compared};
    o->round = h->round;
    o->placed = true;
    return RF_OK;
}

RfResult rf_optimize_load(const RfExemplar *exemplar, const RfOptimizeOptions *options, const void *block, size_t size,
                          RfOptimize **out)
{
    RF_REQUIRE(block, "rf_optimize_load: block is NULL");
    RF_TRY(rf_optimize_create(exemplar, options, out));
    StateHeader header;
    RfResult result = RF_OK;
    if (size < sizeof header)
        result = rf_fail(RF_BAD_INPUT, NULL, "header", "a saved state is at least %zu bytes, this is %zu",
                         sizeof header, size);
    else
    {
        memcpy(&header, block, sizeof header);
        result = check_state(&header, inputs_hash(exemplar, options), block, size);
    }
    if (result == RF_OK && header.placed)
        result = restore(*out, &header, (const uint8_t *)block + sizeof header, size - sizeof header);
    if (result != RF_OK)
    {
        rf_optimize_destroy(*out);
        *out = NULL;
    }
    return result;
}
