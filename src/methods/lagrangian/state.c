// SPDX-License-Identifier: Apache-2.0
// A stepper as one relocatable block: header, grids, x, y, quality. Byte order and struct layout are those of the
// machine; the header tells.

#include "methods/lagrangian/lagrangian.h"

#include "core/hash.h"
#include "core/maths.h"
#include "core/options.h"
#include "core/result.h"
#include "core/saved_state.h"

enum
{
    VERSION = 4
};

static const char METHOD[] = "lagrangian";

typedef struct Header
{
    RfStateHead head;
    int32_t width, height, count, started;
    double time;
    uint64_t step;
    uint32_t next_id, padding;
} Header;

// The sprites' own particles are no one else's.
static uint64_t inputs_hash(const RfLagrangian *l)
{
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    uint64_t kind = (l->rigid ? 1u : 0u) + (l->turning ? 2u : 0u);
    return rf_options_hash(&l->options, table, count, rf_hash_bytes(&kind, sizeof kind, l->exemplar->hash));
}

static size_t vertex_bytes(const RfLagrangian *l)
{
    return (size_t)l->count * (size_t)(l->options.grid_vertices * l->options.grid_vertices) * sizeof(float);
}

RfResult rf_lagrangian_save(const RfLagrangian *l, void **block, size_t *size)
{
    RF_REQUIRE(l && block && size, "rf_lagrangian_save: lagrangian, block or size is NULL");
    size_t grids = (size_t)l->count * sizeof(Grid), vertices = vertex_bytes(l),
           total = sizeof(Header) + grids + 3 * vertices;
    uint8_t *bytes = rf_allocate_zero(total, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    const void *parts[] = {l->grids, l->x, l->y, l->quality};
    uint8_t *end = bytes + sizeof(Header);
    for (int i = 0; i < 4 && l->count > 0; ++i)
    {
        size_t part = i == 0 ? grids : vertices;
        memcpy(end, parts[i], part);
        end += part;
    }
    Header header = {.width = l->width,
                     .height = l->height,
                     .count = l->count,
                     .started = l->started,
                     .time = l->time,
                     .step = l->step,
                     .next_id = l->next_id};
    memcpy(bytes, &header, sizeof header);
    rf_state_seal(bytes, total, METHOD, VERSION, inputs_hash(l));
    *block = bytes;
    *size = total;
    return RF_OK;
}

static bool has_its_size(const Header *header, const RfLagrangian *l, size_t size)
{
    size_t vertices = (size_t)(l->options.grid_vertices * l->options.grid_vertices) * sizeof(float);
    // Before the first step there is no size yet.
    int least = header->started ? 1 : 0;
    return header->count >= 0 && header->width >= least && header->width <= RF_MAX_SIZE && header->height >= least &&
           header->height <= RF_MAX_SIZE && isfinite(header->time) &&
           size == sizeof(Header) + (size_t)header->count * (sizeof(Grid) + 3 * vertices);
}

static RfResult copy_content(RfLagrangian *l, const Header *header, const void *block)
{
    RF_TRY(rf_lagrangian_grids_reserve(l, header->count));
    l->width = header->width;
    l->height = header->height;
    l->count = header->count;
    l->started = header->started != 0;
    l->time = header->time;
    l->step = header->step;
    l->next_id = header->next_id;
    size_t vertices = vertex_bytes(l);
    void *parts[] = {l->grids, l->x, l->y, l->quality};
    const uint8_t *from = (const uint8_t *)block + sizeof(Header);
    for (int i = 0; i < 4 && l->count > 0; ++i)
    {
        size_t part = i == 0 ? (size_t)l->count * sizeof(Grid) : vertices;
        memcpy(parts[i], from, part);
        from += part;
    }
    for (int i = 0; i < l->count; ++i)
        if (l->grids[i].resemblance_count < 0 || l->grids[i].resemblance_count > MAX_RESEMBLANCES)
            return rf_state_damaged();
    return RF_OK;
}

RfResult rf_lagrangian_restore(RfLagrangian *l, const void *block, size_t size)
{
    Header header;
    RF_TRY(rf_state_check(block, size, sizeof header, METHOD, VERSION, inputs_hash(l)));
    memcpy(&header, block, sizeof header);
    if (!has_its_size(&header, l, size))
        return rf_state_damaged();
    return copy_content(l, &header, block);
}

RfResult rf_lagrangian_load(const RfExemplar *exemplar, const RfLagrangianOptions *options, const void *block,
                            size_t size, RfLagrangian **out)
{
    RF_REQUIRE(block && out, "rf_lagrangian_load: block or out is NULL");
    RF_TRY(rf_lagrangian_create(exemplar, options, out));
    RfResult result = rf_lagrangian_restore(*out, block, size);
    if (result != RF_OK)
    {
        rf_lagrangian_destroy(*out);
        *out = NULL;
    }
    return result;
}
