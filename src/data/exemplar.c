// SPDX-License-Identifier: Apache-2.0
#include "data/exemplar.h"
#include "core/hash.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <ctype.h>
#include <stdio.h>

enum
{
    MIN_SIDE = 8
};

static RfResult check_map(const RfMapView *map, const RfImageView *first)
{
    const RfImageView *image = &map->image;
    RF_REQUIRE(map->name && map->name[0] && strlen(map->name) < 32,
               "exemplar: a map's name must have 1 to 31 characters");
    for (const char *c = map->name; *c; ++c)
        RF_REQUIRE(isalnum((unsigned char)*c) || *c == '_', "exemplar: map name %s: letters, digits and _ only",
                   map->name);
    RF_REQUIRE(image->pixels, "exemplar: map %s has no pixels", map->name);
    if (image->width < MIN_SIDE || image->height < MIN_SIDE || image->width > RF_MAX_SIZE ||
        image->height > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, NULL, map->name, "an exemplar of %d x %d pixels: each side must be %d to %d",
                       image->width, image->height, MIN_SIDE, RF_MAX_SIZE);
    if (image->width != first->width || image->height != first->height)
        return rf_fail(RF_BAD_INPUT, NULL, map->name,
                       "this map is %d x %d pixels, the first one %d x %d: all maps need one size", image->width,
                       image->height, first->width, first->height);
    RF_REQUIRE(map->weight >= 0 && map->weight < 1e6f, "exemplar: weight %g of map %s: must be 0 to 1e6",
               (double)map->weight, map->name);
    static const char *const names[] = {"colour", "data", "alpha", "normal", "vector"};
    bool fits = map->kind == RF_MAP_COLOUR   ? image->channels == 1 || image->channels == 3
                : map->kind == RF_MAP_ALPHA  ? image->channels == 1
                : map->kind == RF_MAP_NORMAL ? image->channels == 3
                : map->kind == RF_MAP_VECTOR ? image->channels == 2
                                             : image->channels >= 1;
    RF_REQUIRE((unsigned)map->kind <= RF_MAP_VECTOR, "exemplar: map %s has no known kind", map->name);
    if (!fits)
        return rf_fail(RF_BAD_INPUT, NULL, map->name, "a %s map cannot have %d channels", names[map->kind],
                       image->channels);
    return RF_OK;
}

static RfResult copy_map(RfExemplar *exemplar, int index)
{
    RfImageView image = exemplar->maps[index].image;
    int first = exemplar->first_channel[index];
    for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
            for (int c = 0; c < image.channels; ++c)
            {
                float value = image.pixels[y * image.row_stride + (ptrdiff_t)x * image.channels + c];
                // Squares must stay finite.
                if (!(fabsf(value) < 1e15f))
                    return rf_fail(RF_BAD_INPUT, NULL, exemplar->maps[index].name,
                                   "pixel %d, %d, channel %d is %g: only finite values under 1e15 can be blended", x, y,
                                   c, (double)value);
                exemplar->pixels[((size_t)y * (size_t)exemplar->width + (size_t)x) * (size_t)exemplar->channels +
                                 (size_t)(first + c)] = value;
            }
    return RF_OK;
}

// Mean squared second difference along x (or y), over the border or over the whole inside. A border that continues has
// about the inside's value.
static double roughness(const RfExemplar *exemplar, bool along_x, bool border)
{
    int length = along_x ? exemplar->width : exemplar->height, lines = along_x ? exemplar->height : exemplar->width;
    size_t step = (along_x ? 1u : (size_t)exemplar->width) * (size_t)exemplar->channels;
    size_t line_step = (along_x ? (size_t)exemplar->width : 1u) * (size_t)exemplar->channels;
    int channels = rf_min_int(exemplar->channels, 3);
    double sum = 0;
    int64_t count = 0;
    for (int line = 0; line < lines; ++line)
        for (int i = border ? length - 1 : 1; i < (border ? length + 1 : length - 1); ++i)
            for (int c = 0; c < channels; ++c)
            {
                const float *base = exemplar->pixels + (size_t)line * line_step + (size_t)c;
                double d = base[(size_t)((i - 1) % length) * step] - 2.0 * base[(size_t)(i % length) * step] +
                           base[(size_t)((i + 1) % length) * step];
                sum += d * d;
                ++count;
            }
    return sum / (double)count;
}

