// SPDX-License-Identifier: Apache-2.0
// Distance of radially averaged power spectra, as Yu et al. (2009) judge their blending, with a floor beside it.
//
// Spectra are estimated by averaging over crops that overlap by half (Welch. The use of fast Fourier transform for the
// estimation of power spectra. 1967): Hann-windowed, the mean removed, radial bins of one cycle a crop. Where land
// leaves little room the crops are tried at every eighth of their side. A noise of a quarter grey level is added to
// both sides of a distance, so that empty frequencies do not count.
//
// The exemplar is one sample of a random texture: single crops of it differ by some dB from each other. The floor is
// the mean distance of such pairs. Two real crops go through one complex transform, as its real and imaginary part.
#include "measure/spectrum.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/result.h"

#include <kiss_fftnd.h>
#include <string.h>

enum
{
    MAX_CROP = 2 * RF_MEASURE_MAX_BINS,
    AUTO_CROP = 128,
    MIN_CROP = 16,
    PAIRS = 32,
    // More crops than this, spread evenly, do not steady a mean of 128 x 128 pixels further.
    MAX_CROPS = 256,
    TRIES = 64
};

typedef struct Place
{
    int x, y;
} Place;

// What one thread transforms with.
typedef struct Worker
{
    kiss_fftnd_cfg plan;
    kiss_fft_cpx *windowed, *bins;
} Worker;

struct RfSpectrometer
{
    int crop, first;
    uint64_t seed;
    bool judges;
    float *hann;
    int members[RF_MEASURE_MAX_BINS + 1];
    Worker *workers;
    int worker_count;
    RfRadialSpectrum exemplar, low, high;
    /// One side of the pairs, to be compared with crops of frames.
    RfRadialSpectrum single[PAIRS];
    double floor;
};

// ---- one pair of crops -------------------------------------------------------------------------------------------

static int ring_of(int n, int x, int y)
{
    int fx = x <= n / 2 ? x : x - n, fy = y <= n / 2 ? y : y - n;
    return (int)(sqrt((double)(fx * fx + fy * fy)) + 0.5);
}

// Into the real (part 0) or the imaginary part of the input.
static void window_crop(const RfSpectrometer *s, const RfGrey *picture, Place place, int part, kiss_fft_cpx *out)
{
    int n = s->crop;
    double mean = 0, weight = 0;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
        {
            double w = (double)(s->hann[y] * s->hann[x]);
            mean += w * (double)picture->pixels[(size_t)(place.y + y) * (size_t)picture->w + (size_t)(place.x + x)];
            weight += w;
        }
    mean /= weight;
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
        {
            float value = picture->pixels[(size_t)(place.y + y) * (size_t)picture->w + (size_t)(place.x + x)];
            float windowed = (value - (float)mean) * s->hann[y] * s->hann[x];
            *(part ? &out[y * n + x].i : &out[y * n + x].r) = windowed;
        }
}

// X = A + iB with A, B the transforms of real pictures: A = (X(k) + X*(-k)) / 2, iB = (X(k) - X*(-k)) / 2.
static void add_rings(const RfSpectrometer *s, const kiss_fft_cpx *bins, RfRadialSpectrum *a, RfRadialSpectrum *b)
{
    int n = s->crop;
    memset(a, 0, sizeof *a);
    if (b)
        memset(b, 0, sizeof *b);
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x)
        {
            int ring = ring_of(n, x, y);
            if (ring < 1 || ring > n / 2)
                continue;
            kiss_fft_cpx p = bins[y * n + x], q = bins[(n - y) % n * n + (n - x) % n];
            double ar = (double)p.r + (double)q.r, ai = (double)p.i - (double)q.i;
            double br = (double)p.r - (double)q.r, bi = (double)p.i + (double)q.i;
            a->power[ring] += 0.25 * (ar * ar + ai * ai);
            if (b)
                b->power[ring] += 0.25 * (br * br + bi * bi);
        }
    for (int k = 1; k <= n / 2; ++k)
    {
        double scale = 1 / ((double)s->members[k] * (double)n * (double)n);
        a->power[k] *= scale;
        if (b)
            b->power[k] *= scale;
    }
}

typedef struct Analysis
{
    const RfSpectrometer *spectrometer;
    const RfGrey *picture;
    const Place *places;
    int count;
    RfRadialSpectrum *spectra;
} Analysis;

