// SPDX-License-Identifier: Apache-2.0
// Has blending washed it out? Standard deviations and histograms of frame and exemplar.
//
// The earth mover's distance of two histograms on a line is the area between their cumulative sums (Rubner, Tomasi,
// Guibas. The earth mover's distance as a metric for image retrieval. 2000).
#include "measure/judgement.h"

#include "core/maths.h"
#include "core/random.h"

enum
{
    GREY_BINS = 256,
    L1_BINS = 64,
    FLOOR_CROPS = 32,
    // Channels 0 to 2, and luma.
    VALUES = 4,
    LUMA = 3
};

typedef struct Statistics
{
    double mean[VALUES], deviation[VALUES];
    double bins[GREY_BINS];
} Statistics;

static int colour_channels(const RfImageView *frame)
{
    return frame->channels < 3 ? 1 : 3;
}

static void gather_statistics(const RfImageView *frame, const uint8_t *mask, Statistics *s)
{
    double sum[VALUES] = {0}, squares[VALUES] = {0}, n = 0;
    int channels = colour_channels(frame);
    *s = (Statistics){0};
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
        {
            if (mask && !mask[(size_t)y * (size_t)frame->width + (size_t)x])
                continue;
            const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            float luma = channels == 1 ? p[0] : 0.2126f * p[0] + 0.7152f * p[1] + 0.0722f * p[2];
            double values[VALUES] = {0, 0, 0, 255 * (double)luma};
            for (int c = 0; c < channels; ++c)
                values[c] = 255 * (double)p[c];
            for (int c = 0; c < VALUES; ++c)
            {
                sum[c] += values[c];
                squares[c] += values[c] * values[c];
            }
            s->bins[(int)rf_clamp((float)values[LUMA] + 0.5f, 0, GREY_BINS - 1)] += 1;
            n += 1;
        }
    for (int c = 0; c < VALUES; ++c)
    {
        s->mean[c] = n > 0 ? sum[c] / n : (double)NAN;
        s->deviation[c] = n > 0 ? sqrt(fmax(squares[c] / n - s->mean[c] * s->mean[c], 0)) : (double)NAN;
    }
    for (int i = 0; i < GREY_BINS && n > 0; ++i)
        s->bins[i] /= n;
}

// 1 where both are flat; NaN where only the exemplar is, since no ratio says how much was added.
static double deviation_ratio(double frame, double exemplar)
{
    return exemplar > 1e-3 ? frame / exemplar : frame <= 1e-3 ? 1 : (double)NAN;
}

static void compare(const Statistics *f, const Statistics *e, int channels, RfMeasureContrast *out)
{
    *out = (RfMeasureContrast){
        .channel = {NAN, NAN, NAN}, .luma_floor = NAN, .brightness_floor = NAN, .l1_floor = NAN, .mover_floor = NAN};
    for (int c = 0; c < channels; ++c)
        out->channel[c] = deviation_ratio(f->deviation[c], e->deviation[c]);
    out->luma = deviation_ratio(f->deviation[LUMA], e->deviation[LUMA]);
    out->brightness = f->mean[LUMA] - e->mean[LUMA];
    double carried = 0, bin = 0;
    for (int i = 0; i < GREY_BINS; ++i)
    {
        carried += f->bins[i] - e->bins[i];
        bin += f->bins[i] - e->bins[i];
        out->histogram_mover += fabs(carried);
        if ((i + 1) % (GREY_BINS / L1_BINS) == 0)
        {
            out->histogram_l1 += 0.5 * fabs(bin);
            bin = 0;
        }
    }
    // Nothing counts: means are NaN already.
    if (isnan(out->brightness))
        out->histogram_l1 = out->histogram_mover = (double)NAN;
}

void rf_measure_contrast(const RfImageView *frame, const uint8_t *mask, const RfImageView *exemplar,
                         RfMeasureContrast *out)
{
    Statistics f, e;
    gather_statistics(frame, mask, &f);
    gather_statistics(exemplar, NULL, &e);
    compare(&f, &e, rf_min_int(colour_channels(frame), colour_channels(exemplar)), out);
}

void rf_measure_contrast_floor(const RfImageView *exemplar, uint64_t seed, RfMeasureContrast *out)
{
    Statistics whole, part;
    gather_statistics(exemplar, NULL, &whole);
    double luma = 0, brightness = 0, l1 = 0, mover = 0;
    for (int i = 0; i < FLOOR_CROPS; ++i)
    {
        RfImageView crop = *exemplar;
        crop.width = (exemplar->width + 1) / 2;
        crop.height = (exemplar->height + 1) / 2;
        uint32_t x = rf_random_below((uint32_t)(exemplar->width - crop.width + 1), seed, (uint64_t)i, 3, 0);
        uint32_t y = rf_random_below((uint32_t)(exemplar->height - crop.height + 1), seed, (uint64_t)i, 3, 1);
        crop.pixels += (ptrdiff_t)y * exemplar->row_stride + (ptrdiff_t)x * exemplar->channels;
        RfMeasureContrast c;
        gather_statistics(&crop, NULL, &part);
        compare(&part, &whole, 1, &c);
        luma += fabs(c.luma - 1) / FLOOR_CROPS;
        brightness += fabs(c.brightness) / FLOOR_CROPS;
        l1 += c.histogram_l1 / FLOOR_CROPS;
        mover += c.histogram_mover / FLOOR_CROPS;
    }
    out->luma_floor = luma;
    out->brightness_floor = brightness;
    out->l1_floor = l1;
    out->mover_floor = mover;
}
