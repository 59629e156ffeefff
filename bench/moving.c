// SPDX-License-Identifier: Apache-2.0
// What does a frame of flow-guided texture optimisation cost, and which part of it?
//
//   bench_moving [frames=60] [size=512] [exemplar=FILE] [only=TEXT]
//
// CSV: flow,exemplar,threads,first ms,ms (median after the first),worst ms,carry,renew,draw (medians),patches a frame.
// The flows are built in: vortex, turbulence, cylinder; without exemplar= lava and pebbles of 256 x 256. The machine
// may be shared, so compare figures of one run only.
#include "bench.h"
#include "riffle/riffle.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    THREADS = 2,
    STAGES = 4,
    MAX_FRAMES = 2000
};

typedef struct Settings
{
    int frames, size;
    const char *exemplar, *only;
} Settings;

typedef struct Times
{
    int count;
    double first, patches, of[STAGES][MAX_FRAMES];
} Times;

static void keep(Times *times, const RfOptimize *optimize, double seconds)
{
    RfOptimizeStats stats = rf_optimize_stats(optimize);
    const double parts[STAGES] = {seconds, stats.carry_seconds, stats.search_seconds, stats.draw_seconds};
    for (int i = 0; i < STAGES; ++i)
        times->of[i][times->count] = parts[i];
    times->patches += stats.patches;
    ++times->count;
}

static void run(const Settings *s, RfFlow *flow, const RfExemplar *exemplar, const RfImageView *frame, Times *times)
{
    RfOptimizeOptions options = rf_optimize_defaults();
    RfOptimize *optimize;
    bench_require(rf_optimize_create(exemplar, &options, &optimize));
    *times = (Times){0};
    for (int f = 0; f < s->frames; ++f)
    {
        RfFlowView view;
        bench_require(rf_flow_at(flow, rf_flow_info(flow).first_frame + f, &view));
        double start = bench_now();
        bench_require(rf_optimize_step(optimize, &view, frame));
        double seconds = 1e-3 * (bench_now() - start);
        if (f == 0)
            times->first = seconds;
        else
            keep(times, optimize, seconds);
    }
    rf_optimize_destroy(optimize);
}

static void print(const char *flow, const char *exemplar, int threads, Times *times)
{
    for (int i = 0; i < STAGES; ++i)
        qsort(times->of[i], (size_t)times->count, sizeof(double), bench_by_size);
    int last = times->count - 1, middle = times->count / 2;
    printf("%s,%s,%d,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n", flow, exemplar, threads, 1e3 * times->first,
           1e3 * times->of[0][middle], 1e3 * times->of[0][last], 1e3 * times->of[1][middle], 1e3 * times->of[2][middle],
           1e3 * times->of[3][middle], times->patches / times->count);
    fflush(stdout);
}

static void measure(const Settings *s, const char *flow_name, const char *exemplar_name)
{
    static Times times;
    char path[128];
    RfImage *image, *frame;
    RfExemplar *exemplar;
    bench_require(rf_image_read(exemplar_name, &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar));
    bench_require(rf_image_create(s->size, s->size, map.image.channels, &frame));
    RfImageView view = rf_image_view(frame);
    snprintf(path, sizeof path, "builtin:%s?size=%dx%d", flow_name, s->size, s->size);
    for (int threads = 1; threads <= THREADS; ++threads)
    {
        RfFlowReadOptions reading = rf_flow_read_defaults();
        RfFlow *flow;
        rf_set_threads(threads);
        bench_require(rf_flow_open(path, &reading, &flow));
        run(s, flow, exemplar, &view, &times);
        print(flow_name, exemplar_name, threads, &times);
        rf_flow_close(flow);
    }
    rf_image_destroy(frame);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.frames = 60, .size = 512, .only = ""};
    for (int i = 1; i < argc; ++i)
    {
        const char *value;
        if ((value = bench_value(argv[i], "frames")))
            s->frames = atoi(value);
        else if ((value = bench_value(argv[i], "size")))
            s->size = atoi(value);
        else if ((value = bench_value(argv[i], "exemplar")))
            s->exemplar = value;
        else if ((value = bench_value(argv[i], "only")))
            s->only = value;
        else
        {
            fprintf(stderr, "bench_moving: no option called %s\n", argv[i]);
            exit(2);
        }
    }
    if (s->frames < 2 || s->frames > MAX_FRAMES || s->size < 8)
    {
        fprintf(stderr, "bench_moving: frames= is 2 to %d, size= 8 or more\n", MAX_FRAMES);
        exit(2);
    }
}

int main(int argc, char **argv)
{
    static const char *const flows[] = {"vortex", "turbulence", "cylinder"};
    static const char *const exemplars[] = {"builtin:lava", "builtin:pebbles"};
    Settings settings;
    parse(argc, argv, &settings);
    printf("flow,exemplar,threads,first ms,ms,worst ms,carry ms,renew ms,draw ms,patches a frame\n");
    for (int f = 0; f < 3; ++f)
        for (int e = 0; e < (settings.exemplar ? 1 : 2) && strstr(flows[f], settings.only); ++e)
            measure(&settings, flows[f], settings.exemplar ? settings.exemplar : exemplars[e]);
    return 0;
}