static void analyse_pair(void *context, int item, int worker)
{
    const Analysis *a = context;
    const RfSpectrometer *s = a->spectrometer;
    const Worker *w = &s->workers[worker];
    int i = 2 * item;
    bool two = i + 1 < a->count;
    memset(w->windowed, 0, (size_t)s->crop * (size_t)s->crop * sizeof *w->windowed);
    window_crop(s, a->picture, a->places[i], 0, w->windowed);
    if (two)
        window_crop(s, a->picture, a->places[i + 1], 1, w->windowed);
    kiss_fftnd(w->plan, w->windowed, w->bins);
    add_rings(s, w->bins, &a->spectra[i], two ? &a->spectra[i + 1] : NULL);
}

static void analyse(const RfSpectrometer *s, const RfGrey *picture, const Place *places, int count,
                    RfRadialSpectrum *spectra)
{
    Analysis a = {s, picture, places, count, spectra};
    rf_parallel_for((count + 1) / 2, analyse_pair, &a);
}

// ---- where crops lie ---------------------------------------------------------------------------------------------

static bool fits(const RfGrey *picture, const uint8_t *mask, int crop, Place p)
{
    for (int y = 0; mask && y < crop; ++y)
        if (memchr(mask + (size_t)(p.y + y) * (size_t)picture->w + (size_t)p.x, 0, (size_t)crop))
            return false;
    return true;
}

static int crops_along(int size, int crop, int step)
{
    return 1 + (size - crop + step - 1) / step;
}

// The i-th of `count` crops spread evenly from border to border.
static int crop_start(int size, int crop, int i, int count)
{
    return count > 1 ? (int)((int64_t)(size - crop) * i / (count - 1)) : (size - crop) / 2;
}

// Those of the grid that fit, from the `skip`-th on every `skip`-th; at most MAX_CROPS are stored. Returns how many fit
// in all.
static int grid_places(const RfGrey *picture, const uint8_t *mask, int crop, int step, int skip, Place *places)
{
    int across = crops_along(picture->w, crop, step), down = crops_along(picture->h, crop, step), found = 0, kept = 0;
    for (int j = 0; j < down; ++j)
        for (int i = 0; i < across; ++i)
        {
            Place p = {crop_start(picture->w, crop, i, across), crop_start(picture->h, crop, j, down)};
            if (!fits(picture, mask, crop, p))
                continue;
            if (places && found % skip == 0 && kept < MAX_CROPS)
                places[kept++] = p;
            ++found;
        }
    return places ? kept : found;
}

// Crops that overlap by half; nearer ones where the mask would leave fewer than four.
static int choose_places(const RfGrey *picture, const uint8_t *mask, int crop, Place *places)
{
    if (picture->w < crop || picture->h < crop)
        return 0;
    int step = crop / 2, found = grid_places(picture, mask, crop, step, 1, NULL);
    if (mask && found < 4)
    {
        step = rf_max_int(crop / 8, 1);
        found = grid_places(picture, mask, crop, step, 1, NULL);
    }
    if (found == 0 || !places)
        return found;
    return grid_places(picture, mask, crop, step, (found + MAX_CROPS - 1) / MAX_CROPS, places);
}

// The first of some random places that fits; false if none does.
static bool random_place(const RfSpectrometer *s, const RfGrey *picture, const uint8_t *mask, int pair, int side,
                         Place *place)
{
    for (int i = 0; i < (mask ? TRIES : 1); ++i)
    {
        uint64_t item = (uint64_t)pair, draw = 2 * (uint64_t)i;
        place->x = (int)rf_random_below((uint32_t)(picture->w - s->crop + 1), s->seed, item, (uint64_t)side, draw);
        place->y = (int)rf_random_below((uint32_t)(picture->h - s->crop + 1), s->seed, item, (uint64_t)side, draw + 1);
        if (fits(picture, mask, s->crop, *place))
            return true;
    }
    return false;
}

// ---- the exemplar ------------------------------------------------------------------------------------------------

static double distance_db(const RfSpectrometer *s, const RfRadialSpectrum *a, const RfRadialSpectrum *b)
{
    const double noise = 0.25 * 0.25;
    double sum = 0;
    for (int k = s->first; k <= s->crop / 2; ++k)
    {
        double db = 10 * log10((a->power[k] + noise) / (b->power[k] + noise));
        sum += db * db;
    }
    return sqrt(sum / (s->crop / 2 - s->first + 1));
}

