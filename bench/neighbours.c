// SPDX-License-Identifier: Apache-2.0
// How fast is an exact search for nearest windows? CSV on stdout: case,size,threads,stage,ms (median of n runs),n,
// floor of 32 numbers ms,floor of all numbers ms,floor of 32 short integers ms,GFLOP/s (of the floor of 32: what the
// whole search amounts to).
//
//   bench_neighbours [runs=5] [case=TEXT] [components=N] [picture=FILE]
//
// The floors are measured in the same run, one of each after every search: the bare blocked comparison of as many
// queries and candidates of 32 numbers, or of all a window has, the minimum kept in registers, and nothing else: no
// projection, no index, no full comparison. The search is measured against the floors in floats; that in 16-bit
// integers (where the machine multiplies these twice as fast: RF_SIMD=avx512 does without) is what its own comparison
// could come to. The machine may be shared, so compare figures of one run only.
//
// Queries are made as texture optimisation makes them: windows of pictures patched together from the exemplar, sharp
// (blocks), noisy (blocks and 4 % noise), blurred, or blended (overlapping blocks, averaged).

#include "kernels/neighbours.h"
#include "bench.h"
#include "core/random.h"
#include "core/simd.h"
#include "kernels/short_bounds.h"
#include "riffle/riffle.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef __x86_64__
#include <immintrin.h>
#endif

enum
{
    QUERY_SIDE = 128,
    QUERIES = QUERY_SIDE * QUERY_SIDE,
    MAX_RUNS = 100,
    BLOCK = 14
};

// ---- floors ------------------------------------------------------------------------------------------------------

#ifdef __x86_64__
// least[q][16] over all candidates of 12 queries[k][12], candidates[tile][k][32]
__attribute__((target("avx512f"))) static void panel_floor_avx512(const float *queries, const float *candidates,
                                                                  int tiles, int numbers, float *least)
{
    for (int t = 0; t < tiles; ++t)
    {
        __m512 left[12], right[12];
        for (int q = 0; q < 12; ++q)
            left[q] = right[q] = _mm512_setzero_ps();
        const float *number = queries;
        for (int k = 0; k < numbers; ++k, candidates += 32, number += 12)
        {
            __m512 l = _mm512_loadu_ps(candidates), r = _mm512_loadu_ps(candidates + 16);
#pragma GCC unroll 12
            for (int q = 0; q < 12; ++q)
            {
                __m512 n = _mm512_set1_ps(number[q]);
                left[q] = _mm512_fmadd_ps(n, l, left[q]);
                right[q] = _mm512_fmadd_ps(n, r, right[q]);
            }
        }
#pragma GCC unroll 12
        for (int q = 0; q < 12; ++q)
            _mm512_storeu_ps(least + 16 * q,
                             _mm512_min_ps(_mm512_loadu_ps(least + 16 * q), _mm512_min_ps(left[q], right[q])));
    }
}

// The same in two halves of 6 queries and two of 16 candidates: 12 sums fit its 16 registers.
__attribute__((target("avx2,fma"))) static void panel_floor_avx2(const float *queries, const float *candidates,
                                                                 int tiles, int numbers, float *least)
{
    for (int piece = 0; piece < 4 * tiles; ++piece)
    {
        __m256 left[6], right[6];
        for (int q = 0; q < 6; ++q)
            left[q] = right[q] = _mm256_setzero_ps();
        const float *number = queries + piece % 2 * 6,
                    *from = candidates + (size_t)(piece / 4) * (size_t)numbers * 32 + piece / 2 % 2 * 16;
        float *out = least + piece % 2 * 6 * 16;
        for (int k = 0; k < numbers; ++k, from += 32, number += 12)
        {
            __m256 l = _mm256_loadu_ps(from), r = _mm256_loadu_ps(from + 8);
#pragma GCC unroll 6
            for (int q = 0; q < 6; ++q)
            {
                __m256 n = _mm256_set1_ps(number[q]);
                left[q] = _mm256_fmadd_ps(n, l, left[q]);
                right[q] = _mm256_fmadd_ps(n, r, right[q]);
            }
        }
#pragma GCC unroll 6
        for (int q = 0; q < 6; ++q)
            _mm256_storeu_ps(out + 16 * q,
                             _mm256_min_ps(_mm256_loadu_ps(out + 16 * q), _mm256_min_ps(left[q], right[q])));
    }
}
#endif

