// SPDX-License-Identifier: Apache-2.0
// Runs every method on every pair of flow and exemplar and judges the frames: CSV on stdout, a line a run, and
// pictures.
//
//   evaluation_run main|sweep [frames=200] [threads=N] [out=FOLDER] [flow=NAME] [exemplar=NAME] [method=LABEL]
//   [set="OPTION=VALUE ..."]
//
// `main`: methods at their defaults (and Eulerian advection with one short and one long latency) on all pairs. `sweep`:
// each method's main parameter, on the flows and exemplars marked below. flow=, exemplar= and method= pick some; set=
// goes to their methods, after what is set here. With out= the last frame of each main run is written there as
// FLOW-EXEMPLAR-LABEL.png.
//
// Columns: set, flow, exemplar, label, parameter, value, ms a frame, then the mean of each quantity of
// rf_measure_quantity_table. Flow error is taken at every 11th frame, patch distance at every
// tenth, flicker at every third, the rest at every one; a sweep leaves patch distance and flicker out.

#include "riffle/riffle.h"
#include "support/steppers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum
{
    SIDE = 256,
    MAX_VALUES = 8
};

typedef struct FlowCase
{
    const char *name, *path;
    // Of the greatest speed, in pixels a frame.
    float speed;
    int width, height, moment_every;
    bool swept;
} FlowCase;

// At most 3 pixels a frame, as in the table of the paper's constants in docs/lagrangian.md.
static const FlowCase flows[] = {
    {"vortex", "builtin:vortex?size=256x256", 3, SIDE, SIDE, 1, true},
    {"turbulence", "builtin:turbulence?size=256x256", 1.8f, SIDE, SIDE, 1, true},
    {"cylinder", "builtin:cylinder?size=256x256", 3, SIDE, SIDE, 1, false},
    {"wind", "$/flows2d/gfs_wind", 3, SIDE, SIDE / 2, 24, false},
};

static const struct
{
    const char *name, *path;
    bool swept;
} exemplars[] = {{"noise", "builtin:noise", true},
                 {"foam", "builtin:foam", true},
                 {"lava", "builtin:lava", false},
                 {"pebbles", "builtin:pebbles", false}};

typedef struct MethodCase
{
    const char *label, *method;
    // Set for every run, "name=value name=value".
    const char *options;
    // The parameter that is swept, and its values.
    const char *parameter;
    double values[MAX_VALUES];
    // Another curve of a method that has its column already.
    bool sweep_only;
} MethodCase;

// Particles at an eighth of the frame's side, and at a sixteenth with the relaxation that suits it.
static const MethodCase methods[] = {
    {"lagrangian", "lagrangian", "particle-radius=32", "relaxation", {0.3, 1.5, 3, 6, 12}, false},
    {"lagrangian fine", "lagrangian", "particle-radius=16 relaxation=7", "relaxation", {0.3, 1.5, 3, 7, 15, 40}, false},
    {"optimize", "optimize", "", NULL, {0}, false},
    {"directional", "directional", "", NULL, {0}, false},
    {"lagrangian radius", "lagrangian", "relaxation=7", "particle-radius", {10, 12, 16, 24}, true},
    {"lagrangian distortion",
     "lagrangian",
     "particle-radius=16 relaxation=7",
     "max-distortion",
     {1.6, 2.6, 3.5, 5},
     true},
    {"eulerian", "eulerian", "", "latency", {6, 12, 24, 48}, false},
    {"eulerian short", "eulerian", "layers=1 latency=12", "latency", {8, 12, 16, 24, 48}, false},
    {"eulerian long", "eulerian", "layers=1 latency=96", NULL, {0}, false},
    {"dual", "dual", "", "reset-every", {8, 12, 16, 24, 32, 48, 96}, false},
    {"dual plain", "dual", "blend=0 scatter=0", "reset-every", {8, 12, 16, 24, 32, 48, 96}, false},
    {"sprites", "sprites", "", "particle-radius", {12, 16, 20, 24, 32, 48}, false},
    {"warp", "warp", "", NULL, {0}, false},
};

enum
{
    FLOWS = sizeof flows / sizeof flows[0],
    EXEMPLARS = sizeof exemplars / sizeof exemplars[0],
    METHODS = sizeof methods / sizeof methods[0]
};

typedef struct Settings
{
    bool sweep;
    int frames;
    const char *out, *flow, *exemplar, *method, *set;
} Settings;

