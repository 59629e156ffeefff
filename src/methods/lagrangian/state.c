// SPDX-License-Identifier: Apache-2.0
// A stepper as one relocatable block: header, grids, x, y, quality. Byte order and struct layout are those of the
// machine; the header tells.

#include "methods/lagrangian/lagrangian.h"

#include "core/hash.h"
#include "core/maths.h"
#include "core/options.h"
#include "core/result.h"
#include "core/simd.h"

enum
{
    VERSION = 3
};

static const char magic[8] = "RFLAGRAN";

typedef struct Header
{
    char magic[8];
    uint32_t version, header_size, grid_size, simd;
    /// Of the header, with this as 0, and of everything behind it.
    uint64_t content_hash;
    uint64_t exemplar_hash, options_hash;
    int32_t width, height, count, started;
    double time;
    uint64_t step;
    uint32_t next_id, padding;
} Header;

static uint64_t hash_options(const RfLagrangian *l)
{
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    return rf_options_hash(&l->options, table, count, VERSION + (l->rigid ? 256 : 0) + (l->turning ? 512 : 0));
}

static uint64_t hash_content(Header header, const uint8_t *content, size_t size)
{
    header.content_hash = 0;
    return rf_hash_bytes(content, size, rf_hash_bytes(&header, sizeof header, VERSION));
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
    Header header = {.version = VERSION,
                     .header_size = sizeof(Header),
                     .grid_size = sizeof(Grid),
                     .simd = (uint32_t)rf_simd_level(),
                     .exemplar_hash = l->exemplar->hash,
                     .options_hash = hash_options(l),
                     .width = l->width,
                     .height = l->height,
                     .count = l->count,
                     .started = l->started,
                     .time = l->time,
                     .step = l->step,
                     .next_id = l->next_id};
    memcpy(header.magic, magic, sizeof magic);
    header.content_hash = hash_content(header, bytes + sizeof header, total - sizeof header);
    memcpy(bytes, &header, sizeof header);
    *block = bytes;
    *size = total;
    return RF_OK;
}

static RfResult check_header(const Header *header, const RfLagrangian *l, const void *block, size_t size)
{
    if (memcmp(header->magic, magic, sizeof magic) != 0 || header->version != VERSION ||
        header->header_size != sizeof(Header) || header->grid_size != sizeof(Grid))
        return rf_fail(RF_BAD_INPUT, NULL, "header", "not a saved state of this version: start again without it");
    if (header->simd != (uint32_t)rf_simd_level())
        return rf_fail(RF_BAD_INPUT, NULL, "header",
                       "saved with another instruction set than %s: set RF_SIMD to it, or start again", rf_simd_name());
    if (header->exemplar_hash != l->exemplar->hash || header->options_hash != hash_options(l))
        return rf_fail(RF_BAD_INPUT, NULL, "header",
                       "saved with another exemplar or other options: start again without it");
    size_t vertices = (size_t)(l->options.grid_vertices * l->options.grid_vertices) * sizeof(float);
    // Before the first step there is no size yet.
    int least = header->started ? 1 : 0;
    bool sizes_fit = header->count >= 0 && header->width >= least && header->width <= RF_MAX_SIZE &&
                     header->height >= least && header->height <= RF_MAX_SIZE && isfinite(header->time) &&
                     size == sizeof(Header) + (size_t)header->count * (sizeof(Grid) + 3 * vertices);
    if (!sizes_fit ||
        header->content_hash != hash_content(*header, (const uint8_t *)block + sizeof(Header), size - sizeof(Header)))
        return rf_fail(RF_BAD_INPUT, NULL, "content", "the saved state is damaged: start again without it");
    return RF_OK;
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
            return rf_fail(RF_BAD_INPUT, NULL, "content", "the saved state is damaged: start again without it");
    return RF_OK;
}

RfResult rf_lagrangian_restore(RfLagrangian *l, const void *block, size_t size)
{
    Header header;
    if (size < sizeof header)
        return rf_fail(RF_BAD_INPUT, NULL, "header",
                       "the saved state ends inside its header (%zu of %zu bytes): start again without it", size,
                       sizeof header);
    memcpy(&header, block, sizeof header);
    RF_TRY(check_header(&header, l, block, size));
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
