// SPDX-License-Identifier: Apache-2.0
// Packs an exemplar's channels into the texture's lanes. Colour, data and alpha fill quads one after the other; a
// direction map has a quad of its own, since it is turned.

#include "core/maths.h"
#include "core/result.h"
#include "methods/lagrangian/lagrangian.h"

#include <string.h>

static bool is_direction(RfMapKind kind)
{
    return kind == RF_MAP_NORMAL || kind == RF_MAP_VECTOR;
}

static void assign_lanes(const RfExemplar *exemplar, Material *m)
{
    int next = 0;
    for (int pass = 0; pass < 2; ++pass)
        for (int i = 0; i < exemplar->map_count; ++i)
        {
            RfMapKind kind = exemplar->maps[i].kind;
            if (is_direction(kind) != (pass == 1))
                continue;
            if (pass == 1)
            {
                next = (next + 3) / 4 * 4;
                m->turned[next / 4] = kind == RF_MAP_NORMAL ? 1 : 2;
            }
            for (int c = 0; c < exemplar->maps[i].image.channels; ++c)
                m->lane_of_channel[exemplar->first_channel[i] + c] = next++;
        }
    m->lane_count = (next + 3) / 4 * 4;
    assert(m->lane_count <= MAX_LANES);
}

// Copies the maps into lanes; normals become -1 to 1.
static void copy_lanes(const RfExemplar *exemplar, const Material *m, float *lanes)
{
    size_t pixels = (size_t)exemplar->width * (size_t)exemplar->height;
    for (int i = 0; i < exemplar->map_count; ++i)
        for (int c = 0; c < exemplar->maps[i].image.channels; ++c)
        {
            int channel = exemplar->first_channel[i] + c, lane = m->lane_of_channel[channel];
            bool normal = exemplar->maps[i].kind == RF_MAP_NORMAL;
            for (size_t p = 0; p < pixels; ++p)
            {
                float value = exemplar->pixels[p * (size_t)exemplar->channels + (size_t)channel];
                lanes[p * (size_t)m->lane_count + (size_t)lane] = normal ? 2 * value - 1 : value;
            }
        }
}

static void measure_lane(const float *lanes, size_t pixels, int lane, Material *m)
{
    double sum = 0;
    float low = INFINITY, high = -INFINITY;
    for (size_t p = 0; p < pixels; ++p)
    {
        float value = lanes[p * (size_t)m->lane_count + (size_t)lane];
        sum += (double)value;
        low = fminf(low, value);
        high = fmaxf(high, value);
    }
    m->mean[lane] = (float)(sum / (double)pixels);
    m->low[lane] = low;
    m->high[lane] = high;
    // A constant stays exactly itself.
    if (low == high)
        m->mean[lane] = low;
}

static RfResult prepare_map(const RfExemplar *exemplar, int index, float *lanes, Material *m)
{
    const RfMapView *map = &exemplar->maps[index];
    size_t pixels = (size_t)exemplar->width * (size_t)exemplar->height;
    int first = m->lane_of_channel[exemplar->first_channel[index]], channels = map->image.channels;
    for (int c = 0; c < channels; ++c)
    {
        measure_lane(lanes, pixels, first + c, m);
        m->match_weight[first + c] = map->weight;
        m->plain[first + c] = map->kind == RF_MAP_ALPHA;
        if (is_direction(map->kind))
            m->mean[first + c] = 0;
    }
    bool gaussian = m->blend == RF_BLEND_HISTOGRAM &&
                    (map->kind == RF_MAP_COLOUR || (map->kind == RF_MAP_DATA && channels <= RF_HISTOGRAM_CHANNELS));
    if (gaussian)
    {
        RF_TRY(rf_histogram_create(lanes + first, pixels, (size_t)m->lane_count, channels, &m->histograms[index]));
        for (int c = 0; c < channels; ++c)
        {
            m->match_weight[first + c] *= m->histograms[index].variance[c];
            m->mean[first + c] = 0;
            m->low[first + c] = -INFINITY;
            m->high[first + c] = INFINITY;
        }
    }
    for (size_t p = 0; p < pixels; ++p)
        for (int c = 0; c < channels; ++c)
            lanes[p * (size_t)m->lane_count + (size_t)(first + c)] -= m->mean[first + c];
    return RF_OK;
}

RfResult rf_lagrangian_material_create(const RfExemplar *exemplar, RfBlend blend, Material *out)
{
    *out = (Material){.blend = blend};
    assign_lanes(exemplar, out);
    float *lanes =
        rf_allocate_zero((size_t)exemplar->width * (size_t)exemplar->height, (size_t)out->lane_count * sizeof *lanes);
    if (!lanes)
        return RF_OUT_OF_MEMORY;
    copy_lanes(exemplar, out, lanes);
    RfResult result = RF_OK;
    for (int i = 0; i < exemplar->map_count && result == RF_OK; ++i)
        result = prepare_map(exemplar, i, lanes, out);
    if (result == RF_OK)
        result = rf_texture_create(lanes, exemplar->width, exemplar->height, out->lane_count / 4, exemplar->tiles,
                                   &out->texture);
    rf_release(lanes);
    if (result != RF_OK)
    {
        rf_lagrangian_material_free(out);
        return result;
    }
    for (int level = 0; level < out->texture.level_count; ++level)
        for (int lane = 0; lane < out->lane_count; ++lane)
            out->variance[level][lane] = (float)rf_texture_variance(&out->texture, level, lane);
    for (int i = 0; i < exemplar->map_count; ++i)
        if (out->histograms[i].channels > 0)
            rf_histogram_fit_levels(&out->histograms[i], &out->texture,
                                    &out->lane_of_channel[exemplar->first_channel[i]]);
    return RF_OK;
}

void rf_lagrangian_material_free(Material *material)
{
    rf_texture_free(&material->texture);
    for (int i = 0; i < RF_MAX_MAPS; ++i)
        rf_histogram_free(&material->histograms[i]);
}
