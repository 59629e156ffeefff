// SPDX-License-Identifier: Apache-2.0
// riffle synth EXEMPLAR OUTPUT: a still texture.
#include "constraint_input.h"
#include "errors.h"
#include "outputs.h"
#include "progress.h"
#include "setup.h"
#include "stop.h"
#include "verbs.h"
#include "worker.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

enum
{
    LEAST_SIDE = 8,
    MAX_OPTIONS = 32
};

// Waited for after a signal; nothing is written before the picture is whole.
static const double g_grace_seconds = 0.6, g_poll_seconds = 0.05;

typedef struct Synth
{
    const Settings *settings;
    RfOptimizeOptions options;
    ExemplarInput exemplar;
    ConstraintInput constraints;
    /// Of the result: the exemplar's without its guide.
    Layout layout;
    RfImage *image;
    Outputs outputs;
    Progress progress;
    Worker worker;
    double seconds;
    /// What the library tells of itself, from the worker's thread.
    pthread_mutex_t lock;
    char stage[128];
    double fraction, energy;
} Synth;

// ---- options -----------------------------------------------------------------------------------------------------

const RfOption *synth_option_table(int *count)
{
    static RfOption table[MAX_OPTIONS];
    int all = 0, kept = 0;
    const RfOption *options = rf_optimize_option_table(&all);
    // There is no flow that a still could lie along.
    for (int i = 0; i < all && kept < MAX_OPTIONS; ++i)
        if (strcmp(options[i].name, "orient") != 0)
            table[kept++] = options[i];
    *count = kept;
    return table;
}

static int make_options(Synth *synth)
{
    synth->options = rf_optimize_defaults();
    synth->options.seed = synth->settings->seed;
    int code = settings_verb_options(synth->settings, &synth->options);
    for (int i = 0; i < RF_MAX_OPTIMIZE_WINDOWS && !code; ++i)
        if (synth->options.windows[i] && synth->options.windows[i] % 2 == 0)
            code = fail(CODE_USAGE, NULL, NULL, "--windows: %d is even; windows need a pixel in their middle",
                        synth->options.windows[i]);
    return code;
}

// ---- what is there before anything is made -----------------------------------------------------------------------

static int check_outputs(const Outputs *outputs)
{
    for (int i = 0; i < outputs->count; ++i)
    {
        const Output *output = &outputs->list[i];
        if (output->kind == OUTPUT_VIDEO)
            return fail(CODE_USAGE, output->text, NULL,
                        "a still texture is one picture: png, exr, npy, null:, md5: or -");
        if (output->kind == OUTPUT_IMAGE && output->pattern.numbered)
            return fail(CODE_USAGE, output->text, NULL, "a still texture is one picture: leave the number out");
    }
    return CODE_DONE;
}

static void make_layout(Synth *synth)
{
    const Layout *all = &synth->exemplar.layout;
    synth->layout = (Layout){.format = all->format};
    for (int m = 0; m < all->map_count; ++m)
        if (strcmp(all->maps[m].name, "guide") != 0)
            layout_add(&synth->layout, all->maps[m].name, all->maps[m].kind, all->maps[m].channels);
}

/// The least of what the machine has and what this process may have, in bytes.
static double memory_there(void)
{
    double pages = (double)sysconf(_SC_PHYS_PAGES), page = (double)sysconf(_SC_PAGESIZE);
    struct rlimit limit;
    bool limited = getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY;
    double most = pages * page;
    return limited && (double)limit.rlim_cur < most ? (double)limit.rlim_cur : most;
}

/// Bytes a pixel: the picture and its copy for writing, what is compared, places and windows; then the constraints'
/// levels. Measured with 1 to 4 channels and 2048 x 2048 pixels: 26 to 55, with a target 40 more, turned 15.
static double memory_needed(const Synth *synth)
{
    const RfOptimizeConstraints *bounds = &synth->constraints.constraints;
    int channels = synth->layout.channels;
    bool held = bounds->fixed.pixels || bounds->target.pixels;
    bool turned = bounds->orientation.pixels || bounds->scale.pixels;
    double bytes = 24 + 12 * channels + (held ? 12 * channels + 8 : 0) + (turned ? 15 : 0);
    return bytes * synth->constraints.width * synth->constraints.height;
}

/// Asked for piece by piece, it would be refused late, or the system would end some program for it.
static int check_size(const Synth *synth)
{
    int width = synth->constraints.width, height = synth->constraints.height;
    if (width < LEAST_SIDE || height < LEAST_SIDE || width > RF_MAX_SIZE || height > RF_MAX_SIZE)
        return fail(CODE_USAGE, NULL, NULL,
                    "a still texture of %d x %d pixels: each side must be %d to %d; give another --size", width, height,
                    LEAST_SIDE, RF_MAX_SIZE);
    double needed = memory_needed(synth), there = memory_there();
    if (needed > there)
        return fail(CODE_FAILED, NULL, NULL,
                    "%d x %d pixels need about %.1f GiB of memory, %.1f are there; give a smaller --size", width,
                    height, needed / 0x1p30, there / 0x1p30);
    return CODE_DONE;
}

static int only_number(const void *context, int index)
{
    (void)context;
    return index + 1;
}

