// SPDX-License-Identifier: Apache-2.0
// The best-fit patch under a mask, three ways: kernels/patch_search (sums in vectors that are given up early), the
// search of whole windows (kernels/neighbours, weights for the mask), and correlation by FFT. And a scan of all places.
//
//   bench_patches [exemplar=builtin:canes] [size=128] [queries=50] [only=TEXT]
//
// CSV: box,known pixels,way,ms a query,agreeing (queries with the same place as the scan's). One thread; the exemplar,
// turned by 30 degrees and continued, is prepared before the clock starts. Queries are other places of it, seen through
// masks as directional texture has them: the border round a hole of 4, 16 and 32 pixels, the left and upper border
// alone, and a whole cell of 16 and 32.
#include "bench.h"
#include "core/maths.h"
#include "core/random.h"
#include "kernels/neighbours.h"
#include "kernels/patch_search.h"
#include "kernels/turned_copies.h"
#include "riffle/riffle.h"

#include <kiss_fftnd.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    BORDER = 4,
    MAX_QUERIES = 1000,
    COPY = 2,
    COPIES = 24
};

typedef struct Settings
{
    const char *exemplar, *only;
    int size, queries;
} Settings;

// What a mask knows of its box.
typedef enum Known
{
    KNOWN_AROUND,
    KNOWN_BEFORE,
    KNOWN_ALL
} Known;

typedef struct BoxCase
{
    const char *name;
    int side;
    Known known;
} BoxCase;

static const BoxCase g_boxes[] = {{"round 4 x 4", 4 + 2 * BORDER, KNOWN_AROUND},
                                  {"round 16 x 16", 16 + 2 * BORDER, KNOWN_AROUND},
                                  {"round 32 x 32", 32 + 2 * BORDER, KNOWN_AROUND},
                                  {"before 32 x 32", 32 + 2 * BORDER, KNOWN_BEFORE},
                                  {"all of 16 x 16", 16, KNOWN_ALL},
                                  {"all of 32 x 32", 32, KNOWN_ALL}};

typedef struct Bench
{
    const BoxCase *box;
    /// The turned copy that is searched, borrowed; its pixels once more, and where a box's middle may lie.
    const RfPatchPicture *picture;
    float *pixels;
    uint8_t *valid;
    float *penalties;
    int width, height, channels;
    RfPatchQuery query;
    float weights[RF_PATCH_BOX * RF_PATCH_BOX];
    float values[RF_PATCH_BOX * RF_PATCH_BOX * RF_MAX_EXEMPLAR_CHANNELS];
    RfPatchTerms terms;
    RfWindowDatabase *windows;
    /// Spectra of the picture's channels, and of its squares' sum.
    int fft_width, fft_height;
    kiss_fftnd_cfg forward, backward;
    kiss_fft_cpx *spectra[RF_MAX_EXEMPLAR_CHANNELS + 1], *plane, *spectrum, *sum;
} Bench;

static void *need(void *memory)
{
    if (!memory)
    {
        fprintf(stderr, "bench_patches: out of memory\n");
        exit(1);
    }
    return memory;
}

// ---- the picture

static void take_picture(const RfTurnedCopies *copies, Bench *b)
{
    const RfPatchPicture *p = &copies->pictures[COPY];
    size_t pixels = (size_t)p->width * (size_t)p->height, row = (size_t)p->width + 1;
    b->picture = p;
    b->channels = p->channels;
    b->width = p->width;
    b->height = p->height;
    b->pixels = need(malloc(pixels * (size_t)b->channels * sizeof(float)));
    b->valid = need(malloc(pixels));
    b->penalties = need(malloc(pixels * sizeof *b->penalties));
    for (int y = 0; y < b->height; ++y)
        for (int x = 0; x < b->width; ++x)
        {
            const int32_t *top = p->invalid + (size_t)y * row + (size_t)x, *bottom = top + row;
            b->valid[y * b->width + x] = bottom[1] - bottom[0] - top[1] + top[0] == 0;
            for (int c = 0; c < b->channels; ++c)
                b->pixels[(y * b->width + x) * b->channels + c] =
                    p->planes[((ptrdiff_t)c * p->height + y) * p->stride + x];
        }
}

