// SPDX-License-Identifier: Apache-2.0
// Distance of radially averaged power spectra, as Yu et al. (2009) judge their blending, with a floor beside it.
//
// Spectra are estimated by averaging over crops that overlap by half (Welch. The use of fast Fourier transform for the
// estimation of power spectra. 1967).
#include "support/measures.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/random.h"

#include <assert.h>
#include <kiss_fftnd.h>

enum
{
    MAX_CROP = 128,
    MIN_CROP = 16,
    PAIRS = 32
};

typedef struct Analyser
{
    int crop;
    kiss_fftnd_cfg plan;
    float *hann;
    kiss_fft_cpx *windowed, *bins;
} Analyser;

typedef struct Picture
{
    const float *grey;
    int w, h;
} Picture;

typedef struct Spectrum
{
    double power[MAX_CROP / 2 + 1];
} Spectrum;

static Analyser analyser_create(int crop)
{
    size_t n = (size_t)crop;
    Analyser analyser = {.crop = crop,
                         .plan = kiss_fftnd_alloc((int[]){crop, crop}, 2, 0, NULL, NULL),
                         .windowed = rf_allocate(n * n, sizeof(kiss_fft_cpx)),
                         .hann = rf_allocate(n, sizeof(float)),
                         .bins = rf_allocate(n * n, sizeof(kiss_fft_cpx))};
    assert(analyser.plan && analyser.windowed && analyser.hann && analyser.bins);
    // Scaled to a mean square of 1, so that power keeps its unit.
    for (int i = 0; i < crop; ++i)
        analyser.hann[i] = sqrtf(8.0f / 3.0f) * (0.5f - 0.5f * cosf(2 * RF_PI * ((float)i + 0.5f) / (float)crop));
    return analyser;
}

static void analyser_free(Analyser *analyser)
{
    kiss_fft_free(analyser->plan);
    rf_release(analyser->windowed);
    rf_release(analyser->hann);
    rf_release(analyser->bins);
}

static void window_crop(const Analyser *analyser, const Picture *picture, int x0, int y0)
{
    int n = analyser->crop;
    double mean = 0, weight = 0;
    for (int i = 0; i < n * n; ++i)
    {
        double w = (double)(analyser->hann[i / n] * analyser->hann[i % n]);
        mean += w * (double)picture->grey[(size_t)(y0 + i / n) * (size_t)picture->w + (size_t)(x0 + i % n)];
        weight += w;
    }
    mean /= weight;
    for (int i = 0; i < n * n; ++i)
    {
        float value = picture->grey[(size_t)(y0 + i / n) * (size_t)picture->w + (size_t)(x0 + i % n)];
        analyser->windowed[i] =
            (kiss_fft_cpx){(value - (float)mean) * analyser->hann[i / n] * analyser->hann[i % n], 0};
    }
}

// Power spectral density (grey levels squared a unit of frequency), averaged over rings one cycle a crop wide.
static void crop_spectrum(const Analyser *analyser, const Picture *picture, int x0, int y0, Spectrum *out)
{
    int n = analyser->crop;
    int members[MAX_CROP / 2 + 1] = {0};
    *out = (Spectrum){{0}};
    window_crop(analyser, picture, x0, y0);
    kiss_fftnd(analyser->plan, analyser->windowed, analyser->bins);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
        {
            kiss_fft_cpx bin = analyser->bins[y * n + x];
            int fx = x <= n / 2 ? x : x - n, fy = y <= n / 2 ? y : y - n;
            int ring = (int)(sqrt((double)(fx * fx + fy * fy)) + 0.5);
            if (ring < 1 || ring > n / 2)
                continue;
            out->power[ring] += (double)bin.r * (double)bin.r + (double)bin.i * (double)bin.i;
            ++members[ring];
        }
    for (int k = 1; k <= n / 2; ++k)
        out->power[k] /= members[k] * (double)n * (double)n;
}

static int crops_along(int size, int crop)
{
    return 1 + (2 * (size - crop) + crop - 1) / crop;
}

// The i-th of `count` crops spread evenly from border to border.
static int crop_start(int size, int crop, int i, int count)
{
    return count > 1 ? (int)((int64_t)(size - crop) * i / (count - 1)) : (size - crop) / 2;
}

static Spectrum mean_spectrum(const Analyser *analyser, const Picture *picture)
{
    Spectrum sum = {{0}}, one;
    int across = crops_along(picture->w, analyser->crop), down = crops_along(picture->h, analyser->crop);
    for (int j = 0; j < down; ++j)
        for (int i = 0; i < across; ++i)
        {
            crop_spectrum(analyser, picture, crop_start(picture->w, analyser->crop, i, across),
                          crop_start(picture->h, analyser->crop, j, down), &one);
            for (int k = 0; k <= analyser->crop / 2; ++k)
                sum.power[k] += one.power[k] / (across * down);
        }
    return sum;
}

static void random_crop(const Analyser *analyser, const Picture *picture, int pair, int side, Spectrum *out)
{
    uint32_t x = rf_random_below((uint32_t)(picture->w - analyser->crop + 1), 7, (uint64_t)pair, (uint64_t)side, 0);
    uint32_t y = rf_random_below((uint32_t)(picture->h - analyser->crop + 1), 7, (uint64_t)pair, (uint64_t)side, 1);
    crop_spectrum(analyser, picture, (int)x, (int)y, out);
}

static double distance_db(const Spectrum *a, const Spectrum *b, int crop)
{
    const double noise = 0.25 * 0.25;
    double sum = 0;
    for (int k = 1; k <= crop / 2; ++k)
    {
        double db = 10 * log10((a->power[k] + noise) / (b->power[k] + noise));
        sum += db * db;
    }
    return sqrt(sum / (crop / 2));
}

MeasureSpectrum measure_spectrum(const float *frame, int w, int h, const float *exemplar, int exemplar_w,
                                 int exemplar_h)
{
    int smallest = rf_min_int(rf_min_int(w, h), rf_min_int(exemplar_w, exemplar_h) / 2);
    MeasureSpectrum result = {.crop = rf_clamp_int(smallest, MIN_CROP, MAX_CROP) & ~1};
    assert(rf_min_int(rf_min_int(w, h), rf_min_int(exemplar_w, exemplar_h)) >= result.crop);
    Analyser analyser = analyser_create(result.crop);
    Picture f = {frame, w, h}, e = {exemplar, exemplar_w, exemplar_h};
    Spectrum of_frame = mean_spectrum(&analyser, &f), of_exemplar = mean_spectrum(&analyser, &e);
    result.distance = distance_db(&of_frame, &of_exemplar, result.crop);
    double pair_distance = 0;
    for (int pair = 0; pair < PAIRS; ++pair)
    {
        Spectrum first, second, drawn;
        random_crop(&analyser, &e, pair, 0, &first);
        random_crop(&analyser, &e, pair, 1, &second);
        random_crop(&analyser, &f, pair, 2, &drawn);
        result.floor += distance_db(&first, &second, result.crop) / PAIRS;
        pair_distance += distance_db(&drawn, &second, result.crop) / PAIRS;
    }
    analyser_free(&analyser);
    result.ratio = result.floor > 0 ? result.distance / result.floor : 0;
    result.pair_ratio = result.floor > 0 ? pair_distance / result.floor : 0;
    return result;
}
