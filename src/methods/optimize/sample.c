// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "methods/optimize/optimize.h"

#include <string.h>

// Catmull and Rom's cubic through four samples: at t = 0 the second one.
static void cubic_weights(float t, float w[4])
{
    w[0] = ((-0.5f * t + 1) * t - 0.5f) * t;
    w[1] = (1.5f * t - 2.5f) * t * t + 1;
    w[2] = ((-1.5f * t + 2) * t + 0.5f) * t;
    w[3] = (0.5f * t - 0.5f) * t * t;
}

// False: the pixels of the exemplar as they are.
static bool sample_all(const RfExemplar *e, RfVec2 source, float *values)
{
    int x = (int)floorf(source.x), y = (int)floorf(source.y);
    float u = source.x - (float)x, v = source.y - (float)y, wx[4], wy[4];
    if (u == 0 && v == 0)
    {
        const float *pixel = e->pixels + ((ptrdiff_t)rf_border_int(y, e->height, e->tiles) * e->width +
                                          rf_border_int(x, e->width, e->tiles)) *
                                             e->channels;
        memcpy(values, pixel, (size_t)e->channels * sizeof *values);
        return false;
    }
    cubic_weights(u, wx);
    cubic_weights(v, wy);
    // Offsets of the columns and rows, brought inside.
    ptrdiff_t columns[4], rows[4];
    for (int i = 0; i < 4; ++i)
    {
        columns[i] = (ptrdiff_t)rf_border_int(x + i - 1, e->width, e->tiles) * e->channels;
        rows[i] = (ptrdiff_t)rf_border_int(y + i - 1, e->height, e->tiles) * e->width * e->channels;
    }
    for (int c = 0; c < e->channels; ++c)
    {
        float sum = 0;
        for (int j = 0; j < 4; ++j)
        {
            const float *row = e->pixels + rows[j] + c;
            sum += wy[j] * (wx[0] * row[columns[0]] + wx[1] * row[columns[1]] + wx[2] * row[columns[2]] +
                            wx[3] * row[columns[3]]);
        }
        values[c] = sum;
    }
    return true;
}

static void take_mean(const RfSynthesisMaterial *m, const int16_t *mean, float *values)
{
    for (int c = 0; c < m->comparison.exemplar->channels; ++c)
        if (m->comparison.compared[c])
        {
            int k = m->comparison.compared[c] - 1;
            values[c] = (float)mean[k] / (m->levels[0].scale * m->comparison.factor[k]) + m->comparison.middle[k];
        }
}

// From the exemplar's frame to the picture's: the turn, without its scale, backwards.
static RfVec2 turn_direction(RfVec2 turn, RfVec2 v)
{
    float length = rf_vec2_length(turn);
    RfVec2 back = rf_turn_back((RfVec2){turn.x / length, turn.y / length}, v);
    return back;
}

static void turn_map(const RfMapView *map, RfVec2 turn, float *values)
{
    if (map->kind == RF_MAP_VECTOR)
    {
        RfVec2 v = turn_direction(turn, (RfVec2){values[0], values[1]});
        values[0] = v.x, values[1] = v.y;
    }
    else if (map->kind == RF_MAP_NORMAL) // stored as (n + 1) / 2, with y up
    {
        RfVec2 n = turn_direction(turn, (RfVec2){2 * values[0] - 1, 1 - 2 * values[1]});
        values[0] = 0.5f * n.x + 0.5f, values[1] = 0.5f - 0.5f * n.y;
    }
}

static void clamp_map(const RfMapView *map, float *values)
{
    // The cubic overshoots.
    if (map->kind == RF_MAP_COLOUR || map->kind == RF_MAP_ALPHA)
        for (int c = 0; c < map->image.channels; ++c)
            values[c] = rf_clamp(values[c], 0, 1);
}

int rf_optimize_channels(const RfExemplar *exemplar)
{
    int channels = 0;
    for (int i = 0; i < exemplar->map_count; ++i)
        if (strcmp(exemplar->maps[i].name, RF_GUIDE_MAP) != 0)
            channels += exemplar->maps[i].image.channels;
    return channels;
}

void rf_optimize_sample(const RfSynthesisMaterial *material, RfVec2 source, const RfVec2 *turn, const int16_t *mean,
                        float *values)
{
    const RfExemplar *e = material->comparison.exemplar;
    float all[RF_MAX_EXEMPLAR_CHANNELS];
    bool between = sample_all(e, source, all);
    if (mean)
        take_mean(material, mean, all);
    for (int i = 0; i < e->map_count; ++i)
    {
        const RfMapView *map = &e->maps[i];
        if (strcmp(map->name, RF_GUIDE_MAP) == 0)
            continue;
        float *part = all + e->first_channel[i];
        if (turn)
            turn_map(map, *turn, part);
        if (between)
            clamp_map(map, part);
        memcpy(values, part, (size_t)map->image.channels * sizeof *values);
        values += map->image.channels;
    }
}