// ms of the bare comparison, or NAN where there is none for the instruction set.
static double comparison_floor(const float *queries, const float *candidates, int tiles, int numbers, int threads)
{
#ifdef __x86_64__
    static float least[QUERIES / 12 + 1][12 * 16];
    if (rf_simd_level() == RF_SIMD_PLAIN)
        return NAN;
    bool wide = rf_simd_level() == RF_SIMD_AVX512;
    double start = bench_now();
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (int panel = 0; panel < QUERIES / 12 + 1; ++panel)
        (wide ? panel_floor_avx512 : panel_floor_avx2)(queries + (size_t)panel * 12 * (size_t)numbers, candidates,
                                                       tiles, numbers, least[panel]);
    return bench_now() - start;
#else
    return NAN;
#endif
}

// ms of as many tiles in integers of any value as the search goes through, by its own kernel, written and not looked
// at; NAN where floats are as fast. 32 numbers are 16 floats' worth.
static double short_floor(const float *queries, const float *candidates, int tiles, int threads)
{
    static _Alignas(64) int32_t starts[RF_TILE_CANDIDATES];
    if (!rf_simd_multiplies_shorts())
        return NAN;
    double start = bench_now();
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (int panel = 0; panel < QUERIES / RF_TILE_QUERIES + 1; ++panel)
    {
        _Alignas(64) float scores[RF_TILE_QUERIES * RF_TILE_CANDIDATES];
        _Alignas(64) int16_t numbers[RF_TILE_QUERIES * RF_KEPT_STRIDE];
        memcpy(numbers, queries + (size_t)panel * RF_TILE_QUERIES * 16, sizeof numbers);
        for (int t = 0; t < tiles; ++t)
            rf_short_products(numbers,
                              (const int16_t *)(const void *)(candidates + (size_t)t * RF_TILE_CANDIDATES * 16), 16,
                              starts, scores, RF_TILE_CANDIDATES);
    }
    return bench_now() - start;
}

// ---- queries -----------------------------------------------------------------------------------------------------

typedef struct Picture
{
    float *pixels;
    int width, height, channels;
} Picture;

static Picture make_picture(int width, int height, int channels)
{
    return (Picture){calloc((size_t)width * (size_t)height * (size_t)channels, sizeof(float)), width, height, channels};
}

static RfImageView view_of(const Picture *p)
{
    return (RfImageView){p->pixels, p->width, p->height, p->channels, (ptrdiff_t)p->width * p->channels};
}

// The first channels of the middle of a built-in picture or a file.
static Picture read_picture(const char *name, int size, int channels)
{
    RfImage *image;
    bench_require(rf_image_read(name, &image));
    RfImageView from = rf_image_view(image);
    Picture p = make_picture(size, size, channels);
    int left = from.width > size ? (from.width - size) / 2 : 0, top = from.height > size ? (from.height - size) / 2 : 0;
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            for (int k = 0; k < channels; ++k)
                p.pixels[(y * size + x) * channels + k] =
                    from.pixels[(y + top) % from.height * from.row_stride + (x + left) % from.width * from.channels +
                                k % from.channels];
    rf_image_destroy(image);
    return p;
}

// Adds blocks of the exemplar, one every `step` pixels.
static void add_blocks(const Picture *exemplar, int step, Picture *out)
{
    for (int by = 0; by < out->height; by += step)
        for (int bx = 0; bx < out->width; bx += step)
        {
            uint64_t item = (uint64_t)(by * out->width + bx);
            int u = (int)rf_random_below((uint32_t)(exemplar->width - BLOCK), 1, 0, item, 0),
                v = (int)rf_random_below((uint32_t)(exemplar->height - BLOCK), 1, 0, item, 1);
            for (int y = 0; y < BLOCK && by + y < out->height; ++y)
                for (int x = 0; x < BLOCK && bx + x < out->width; ++x)
                    for (int k = 0; k < out->channels; ++k)
                        out->pixels[((by + y) * out->width + bx + x) * out->channels + k] +=
                            exemplar->pixels[((v + y) * exemplar->width + u + x) * exemplar->channels + k];
        }
}

