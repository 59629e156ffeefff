// SPDX-License-Identifier: Apache-2.0
// Pictures of sets that started at different times in different places are independent of each other, so the
// contrast-preserving form (kernels/resolving.c) is used with a correlation of 0.
#include "kernels/crossfade.h"

#include "core/parallel.h"
#include "core/result.h"

#include <string.h>

enum
{
    BAND = 8
};

RfResult rf_crossfade_move(RfCoordinates *c, const RfTurn *turns, const char *stage, const RfFlowView *flow, int width,
                           int height)
{
    double before = c->time;
    bool first = !c->placed;
    RF_TRY(rf_coordinates_move(c, stage, flow, width, height));
    for (int set = 0; set < c->sets && !first; ++set)
        if (rf_turn_count(turns[set], c->time - c->start) != rf_turn_count(turns[set], before - c->start))
            rf_coordinates_reset(c, set);
    return RF_OK;
}

void rf_crossfade_origins(RfCrossfade *crossfade, uint64_t seed, const RfTurn *turns)
{
    const RfCoordinates *c = crossfade->coordinates;
    const RfExemplar *exemplar = crossfade->sampler->exemplar;
    for (int set = 0; set < c->sets; ++set)
    {
        uint64_t frame = turns ? rf_turn_count(turns[set], c->time - c->start) : 0, item = turns ? (uint64_t)set : 0;
        crossfade->origins[set] = (RfVec2){(float)exemplar->width * rf_random_float(seed, frame, item, 0),
                                           (float)exemplar->height * rf_random_float(seed, frame, item, 1)};
    }
}

static void fit_channel(const RfExemplar *exemplar, int channel, float *mean, float *low, float *high)
{
    size_t count = (size_t)exemplar->width * (size_t)exemplar->height;
    double sum = 0;
    *low = INFINITY;
    *high = -INFINITY;
    for (size_t k = 0; k < count; ++k)
    {
        float value = exemplar->pixels[k * (size_t)exemplar->channels + (size_t)channel];
        sum += (double)value;
        *low = rf_min(value, *low);
        *high = rf_max(value, *high);
    }
    // A constant stays exactly itself.
    *mean = *low == *high ? *low : (float)(sum / (double)count);
}

void rf_crossfade_quads(const RfExemplar *exemplar, bool contrast, RfResolveQuad quads[RF_SAMPLE_QUADS])
{
    memset(quads, 0, RF_SAMPLE_QUADS * sizeof *quads);
    for (int m = 0; m < exemplar->map_count; ++m)
    {
        RfMapKind kind = exemplar->maps[m].kind;
        bool direction = kind == RF_MAP_NORMAL || kind == RF_MAP_VECTOR;
        for (int c = 0; c < exemplar->maps[m].image.channels; ++c)
        {
            int channel = exemplar->first_channel[m] + c, lane = channel % 4;
            RfResolveQuad *quad = &quads[channel / 4];
            fit_channel(exemplar, channel, &quad->mean[lane], &quad->low[lane], &quad->high[lane]);
            quad->plain[lane] = !contrast || kind == RF_MAP_ALPHA || direction ? 1 : 0;
            if (!direction)
                continue;
            quad->mean[lane] = kind == RF_MAP_NORMAL ? 0.5f : 0;
            quad->low[lane] = -INFINITY;
            quad->high[lane] = INFINITY;
        }
    }
    quads[0].colour = contrast && exemplar->maps[0].kind == RF_MAP_COLOUR && exemplar->maps[0].image.channels == 3 &&
                      exemplar->first_channel[0] == 0;
}

typedef struct DrawJob
{
    const RfCrossfade *crossfade;
    const RfFlowView *flow;
    const RfImageView *frame;
} DrawJob;

static void sample_set(const RfCrossfade *crossfade, int set, int x, int y, float values[RF_SAMPLE_CHANNELS])
{
    const RfCoordinates *c = crossfade->coordinates;
    RfVec2 origin = crossfade->origins[set], offset = rf_coordinates_offset(c, set, x, y);
    RfVec2 point = {origin.x + (float)x + 0.5f + offset.x, origin.y + (float)y + 0.5f + offset.y};
    rf_sampler_at(crossfade->sampler, point, rf_coordinates_jacobian(c, set, x, y), values);
}

// Sums over the sets at one run of pixels.
typedef struct Sums
{
    float colour[RF_SAMPLE_QUADS][RF_CROSSFADE_PIXELS * 4], weight[RF_CROSSFADE_PIXELS], weight2[RF_CROSSFADE_PIXELS];
} Sums;