static bool has_room(const Bench *b, int x, int y)
{
    return b->valid[(y + b->box->side / 2) * b->width + x + b->box->side / 2];
}

static size_t bins(const Bench *b)
{
    return (size_t)b->fft_height * (size_t)b->fft_width;
}

// Some versions of the library tell the size they need, but do not take it themselves.
static kiss_fftnd_cfg make_plan(const int *sides, bool inverse)
{
    size_t size = 0;
    kiss_fftnd_alloc(sides, 2, inverse, NULL, &size);
    return need(kiss_fftnd_alloc(sides, 2, inverse, need(malloc(size)), &size));
}

static void prepare_fft(Bench *b)
{
    b->fft_width = kiss_fft_next_fast_size(b->width);
    b->fft_height = kiss_fft_next_fast_size(b->height);
    int sides[2] = {b->fft_height, b->fft_width};
    b->forward = make_plan(sides, false);
    b->backward = make_plan(sides, true);
    b->plane = need(malloc(bins(b) * sizeof *b->plane));
    b->spectrum = need(malloc(bins(b) * sizeof *b->spectrum));
    b->sum = need(malloc(bins(b) * sizeof *b->sum));
    for (int c = 0; c <= b->channels; ++c)
    {
        memset(b->plane, 0, bins(b) * sizeof *b->plane);
        for (int i = 0; i < b->width * b->height; ++i)
        {
            float *to = &b->plane[i / b->width * b->fft_width + i % b->width].r;
            const float *from = b->pixels + (ptrdiff_t)i * b->channels;
            for (int k = 0; k < b->channels; ++k)
                *to += c == b->channels ? from[k] * from[k] : k == c ? from[k] : 0;
        }
        b->spectra[c] = need(malloc(bins(b) * sizeof **b->spectra));
        kiss_fftnd(b->forward, b->plane, b->spectra[c]);
    }
}

static void prepare_windows(Bench *b)
{
    RfWindowSource source = {.image = {b->pixels, b->width, b->height, b->channels, (ptrdiff_t)b->width * b->channels}};
    RfWindowOptions options = {.side = b->box->side};
    bench_require(rf_windows_create(&source, 1, &options, &b->windows));
    for (int i = 0; i < rf_windows_count(b->windows); ++i)
    {
        RfWindowPlace place = rf_windows_place(b->windows, i);
        b->penalties[i] = has_room(b, place.x, place.y) ? 0 : 1e29f;
    }
}

// ---- queries

static bool is_known(const BoxCase *box, int x, int y)
{
    int end = box->side - BORDER;
    if (box->known == KNOWN_BEFORE)
        return x < BORDER || y < BORDER;
    return box->known == KNOWN_ALL || x < BORDER || y < BORDER || x >= end || y >= end;
}

static void make_query(Bench *b, const RfTurnedCopies *copies, int number)
{
    const RfExemplar *e = copies->sampler->exemplar;
    int side = b->box->side;
    RfVec2 source = {rf_random_float(1, 0, (uint64_t)number, 0) * (float)e->width,
                     rf_random_float(1, 0, (uint64_t)number, 1) * (float)e->height};
    // As a neighbouring copy shows it, so that nothing fits exactly.
    RfJacobian j = rf_turned_copy_jacobian(copies, COPY + 1);
    for (int i = 0; i < side * side; ++i)
    {
        float seen[RF_SAMPLE_CHANNELS];
        RfVec2 step = {(float)(i % side), (float)(i / side)};
        rf_sampler_at(copies->sampler, rf_vec2_add(source, rf_jacobian_step(j, step)), j, seen);
        rf_turned_copies_compared(copies, seen, b->values + (ptrdiff_t)i * b->channels);
        b->weights[i] = is_known(b->box, i % side, i / side) ? 1 : 0;
    }
    b->query = (RfPatchQuery){.width = side, .height = side, .pixels = b->values, .weights = b->weights};
    b->query.guess_x = b->query.guess_y = -1;
}

