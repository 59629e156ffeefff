// SPDX-License-Identifier: Apache-2.0
// How fast is a step? CSV on stdout: case,size,threads,stage,ms (median of n frames),n,copy floor ms,sampling floor ms.
//
//   bench_speed [frames=60] [case=N]      N from 1: that case alone
//
// The floors are measured in the same run, after every fifth frame: copying a frame, and one bilinear RGBA sample a
// drawn sample, no weights, no edges. The machine may be shared, so compare figures of one run only.

#include "bench.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    SIZE = 1024,
    TEXTURE = 512,
    MAX_FRAMES = 2000
};

typedef float Vec4 __attribute__((vector_size(16)));

static double copy_floor(float *to, const float *from, size_t floats, int threads)
{
    double start = bench_now();
#pragma omp parallel for num_threads(threads)
    for (int part = 0; part < threads; ++part)
        memcpy(to + floats * (size_t)part / (size_t)threads, from + floats * (size_t)part / (size_t)threads,
               floats / (size_t)threads * sizeof *to);
    return bench_now() - start;
}

// Rows of a frame, each sampled along a slightly turned line of the texture, `layers` times over.
static double sampling_floor(const Vec4 *texture, Vec4 *frame, float layers, int threads)
{
    double start = bench_now();
    int rows = (int)((float)SIZE * layers);
#pragma omp parallel for num_threads(threads) schedule(dynamic, 16)
    for (int row = 0; row < rows; ++row)
    {
        int y = row % SIZE;
        for (int x = 0; x < SIZE; ++x)
        {
            float u = (float)x * 1.9f + (float)y * 0.1f, v = (float)y * 1.9f - (float)x * 0.1f + 200;
            int i = (int)u, j = (int)v;
            float fx = u - (float)i, fy = v - (float)j;
            i &= TEXTURE - 1;
            j &= TEXTURE - 1;
            const Vec4 *t = texture + (size_t)j * (TEXTURE + 1) + (size_t)i;
            Vec4 upper = t[0] + fx * (t[1] - t[0]), lower = t[TEXTURE + 1] + fx * (t[TEXTURE + 2] - t[TEXTURE + 1]);
            frame[(size_t)y * SIZE + (size_t)x] += upper + fy * (lower - upper);
        }
    }
    return bench_now() - start;
}

// The two-vortex scene in slow motion: 3 pixels a frame at most where it is drawn four times as large as it is given.
static void slow_vortices(int w, int h, double frame, float *velocity)
{
    scene_two_vortices(w, h, frame / 4, velocity);
    for (int k = 0; k < 2 * w * h; ++k)
        velocity[k] *= 0.25f;
}

typedef struct Case
{
    const char *name;
    SceneFlow *flow;
    RfLagrangianOptions options;
} Case;

// Returns the median ms of a whole step.
static double run(const RfExemplar *exemplar, const Case *test, int threads, int frames)
{
    const char *name = test->name;
    const RfLagrangianOptions options = test->options;
    static double stage[4][MAX_FRAMES], copies[MAX_FRAMES], samplings[MAX_FRAMES];
    static const char *const names[4] = {"advect", "distribute", "draw", "all"};
    RfLagrangian *lagrangian;
    RfImage *image;
    bench_require(rf_lagrangian_create(exemplar, &options, &lagrangian));
    bench_require(rf_image_create(SIZE, SIZE, 3, &image));
    RfImageView frame = rf_image_view(image);
    float *copy = malloc((size_t)SIZE * SIZE * 3 * sizeof *copy);
    Vec4 *texture = aligned_alloc(64, (TEXTURE + 2) * (TEXTURE + 1) * sizeof *texture + 64),
         *sums = aligned_alloc(64, (size_t)SIZE * SIZE * sizeof *sums);
    memset(texture, 0, (TEXTURE + 2) * (TEXTURE + 1) * sizeof *texture);
    memset(sums, 0, (size_t)SIZE * SIZE * sizeof *sums);
    memset(copy, 0, (size_t)SIZE * SIZE * 3 * sizeof *copy);
    SceneMoments scene = scene_moments(test->flow, 256, 256);
    rf_set_threads(threads);
    float layers = 0;
    int warm_up = 120, live = 0;
    for (int f = 0; f < frames + warm_up; ++f)
    {
        RfFlowView view = scene_step(&scene, f);
        bench_require(rf_lagrangian_step(lagrangian, &view, &frame));
        if (f < warm_up)
            continue;
        RfLagrangianStats s = rf_lagrangian_stats(lagrangian);
        int k = f - warm_up;
        stage[0][k] = 1e3 * s.advect_seconds;
        stage[1][k] = 1e3 * s.distribute_seconds;
        stage[2][k] = 1e3 * s.draw_seconds;
        stage[3][k] = stage[0][k] + stage[1][k] + stage[2][k];
        layers = s.layers;
        live = s.live + s.fading;
        if (k % 5 != 0)
            continue; // They walk over 20 MB: after each frame, they would be measured in the next one's cold caches.
        copies[k / 5] = copy_floor(copy, frame.pixels, (size_t)SIZE * SIZE * 3, threads);
        samplings[k / 5] = sampling_floor(texture, sums, layers, threads);
    }
    double copy_ms = bench_median(copies, (frames + 4) / 5), sampling_ms = bench_median(samplings, (frames + 4) / 5);
    for (int s = 0; s < 4; ++s)
        printf("%s (%d grids; %.1f layers),%dx%d,%d,%s,%.2f,%d,%.2f,%.2f\n", name, live, (double)layers, SIZE, SIZE,
               threads, names[s], bench_median(stage[s], frames), frames, copy_ms, sampling_ms);
    fflush(stdout);
    scene_moments_free(&scene);
    rf_lagrangian_destroy(lagrangian);
    rf_image_destroy(image);
    free(copy);
    free(texture);
    free(sums);
    return bench_median(stage[3], frames);
}

int main(int argc, char **argv)
{
    int frames = 60, only = 0;
    for (int i = 1; i < argc; ++i)
        if (sscanf(argv[i], "frames=%d", &frames) != 1 && sscanf(argv[i], "case=%d", &only) != 1)
            return fprintf(stderr, "bench_speed: %s: must be frames=N or case=N\n", argv[i]), 2;
    frames = frames < 1 ? 1 : frames > MAX_FRAMES ? MAX_FRAMES : frames;
    RfImage *image;
    bench_require(rf_image_read("builtin:bubbles?size=256", &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    RfExemplar *exemplar;
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar));
    printf("case,size,threads,stage,ms,frames,copy floor ms,sampling floor ms\n");
    RfLagrangianOptions options = rf_lagrangian_defaults(), paper = rf_lagrangian_paper();
    options.particle_radius = paper.particle_radius = 80; // about 150 particles in steady state
    RfLagrangianOptions histogram = options;
    histogram.blend = RF_BLEND_HISTOGRAM;
    const Case cases[] = {{"defaults at 3 px a frame", slow_vortices, options},
                          {"defaults at 12 px a frame", scene_two_vortices, options},
                          {"histogram blend at 3 px a frame", slow_vortices, histogram},
                          {"paper at 3 px a frame", slow_vortices, paper}};
    for (int i = 0; i < (int)(sizeof cases / sizeof cases[0]); ++i)
    {
        if (only != 0 && only != i + 1)
            continue;
        double one = run(exemplar, &cases[i], 1, frames), two = run(exemplar, &cases[i], 2, frames);
        printf("# %s: 2 threads are %.2f times as fast as 1\n", cases[i].name, one / two);
    }
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
    return 0;
}