float rf_exemplar_border_roughness(const RfExemplar *exemplar)
{
    // Keeps constant exemplars, whose differences are rounding, at 1.
    const double noise = 1e-10;
    double across = (roughness(exemplar, true, true) + noise) / (roughness(exemplar, true, false) + noise);
    double down = (roughness(exemplar, false, true) + noise) / (roughness(exemplar, false, false) + noise);
    return (float)fmax(across, down);
}

static bool looks_tileable(const RfExemplar *exemplar)
{
    // A border as rough as half again the inside still reads as continuous.
    return rf_exemplar_border_roughness(exemplar) <= 1.5f;
}

RfResult rf_exemplar_create(const RfMapView *maps, int map_count, RfTiling tiling, RfExemplar **out)
{
    RF_REQUIRE(out && maps, "rf_exemplar_create: maps or out is NULL");
    *out = NULL;
    RF_REQUIRE(map_count >= 1 && map_count <= RF_MAX_MAPS, "exemplar: %d maps: must be 1 to %d", map_count,
               RF_MAX_MAPS);
    int channels = 0;
    for (int i = 0; i < map_count; ++i)
    {
        RF_TRY(check_map(&maps[i], &maps[0].image));
        channels += maps[i].image.channels;
        for (int j = 0; j < i; ++j)
            RF_REQUIRE(strcmp(maps[i].name, maps[j].name) != 0, "exemplar: two maps are called %s", maps[i].name);
    }
    RF_REQUIRE(channels <= RF_MAX_EXEMPLAR_CHANNELS, "exemplar: %d channels over all maps: at most %d", channels,
               RF_MAX_EXEMPLAR_CHANNELS);

    RfExemplar *exemplar = rf_allocate_zero(1, sizeof *exemplar);
    if (!exemplar)
        return RF_OUT_OF_MEMORY;
    exemplar->width = maps[0].image.width;
    exemplar->height = maps[0].image.height;
    exemplar->channels = channels;
    exemplar->map_count = map_count;
    exemplar->pixels =
        rf_allocate((size_t)exemplar->width * (size_t)exemplar->height, (size_t)channels * sizeof(float));
    RfResult result = exemplar->pixels ? RF_OK : RF_OUT_OF_MEMORY;
    int first = 0;
    for (int i = 0; i < map_count && result == RF_OK; ++i)
    {
        snprintf(exemplar->names[i], sizeof exemplar->names[i], "%s", maps[i].name);
        exemplar->maps[i] = maps[i];
        exemplar->maps[i].name = exemplar->names[i];
        exemplar->first_channel[i] = first;
        result = copy_map(exemplar, i);
        exemplar->maps[i].image.pixels = exemplar->pixels + first;
        exemplar->maps[i].image.row_stride = (ptrdiff_t)exemplar->width * channels;
        first += maps[i].image.channels;
    }
    if (result != RF_OK)
    {
        rf_exemplar_destroy(exemplar);
        return result;
    }
    exemplar->tiles = tiling == RF_TILING_YES || (tiling == RF_TILING_AUTO && looks_tileable(exemplar));
    exemplar->hash = rf_hash_bytes(
        exemplar->pixels, (size_t)exemplar->width * (size_t)exemplar->height * (size_t)channels * sizeof(float),
        (uint64_t)exemplar->width << 32 | (uint64_t)channels << 1 | exemplar->tiles);
    for (int i = 0; i < map_count; ++i)
        exemplar->hash = rf_hash64(exemplar->hash ^ (uint64_t)maps[i].kind ^ (uint64_t)maps[i].image.channels << 8 ^
                                   rf_hash_bytes(&maps[i].weight, sizeof maps[i].weight, (uint64_t)i));
    *out = exemplar;
    return RF_OK;
}

void rf_exemplar_destroy(RfExemplar *exemplar)
{
    if (!exemplar)
        return;
    rf_release(exemplar->pixels);
    rf_release(exemplar);
}

int rf_exemplar_width(const RfExemplar *exemplar)
{
    return exemplar->width;
}

int rf_exemplar_height(const RfExemplar *exemplar)
{
    return exemplar->height;
}

int rf_exemplar_channels(const RfExemplar *exemplar)
{
    return exemplar->channels;
}

bool rf_exemplar_tiles(const RfExemplar *exemplar)
{
    return exemplar->tiles;
}

int rf_exemplar_map_count(const RfExemplar *exemplar)
{
    return exemplar->map_count;
}

RfMapView rf_exemplar_map(const RfExemplar *exemplar, int index, int *first_channel)
{
    assert(index >= 0 && index < exemplar->map_count);
    if (first_channel)
        *first_channel = exemplar->first_channel[index];
    return exemplar->maps[index];
}
