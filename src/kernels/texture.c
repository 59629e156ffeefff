// SPDX-License-Identifier: Apache-2.0
// Band-limited oversampling with the loss of bilinear sampling put back.
//
// A bilinear sample at a random phase t between two texels multiplies the amplitude at the angular frequency w (radians
// a texel) by |1 - t + t e^iw|; over all phases the mean power is 2/3 + 1/3 cos w. On the exemplar's own pixels that
// costs up to 4.8 dB at the highest frequency. Texels twice as dense put that frequency at w = pi/2, where 1.8 dB are
// lost, and these are known beforehand: every level is made with the filter
//
//     A(w) = 1 / sqrt(2/3 + 1/3 cos w)    below its band's edge, 0 above,
//
// so that the sampled picture has the exemplar's spectrum on average over the phases. The filter is a windowed cosine
// sum, eight zero crossings wide.
//
// Deviation from the usual: no trilinear mixing. Flows are nearly incompressible, so the level changes seldom;
// anisotropy is left to the taps of the sampler.

#include "kernels/texture.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"

#include <string.h>

enum
{
    KERNEL_LOBES = 8,
    SAMPLES_PER_LOBE = 256,
    TABLE_SIZE = KERNEL_LOBES * SAMPLES_PER_LOBE + 2,
    MIN_SIDE = 8,
    MAX_PIXELS = 1 << 27
};

// h(t), t in samples of the band's critical rate: the inverse transform of A below the band's edge, under a Hann
// window.
static void make_kernel(float table[TABLE_SIZE])
{
    const int steps = 256;
    for (int i = 0; i < TABLE_SIZE; ++i)
    {
        double t = (double)i / SAMPLES_PER_LOBE, sum = 0;
        for (int k = 0; k < steps; ++k)
        {
            double f = (k + 0.5) / steps;                          // 0..1: up to the band's edge
            double gain = 1 / sqrt(2.0 / 3 + cos(f * M_PI_2) / 3); // there w = pi/2 a texel
            sum += gain * cos(M_PI * f * t);
        }
        double window = t < KERNEL_LOBES ? 0.5 + 0.5 * cos(M_PI * t / KERNEL_LOBES) : 0;
        table[i] = (float)(sum / steps * window);
    }
}

static float kernel_at(const float *table, float t)
{
    float x = fabsf(t) * SAMPLES_PER_LOBE;
    if (x >= KERNEL_LOBES * SAMPLES_PER_LOBE)
        return 0;
    int i = (int)x;
    return rf_lerp(table[i], table[i + 1], x - (float)i);
}

typedef struct Resampling
{
    const float *in, *table;
    float *out;
    int in_length, out_length, lines, channels;
    // Floats from sample to sample and from line to line.
    ptrdiff_t in_step, in_line, out_step, out_line;
    // Input samples a critical sample of the output's band.
    float stretch;
    bool tiles;
} Resampling;

// One output sample position of all lines: out(k) = sum_i in(i) h((x_k - i) / stretch), normalised to sum 1.
static void resample_position(void *context, int k, int worker)
{
    (void)worker;
    const Resampling *r = context;
    float x = (float)((double)k * r->in_length / r->out_length), reach = KERNEL_LOBES * r->stretch;
    int first = (int)ceilf(x - reach), last = (int)floorf(x + reach);
    float total = 0;
    for (int i = first; i <= last; ++i)
        total += kernel_at(r->table, (x - (float)i) / r->stretch);
    float *out = r->out + k * r->out_step;
    for (int line = 0; line < r->lines; ++line)
        memset(out + line * r->out_line, 0, (size_t)r->channels * sizeof(float));
    for (int i = first; i <= last; ++i)
    {
        float weight = kernel_at(r->table, (x - (float)i) / r->stretch) / total;
        int source = r->tiles ? rf_wrap_int(i, r->in_length) : rf_mirror_int(i, r->in_length);
        const float *in = r->in + source * r->in_step;
        for (int line = 0; line < r->lines; ++line)
            for (int c = 0; c < r->channels; ++c)
                out[line * r->out_line + c] += weight * in[line * r->in_line + c];
    }
}