static void blur(Picture *p)
{
    size_t count = (size_t)p->width * (size_t)p->height * (size_t)p->channels;
    float *from = malloc(count * sizeof *from);
    memcpy(from, p->pixels, count * sizeof *from);
    for (int y = 1; y < p->height - 1; ++y)
        for (int x = 1; x < p->width - 1; ++x)
            for (int k = 0; k < p->channels; ++k)
            {
                float sum = 0;
                for (int j = -1; j <= 1; ++j)
                    for (int i = -1; i <= 1; ++i)
                        sum += (float)((2 - abs(i)) * (2 - abs(j))) *
                               from[((y + j) * p->width + x + i) * p->channels + k] / 16;
                p->pixels[(y * p->width + x) * p->channels + k] = sum;
            }
    free(from);
}

static float *make_queries(const char *kind, const Picture *exemplar, int side)
{
    int size = QUERY_SIDE + side - 1, step = strcmp(kind, "blended") == 0 ? BLOCK / 2 : BLOCK;
    Picture picture = make_picture(size, size, exemplar->channels);
    size_t count = (size_t)size * (size_t)size * (size_t)picture.channels;
    add_blocks(exemplar, step, &picture);
    if (strcmp(kind, "blended") == 0)
        for (size_t i = 0; i < count; ++i)
            picture.pixels[i] *= 0.25f;
    if (strcmp(kind, "noisy") == 0)
        for (size_t i = 0; i < count; ++i)
            picture.pixels[i] += 0.08f * (rf_random_float(2, 0, i, 0) + rf_random_float(2, 0, i, 1) - 1);
    if (strcmp(kind, "blurred") == 0)
        blur(&picture);
    float *windows = malloc((size_t)QUERIES * (size_t)(side * side * picture.channels) * sizeof *windows);
    static int corners[QUERIES][2];
    for (int i = 0; i < QUERIES; ++i)
    {
        corners[i][0] = i % QUERY_SIDE;
        corners[i][1] = i / QUERY_SIDE;
    }
    RfWindowSource source = {.image = view_of(&picture)};
    bench_require(rf_windows_gather(&source, side, false, (const int(*)[2])corners, QUERIES, windows, NULL));
    free(picture.pixels);
    return windows;
}

// ---- cases -------------------------------------------------------------------------------------------------------

typedef struct Case
{
    const char *picture;
    int size, side, channels;
} Case;

static int g_runs = 5, g_components = 0;

static float *make_numbers(size_t count)
{
    float *numbers = aligned_alloc(64, (count * sizeof *numbers + 63) / 64 * 64);
    for (size_t i = 0; i < count; ++i)
        numbers[i] = rf_random_float(3, 0, i, 0) - 0.5f;
    return numbers;
}

