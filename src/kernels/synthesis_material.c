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
static const float LEAST_RANGE = 1e-15f;

static bool same_channel(const RfExemplar *e, int a, int b)
{
    const float *pixels = e->pixels;
    for (size_t i = 0, n = (size_t)e->width * (size_t)e->height; i < n; ++i, pixels += e->channels)
        if (pixels[a] != pixels[b])
            return false;
    return true;
}

static void range_of(const RfExemplar *e, int channel, float *low, float *high)
{
    const float *pixels = e->pixels + channel;
    *low = *high = *pixels;
    for (size_t i = 0, n = (size_t)e->width * (size_t)e->height; i < n; ++i, pixels += e->channels)
    {
        *low = rf_min(*low, *pixels);
        *high = rf_max(*high, *pixels);
    }
}

// A channel equal to one that is compared already adds its weight there.
static void compare_channel(RfSynthesisMaterial *m, int first, int channel, float weight)
{
    float low, high;
    for (int i = first; i < m->channels; ++i)
        if (same_channel(m->exemplar, m->from[i], channel))
        {
            m->factor[i] = sqrtf(m->factor[i] * m->factor[i] + weight);
            m->compared[channel] = 1 + i;
            return;
        }
    range_of(m->exemplar, channel, &low, &high);
    m->from[m->channels] = channel;
    m->middle[m->channels] = 0.5f * low + 0.5f * high;
    m->factor[m->channels++] = sqrtf(weight);
    m->compared[channel] = m->channels;
}

static void compare_maps(RfSynthesisMaterial *m, bool guides)
{
    const RfExemplar *e = m->exemplar;
    int first = m->channels;
    for (int i = 0; i < e->map_count; ++i)
    {
        bool guide = strcmp(e->maps[i].name, RF_GUIDE_MAP) == 0;
        for (int c = 0; c < e->maps[i].image.channels && guide == guides; ++c)
            if (guides || e->maps[i].weight > 0) // every channel of a guide has its partner
                compare_channel(m, guides ? m->channels : first, e->first_channel[i] + c, e->maps[i].weight);
    }
    if (guides)
        m->guides = m->channels - first;
}

static float scale_of(RfSynthesisMaterial *m)
{
    float low, high;
    for (int i = 0; i < m->channels; ++i)
    {
        range_of(m->exemplar, m->from[i], &low, &high);
        m->widest = rf_max(m->widest, (high - low) * m->factor[i]);
    }
    // Squares of the scale, and squared differences times it, stay finite where nothing differs.
    m->widest = rf_max(m->widest, LEAST_RANGE);
    return RF_FIXED_RANGE / RANGE_TO_SPARE / m->widest;
}

static float *compared_pixels(const RfSynthesisMaterial *m)
{
    const RfExemplar *e = m->exemplar;
    size_t pixels = (size_t)e->width * (size_t)e->height;
    float *out = rf_allocate(pixels * (size_t)m->channels, sizeof *out);
    for (size_t i = 0; out && i < pixels; ++i)
        for (int c = 0; c < m->channels; ++c)
            out[i * (size_t)m->channels + (size_t)c] =
                (e->pixels[i * (size_t)e->channels + (size_t)m->from[c]] - m->middle[c]) * m->factor[c];
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
    float *pixels[RF_SYNTHESIS_LEVELS] = {compared_pixels(m)};
    int width[RF_SYNTHESIS_LEVELS] = {m->exemplar->width}, height[RF_SYNTHESIS_LEVELS] = {m->exemplar->height};
    RfResult result = pixels[0] ? RF_OK : RF_OUT_OF_MEMORY;
    for (int l = 1; l < m->level_count && result == RF_OK; ++l)
    {
        width[l] = (width[l - 1] + 1) / 2;
        height[l] = (height[l - 1] + 1) / 2;
        pixels[l] = rf_allocate((size_t)width[l] * (size_t)height[l] * (size_t)m->channels, sizeof *pixels[l]);
        if (pixels[l])
            rf_halve(pixels[l - 1], width[l - 1], height[l - 1], m->channels, m->exemplar->tiles, pixels[l]);
        else
            result = RF_OUT_OF_MEMORY;
    }
    for (int l = m->level_count - 1; l >= 0; --l)
    {
        if (result == RF_OK)
            result =
                rf_synthesis_exemplar_create(pixels[l], width[l], height[l], m->channels, m->exemplar->tiles, scale,
                                             similar, l + 1 < m->level_count ? &m->levels[l + 1] : NULL, &m->levels[l]);
        else
            rf_release(pixels[l]);
    }
    return result;
}

RfResult rf_synthesis_material_create(const RfExemplar *exemplar, int levels, int similar, RfSynthesisMaterial *out)
{
    *out = (RfSynthesisMaterial){.exemplar = exemplar};
    compare_maps(out, false);
    if (out->channels == 0)
        return rf_fail(RF_BAD_INPUT, NULL, NULL, "nothing to compare: all maps of the exemplar have weight 0");
    compare_maps(out, true);
    out->level_count = pick_levels(exemplar, levels);
    RfResult result = fill_levels(out, scale_of(out), similar);
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