// ---- the ways

static RfPatchMatch by_scan(Bench *b)
{
    RfPatchMatch best = {-1, -1, INFINITY};
    int side = b->box->side;
    for (int y = 0; y <= b->height - side; ++y)
        for (int x = 0; x <= b->width - side; ++x)
        {
            if (!has_room(b, x, y))
                continue;
            double sum = 0;
            for (int i = 0; i < side * side && sum < best.distance; ++i)
                for (int c = 0; c < b->channels && b->weights[i] > 0; ++c)
                {
                    int at = ((y + i / side) * b->width + x + i % side) * b->channels + c;
                    double d = (double)b->pixels[at] - (double)b->values[(ptrdiff_t)i * b->channels + c];
                    sum += (double)b->weights[i] * d * d;
                }
            if (sum < best.distance)
                best = (RfPatchMatch){x, y, sum};
        }
    return best;
}

static RfPatchMatch by_sums(Bench *b)
{
    return rf_patch_search(b->picture, &b->query, &b->terms);
}

static RfPatchMatch by_windows(Bench *b)
{
    RfWindowQueries queries = {.count = 1, .windows = b->values, .weights = b->weights, .penalties = b->penalties};
    RfWindowMatch match;
    bench_require(rf_windows_search(b->windows, &queries, &match));
    return (RfPatchMatch){match.place.x, match.place.y, (double)match.distance};
}

// A channel of the query through its mask, or the mask; and what its correlation with the picture counts.
static float masked(const Bench *b, int channel, int pixel)
{
    return b->weights[pixel] * (channel == b->channels ? 1 : b->values[(ptrdiff_t)pixel * b->channels + channel]);
}

// Adds the correlations of two channels, which are transformed at once, to the spectrum of sums.
static void add_two(Bench *b, int first, int second)
{
    int side = b->box->side, width = b->fft_width, height = b->fft_height;
    memset(b->plane, 0, bins(b) * sizeof *b->plane);
    for (int i = 0; i < side * side; ++i)
    {
        kiss_fft_cpx *to = &b->plane[i / side * width + i % side];
        to->r = masked(b, first, i);
        to->i = second <= b->channels ? masked(b, second, i) : 0;
    }
    kiss_fftnd(b->forward, b->plane, b->spectrum);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            size_t at = (size_t)y * (size_t)width + (size_t)x;
            kiss_fft_cpx z = b->spectrum[at], m = b->spectrum[(y ? height - y : 0) * width + (x ? width - x : 0)];
            const kiss_fft_cpx parts[2] = {{0.5f * (z.r + m.r), 0.5f * (z.i - m.i)},
                                           {0.5f * (z.i + m.i), 0.5f * (m.r - z.r)}};
            for (int k = 0; k < 2; ++k)
            {
                int channel = k ? second : first;
                if (channel > b->channels)
                    continue;
                kiss_fft_cpx p = b->spectra[channel][at], q = parts[k];
                float factor = channel == b->channels ? 1 : -2;
                b->sum[at].r += factor * (p.r * q.r + p.i * q.i);
                b->sum[at].i += factor * (p.i * q.r - p.r * q.i);
            }
        }
}

// weight (p - q)^2 summed over the mask, less the sum of weight q^2, which is the same everywhere.
static RfPatchMatch by_fft(Bench *b)
{
    int side = b->box->side;
    memset(b->sum, 0, bins(b) * sizeof *b->sum);
    for (int c = 0; c <= b->channels; c += 2)
        add_two(b, c, c + 1);
    kiss_fftnd(b->backward, b->sum, b->plane);
    RfPatchMatch best = {-1, -1, INFINITY};
    for (int y = 0; y <= b->height - side; ++y)
        for (int x = 0; x <= b->width - side; ++x)
            if (has_room(b, x, y) && (double)b->plane[y * b->fft_width + x].r < best.distance)
                best = (RfPatchMatch){x, y, (double)b->plane[y * b->fft_width + x].r};
    return best;
}