static int open_synth(Synth *synth, InputFiles *files)
{
    const Settings *settings = synth->settings;
    int code = make_options(synth);
    if (!code)
        code = constraints_begin(&synth->constraints, settings, files);
    if (!code)
        code = outputs_open(&synth->outputs, settings, settings->words[1], false, files);
    if (!code)
        code = check_outputs(&synth->outputs);
    if (!code)
        code = exemplar_input_read(settings, settings->words[0], false, &synth->exemplar);
    if (code)
        return code;
    make_layout(synth);
    code = constraints_read(&synth->constraints, settings, synth->exemplar.exemplar, &synth->layout);
    if (!code)
        code = check_size(synth);
    return code ? code : outputs_check(&synth->outputs, only_number, NULL, 1);
}

static void tell_synth(const Synth *synth)
{
    const RfExemplar *exemplar = synth->exemplar.exemplar;
    tell(synth->settings, "exemplar: %d x %d pixels, %d channels, %s", rf_exemplar_width(exemplar),
         rf_exemplar_height(exemplar), rf_exemplar_channels(exemplar),
         rf_exemplar_tiles(exemplar) ? "tiles" : "does not tile");
    tell(synth->settings, "result: %d x %d pixels, %d channels%s; %s, %d thread%s", synth->constraints.width,
         synth->constraints.height, synth->layout.channels, synth->options.tile ? ", tiles" : "", rf_simd_name(),
         rf_threads(), rf_threads() == 1 ? "" : "s");
}

// ---- making it ---------------------------------------------------------------------------------------------------

/// From the worker's thread.
static bool hear(void *user, const char *stage, double fraction)
{
    Synth *synth = user;
    const char *energy = strstr(stage, "energy ");
    pthread_mutex_lock(&synth->lock);
    snprintf(synth->stage, sizeof synth->stage, "%s", stage);
    synth->fraction = fraction;
    if (energy)
        synth->energy = strtod(energy + strlen("energy "), NULL);
    pthread_mutex_unlock(&synth->lock);
    return !stop_asked();
}

static int compute(void *context)
{
    Synth *synth = context;
    RfProgress progress = {hear, synth};
    int width = synth->constraints.width, height = synth->constraints.height;
    RfResult result = rf_image_create(width, height, synth->layout.channels, &synth->image);
    double start = now_seconds();
    if (result == RF_OK)
    {
        RfImageView view = rf_image_view(synth->image);
        rf_image_set_origin(synth->image, synth->layout.format, RF_ENCODING_SRGB);
        rf_set_progress(&progress);
        result = rf_optimize_still(synth->exemplar.exemplar, &synth->options, &synth->constraints.constraints, &view);
        rf_set_progress(NULL);
    }
    synth->seconds = now_seconds() - start;
    if (result == RF_OUT_OF_MEMORY)
        return fail(CODE_FAILED, NULL, NULL, "out of memory with %d x %d pixels; give a smaller --size", width, height);
    return result == RF_OK ? CODE_DONE : fail_result(result, synth->settings->words[0]);
}

static void show_stage(Synth *synth)
{
    char stage[sizeof synth->stage];
    pthread_mutex_lock(&synth->lock);
    memcpy(stage, synth->stage, sizeof stage);
    double fraction = synth->fraction;
    pthread_mutex_unlock(&synth->lock);
    progress_part(&synth->progress, stage, fraction);
}

static void tell_stop(Synth *synth)
{
    progress_clear(&synth->progress);
    warn(synth->settings, NULL, "stopped by signal %d; nothing is written", stop_asked());
}

static int compute_beside(Synth *synth)
{
    int code = worker_start(&synth->worker);
    if (code)
        return code;
    worker_post(&synth->worker, compute, synth);
    while (!worker_wait(&synth->worker, g_poll_seconds, &code))
    {
        show_stage(synth);
        if (stop_age() < g_grace_seconds)
            continue;
        // The worker still uses everything: the program leaves from here.
        tell_stop(synth);
        _exit(CODE_SIGNAL + stop_asked());
    }
    worker_end(&synth->worker);
    return code == CODE_DONE && stop_asked() ? CODE_SIGNAL + stop_asked() : code;
}

static int make_still(Synth *synth)
{
    progress_begin(&synth->progress, synth->settings, 1, 0);
    int code = compute_beside(synth);
    if (!code)
        code = outputs_write(&synth->outputs, 1, synth->image, &synth->layout, NULL);
    if (code >= CODE_SIGNAL)
        tell_stop(synth);
    else if (code)
        progress_clear(&synth->progress);
    else
        progress_still(&synth->progress, synth->seconds, synth->energy);
    return code;
}

int run_synth(Settings *settings)
{
    // An Outputs is large.
    Synth *synth = calloc(1, sizeof *synth);
    if (!synth)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    InputFiles files = {0};
    synth->settings = settings;
    pthread_mutex_init(&synth->lock, NULL);
    inputs_add(&files, settings->words[0], IMAGE_EXTENSIONS);
    for (int i = 0; i < settings->map_count; ++i)
        inputs_add(&files, settings->maps[i].file, IMAGE_EXTENSIONS);
    int code = open_synth(synth, &files);
    if (!code)
    {
        setup_end();
        tell_synth(synth);
        code = make_still(synth);
    }
    rf_image_destroy(synth->image);
    constraints_close(&synth->constraints);
    exemplar_input_close(&synth->exemplar);
    inputs_free(&files);
    pthread_mutex_destroy(&synth->lock);
    free(synth);
    return code;
}
