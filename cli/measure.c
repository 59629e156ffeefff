// SPDX-License-Identifier: Apache-2.0
// riffle measure FRAMES: one frame after the other is read, paired with the flow by its number and judged; then the
// table and the reports. A worker judges, so that after a signal a long frame need not be waited for.
#include "errors.h"
#include "flow_input.h"
#include "image_input.h"
#include "layout.h"
#include "mask_input.h"
#include "progress.h"
#include "report.h"
#include "run.h"
#include "setup.h"
#include "stop.h"
#include "text.h"
#include "verbs.h"
#include "worker.h"

#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum
{
    /// Of the library's measures.
    MIN_SIDE = 16
};

// After a signal the frame on the way is waited for so long.
static const double g_grace_seconds = 0.6, g_poll_seconds = 0.05;

typedef struct Judging
{
    const Settings *settings;
    ImageInput images;
    FramePlan plan;
    int *indices;
    FlowInput flow;
    RfImage *exemplar;
    /// [height][width] of the frames; NULL: the flow's own.
    uint8_t *mask;
    RfMeasure *measure;
    Progress progress;
    Worker worker;
    /// Of the frame that the worker judges, and what computing it took.
    int index;
    double seconds;
    Report report;
} Judging;

// ---- inputs ------------------------------------------------------------------------------------------------------

/// Colour and alpha, sRGB-encoded; other channels are left out.
static int take_colour(const RfImage *image, const char *path, RfImage **out, bool *alpha)
{
    Layout layout;
    RfImage *pixels = NULL;
    RfResult result = layout_split(image, &layout, &pixels);
    if (result != RF_OK)
        return fail_result(result, path);
    RfImageView view = rf_image_view(pixels);
    int code = CODE_DONE;
    if (layout.colours == 0)
        code = fail(CODE_BAD_INPUT, path, NULL, "no colour here: looked for R G B or Y; its first channel is %s",
                    rf_image_channel_name(image, 0));
    else
        result = layout_encode(&view, &layout, RF_ENCODING_SRGB);
    if (!code && result == RF_OK)
        result = layout_channels(&view, &layout, 0, layout.colours, out);
    rf_image_destroy(pixels);
    *alpha = layout.alpha;
    return code || result == RF_OK ? code : fail_result(result, path);
}

static int read_frame(const Judging *judging, int index, RfImage **out, bool *alpha)
{
    RfImage *image = NULL;
    int place = judging->indices[index];
    int code = image_input_read(&judging->images, place, &image);
    if (!code)
        code = take_colour(image, image_input_path(&judging->images, place), out, alpha);
    rf_image_destroy(image);
    return code;
}

static int read_exemplar(Judging *judging, const char *path)
{
    RfImage *image = NULL;
    bool alpha = false;
    RfResult result = rf_image_read(path, &image);
    if (result != RF_OK)
        return fail_result(result, path);
    int code = take_colour(image, path, &judging->exemplar, &alpha);
    rf_image_destroy(image);
    return code;
}

/// Sizes that the options ask for and a picture does not have.
static int check_room(const RfMeasureOptions *options, const char *path, int width, int height)
{
    int side = width < height ? width : height;
    if (options->spectrum_crop > side)
        return fail(CODE_USAGE, NULL, NULL, "--spectrum-crop %d: %s is %d x %d pixels", options->spectrum_crop, path,
                    width, height);
    if (options->patch_size > side)
        return fail(CODE_USAGE, NULL, NULL, "--patch-size %d: %s is %d x %d pixels", options->patch_size, path, width,
                    height);
    return CODE_DONE;
}

static int check_exemplar(const Judging *judging)
{
    RfImageView view = rf_image_view(judging->exemplar);
    if (view.width < MIN_SIDE || view.height < MIN_SIDE)
        return fail(CODE_BAD_INPUT, judging->settings->exemplar, NULL,
                    "%d x %d pixels: an exemplar needs %d on each side to be measured with", view.width, view.height,
                    MIN_SIDE);
    return check_room(&judging->report.options, judging->settings->exemplar, view.width, view.height);
}

