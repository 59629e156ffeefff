// SPDX-License-Identifier: Apache-2.0
// Heckbert. Fundamentals of texture mapping and image warping. 1989.
//
// Where the map compresses, up to 16 samples are averaged along the axis that is compressed most; what the other axis
// is compressed by picks the texture's level. Stretched textures are interpolated bilinearly on the oversampled level
// (kernels/texture.c).
#include "kernels/sampler.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <string.h>

enum
{
    MAX_TAPS = 16
};

// The footprint of a pixel in the exemplar: `taps` samples along `axis`, from a level that holds the rest.
typedef struct Footprint
{
    int taps, level;
    RfVec2 axis;
} Footprint;

static Footprint footprint(const RfTexture *texture, RfJacobian j)
{
    // Singular values from J J^T = [a b; b c]; the larger one's direction is the footprint's long axis.
    float a = j.xx * j.xx + j.xy * j.xy, b = j.xx * j.yx + j.xy * j.yy, c = j.yx * j.yx + j.yy * j.yy;
    float mean = 0.5f * (a + c), spread = sqrtf(0.25f * (a - c) * (a - c) + b * b);
    float longest = sqrtf(mean + spread), shortest = sqrtf(fmaxf(mean - spread, 0));
    Footprint print = {0};
    // One sample reaches 1.2 pixels before anything is seen to alias.
    float across = fmaxf(fmaxf(shortest, longest / MAX_TAPS), 1);
    print.taps = (int)ceilf(rf_clamp(longest / across - 0.2f, 1, MAX_TAPS));
    if (across > 1)
        print.level = (int)rf_clamp(log2f(across) + 0.5f, 0, (float)(texture->level_count - 1));
    if (print.taps > 1)
    {
        float angle = 0.5f * atan2f(2 * b, a - c);
        print.axis = (RfVec2){longest * cosf(angle), longest * sinf(angle)};
    }
    return print;
}

// A coordinate along one axis brought into 0..size: wrapped, or mirrored with the sign of its slope in *sign.
static float fold(float u, int size, bool tiles, float *sign)
{
    float period = (float)(tiles ? size : 2 * size);
    u -= period * floorf(u / period);
    *sign = 1;
    if (!tiles && u > (float)size)
    {
        u = period - u;
        *sign = -1;
    }
    return u;
}

// Texel and fraction of a folded coordinate.
static int texel(float u, float scale, int size, bool tiles, float *fraction)
{
    float t = (u - 0.5f) * scale;
    if (tiles && t < 0)
        t += (float)size;
    t = rf_clamp(t, 0, tiles ? (float)size - 1e-3f : (float)(size - 1));
    int i = rf_min_int((int)t, size - 1);
    *fraction = t - (float)i;
    return i;
}

static void add_tap(const RfTexture *texture, const RfTextureLevel *level, float u, float v, float weight, float *sum)
{
    float s, t;
    int x = texel(u, level->scale_x, level->width, texture->tiles, &s);
    int y = texel(v, level->scale_y, level->height, texture->tiles, &t);
    float w00 = weight * (1 - s) * (1 - t), w10 = weight * s * (1 - t), w01 = weight * (1 - s) * t,
          w11 = weight * s * t;
    for (int q = 0; q < texture->quads; ++q)
    {
        const float *row0 =
            level->texels + (size_t)q * rf_texture_plane(level) + 4 * ((size_t)y * (size_t)level->stride + (size_t)x);
        const float *row1 = row0 + 4 * (size_t)level->stride;
        for (int c = 0; c < 4; ++c)
            sum[4 * q + c] += w00 * row0[c] + w10 * row0[c + 4] + w01 * row1[c] + w11 * row1[c + 4];
    }
}

// Turns direction-valued channels from the exemplar's axes into the frame's, by the rotation part of J's inverse; a
// mirrored exemplar's own axis is flipped first. Normals have y up.
static void turn_directions(const RfExemplar *exemplar, RfJacobian j, float mirror_x, float mirror_y, float *values)
{
    float length = sqrtf((j.xx + j.yy) * (j.xx + j.yy) + (j.yx - j.xy) * (j.yx - j.xy));
    float c = length > 0 ? (j.xx + j.yy) / length : 1, s = length > 0 ? (j.xy - j.yx) / length : 0;
    for (int m = 0; m < exemplar->map_count; ++m)
    {
        float *p = values + exemplar->first_channel[m];
        if (exemplar->maps[m].kind == RF_MAP_VECTOR)
        {
            float x = mirror_x * p[0], y = mirror_y * p[1];
            p[0] = c * x - s * y;
            p[1] = s * x + c * y;
        }
        else if (exemplar->maps[m].kind == RF_MAP_NORMAL)
        {
            float x = mirror_x * (2 * p[0] - 1), y = -mirror_y * (2 * p[1] - 1), z = 2 * p[2] - 1;
            float norm = sqrtf(x * x + y * y + z * z), scale = norm > 0 ? 0.5f / norm : 0;
            p[0] = 0.5f + scale * (c * x - s * y);
            p[1] = 0.5f - scale * (s * x + c * y);
            p[2] = 0.5f + scale * z;
        }
    }
}

static RfResult make_texture(const RfExemplar *exemplar, RfTexture *texture)
{
    int quads = (exemplar->channels + 3) / 4;
    size_t count = (size_t)exemplar->width * (size_t)exemplar->height, channels = (size_t)exemplar->channels;
    float *padded = rf_allocate_zero(count, (size_t)(4 * quads) * sizeof(float));
    if (!padded)
        return RF_OUT_OF_MEMORY;
    for (size_t k = 0; k < count; ++k)
        memcpy(padded + k * (size_t)(4 * quads), exemplar->pixels + k * channels, channels * sizeof(float));
    RfResult result = rf_texture_create(padded, exemplar->width, exemplar->height, quads, exemplar->tiles, texture);
    rf_release(padded);
    return result;
}

RfResult rf_sampler_create(const RfExemplar *exemplar, RfSampler *out)
{
    *out = (RfSampler){.exemplar = exemplar};
    for (int m = 0; m < exemplar->map_count; ++m)
        out->turns |= exemplar->maps[m].kind == RF_MAP_NORMAL || exemplar->maps[m].kind == RF_MAP_VECTOR;
    return make_texture(exemplar, &out->texture);
}

void rf_sampler_free(RfSampler *sampler)
{
    rf_texture_free(&sampler->texture);
}

void rf_sampler_at(const RfSampler *sampler, RfVec2 point, RfJacobian j, float values[RF_SAMPLE_CHANNELS])
{
    const RfTexture *texture = &sampler->texture;
    Footprint print = footprint(texture, j);
    float mirror_x, mirror_y;
    memset(values, 0, RF_SAMPLE_CHANNELS * sizeof *values);
    for (int i = 0; i < print.taps; ++i)
    {
        float along = ((float)i + 0.5f) / (float)print.taps - 0.5f;
        float u = fold(point.x + along * print.axis.x, texture->width, texture->tiles, &mirror_x);
        float v = fold(point.y + along * print.axis.y, texture->height, texture->tiles, &mirror_y);
        add_tap(texture, &texture->levels[print.level], u, v, 1.0f / (float)print.taps, values);
    }
    if (sampler->turns)
    {
        fold(point.x, texture->width, texture->tiles, &mirror_x);
        fold(point.y, texture->height, texture->tiles, &mirror_y);
        turn_directions(sampler->exemplar, j, mirror_x, mirror_y, values);
    }
}
