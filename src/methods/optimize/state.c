// SPDX-License-Identifier: Apache-2.0
// Saved states of a moving texture: a header, the markers of all pixels, those that fade.
#include "core/maths.h"
#include "core/memory.h"
#include "core/options.h"
#include "core/result.h"
#include "core/saved_state.h"
#include "methods/optimize/moving.h"

#include <string.h>

enum
{
    STATE_VERSION = 4
};

static const char STATE_METHOD[] = "optimize";

typedef struct StateHeader
{
    RfStateHead head;
    int32_t width, height, placed, fading;
    double time, distance;
} StateHeader;

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfOptimizeOptions *options)
{
    int count;
    const RfOption *table = rf_optimize_option_table(&count);
    return rf_options_hash(options, table, count, exemplar->hash);
}

/// A marker as it is saved. Those that fade are told by their pixel.
typedef struct Record
{
    RfVec2 at, source;
    RfBend bend;
    float share, continued;
    int32_t pixel;
} Record;

static size_t rest_size(int width, int height, int fading)
{
    return ((size_t)width * (size_t)height + (size_t)fading) * sizeof(Record);
}

static Record *write_markers(const RfMarkers *m, Record *out)
{
    for (int i = 0; i < m->width * m->height; ++i)
        if (m->pixels[i].share > 0)
        {
            const RfMarker *k = &m->pixels[i];
            *out++ = (Record){k->at, k->source, k->bend, k->share, k->continued, i};
        }
    return out;
}

static int count_markers(const RfMarkers *m)
{
    int count = 0;
    for (int i = 0; i < m->width * m->height; ++i)
        count += m->pixels[i].share > 0;
    return count;
}

RfResult rf_optimize_save(const RfOptimize *o, void **block, size_t *size)
{
    RF_REQUIRE(o && block && size, "rf_optimize_save: optimize, block or size is NULL");
    *block = NULL;
    StateHeader header;
    memset(&header, 0, sizeof header);
    header.placed = o->placed;
    header.width = o->markers.width;
    header.height = o->markers.height;
    header.fading = count_markers(&o->fading);
    header.time = o->time;
    header.distance = o->distance;
    size_t rest = o->placed ? rest_size(header.width, header.height, header.fading) : 0;
    uint8_t *bytes = rf_allocate(sizeof header + rest, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    if (o->placed)
        write_markers(&o->fading, write_markers(&o->markers, (Record *)(void *)(bytes + sizeof header)));
    memcpy(bytes, &header, sizeof header);
    rf_state_seal(bytes, sizeof header + rest, STATE_METHOD, STATE_VERSION, inputs_hash(o->exemplar, &o->options));
    *block = bytes;
    *size = sizeof header + rest;
    return RF_OK;
}

static bool has_its_size(const StateHeader *h, size_t size)
{
    bool sized = h->placed == 1 && h->width >= 8 && h->width <= RF_MAX_SIZE && h->height >= 8 &&
                 h->height <= RF_MAX_SIZE && h->fading >= 0 && h->fading <= h->width * h->height && isfinite(h->time) &&
                 h->distance >= 0 && h->distance < 1e20;
    size_t rest = size - sizeof *h;
    return sized ? rest == rest_size(h->width, h->height, h->fading) : h->placed == 0 && !rest;
}

static bool is_finite(RfVec2 v)
{
    return isfinite(v.x) && isfinite(v.y);
}

// Every pixel has a marker, in order; those that fade come after them. All lie in their pixel.
static bool is_sound(const RfOptimize *o, const Record *r, size_t number, size_t pixels)
{
    int width = o->markers.width;
    if (r->pixel < 0 || (size_t)r->pixel >= pixels || (number < pixels && (size_t)r->pixel != number))
        return false;
    bool near = fabsf(r->at.x - (float)(r->pixel % width)) <= 1 && fabsf(r->at.y - (float)(r->pixel / width)) <= 1;
    return near && is_finite(r->source) && is_finite(r->bend.x) && is_finite(r->bend.y) && r->share > 0 &&
           r->share <= 1 && r->continued >= 0 && r->continued <= RF_CONTINUED_MOST;
}

static RfResult restore(RfOptimize *o, const StateHeader *h, const uint8_t *rest, size_t size)
{
    RF_TRY(rf_synthesis_material_create(o->exemplar, o->options.levels, o->options.similar, &o->material));
    RF_TRY(rf_optimize_make_room(o, h->width, h->height));
    size_t pixels = (size_t)h->width * (size_t)h->height;
    for (size_t i = 0; i < size / sizeof(Record); ++i)
    {
        Record record;
        memcpy(&record, rest + i * sizeof record, sizeof record);
        RfMarkers *m = i < pixels ? &o->markers : &o->fading;
        if (!is_sound(o, &record, i, pixels))
            return rf_state_damaged();
        m->pixels[record.pixel] = (RfMarker){record.at, record.source, record.bend, record.share, record.continued};
    }
    o->time = h->time;
    o->distance = h->distance;
    o->placed = true;
    return RF_OK;
}

RfResult rf_optimize_load(const RfExemplar *exemplar, const RfOptimizeOptions *options, const void *block, size_t size,
                          RfOptimize **out)
{
    RF_REQUIRE(block, "rf_optimize_load: block is NULL");
    RF_TRY(rf_optimize_create(exemplar, options, out));
    StateHeader header;
    RfResult result =
        rf_state_check(block, size, sizeof header, STATE_METHOD, STATE_VERSION, inputs_hash(exemplar, options));
    if (result == RF_OK)
    {
        memcpy(&header, block, sizeof header);
        result = has_its_size(&header, size) ? RF_OK : rf_state_damaged();
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
