// SPDX-License-Identifier: Apache-2.0
// What do the measures cost? CSV on stdout: size,threads,what,ms (the least of three steps). "cheap" is flicker,
// spectrum, contrast and coverage; the others are what the flow error and the patch distance add to it.
//
//   bench_measure [size=256] [exemplar=256]

#include "bench.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    STEPS = 4
};

typedef struct Inputs
{
    RfImageView exemplar, frame;
    float *velocity;
} Inputs;

// Noise stands for any texture: the search of windows then finds nothing near, which is its slow case.
static RfImageView draw(int size, uint64_t seed)
{
    size_t count = (size_t)size * (size_t)size;
    float *grey = malloc(count * sizeof *grey), *colour = malloc(3 * count * sizeof *colour);
    if (!grey || !colour)
        exit(1);
    scene_noise(size, size, 0.02f, 0.2f, seed, grey);
    for (size_t k = 0; k < 3 * count; ++k)
        colour[k] = grey[k / 3] * (0.6f + 0.2f * (float)(k % 3));
    free(grey);
    return (RfImageView){colour, size, size, 3, 3 * size};
}

static double least_step(const Inputs *in, RfMeasureOptions options)
{
    RfMeasure *measure;
    RfMeasureFrame result;
    double least = 1e30;
    bench_require(rf_measure_create(&in->exemplar, &options, &measure));
    for (int i = 0; i < STEPS; ++i)
    {
        RfFlowView flow = {.width = in->frame.width, .height = in->frame.height, .velocity = in->velocity, .time = i};
        double start = bench_now();
        bench_require(rf_measure_step(measure, &flow, NULL, &in->frame, &result));
        double took = bench_now() - start;
        // The first step has no predecessor, and prepares.
        least = i > 0 && took < least ? took : least;
    }
    rf_measure_destroy(measure);
    return least;
}

static void run(const Inputs *in, int threads)
{
    rf_set_threads(threads);
    RfMeasureOptions options = rf_measure_defaults();
    options.flow_every = options.patch_every = 0;
    double cheap = least_step(in, options);
    printf("%d,%d,cheap,%.1f\n", in->frame.width, threads, cheap);
    options.flow_every = 1;
    printf("%d,%d,flow error by inverse search,%.1f\n", in->frame.width, threads, least_step(in, options) - cheap);
    options.estimator = RF_MEASURE_LUCAS_KANADE;
    printf("%d,%d,flow error by Lucas and Kanade,%.1f\n", in->frame.width, threads, least_step(in, options) - cheap);
    options.flow_every = 0;
    options.patch_every = 1;
    printf("%d,%d,patch distance,%.1f\n", in->frame.width, threads, least_step(in, options) - cheap);
}

int main(int argc, char **argv)
{
    int size = 256, exemplar = 256;
    for (int i = 1; i < argc; ++i)
        if (strncmp(argv[i], "size=", 5) == 0)
            size = atoi(argv[i] + 5);
        else if (strncmp(argv[i], "exemplar=", 9) == 0)
            exemplar = atoi(argv[i] + 9);
    Inputs in = {draw(exemplar, 1), draw(size, 2), malloc(2 * sizeof(float) * (size_t)size * (size_t)size)};
    if (!in.velocity)
        return 1;
    scene_two_vortices(size, size, 0, in.velocity);
    run(&in, 1);
    run(&in, 2);
    free(in.exemplar.pixels);
    free(in.frame.pixels);
    free(in.velocity);
    return 0;
}
