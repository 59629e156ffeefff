// SPDX-License-Identifier: Apache-2.0
// Judges a method of texture advection on the two-vortex scene: flow error by the fine estimator and by inverse search
// ("dis"), over the frame's own floor and over the exemplar's; spectrum distance over its floor; flicker and contrast.
// "product" is the inverse search's ratio times the spectrum's.
//
//   bench_quality [EXEMPLAR] [size=256] [frames=200] [every=10] [out=FOLDER] [label=TEXT]
//   [method=lagrangian|paper|eulerian|dual|sprites|warp] [OPTION=VALUE ...]
//
// EXEMPLAR is an image or a built-in one; an OPTION is any of the method's and stands behind it; `paper` is lagrangian
// with the paper's constants (preset=paper says the same). One CSV line on stdout; with out= every
// `every`-th frame as a PNG there.

#include "riffle/riffle.h"
#include "support/scenes.h"
#include "support/steppers.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct Settings
{
    const char *exemplar, *out, *label;
    int size, frames, every;
    const Stepper *method;
    StepperOptions options;
} Settings;

static void fail(const char *what)
{
    fprintf(stderr, "bench_quality: %s: %s: %s\n", what, rf_last_error()->file, rf_last_error()->message);
    exit(1);
}

static void set_method(Settings *s, const char *name)
{
    s->method = stepper_find(name);
    if (!s->method)
    {
        fprintf(stderr, "bench_quality: no method called %s\n", name);
        exit(2);
    }
    s->options = s->method->defaults();
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.exemplar = "builtin:foam", .label = "", .size = 256, .frames = 200, .every = 10};
    set_method(s, "lagrangian");
    for (int i = 1; i < argc; ++i)
    {
        char *equals = strchr(argv[i], '=');
        if (!equals || strncmp(argv[i], "builtin:", 8) == 0)
        {
            s->exemplar = argv[i];
            continue;
        }
        *equals = '\0';
        const char *value = equals + 1;
        if (strcmp(argv[i], "size") == 0)
            s->size = atoi(value);
        else if (strcmp(argv[i], "frames") == 0)
            s->frames = atoi(value);
        else if (strcmp(argv[i], "every") == 0)
            s->every = atoi(value);
        else if (strcmp(argv[i], "out") == 0)
            s->out = value;
        else if (strcmp(argv[i], "label") == 0)
            s->label = value;
        else if (strcmp(argv[i], "method") == 0)
            set_method(s, value);
        else if (strcmp(argv[i], "preset") == 0)
            set_method(s, strcmp(value, "paper") == 0 ? "paper" : "lagrangian");
        else if (!stepper_set(s->method, &s->options, argv[i], value))
        {
            fprintf(stderr, "bench_quality: no option called %s\n", argv[i]);
            exit(2);
        }
    }
    RfOptionKind kind;
    float *radius = stepper_field(s->method, &s->options, "particle-radius", &kind);
    if (radius && *radius == 0 && strcmp(s->method->name, "sprites") != 0)
        *radius = (float)s->size / 8;
}

// What a run is made of, and what it has summed up.
typedef struct Run
{
    Settings settings;
    RfImage *image, *frame_image;
    RfExemplar *exemplar;
    void *method;
    RfImageView pixels, frame;
    SceneMoments scene;
    /// By inverse search, which also judges the rest, and by the finer estimator.
    RfMeasure *dis, *fine;

    /// Sums, for ratios of means.
    RfMeasureFlow dis_sum, fine_sum;
    double spectrum, spectrum_floor, flicker, flicker_floor, pop, contrast, histogram;
    double ms, layers, live, fading, born;
    int64_t holes;
    int judged;
} Run;

static RfMeasure *make_measure(const Run *run, RfMeasureEstimator estimator)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.estimator = estimator;
    options.flow_every = 1;
    options.patch_every = 0;
    RfMeasure *measure;
    if (rf_measure_create(&run->pixels, &options, &measure) != RF_OK)
        fail("measure");
    return measure;
}