static void add_sample(const RfCrossfade *crossfade, int i, float weight, const float *values, Sums *sums)
{
    sums->weight[i] += weight;
    sums->weight2[i] += weight * weight;
    for (int q = 0; q < crossfade->sampler->texture.quads; ++q)
        for (int lane = 0; lane < 4; ++lane)
            sums->colour[q][4 * i + lane] += weight * (values[4 * q + lane] - crossfade->quads[q].mean[lane]);
}

static void normalise_normals(const RfExemplar *exemplar, float *pixel)
{
    for (int m = 0; m < exemplar->map_count; ++m)
    {
        if (exemplar->maps[m].kind != RF_MAP_NORMAL)
            continue;
        float *p = pixel + exemplar->first_channel[m], x = 2 * p[0] - 1, y = 2 * p[1] - 1, z = 2 * p[2] - 1;
        float length = sqrtf(x * x + y * y + z * z), scale = length > 0 ? 0.5f / length : 0;
        p[0] = 0.5f + scale * x;
        p[1] = 0.5f + scale * y;
        p[2] = length > 0 ? 0.5f + scale * z : 1;
    }
}

// Blends `count` pixels from (x, y) on.
static void draw_run(const DrawJob *job, int x, int y, int count, float *out)
{
    const RfCrossfade *crossfade = job->crossfade;
    const RfExemplar *exemplar = crossfade->sampler->exemplar;
    float weights[RF_MAX_COORDINATE_SETS][RF_CROSSFADE_PIXELS], values[RF_SAMPLE_CHANNELS];
    Sums sums = {0};
    crossfade->weigh(crossfade->context, x, y, count, weights);
    for (int set = 0; set < crossfade->coordinates->sets; ++set)
        for (int i = 0; i < count; ++i)
            if (weights[set][i] > 0)
            {
                sample_set(crossfade, set, x + i, y, values);
                add_sample(crossfade, i, weights[set][i], values, &sums);
            }
    float rho[RF_CROSSFADE_PIXELS] = {0}, inverse_sum[RF_CROSSFADE_PIXELS], inverse_norm[RF_CROSSFADE_PIXELS];
    float resolved[RF_SAMPLE_QUADS][RF_CROSSFADE_PIXELS * 4];
    rf_resolve_scales(sums.weight, sums.weight2, rho, count, inverse_sum, inverse_norm);
    for (int q = 0; q < crossfade->sampler->texture.quads; ++q)
        rf_resolve_row(sums.colour[q], inverse_sum, inverse_norm, &crossfade->quads[q], count, resolved[q]);
    for (int i = 0; i < count; ++i, out += exemplar->channels)
    {
        for (int c = 0; c < exemplar->channels; ++c)
            out[c] = resolved[c / 4][4 * i + c % 4];
        if (crossfade->sampler->turns)
            normalise_normals(exemplar, out);
    }
}

static void draw_single(const RfCrossfade *crossfade, int x, int y, int count, float *out)
{
    size_t channels = (size_t)crossfade->sampler->exemplar->channels;
    float values[RF_SAMPLE_CHANNELS];
    for (int i = 0; i < count; ++i, out += channels)
    {
        sample_set(crossfade, 0, x + i, y, values);
        memcpy(out, values, channels * sizeof *out);
    }
}

static void draw_band(void *context, int item, int worker)
{
    (void)worker;
    const DrawJob *job = context;
    const RfImageView *frame = job->frame;
    int end = rf_min_int((item + 1) * BAND, frame->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0, next; x < frame->width; x = next)
        {
            // A run is all fluid or all land.
            bool fluid = !job->flow->mask || rf_pixel_inside(job->flow, frame->width, frame->height, x, y);
            int most = rf_min_int(x + RF_CROSSFADE_PIXELS, frame->width);
            for (next = x + 1; next < most; ++next)
                if (job->flow->mask && rf_pixel_inside(job->flow, frame->width, frame->height, next, y) != fluid)
                    break;
            float *out = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            if (!fluid)
                memset(out, 0, (size_t)(next - x) * (size_t)frame->channels * sizeof(float));
            else if (job->crossfade->coordinates->sets == 1)
                draw_single(job->crossfade, x, y, next - x, out);
            else
                draw_run(job, x, y, next - x, out);
        }
}

void rf_crossfade_draw(const RfCrossfade *crossfade, const RfFlowView *flow, const RfImageView *frame)
{
    DrawJob job = {crossfade, flow, frame};
    rf_parallel_for((frame->height + BAND - 1) / BAND, draw_band, &job);
}

RfResult rf_crossfade_check(const RfSampler *sampler, const RfImageView *frame)
{
    RF_REQUIRE(frame->channels == sampler->exemplar->channels, "frame: %d channels: the exemplar has %d",
               frame->channels, sampler->exemplar->channels);
    RF_REQUIRE(frame->row_stride >= (ptrdiff_t)frame->width * frame->channels,
               "frame: row_stride is less than width * channels");
    return RF_OK;
}