static void require(RfResult result, const char *what)
{
    if (result == RF_OK)
        return;
    fprintf(stderr, "evaluation_run: %s: %s\n", what, rf_last_error()->message);
    exit(1);
}

static bool wanted(const char *pick, const char *name)
{
    return !pick || strcmp(pick, name) == 0;
}

static Settings parse(int argc, char **argv)
{
    Settings s = {.frames = 200};
    if (argc < 2 || (strcmp(argv[1], "main") != 0 && strcmp(argv[1], "sweep") != 0))
    {
        fprintf(stderr, "evaluation_run main|sweep [frames=N] [out=FOLDER] [flow=] [exemplar=] [method=]\n");
        exit(2);
    }
    s.sweep = strcmp(argv[1], "sweep") == 0;
    for (int i = 2; i < argc; ++i)
    {
        const struct
        {
            const char *name, **value;
        } texts[] = {
            {"out=", &s.out}, {"flow=", &s.flow}, {"exemplar=", &s.exemplar}, {"method=", &s.method}, {"set=", &s.set}};
        int threads = 0;
        bool known = (sscanf(argv[i], "frames=%d", &s.frames) == 1 && s.frames > 1) ||
                     (sscanf(argv[i], "threads=%d", &threads) == 1 && threads > 0);
        if (threads > 0)
            rf_set_threads(threads);
        for (int k = 0; k < 5; ++k)
            if (strncmp(argv[i], texts[k].name, strlen(texts[k].name)) == 0)
            {
                *texts[k].value = argv[i] + strlen(texts[k].name);
                known = true;
            }
        if (!known)
        {
            fprintf(stderr, "evaluation_run: %s: not understood\n", argv[i]);
            exit(2);
        }
    }
    return s;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

// NULL where a real flow is not there.
static RfFlow *open_flow(const FlowCase *test)
{
    char path[4096];
    if (test->path[0] == '$')
    {
        const char *data = getenv("RIFFLE_DATA");
        snprintf(path, sizeof path, "%s%s", data ? data : RF_SOURCE_DIR "/../shared/data", test->path + 1);
    }
    else
        snprintf(path, sizeof path, "%s", test->path);
    RfFlowReadOptions options = rf_flow_read_defaults();
    options.moment_every = test->moment_every;
    RfFlow *flow;
    if (rf_flow_open(path, &options, &flow) != RF_OK)
    {
        fprintf(stderr, "skipped: %s: %s\n", test->name, rf_last_error()->message);
        return NULL;
    }
    // Again, at the speed wanted.
    RfFlowInfo info = rf_flow_info(flow);
    rf_flow_close(flow);
    options.velocity_scale = test->speed / info.max_speed * (float)info.width / (float)test->width;
    require(rf_flow_open(path, &options, &flow), path);
    return flow;
}

static void set_all(const MethodCase *method, const Stepper *stepper, const char *words, StepperOptions *options)
{
    char text[512];
    snprintf(text, sizeof text, "%s", words);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " "))
    {
        char *equals = strchr(word, '=');
        if (equals)
            *equals = 0;
        if (!equals || !stepper_set(stepper, options, word, equals + 1))
            fprintf(stderr, "evaluation_run: %s has no option %s\n", method->method, word), exit(1);
    }
}

static void set_options(const Settings *s, const MethodCase *method, const Stepper *stepper, double value,
                        StepperOptions *options)
{
    *options = stepper->defaults();
    set_all(method, stepper, method->options, options);
    char text[64] = "";
    if (!isnan(value))
        snprintf(text, sizeof text, "%s=%g", method->parameter, value);
    set_all(method, stepper, text, options);
    if (s->set)
        set_all(method, stepper, s->set, options);
}

static void print_header(void)
{
    int count;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    printf("set,flow,exemplar,label,parameter,value,ms");
    for (int i = 0; i < count; ++i)
        printf(",%s", table[i].name);
    printf("\n");
}

typedef struct Run
{
    const Settings *settings;
    const FlowCase *flow;
    const MethodCase *method;
    const char *exemplar;
    double value;
    RfFlow *source;
    const RfExemplar *material;
    RfImageView picture;
} Run;