static void start(Run *run)
{
    const Settings *s = &run->settings;
    if (rf_image_read(s->exemplar, &run->image) != RF_OK)
        fail(s->exemplar);
    run->pixels = rf_image_view(run->image);
    int channels = run->pixels.channels, size = s->size;
    RfMapView map = {"colour", channels == 1 || channels == 3 ? RF_MAP_COLOUR : RF_MAP_DATA, run->pixels, 1};
    if (rf_exemplar_create(&map, 1, RF_TILING_AUTO, &run->exemplar) != RF_OK ||
        s->method->create(run->exemplar, &s->options, &run->method) != RF_OK ||
        rf_image_create(size, size, channels, &run->frame_image) != RF_OK)
        fail("create");
    rf_image_set_origin(run->frame_image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    run->frame = rf_image_view(run->frame_image);
    run->dis = make_measure(run, RF_MEASURE_INVERSE_SEARCH);
    run->fine = make_measure(run, RF_MEASURE_LUCAS_KANADE);
    run->scene = scene_moments(scene_two_vortices, size, size);
}

static void finish(Run *run)
{
    scene_moments_free(&run->scene);
    run->settings.method->destroy(run->method);
    rf_exemplar_destroy(run->exemplar);
    rf_image_destroy(run->image);
    rf_image_destroy(run->frame_image);
    rf_measure_destroy(run->dis);
    rf_measure_destroy(run->fine);
}

static void add_stats(Run *run, int frame, double seconds)
{
    const Settings *s = &run->settings;
    if (frame > 1)
        run->ms += 1e3 * seconds / (s->frames - 1);
    if (!s->method->stats)
        return;
    RfLagrangianStats stats = s->method->stats(run->method);
    double share = 1.0 / s->frames;
    run->holes += stats.holes;
    run->layers += share * (double)stats.layers;
    run->live += share * stats.live;
    run->fading += share * stats.fading;
    run->born += frame > 1 ? share * stats.born : 0;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void keep_frame(const Run *run, int frame)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%sframe.%04d.png", run->settings.out, run->settings.label, frame);
    if (rf_image_write(path, run->frame_image) != RF_OK)
        fail(path);
}

static void add_flow(RfMeasureFlow *sum, const RfMeasureFlow *e)
{
    sum->error += e->error;
    sum->floor += e->floor;
    sum->exemplar_floor += e->exemplar_floor;
}

// Without a flow: the frame only makes the next one's predecessor.
static RfMeasureFrame look(Run *run, const RfFlowView *flow)
{
    RfMeasureFrame fine, dis;
    if (rf_measure_step(run->fine, flow, NULL, &run->frame, &fine) != RF_OK ||
        rf_measure_step(run->dis, flow, NULL, &run->frame, &dis) != RF_OK)
        fail("measure");
    if (flow)
    {
        add_flow(&run->fine_sum, &fine.flow);
        add_flow(&run->dis_sum, &dis.flow);
    }
    return dis;
}

static void judge(Run *run, const RfFlowView *flow)
{
    RfMeasureFrame m = look(run, flow);
    run->spectrum += m.spectrum.distance;
    run->spectrum_floor += m.spectrum.floor;
    run->flicker += m.flicker.whole;
    run->flicker_floor += m.flicker.floor;
    run->pop = m.flicker.block > run->pop ? m.flicker.block : run->pop;
    run->contrast += m.contrast.luma;
    run->histogram += m.contrast.histogram_mover;
    ++run->judged;
}

static void report(const Run *run)
{
    const RfMeasureFlow *fine = &run->fine_sum, *dis = &run->dis_sum;
    double n = run->judged, spectrum_ratio = run->spectrum / run->spectrum_floor;
    printf("%s%s,error %.3f px,x%.2f,exemplar x%.2f,dis error %.3f px,x%.2f,exemplar x%.2f,", run->settings.label,
           run->settings.exemplar, fine->error / n, fine->error / fine->floor, fine->error / fine->exemplar_floor,
           dis->error / n, dis->error / dis->floor, dis->error / dis->exemplar_floor);
    printf("spectrum %.2f dB,x%.2f,product %.2f,flicker %.3f,floor %.3f,pop %.2f,contrast %.3f,histogram %.2f,",
           run->spectrum / n, spectrum_ratio, dis->error / dis->floor * spectrum_ratio, run->flicker / n,
           run->flicker_floor / n, run->pop, run->contrast / n, run->histogram / n);
    printf("holes %lld,live %.0f,fading %.0f,born %.2f,layers %.2f,ms %.2f\n", (long long)run->holes, run->live,
           run->fading, run->born, run->layers, run->ms);
}

int main(int argc, char **argv)
{
    static Run run;
    parse(argc, argv, &run.settings);
    start(&run);
    int every = run.settings.every;
    for (int f = 1; f <= run.settings.frames; ++f)
    {
        RfFlowView view = scene_step(&run.scene, f);
        double started = now();
        if (run.settings.method->step(run.method, &view, &run.frame) != RF_OK)
            fail("step");
        add_stats(&run, f, now() - started);
        if (run.settings.out && (f - 1) % every == 0)
            keep_frame(&run, f);
        if (f % every == 0 && f > 1)
            judge(&run, &view);
        else if ((f + 1) % every == 0)
            look(&run, NULL);
    }
    report(&run);
    finish(&run);
    return 0;
}