static int make_options(Judging *judging)
{
    RfMeasureOptions *options = &judging->report.options;
    *options = rf_measure_defaults();
    int code = settings_verb_options(judging->settings, options);
    if (!code && options->spectrum_crop != 0 && (options->spectrum_crop < MIN_SIDE || options->spectrum_crop % 2 != 0))
        code = fail(CODE_USAGE, NULL, NULL, "--spectrum-crop %d: must be 0, or even and %d to 512",
                    options->spectrum_crop, MIN_SIDE);
    return code;
}

// ---- frames and flow ---------------------------------------------------------------------------------------------

/// Where the numbers leave something out, motion cannot be judged against a flow that changes in between.
static int check_gaps(const Judging *judging)
{
    const Settings *settings = judging->settings;
    const FramePlan *plan = &judging->plan;
    bool changes = settings->flow && judging->flow.info.moment_count != 1;
    if (changes && settings->frame_step > 1)
        return fail(CODE_USAGE, NULL, NULL,
                    "--frames %d-%dx%d: motion is judged from each frame to the next; leave x%d out, and "
                    "--flow-every, --flicker-every and --patch-every take fewer",
                    settings->first_frame, settings->last_frame, settings->frame_step, settings->frame_step);
    for (int i = 1, usual = 0; i < plan->count; ++i)
    {
        int before = plan->numbers[i - 1], gap = plan->numbers[i] - before;
        if (gap < 1)
            return fail(CODE_BAD_INPUT, image_input_path(&judging->images, judging->indices[i]), NULL,
                        "there are two frames of number %d; give one sequence by its pattern (name.%%04d.ext)", before);
        if (changes && gap != 1)
            return fail(CODE_BAD_INPUT, settings->words[0], NULL,
                        "has no frame %d, between %d and %d: motion is judged from each frame to the next", before + 1,
                        before, plan->numbers[i]);
        if (i > 1 && gap != usual)
        {
            warn(settings, settings->words[0], "the numbers go from %d to %d: is a frame missing?", before,
                 plan->numbers[i]);
            break;
        }
        usual = gap;
    }
    return CODE_DONE;
}

/// Frames and moments pair by number.
static int check_pairing(const Judging *judging)
{
    const RfFlowInfo *info = &judging->flow.info;
    const Settings *settings = judging->settings;
    int first = judging->plan.numbers[0], last = judging->plan.numbers[judging->plan.count - 1];
    if (judging->plan.count == 1)
        warn(settings, settings->words[0],
             "is one frame: flow error and flicker need two, so only the mask of %s counts", settings->flow);
    if (info->moment_count <= 1)
        return CODE_DONE;
    if (last < info->first_frame || first > info->last_frame)
        return fail(CODE_BAD_INPUT, settings->words[0], NULL,
                    "has the frames %d to %d, but %s has %d to %d, and they pair by number: rename one of them", first,
                    last, settings->flow, info->first_frame, info->last_frame);
    if (first < info->first_frame || last > info->last_frame)
        warn(settings, settings->flow,
             "has the frames %d to %d, those to judge are %d to %d: before and behind its own its velocity stays as it "
             "is",
             info->first_frame, info->last_frame, first, last);
    return CODE_DONE;
}

/// The first frame says how large all are, and whether they have alpha.
static int begin_judging(Judging *judging, const RfImageView *frame, bool alpha)
{
    Report *report = &judging->report;
    const Settings *settings = judging->settings;
    const char *path = image_input_path(&judging->images, judging->indices[0]);
    if (frame->width < MIN_SIDE || frame->height < MIN_SIDE)
        return fail(CODE_BAD_INPUT, path, NULL, "%d x %d pixels: frames need %d on each side to be measured",
                    frame->width, frame->height, MIN_SIDE);
    int code = check_room(&report->options, path, frame->width, frame->height);
    if (!code && settings->mask)
        code = mask_read(settings->mask, frame->width, frame->height, &judging->mask);
    if (code)
        return code;
    if (settings->flow)
        flow_input_warn_of_size(&judging->flow, settings, frame->width, frame->height);
    report->width = frame->width;
    report->height = frame->height;
    report->channels = frame->channels;
    report->options.alpha = alpha;
    if (alpha == false && report->options.holes == RF_MEASURE_HOLES_ALPHA)
        warn(settings, path, "has no alpha, so --holes alpha finds none but what is not finite");
    RfImageView exemplar = judging->exemplar ? rf_image_view(judging->exemplar) : (RfImageView){0};
    RfResult result = rf_measure_create(judging->exemplar ? &exemplar : NULL, &report->options, &judging->measure);
    if (result == RF_OK && judging->exemplar && report->gallery.wanted)
        result = gallery_take_exemplar(&report->gallery, judging->exemplar, frame);
    return result == RF_OK ? CODE_DONE : fail_result(result, settings->exemplar);
}

