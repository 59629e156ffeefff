// SPDX-License-Identifier: Apache-2.0
// Saved states: a header, where every pixel's texture comes from, what it is blended with.
#include "core/memory.h"
#include "core/options.h"
#include "core/parallel.h"
#include "core/result.h"
#include "core/saved_state.h"
#include "methods/directional/directional.h"

#include <string.h>

enum
{
    STATE_VERSION = 1
};

static const char STATE_METHOD[] = "directional";

typedef struct StateHeader
{
    RfStateHead head;
    int32_t width, height;
    int64_t placed;
    double time;
    uint64_t laid, steps;
} StateHeader;

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfDirectionalOptions *options)
{
    int count;
    const RfOption *table = rf_directional_option_table(&count);
    return rf_options_hash(options, table, count, exemplar->hash);
}

static size_t rest_size(const RfExemplar *exemplar, int width, int height)
{
    size_t pixels = (size_t)width * (size_t)height;
    return pixels * sizeof(RfTexel) + pixels * (size_t)exemplar->channels * sizeof(float);
}

RfResult rf_directional_save(const RfDirectional *d, void **block, size_t *size)
{
    RF_REQUIRE(d && block && size, "rf_directional_save: directional, block or size is NULL");
    *block = NULL;
    StateHeader header;
    memset(&header, 0, sizeof header);
    header.placed = d->placed;
    header.width = d->width;
    header.height = d->height;
    header.time = d->time;
    header.laid = d->laid;
    header.steps = d->steps;
    size_t rest = d->placed ? rest_size(d->exemplar, d->width, d->height) : 0;
    size_t texels = (size_t)d->width * (size_t)d->height * sizeof *d->texels;
    uint8_t *bytes = rf_allocate(sizeof header + rest, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    if (d->placed)
    {
        memcpy(bytes + sizeof header, d->texels, texels);
        memcpy(bytes + sizeof header + texels, d->blended, rest - texels);
    }
    memcpy(bytes, &header, sizeof header);
    rf_state_seal(bytes, sizeof header + rest, STATE_METHOD, STATE_VERSION, inputs_hash(d->exemplar, &d->options));
    *block = bytes;
    *size = sizeof header + rest;
    return RF_OK;
}

static bool has_its_size(const StateHeader *h, const RfExemplar *exemplar, size_t size)
{
    bool sized = h->placed == 1 && h->width >= 8 && h->width <= RF_MAX_SIZE && h->height >= 8 &&
                 h->height <= RF_MAX_SIZE && isfinite(h->time);
    size_t rest = size - sizeof *h;
    return sized ? rest == rest_size(exemplar, h->width, h->height) : h->placed == 0 && !rest;
}

static bool is_sound(const RfDirectional *d, const RfTexel *t)
{
    return t->copy >= -1 && t->copy < d->options.rotations && fabsf(t->source.x) < 1e6f && fabsf(t->source.y) < 1e6f &&
           fabsf(t->rest.x) <= 1 && fabsf(t->rest.y) <= 1 && t->blends >= 0 && t->blends < 1e6f;
}

static void show_row(void *context, int y, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    for (ptrdiff_t i = (ptrdiff_t)y * d->width; i < (ptrdiff_t)(y + 1) * d->width; ++i)
        if (d->texels[i].copy >= 0)
            rf_directional_show(d, &d->texels[i], d->blended + i * d->exemplar->channels,
                                d->picture + i * d->exemplar->channels);
}

static RfResult restore(RfDirectional *d, const StateHeader *h, const uint8_t *rest, size_t size)
{
    RF_TRY(rf_directional_make_room(d, h->width, h->height));
    size_t pixels = (size_t)h->width * (size_t)h->height, texels = pixels * sizeof *d->texels;
    memcpy(d->texels, rest, texels);
    memcpy(d->blended, rest + texels, size - texels);
    bool sound = true;
    for (size_t i = 0; i < pixels; ++i)
        sound &= is_sound(d, &d->texels[i]);
    for (size_t i = 0; i < pixels * (size_t)d->exemplar->channels; ++i)
        sound &= isfinite(d->blended[i]) != 0;
    if (!sound)
        return rf_state_damaged();
    rf_parallel_for(h->height, show_row, d);
    d->time = h->time;
    d->laid = h->laid;
    d->steps = h->steps;
    d->placed = true;
    return RF_OK;
}

RfResult rf_directional_load(const RfExemplar *exemplar, const RfDirectionalOptions *options, const void *block,
                             size_t size, RfDirectional **out)
{
    RF_REQUIRE(block, "rf_directional_load: block is NULL");
    RF_TRY(rf_directional_create(exemplar, options, out));
    StateHeader header;
    RfResult result =
        rf_state_check(block, size, sizeof header, STATE_METHOD, STATE_VERSION, inputs_hash(exemplar, options));
    if (result == RF_OK)
    {
        memcpy(&header, block, sizeof header);
        result = has_its_size(&header, exemplar, size) ? RF_OK : rf_state_damaged();
    }
    if (result == RF_OK && header.placed)
        result = restore(*out, &header, (const uint8_t *)block + sizeof header, size - sizeof header);
    if (result != RF_OK)
    {
        rf_directional_destroy(*out);
        *out = NULL;
    }
    return result;
}
