// SPDX-License-Identifier: Apache-2.0
#include "kernels/comparison.h"
#include "core/maths.h"
#include "core/result.h"

#include <string.h>

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
static void compare_channel(RfComparison *k, int first, int channel, float weight)
{
    float low, high;
    for (int i = first; i < k->channels; ++i)
        if (same_channel(k->exemplar, k->from[i], channel))
        {
            k->factor[i] = sqrtf(k->factor[i] * k->factor[i] + weight);
            k->compared[channel] = 1 + i;
            return;
        }
    range_of(k->exemplar, channel, &low, &high);
    k->from[k->channels] = channel;
    k->middle[k->channels] = 0.5f * low + 0.5f * high;
    k->factor[k->channels++] = sqrtf(weight);
    k->compared[channel] = k->channels;
}

static void compare_maps(RfComparison *k, bool guides)
{
    const RfExemplar *e = k->exemplar;
    int first = k->channels;
    for (int i = 0; i < e->map_count; ++i)
    {
        bool guide = strcmp(e->maps[i].name, RF_GUIDE_MAP) == 0;
        for (int c = 0; c < e->maps[i].image.channels && guide == guides; ++c)
            if (guides || e->maps[i].weight > 0) // every channel of a guide has its partner
                compare_channel(k, guides ? k->channels : first, e->first_channel[i] + c, e->maps[i].weight);
    }
    if (guides)
        k->guides = k->channels - first;
}

static void find_widest(RfComparison *k)
{
    float low, high;
    for (int i = 0; i < k->channels; ++i)
    {
        range_of(k->exemplar, k->from[i], &low, &high);
        k->widest = rf_max(k->widest, (high - low) * k->factor[i]);
    }
    // Squares of a scale that makes it a number of fixed point, and squared differences times it, stay finite where
    // nothing differs.
    k->widest = rf_max(k->widest, LEAST_RANGE);
}

RfResult rf_comparison_create(const RfExemplar *exemplar, RfComparison *out)
{
    *out = (RfComparison){.exemplar = exemplar};
    compare_maps(out, false);
    if (out->channels == 0)
        return rf_fail(RF_BAD_INPUT, NULL, NULL, "nothing to compare: all maps of the exemplar have weight 0");
    compare_maps(out, true);
    find_widest(out);
    return RF_OK;
}

RfResult rf_refuse_guide(const RfExemplar *exemplar)
{
    for (int i = 0; i < exemplar->map_count; ++i)
        if (strcmp(exemplar->maps[i].name, RF_GUIDE_MAP) == 0)
            return rf_fail(RF_BAD_INPUT, NULL, NULL, "a map named %s belongs to still textures: leave it out",
                           RF_GUIDE_MAP);
    return RF_OK;
}