static int check_same(const Report *report, const RfImageView *frame, const char *path)
{
    if (frame->width != report->width || frame->height != report->height)
        return fail(CODE_BAD_INPUT, path, NULL, "is %d x %d pixels, the first frame %d x %d: all need one size",
                    frame->width, frame->height, report->width, report->height);
    if (frame->channels != report->channels)
        return fail(CODE_BAD_INPUT, path, NULL,
                    "has %d channel%s of colour and alpha, the first frame %d: all need the same", frame->channels,
                    frame->channels == 1 ? "" : "s", report->channels);
    return CODE_DONE;
}

static int judge_frame(Judging *judging, int index, const RfImage *frame)
{
    Report *report = &judging->report;
    RfFlowView flow;
    RfImageView view = rf_image_view(frame);
    int number = report->numbers[index];
    bool flowing = judging->settings->flow != NULL;
    const char *path = image_input_path(&judging->images, judging->indices[index]);
    int code = check_same(report, &view, path);
    if (!code && flowing)
        code = flow_input_at(&judging->flow, number, &flow);
    if (code)
        return code;
    double start = now_seconds();
    RfResult result =
        rf_measure_step(judging->measure, flowing ? &flow : NULL, judging->mask, &view, &report->values[index]);
    judging->seconds = now_seconds() - start;
    if (result == RF_OK && report->gallery.wanted)
        result = gallery_take(&report->gallery, judging->measure, &report->values[index], index, judging->plan.count,
                              number, frame);
    return result == RF_OK ? CODE_DONE : fail_result(result, path);
}

static bool hear(void *user, const char *stage, double fraction)
{
    (void)user, (void)stage, (void)fraction;
    return !stop_asked();
}

/// The worker's job.
static int judge_next(void *context)
{
    static const RfProgress progress = {hear, NULL};
    Judging *judging = context;
    RfImage *frame = NULL;
    bool alpha = false;
    int index = judging->index;
    rf_set_progress(&progress);
    int code = read_frame(judging, index, &frame, &alpha);
    RfImageView view = code ? (RfImageView){0} : rf_image_view(frame);
    if (!code && index == 0)
        code = begin_judging(judging, &view, alpha);
    if (!code)
        code = judge_frame(judging, index, frame);
    rf_image_destroy(frame);
    return code;
}

// ---- the run -----------------------------------------------------------------------------------------------------

static void tell_stop(const Judging *judging)
{
    warn(judging->settings, NULL, "stopped by signal %d with %d of %d frames judged; nothing is written", stop_asked(),
         judging->report.count, judging->plan.count);
}

static int judge_one(Judging *judging, int index)
{
    int code = CODE_DONE;
    judging->index = index;
    worker_post(&judging->worker, judge_next, judging);
    while (!worker_wait(&judging->worker, g_poll_seconds, &code))
    {
        progress_stage(&judging->progress, "judging");
        if (stop_age() < g_grace_seconds)
            continue;
        // The worker still uses everything: the program leaves from here.
        progress_clear(&judging->progress);
        tell_stop(judging);
        _exit(CODE_SIGNAL + stop_asked());
    }
    if (code)
        return code;
    ++judging->report.count;
    FrameReport report = {.stage_count = 0};
    progress_frame(&judging->progress, judging->report.numbers[index], judging->seconds, &report);
    return CODE_DONE;
}