// ---- measuring

typedef struct Way
{
    const char *name;
    RfPatchMatch (*search)(Bench *b);
} Way;

static void measure(Bench *b, const RfTurnedCopies *copies, const Settings *s)
{
    static const Way ways[] = {{"scan", by_scan}, {"sums", by_sums}, {"windows", by_windows}, {"fft", by_fft}};
    static RfPatchMatch truth[MAX_QUERIES];
    prepare_windows(b);
    for (int w = 0; w < 4; ++w)
    {
        int agreeing = 0, known = 0;
        double seconds = 0;
        for (int q = 0; q < s->queries; ++q)
        {
            make_query(b, copies, q);
            double start = bench_now();
            RfPatchMatch match = ways[w].search(b);
            seconds += bench_now() - start;
            if (w == 0)
                truth[q] = match;
            agreeing += match.x == truth[q].x && match.y == truth[q].y;
        }
        for (int i = 0; i < b->box->side * b->box->side; ++i)
            known += b->weights[i] > 0;
        printf("%s,%d,%s,%.3f,%d of %d\n", b->box->name, known, ways[w].name, seconds / s->queries, agreeing,
               s->queries);
        fflush(stdout);
    }
    rf_windows_destroy(b->windows);
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.exemplar = "builtin:canes", .size = 128, .queries = 50, .only = ""};
    for (int i = 1; i < argc; ++i)
    {
        const char *value;
        if ((value = bench_value(argv[i], "exemplar")))
            s->exemplar = value;
        else if ((value = bench_value(argv[i], "size")))
            s->size = atoi(value);
        else if ((value = bench_value(argv[i], "queries")))
            s->queries = atoi(value);
        else if ((value = bench_value(argv[i], "only")))
            s->only = value;
        else
        {
            fprintf(stderr, "bench_patches: no option called %s\n", argv[i]);
            exit(2);
        }
    }
    if (s->size < 64 || s->size > 256 || s->queries < 1 || s->queries > MAX_QUERIES)
    {
        fprintf(stderr, "bench_patches: size= is 64 to 256, queries= 1 to %d\n", MAX_QUERIES);
        exit(2);
    }
}

int main(int argc, char **argv)
{
    Settings settings;
    parse(argc, argv, &settings);
    rf_set_threads(1);
    char path[256];
    snprintf(path, sizeof path, "%s?size=%d", settings.exemplar, settings.size);
    RfImage *image;
    RfExemplar *exemplar;
    bench_require(rf_image_read(path, &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_YES, &exemplar));
    RfComparison comparison;
    RfSampler sampler;
    RfTurnedCopies copies;
    bench_require(rf_comparison_create(exemplar, &comparison));
    bench_require(rf_sampler_create(exemplar, &sampler));
    bench_require(rf_turned_copies_create(&sampler, &comparison, 0, COPIES, 32 + 2 * BORDER, &copies));
    Bench *bench = need(calloc(1, sizeof *bench));
    take_picture(&copies, bench);
    prepare_fft(bench);
    printf("box,known pixels,way,ms a query,agreeing\n");
    for (size_t i = 0; i < sizeof g_boxes / sizeof g_boxes[0]; ++i)
    {
        bench->box = &g_boxes[i];
        if (strstr(bench->box->name, settings.only))
            measure(bench, &copies, &settings);
    }
    for (int c = 0; c <= bench->channels; ++c)
        free(bench->spectra[c]);
    free(bench->forward);
    free(bench->backward);
    free(bench->spectrum);
    free(bench->sum);
    free(bench->plane);
    free(bench->pixels);
    free(bench->valid);
    free(bench->penalties);
    free(bench);
    rf_turned_copies_free(&copies);
    rf_sampler_free(&sampler);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
    return 0;
}