static void average(const RfRadialSpectrum *spectra, int count, RfRadialSpectrum *mean)
{
    memset(mean, 0, sizeof *mean);
    for (int i = 0; i < count; ++i)
        for (int k = 0; k <= RF_MEASURE_MAX_BINS; ++k)
            mean->power[k] += spectra[i].power[k] / count;
}

static void set_nan(RfRadialSpectrum *spectrum)
{
    for (int k = 0; k <= RF_MEASURE_MAX_BINS; ++k)
        spectrum->power[k] = (double)NAN;
}

static void analyse_exemplar(RfSpectrometer *s, const RfGrey *exemplar, RfRadialSpectrum *spectra)
{
    Place places[MAX_CROPS];
    int count = choose_places(exemplar, NULL, s->crop, places);
    analyse(s, exemplar, places, count, spectra);
    average(spectra, count, &s->exemplar);

    for (int i = 0; i < 2 * PAIRS; ++i)
        random_place(s, exemplar, NULL, i / 2, i % 2, &places[i]);
    analyse(s, exemplar, places, 2 * PAIRS, spectra);
    s->floor = 0;
    s->low = s->high = spectra[0];
    for (int i = 0; i < PAIRS; ++i)
    {
        s->floor += distance_db(s, &spectra[2 * i], &spectra[2 * i + 1]) / PAIRS;
        s->single[i] = spectra[2 * i + 1];
    }
    for (int i = 1; i < 2 * PAIRS; ++i)
        for (int k = 1; k <= s->crop / 2; ++k)
        {
            s->low.power[k] = fmin(s->low.power[k], spectra[i].power[k]);
            s->high.power[k] = fmax(s->high.power[k], spectra[i].power[k]);
        }
    // Where there is no room for two different crops, nothing is known of their differences.
    if (exemplar->w == s->crop && exemplar->h == s->crop)
    {
        s->floor = (double)NAN;
        set_nan(&s->low);
        set_nan(&s->high);
    }
}

// ---- making one --------------------------------------------------------------------------------------------------

static int pick_crop(const RfGrey *exemplar, const RfGrey *frame, const uint8_t *mask)
{
    int smallest = rf_min_int(frame->w, frame->h);
    smallest = exemplar ? rf_min_int(smallest, rf_min_int(exemplar->w, exemplar->h) / 2) : smallest / 2;
    int crop = rf_clamp_int(smallest, MIN_CROP, AUTO_CROP) & ~1;
    while (crop >= 2 * MIN_CROP && choose_places(frame, mask, crop, NULL) == 0)
        crop = crop / 2 & ~1;
    return crop;
}

static void free_worker(Worker *w)
{
    rf_release(w->plan);
    rf_release(w->windowed);
    rf_release(w->bins);
}

// As many workers as there are threads now, which may be more than when the spectrometer was made.
static RfResult prepare_workers(RfSpectrometer *s)
{
    size_t n = (size_t)s->crop, plan_bytes = 0;
    int dims[2] = {s->crop, s->crop}, wanted = rf_threads();
    if (wanted <= s->worker_count)
        return RF_OK;
    Worker *workers = rf_reallocate(s->workers, (size_t)s->worker_count, (size_t)wanted, sizeof *workers);
    if (!workers)
        return RF_OUT_OF_MEMORY;
    s->workers = workers;
    kiss_fftnd_alloc(dims, 2, 0, NULL, &plan_bytes);
    for (; s->worker_count < wanted; ++s->worker_count)
    {
        Worker w = {rf_allocate(plan_bytes, 1), rf_allocate(n * n, sizeof *w.windowed),
                    rf_allocate(n * n, sizeof *w.bins)};
        if (!w.plan || !w.windowed || !w.bins)
        {
            free_worker(&w);
            return RF_OUT_OF_MEMORY;
        }
        kiss_fftnd_cfg plan = kiss_fftnd_alloc(dims, 2, 0, w.plan, &plan_bytes);
        assert(plan == w.plan);
        s->workers[s->worker_count] = w;
    }
    return RF_OK;
}