static int judge_all(Judging *judging)
{
    int count = judging->plan.count, code = worker_start(&judging->worker);
    progress_begin(&judging->progress, judging->settings, count, 0);
    for (int i = 0; i < count && !code; ++i)
        code = stop_asked() ? CODE_SIGNAL + stop_asked() : judge_one(judging, i);
    worker_end(&judging->worker);
    if (code)
        progress_clear(&judging->progress);
    if (code >= CODE_SIGNAL)
        tell_stop(judging);
    return code;
}

static int open_inputs(Judging *judging)
{
    const Settings *settings = judging->settings;
    int code = image_input_open(&judging->images, settings->words[0]);
    if (!code)
        code = plan_of_images(settings, &judging->images, &judging->plan, &judging->indices);
    if (!code && settings->exemplar)
        code = read_exemplar(judging, settings->exemplar);
    if (!code && settings->exemplar)
        code = check_exemplar(judging);
    if (!code && settings->flow)
        code = flow_input_open(&judging->flow, settings, settings->flow);
    if (!code)
        code = check_gaps(judging);
    if (!code && settings->flow)
        code = check_pairing(judging);
    return code;
}

static void tell_inputs(const Judging *judging)
{
    const Settings *settings = judging->settings;
    const RfFlowInfo *info = &judging->flow.info;
    const int *numbers = judging->plan.numbers;
    tell(settings, "frames: %d, %d to %d; %s, %d threads", judging->plan.count, numbers[0],
         numbers[judging->plan.count - 1], rf_simd_name(), rf_threads());
    if (settings->flow)
        tell(settings, "flow: %s, %d x %d cells, %s; %s; greatest speed %.3g cells a frame", info->format, info->width,
             info->height, info->has_mask ? "with a mask" : "no mask", info->conventions, (double)info->max_speed);
    if (settings->flow)
        flow_input_warn_of_speed(&judging->flow, settings);
    RfImageView exemplar = judging->exemplar ? rf_image_view(judging->exemplar) : (RfImageView){0};
    if (judging->exemplar)
        tell(settings, "exemplar: %d x %d pixels, %d channels", exemplar.width, exemplar.height, exemplar.channels);
}

static int make_report(Judging *judging)
{
    Report *report = &judging->report;
    const Settings *settings = judging->settings;
    report->numbers = malloc((size_t)judging->plan.count * sizeof *report->numbers);
    report->values = calloc((size_t)judging->plan.count, sizeof *report->values);
    if (!report->numbers || !report->values)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    memcpy(report->numbers, judging->plan.numbers, (size_t)judging->plan.count * sizeof *report->numbers);
    bool pages = false;
    for (int i = 0; i < settings->report_count; ++i)
        pages = pages || text_extension_in(settings->reports[i], "html");
    if (!pages)
        return CODE_DONE;
    gallery_begin(&report->gallery);
    return CODE_DONE;
}

static int tell_report(Judging *judging)
{
    Report *report = &judging->report;
    rf_measure_summary(judging->measure, &report->summary);
    rf_measure_spectra(judging->measure, &report->spectra);
    progress_done(&judging->progress);
    if (settings_json(judging->settings))
        report_write_json(report, stdout);
    else
        report_print_table(report);
    return report_write_files(report);
}

int run_measure(Settings *settings)
{
    Judging *judging = calloc(1, sizeof *judging);
    if (!judging)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    const char *const inputs[] = {settings->words[0], settings->flow, settings->exemplar, settings->mask};
    judging->settings = judging->report.settings = settings;
    int code = make_options(judging);
    if (!code)
        code = report_check_files(settings, inputs, sizeof inputs / sizeof inputs[0]);
    if (!code)
        code = open_inputs(judging);
    if (!code)
        code = make_report(judging);
    if (!code)
    {
        setup_end();
        tell_inputs(judging);
        code = judge_all(judging);
    }
    if (!code)
        code = tell_report(judging);
    rf_measure_destroy(judging->measure);
    image_input_close(&judging->images);
    flow_input_close(&judging->flow);
    rf_image_destroy(judging->exemplar);
    gallery_free(&judging->report.gallery);
    free(judging->report.numbers);
    free(judging->report.values);
    plan_free(&judging->plan);
    free(judging->indices);
    free(judging->mask);
    free(judging);
    return code;
}