static void pad_level(RfTextureLevel *level, int quads, bool tiles)
{
    for (int q = 0; q < quads; ++q)
    {
        float *plane = level->texels + (size_t)q * rf_texture_plane(level);
        size_t row_floats = (size_t)level->stride * 4;
        for (int y = 0; y < level->height; ++y)
            for (int x = 0; x < 2; ++x)
                memcpy(plane + (size_t)y * row_floats + (size_t)(level->width + x) * 4,
                       plane + (size_t)y * row_floats + (size_t)(tiles ? x % level->width : level->width - 1) * 4,
                       4 * sizeof(float));
        for (int y = 0; y < 2; ++y)
            memcpy(plane + (size_t)(level->height + y) * row_floats,
                   plane + (size_t)(tiles ? y % level->height : level->height - 1) * row_floats,
                   row_floats * sizeof(float));
    }
}

static RfResult make_level(const float *pixels, const float *table, int halvings, RfTexture *texture)
{
    RfTextureLevel *level = &texture->levels[halvings];
    int channels = 4 * texture->quads;
    float density = 2.0f / (float)(1 << halvings);
    level->width = rf_max_int((int)lrintf((float)texture->width * density), 1);
    level->height = rf_max_int((int)lrintf((float)texture->height * density), 1);
    level->scale_x = (float)level->width / (float)texture->width;
    level->scale_y = (float)level->height / (float)texture->height;
    level->stride = level->width + 2;
    level->texels = rf_allocate_zero((size_t)texture->quads, rf_texture_plane(level) * sizeof(float));
    float *rows = rf_allocate((size_t)level->width * (size_t)texture->height, (size_t)channels * sizeof(float));
    if (!level->texels || !rows)
    {
        rf_release(rows);
        return RF_OUT_OF_MEMORY;
    }
    // Along x into rows[height][level width][channels], then along y into the quads' planes.
    Resampling along_x = {pixels,
                          table,
                          rows,
                          texture->width,
                          level->width,
                          texture->height,
                          channels,
                          channels,
                          (ptrdiff_t)texture->width * channels,
                          channels,
                          (ptrdiff_t)level->width * channels,
                          (float)(1 << halvings),
                          texture->tiles};
    rf_parallel_for(level->width, resample_position, &along_x);
    for (int q = 0; q < texture->quads; ++q)
    {
        Resampling along_y = {rows + 4 * q,
                              table,
                              level->texels + (size_t)q * rf_texture_plane(level),
                              texture->height,
                              level->height,
                              level->width,
                              4,
                              (ptrdiff_t)level->width * channels,
                              channels,
                              (ptrdiff_t)level->stride * 4,
                              4,
                              (float)(1 << halvings),
                              texture->tiles};
        rf_parallel_for(level->height, resample_position, &along_y);
    }
    rf_release(rows);
    pad_level(level, texture->quads, texture->tiles);
    return RF_OK;
}

RfResult rf_texture_create(const float *pixels, int width, int height, int quads, bool tiles, RfTexture *out)
{
    assert(width > 0 && height > 0 && quads > 0 && quads <= RF_TEXTURE_QUADS);
    *out = (RfTexture){0};
    // Texels are numbered in 32 bits, and there are four to a pixel.
    if ((int64_t)width * height > MAX_PIXELS)
        return rf_fail(RF_UNSUPPORTED, NULL, NULL, "an exemplar of %d x %d pixels: at most %d pixels can be sampled",
                       width, height, MAX_PIXELS);
    *out = (RfTexture){.width = width, .height = height, .quads = quads, .tiles = tiles};
    float table[TABLE_SIZE];
    make_kernel(table);
    RfResult result = RF_OK;
    while (result == RF_OK && out->level_count < RF_TEXTURE_LEVELS &&
           (out->level_count == 0 || rf_min_int(width, height) >> (out->level_count - 1) >= MIN_SIDE))
    {
        result = make_level(pixels, table, out->level_count, out);
        ++out->level_count;
    }
    if (result != RF_OK)
        rf_texture_free(out);
    return result;
}

double rf_texture_variance(const RfTexture *texture, int level_number, int lane)
{
    const RfTextureLevel *level = &texture->levels[level_number];
    const float *plane = level->texels + (size_t)(lane / 4) * rf_texture_plane(level) + lane % 4;
    double sum = 0;
    for (int y = 0; y < level->height; ++y)
        for (int x = 0; x < level->width; ++x)
        {
            double value = (double)plane[((size_t)y * (size_t)level->stride + (size_t)x) * 4];
            sum += value * value;
        }
    return sum / ((double)level->width * (double)level->height);
}

void rf_texture_free(RfTexture *texture)
{
    for (int i = 0; i < RF_TEXTURE_LEVELS; ++i)
        rf_release(texture->levels[i].texels);
    *texture = (RfTexture){0};
}