static RfResult prepare(RfSpectrometer *s, const RfGrey *exemplar)
{
    s->hann = rf_allocate((size_t)s->crop, sizeof(float));
    RfRadialSpectrum *spectra = rf_allocate(MAX_CROPS, sizeof *spectra);
    RfResult result = s->hann && spectra ? prepare_workers(s) : RF_OUT_OF_MEMORY;
    // Scaled to a mean square of 1, so that power keeps its unit.
    for (int i = 0; result == RF_OK && i < s->crop; ++i)
        s->hann[i] = sqrtf(8.0f / 3.0f) * (0.5f - 0.5f * cosf(2 * RF_PI * ((float)i + 0.5f) / (float)s->crop));
    for (int i = 0; i < s->crop * s->crop; ++i)
    {
        int ring = ring_of(s->crop, i % s->crop, i / s->crop);
        if (ring <= s->crop / 2)
            ++s->members[ring];
    }
    s->judges = exemplar && exemplar->w >= s->crop && exemplar->h >= s->crop;
    if (result == RF_OK && s->judges)
        analyse_exemplar(s, exemplar, spectra);
    rf_release(spectra);
    return result;
}

RfResult rf_spectrometer_create(const RfGrey *exemplar, const RfGrey *frame, const uint8_t *mask, int crop, int first,
                                uint64_t seed, RfSpectrometer **out)
{
    *out = NULL;
    RfSpectrometer *s = rf_allocate_zero(1, sizeof *s);
    if (!s)
        return RF_OUT_OF_MEMORY;
    s->crop = crop ? crop : pick_crop(exemplar, frame, mask);
    s->first = first;
    s->seed = seed;
    RfResult result = prepare(s, exemplar);
    if (result != RF_OK)
    {
        rf_spectrometer_destroy(s);
        return result;
    }
    *out = s;
    return RF_OK;
}

void rf_spectrometer_destroy(RfSpectrometer *s)
{
    if (!s)
        return;
    for (int i = 0; i < s->worker_count; ++i)
        free_worker(&s->workers[i]);
    rf_release(s->workers);
    rf_release(s->hann);
    rf_release(s);
}

int rf_spectrometer_crop(const RfSpectrometer *s)
{
    return s->crop;
}

// ---- frames ------------------------------------------------------------------------------------------------------

// Mean distance of single crops of the frame to single crops of the exemplar.
static double pair_distance(const RfSpectrometer *s, const RfGrey *frame, const uint8_t *mask,
                            RfRadialSpectrum *spectra)
{
    Place places[PAIRS];
    int pairs[PAIRS], count = 0;
    double sum = 0;
    for (int i = 0; i < PAIRS; ++i)
        if (random_place(s, frame, mask, i, 2, &places[count]))
            pairs[count++] = i;
    analyse(s, frame, places, count, spectra);
    for (int i = 0; i < count; ++i)
        sum += distance_db(s, &spectra[i], &s->single[pairs[i]]);
    return count ? sum / count : (double)NAN;
}

RfResult rf_spectrometer_measure(RfSpectrometer *s, const RfGrey *frame, const uint8_t *mask,
                                 RfRadialSpectrum *spectrum, RfMeasureSpectrum *distance)
{
    Place places[MAX_CROPS];
    RF_TRY(prepare_workers(s));
    RfRadialSpectrum *spectra = rf_allocate(MAX_CROPS, sizeof *spectra);
    if (!spectra)
        return RF_OUT_OF_MEMORY;
    int count = choose_places(frame, mask, s->crop, places);
    double nan = (double)NAN;
    *distance = (RfMeasureSpectrum){nan, s->judges ? s->floor : nan, nan, nan};
    set_nan(spectrum);
    if (count > 0)
    {
        analyse(s, frame, places, count, spectra);
        average(spectra, count, spectrum);
    }
    if (count > 0 && s->judges)
    {
        distance->distance = distance_db(s, spectrum, &s->exemplar);
        double pairs = pair_distance(s, frame, mask, spectra);
        if (s->floor > 0)
        {
            distance->ratio = distance->distance / s->floor;
            distance->pair_ratio = pairs / s->floor;
        }
    }
    rf_release(spectra);
    return RF_OK;
}

void rf_spectrometer_exemplar(const RfSpectrometer *s, RfRadialSpectrum *mean, RfRadialSpectrum *low,
                              RfRadialSpectrum *high)
{
    *mean = s->exemplar;
    *low = s->low;
    *high = s->high;
    if (s->judges)
        return;
    set_nan(mean);
    set_nan(low);
    set_nan(high);
}
