// SPDX-License-Identifier: Apache-2.0
#include "kernels/synthesis_material.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"
#include "kernels/pyramid.h"

#include <string.h>

enum
{
    SMALLEST_SIDE = 5,
    // Of the coarsest level, where there are at least three: it is halved from here on.
    COARSEST_SIDE = 33,
    LEAST_COARSEST_SIDE = 8
};

// Targets and guides may leave the exemplar's range by this much before they are clamped.
static const float RANGE_TO_SPARE = 1.2f;

static float *compared_pixels(const RfComparison *k)
{
    const RfExemplar *e = k->exemplar;
    size_t pixels = (size_t)e->width * (size_t)e->height;
    float *out = rf_allocate(pixels * (size_t)k->channels, sizeof *out);
    for (size_t i = 0; out && i < pixels; ++i)
        for (int c = 0; c < k->channels; ++c)
            out[i * (size_t)k->channels + (size_t)c] = rf_comparison_value(k, c, e->pixels + i * (size_t)e->channels);
    return out;
}

static int pick_levels(const RfExemplar *e, int asked)
{
    int side = rf_min_int(e->width, e->height), levels = 1;
    while (levels < RF_SYNTHESIS_LEVELS && (side + 1) / 2 >= LEAST_COARSEST_SIDE &&
           (asked ? levels < asked : levels < 3 || side >= COARSEST_SIDE))
    {
        side = (side + 1) / 2;
        ++levels;
    }
    return levels;
}

// From fine to coarse the pixels, from coarse to fine the lists of similar places.
static RfResult fill_levels(RfSynthesisMaterial *m, float scale, int similar)
{
    const RfExemplar *e = m->comparison.exemplar;
    int channels = m->comparison.channels;
    float *pixels[RF_SYNTHESIS_LEVELS] = {compared_pixels(&m->comparison)};
    int width[RF_SYNTHESIS_LEVELS] = {e->width}, height[RF_SYNTHESIS_LEVELS] = {e->height};
    RfResult result = pixels[0] ? RF_OK : RF_OUT_OF_MEMORY;
    for (int l = 1; l < m->level_count && result == RF_OK; ++l)
    {
        width[l] = (width[l - 1] + 1) / 2;
        height[l] = (height[l - 1] + 1) / 2;
        pixels[l] = rf_allocate((size_t)width[l] * (size_t)height[l] * (size_t)channels, sizeof *pixels[l]);
        if (pixels[l])
            rf_halve(pixels[l - 1], width[l - 1], height[l - 1], channels, e->tiles, pixels[l]);
        else
            result = RF_OUT_OF_MEMORY;
    }
    for (int l = m->level_count - 1; l >= 0; --l)
    {
        if (result == RF_OK)
            result = rf_synthesis_exemplar_create(pixels[l], width[l], height[l], channels, e->tiles, scale, similar,
                                                  l + 1 < m->level_count ? &m->levels[l + 1] : NULL, &m->levels[l]);
        else
            rf_release(pixels[l]);
    }
    return result;
}

RfResult rf_synthesis_material_create(const RfExemplar *exemplar, int levels, int similar, RfSynthesisMaterial *out)
{
    *out = (RfSynthesisMaterial){0};
    RF_TRY(rf_comparison_create(exemplar, &out->comparison));
    out->level_count = pick_levels(exemplar, levels);
    RfResult result = fill_levels(out, RF_FIXED_RANGE / RANGE_TO_SPARE / out->comparison.widest, similar);
    if (result != RF_OK)
        rf_synthesis_material_free(out);
    return result;
}

void rf_synthesis_material_free(RfSynthesisMaterial *material)
{
    for (int l = 0; l < RF_SYNTHESIS_LEVELS; ++l)
        rf_synthesis_exemplar_free(&material->levels[l]);
    *material = (RfSynthesisMaterial){0};
}

int rf_synthesis_side(const RfSynthesisMaterial *material, int level, int side, int width, int height)
{
    const RfSynthesisExemplar *e = &material->levels[level];
    int room = rf_min_int(width, height), exemplar_side = rf_min_int(e->width, e->height);
    room = rf_min_int(room, e->tiles ? exemplar_side : exemplar_side * 2 / 3);
    side = rf_min_int(side, room);
    side -= side % 2 == 0;
    return side < SMALLEST_SIDE ? 0 : side;
}