static void run(const Case *test, const char *kind, const Picture *exemplar, int threads)
{
    double search[MAX_RUNS], create[MAX_RUNS], few[MAX_RUNS], all[MAX_RUNS], shorts[MAX_RUNS];
    rf_set_threads(threads);
    RfWindowSource source = {.image = view_of(exemplar)};
    RfWindowOptions options = {.side = test->side, .components = g_components};
    RfWindowDatabase *database;
    int numbers = test->side * test->side * test->channels;
    float *windows = make_queries(kind, exemplar, test->side);
    RfWindowQueries queries = {.count = QUERIES, .windows = windows};
    RfWindowMatch *matches = malloc(QUERIES * sizeof *matches);
    size_t tiles = ((size_t)(test->size - test->side + 1) * (size_t)(test->size - test->side + 1) + 31) / 32;
    float *query_numbers = make_numbers((size_t)(QUERIES + 12) * (size_t)(numbers > 32 ? numbers : 32)),
          *candidate_numbers = make_numbers(tiles * 32 * (size_t)(numbers > 32 ? numbers : 32));
    float kept = 0;
    int components = 0, candidates = 0;
    int runs = test->side > 9 ? 3 : g_runs; // these take seconds
    for (int r = 0; r < runs; ++r)
    {
        double start = bench_now();
        bench_require(rf_windows_create(&source, 1, &options, &database));
        create[r] = bench_now() - start;
        start = bench_now();
        bench_require(rf_windows_search(database, &queries, matches));
        search[r] = bench_now() - start;
        few[r] = comparison_floor(query_numbers, candidate_numbers, (int)tiles, 32, threads);
        shorts[r] = short_floor(query_numbers, candidate_numbers, (int)tiles, threads);
        all[r] = r < 3 ? comparison_floor(query_numbers, candidate_numbers, (int)tiles, numbers, threads) : all[r % 3];
        components = rf_windows_components(database, &kept);
        candidates = rf_windows_count(database);
        rf_windows_destroy(database);
    }
    double search_ms = bench_median(search, runs), few_ms = bench_median(few, runs), all_ms = bench_median(all, runs),
           shorts_ms = bench_median(shorts, runs), flops = 2.0 * 32 * (double)tiles * 32 * QUERIES;
    const char *name = strrchr(test->picture, '/') ? strrchr(test->picture, '/') + 1 : test->picture;
    printf("%s %s (%dx%dx%d; %d components: %.1f %%),%dx%d,%d,search,%.2f,%d,%.2f,%.2f,%.2f,%.0f\n", name, kind,
           test->side, test->side, test->channels, components, (double)kept * 100, QUERIES, candidates, threads,
           search_ms, runs, few_ms, all_ms, shorts_ms, flops / search_ms * 1e-6);
    printf("%s %s (%dx%dx%d; %d components: %.1f %%),%d,%d,create,%.2f,%d,,,,\n", name, kind, test->side, test->side,
           test->channels, components, (double)kept * 100, candidates, threads, bench_median(create, runs), runs);
    printf("# %s %s: %.0f %% of the speed of the floor of 32 (%.0f GFLOP/s), %.1f times that of all\n", name, kind,
           100 * few_ms / search_ms, flops / few_ms * 1e-6, all_ms / search_ms);
    fflush(stdout);
    free(windows);
    free(matches);
    free(query_numbers);
    free(candidate_numbers);
}

int main(int argc, char **argv)
{
    const char *only = "", *picture = NULL;
    for (int i = 1; i < argc; ++i)
    {
        if (strncmp(argv[i], "runs=", 5) == 0)
            g_runs = atoi(argv[i] + 5);
        if (strncmp(argv[i], "case=", 5) == 0)
            only = argv[i] + 5;
        if (strncmp(argv[i], "picture=", 8) == 0)
            picture = argv[i] + 8;
        if (strncmp(argv[i], "components=", 11) == 0)
            g_components = atoi(argv[i] + 11);
    }
    g_runs = g_runs < 3 ? 3 : g_runs > MAX_RUNS ? MAX_RUNS : g_runs;
    static const Case cases[] = {{"builtin:bubbles", 64, 9, 2},
                                 {"builtin:foam", 64, 9, 2},
                                 {"builtin:foam", 128, 9, 3},
                                 {"builtin:pebbles", 128, 5, 3},
                                 {"builtin:lava", 136, 17, 3}};
    static const char *const kinds[] = {"sharp", "noisy", "blurred", "blended"};
    printf("case,size,threads,stage,ms,runs,floor of 32 ms,floor of all ms,floor of 32 shorts ms,GFLOP/s\n");
    for (size_t i = 0; i < sizeof cases / sizeof cases[0] * 8; ++i)
    {
        Case test = cases[i / 8];
        test.picture = picture ? picture : test.picture;
        const char *kind = kinds[i / 2 % 4];
        char label[64];
        snprintf(label, sizeof label, "%zu%s%zu", i / 8, kind, i % 2 + 1);
        if (!strstr(label, only))
            continue;
        Picture exemplar = read_picture(test.picture, test.size, test.channels);
        run(&test, kind, &exemplar, (int)(i % 2) + 1);
        free(exemplar.pixels);
    }
    return 0;
}