static void print_run(const Run *run, double ms, const RfMeasure *measure)
{
    RfMeasureSummary summary;
    int count;
    rf_measure_summary(measure, &summary);
    rf_measure_quantity_table(&count);
    printf("%s,%s,%s,%s,%s,%g,%.3f", run->settings->sweep ? "sweep" : "main", run->flow->name, run->exemplar,
           run->method->label, isnan(run->value) ? "" : run->method->parameter, run->value, ms);
    for (int i = 0; i < count; ++i)
        printf(",%.6g", summary.quantities[i].mean);
    printf("\n");
    fflush(stdout);
}

static void keep_frame(const Run *run, const RfImage *frame)
{
    char path[4096], label[64];
    snprintf(label, sizeof label, "%s", run->method->label);
    for (char *c = label; *c; ++c)
        *c = *c == ' ' ? '-' : *c;
    snprintf(path, sizeof path, "%s/%s-%s-%s.png", run->settings->out, run->flow->name, run->exemplar, label);
    require(rf_image_write(path, frame), path);
}

static void run_one(const Run *run)
{
    const Settings *s = run->settings;
    const Stepper *stepper = stepper_find(run->method->method);
    StepperOptions options;
    set_options(s, run->method, stepper, run->value, &options);
    RfMeasureOptions judging = rf_measure_defaults();
    // Not ten, or methods with a period of their own would be met at a few phases only.
    judging.flow_every = 11;
    judging.flicker_every = s->sweep ? 0 : 3;
    judging.patch_every = s->sweep ? 0 : 10;
    judging.patch_stride = 8;
    void *method;
    RfImage *image;
    RfMeasure *measure;
    require(stepper->create(run->material, &options, &method), run->method->label);
    require(rf_image_create(run->flow->width, run->flow->height, run->picture.channels, &image), "frame");
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    require(rf_measure_create(&run->picture, &judging, &measure), "measure");
    RfImageView frame = rf_image_view(image);
    int first = rf_flow_info(run->source).first_frame;
    double seconds = 0;
    for (int f = 0; f < s->frames; ++f)
    {
        RfFlowView view;
        RfMeasureFrame judged;
        require(rf_flow_at(run->source, first + f, &view), run->flow->name);
        double start = now();
        require(stepper->step(method, &view, &frame), run->method->label);
        seconds += f > 0 ? now() - start : 0;
        require(rf_measure_step(measure, &view, NULL, &frame, &judged), "measure");
    }
    print_run(run, 1e3 * seconds / (s->frames - 1), measure);
    if (s->out && !s->sweep)
        keep_frame(run, image);
    rf_measure_destroy(measure);
    rf_image_destroy(image);
    stepper->destroy(method);
}

static void run_methods(Run *run)
{
    for (int m = 0; m < METHODS; ++m)
    {
        run->method = &methods[m];
        run->value = NAN;
        if (!wanted(run->settings->method, methods[m].label) || (methods[m].sweep_only && !run->settings->sweep))
            continue;
        if (!run->settings->sweep)
            run_one(run);
        for (int v = 0; run->settings->sweep && v < MAX_VALUES && methods[m].values[v] > 0; ++v)
        {
            run->value = methods[m].values[v];
            run_one(run);
        }
    }
}

static void run_exemplars(Run *run)
{
    for (int e = 0; e < EXEMPLARS; ++e)
    {
        if (!wanted(run->settings->exemplar, exemplars[e].name) || (run->settings->sweep && !exemplars[e].swept))
            continue;
        RfImage *image;
        RfExemplar *exemplar;
        require(rf_image_read(exemplars[e].path, &image), exemplars[e].path);
        run->picture = rf_image_view(image);
        RfMapView map = {"colour", run->picture.channels == 3 ? RF_MAP_COLOUR : RF_MAP_DATA, run->picture, 1};
        require(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar), exemplars[e].path);
        run->material = exemplar;
        run->exemplar = exemplars[e].name;
        run_methods(run);
        rf_exemplar_destroy(exemplar);
        rf_image_destroy(image);
    }
}

int main(int argc, char **argv)
{
    Settings settings = parse(argc, argv);
    print_header();
    for (int f = 0; f < FLOWS; ++f)
    {
        if (!wanted(settings.flow, flows[f].name) || (settings.sweep && !flows[f].swept))
            continue;
        Run run = {.settings = &settings, .flow = &flows[f], .source = open_flow(&flows[f])};
        if (!run.source)
            continue;
        run_exemplars(&run);
        rf_flow_close(run.source);
    }
    return 0;
}
