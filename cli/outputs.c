// SPDX-License-Identifier: Apache-2.0
#include "outputs.h"
#include "frame_files.h"
#include "text.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define IMAGE_KINDS "png|exr|npy"
#define FLOW_KINDS "flo|npy|exr|vti"
#define VIDEO_KINDS "mp4|webm|mov|gif"

static bool is_folder(const char *path)
{
    struct stat status;
    return path[strlen(path) - 1] == '/' || (stat(path, &status) == 0 && S_ISDIR(status.st_mode));
}

static int refuse_folder(const char *path, const char *extension)
{
    const char *slash = path[strlen(path) - 1] == '/' ? "" : "/";
    return fail(CODE_USAGE, path, NULL, "is a directory; name the files in it: %s%sframe.%%04d.%s", path, slash,
                extension);
}

static int find_kind(Output *output, bool flows, bool still)
{
    const char *text = output->text;
    if (is_folder(text))
        return refuse_folder(text, flows ? "vti" : "png");
    if (strcmp(text, "null:") == 0)
        output->kind = OUTPUT_NULL;
    else if (strcmp(text, "md5:") == 0)
        output->kind = OUTPUT_MD5;
    else if (strcmp(text, "-") == 0 && !flows)
        output->kind = OUTPUT_STDOUT;
    else if (text_extension_in(text, flows ? FLOW_KINDS : IMAGE_KINDS))
        output->kind = flows ? OUTPUT_FLOW : OUTPUT_IMAGE;
    else if (text_extension_in(text, VIDEO_KINDS) && !flows)
        output->kind = OUTPUT_VIDEO;
    else if (flows)
        return fail(CODE_USAGE, text, NULL,
                    "a flow is written as flo, npy, exr or vti, to null: or md5:; riffle render "
                    "makes pictures of it");
    else if (still)
        return fail(CODE_USAGE, text, NULL, "a still texture is one picture: png, exr, npy, null:, md5: or -");
    else
        return fail(CODE_USAGE, text, NULL,
                    "frames are written as png, exr, npy (out.%%04d.png), mp4, webm, mov, gif, "
                    "to null:, md5: or -");
    if (!pattern_parse(text, &output->pattern))
        return fail(CODE_USAGE, NULL, NULL, "an output's name is longer than %d characters", PATH_SIZE - 1);
    return CODE_DONE;
}

static int check_pair(const Output *a, const Output *b)
{
    bool a_prints = a->kind == OUTPUT_MD5 || a->kind == OUTPUT_STDOUT;
    bool b_prints = b->kind == OUTPUT_MD5 || b->kind == OUTPUT_STDOUT;
    if (strcmp(a->text, b->text) == 0)
        return fail(CODE_USAGE, a->text, NULL, "is an output twice");
    if (a_prints && b_prints)
        return fail(CODE_USAGE, NULL, NULL, "%s and %s both write to stdout; give one of them", a->text, b->text);
    return CODE_DONE;
}

static int check_conflicts(const Outputs *outputs)
{
    const Settings *settings = outputs->settings;
    for (int i = 0; i < outputs->count; ++i)
    {
        for (int j = 0; j < i; ++j)
        {
            int code = check_pair(&outputs->list[j], &outputs->list[i]);
            if (code)
                return code;
        }
        OutputKind kind = outputs->list[i].kind;
        if (settings->resume && (kind == OUTPUT_MD5 || kind == OUTPUT_NULL || kind == OUTPUT_STDOUT))
            return fail(CODE_USAGE, NULL, NULL, "--resume: %s cannot resume, since nothing of it stays",
                        outputs->list[i].text);
    }
    if (settings->resume && !outputs_first_image(outputs) && outputs_have(outputs, OUTPUT_VIDEO))
        return fail(CODE_USAGE, NULL, NULL,
                    "--resume: a video is encoded again from its frames; write images beside it");
    if (settings->uv && !outputs_first_image(outputs))
        return fail(CODE_USAGE, NULL, NULL, "--uv needs an image output, beside which its files stand");
    return CODE_DONE;
}

int outputs_open(Outputs *outputs, const Settings *settings, const char *destination, bool flows,
                 const InputFiles *inputs)
{
    *outputs = (Outputs){.settings = settings, .inputs = inputs, .replace = settings->replace};
    outputs->list[outputs->count++].text = destination;
    for (int i = 0; i < settings->output_count; ++i)
        outputs->list[outputs->count++].text = settings->outputs[i];
    for (int i = 0; i < outputs->count; ++i)
    {
        int code = find_kind(&outputs->list[i], flows, outputs->settings->verb->bit == VERB_SYNTH);
        if (code)
            return code;
    }
    return check_conflicts(outputs);
}

int outputs_gather(Outputs *outputs, int count)
{
    outputs->count_of_frames = count;
    for (int i = 0; i < outputs->count && count > 1; ++i)
    {
        Output *output = &outputs->list[i];
        if (output->kind == OUTPUT_FLOW && !output->pattern.numbered && text_extension_in(output->text, "npy"))
            output->kind = OUTPUT_ARRAY;
        if (output->kind == OUTPUT_ARRAY && outputs->settings->resume)
            return fail(CODE_USAGE, NULL, NULL, "--resume: %s takes all moments at once and cannot be resumed",
                        output->text);
    }
    return CODE_DONE;
}

const Output *outputs_first_image(const Outputs *outputs)
{
    for (int i = 0; i < outputs->count; ++i)
        if (outputs->list[i].kind == OUTPUT_IMAGE || outputs->list[i].kind == OUTPUT_FLOW)
            return &outputs->list[i];
    return NULL;
}

bool outputs_have(const Outputs *outputs, OutputKind kind)
{
    for (int i = 0; i < outputs->count; ++i)
        if (outputs->list[i].kind == kind)
            return true;
    return false;
}

bool outputs_hold_one(const Outputs *outputs)
{
    for (int i = 0; i < outputs->count; ++i)
        if (outputs->list[i].kind != OUTPUT_IMAGE || outputs->list[i].pattern.numbered)
            return false;
    return true;
}

bool outputs_idle(const Outputs *outputs)
{
    return outputs->count == 1 && outputs->list[0].kind == OUTPUT_NULL;
}

/// The folder must be there: making it is the caller's affair, and a typing error should not make one.
static int check_folder(const char *path)
{
    char folder[PATH_SIZE];
    size_t length = strlen(path) - strlen(text_base_name(path));
    memcpy(folder, path, length);
    folder[length] = '\0';
    struct stat status;
    if (stat(length ? folder : ".", &status) == 0)
        return CODE_DONE;
    bool missing = errno == ENOENT;
    return fail(CODE_FAILED, path, NULL, "cannot be written: %s%s", strerror(errno),
                missing ? "; make its folder first" : "");
}

/// Any file that is about to be written: no input, and nothing that is there unless that was asked for.
static int check_file(const Outputs *outputs, const char *path)
{
    struct stat status;
    if (lstat(path, &status) != 0)
        return CODE_DONE;
    if (inputs_contain(outputs->inputs, path))
        return fail(CODE_USAGE, path, NULL, "is an input of this run and is never replaced; choose another name");
    if (S_ISDIR(status.st_mode))
        return refuse_folder(path, "png");
    if (!outputs->replace)
        return fail(CODE_USAGE, path, NULL, "exists; -y replaces it");
    return CODE_DONE;
}

static int check_output(const Outputs *outputs, const Output *output, int (*number)(const void *context, int index),
                        const void *context, int count)
{
    if (output->kind == OUTPUT_NULL || output->kind == OUTPUT_MD5 || output->kind == OUTPUT_STDOUT)
        return CODE_DONE;
    char name[PATH_SIZE];
    if (output->kind == OUTPUT_VIDEO || output->kind == OUTPUT_ARRAY)
    {
        int code = check_folder(output->text);
        return code ? code : check_file(outputs, output->text);
    }
    if (!output->pattern.numbered && count > 1)
    {
        int stem = (int)(strlen(output->text) - strlen(text_extension(output->text)));
        return fail(CODE_USAGE, output->text, NULL, "one name for %d frames; put a number in it, as %.*s%%04d.%s",
                    count, stem, output->text, text_extension(output->text));
    }
    for (int i = 0; i < count; ++i)
    {
        int frame = number(context, i);
        if (!pattern_name(&output->pattern, frame, NULL, NULL, name))
            return fail(CODE_USAGE, NULL, NULL, "an output's name is longer than %d characters", PATH_SIZE - 1);
        int code = i == 0 ? check_folder(name) : CODE_DONE;
        code = code ? code : check_file(outputs, name);
        if (code)
            return code;
    }
    return CODE_DONE;
}

int outputs_check(Outputs *outputs, int (*number)(const void *context, int index), const void *context, int count)
{
    for (int i = 0; i < outputs->count; ++i)
    {
        int code = check_output(outputs, &outputs->list[i], number, context, count);
        if (code)
            return code;
    }
    return CODE_DONE;
}

static bool output_complete(const Output *output, int (*number)(const void *context, int index), const void *context,
                            int count)
{
    char name[PATH_SIZE];
    bool files = output->kind == OUTPUT_IMAGE || output->kind == OUTPUT_FLOW;
    if (output->kind == OUTPUT_VIDEO)
        return access(output->text, F_OK) == 0;
    for (int i = 0; i < (output->pattern.numbered ? count : 1) && files; ++i)
        if (!pattern_name(&output->pattern, number(context, i), NULL, NULL, name) || access(name, F_OK) != 0)
            return false;
    return files;
}

bool outputs_complete(const Outputs *outputs, int (*number)(const void *context, int index), const void *context,
                      int count)
{
    for (int i = 0; i < outputs->count; ++i)
        if (!output_complete(&outputs->list[i], number, context, count))
            return false;
    return true;
}

/// The video if it is open or could be opened. Without an encoder beside other outputs the run goes on.
static int open_video(Outputs *outputs, Output *output, const RfImage *pixels)
{
    if (output->video || output->without_video)
        return CODE_DONE;
    RfImageView view = rf_image_view(pixels);
    RfResult result =
        rf_video_open(output->text, view.width, view.height, (float)outputs->settings->fps, &output->video);
    output->width = view.width;
    output->height = view.height;
    if (result == RF_OK)
        return CODE_DONE;
    fail_result(result, output->text);
    Fault fault = *last_fault();
    fault.code = CODE_FAILED;
    if (result == RF_UNSUPPORTED)
    {
        const Output *image = outputs_first_image(outputs);
        size_t used = strlen(fault.message);
        if (image)
            snprintf(fault.message + used, sizeof fault.message - used,
                     "; the frames are written, and then riffle convert %s %s makes it", image->text, output->text);
        output->without_video = true;
        outputs->video_missing = true;
        outputs->missing = fault;
    }
    adopt_fault(&fault);
    return result == RF_UNSUPPORTED && outputs->count > 1 ? CODE_DONE : CODE_FAILED;
}

static int write_video(Outputs *outputs, Output *output, int frame, const RfImage *pixels, const Layout *layout)
{
    int code = open_video(outputs, output, pixels);
    if (code || !output->video)
        return code;
    RfImageView view = rf_image_view(pixels);
    if (view.width != output->width || view.height != output->height)
        return fail(CODE_BAD_INPUT, output->text, NULL,
                    "frame %d is %d x %d pixels, those before it %d x %d: a video has "
                    "one size",
                    frame, view.width, view.height, output->width, output->height);
    RfImage *colour = NULL;
    code = frame_picture(pixels, layout, output->text, &colour);
    if (code)
        return code;
    view = rf_image_view(colour);
    RfResult result = rf_video_write(output->video, &view);
    rf_image_destroy(colour);
    return result == RF_OK ? CODE_DONE : fail_result(result, output->text);
}

static int write_file(const Outputs *outputs, const Output *output, int frame, const char *map, const RfImage *image)
{
    char name[PATH_SIZE];
    if (!pattern_name(&output->pattern, frame, map, map ? "exr" : NULL, name))
        return fail(CODE_USAGE, NULL, NULL, "an output's name is longer than %d characters", PATH_SIZE - 1);
    int code = check_file(outputs, name);
    if (code)
        return code;
    RfResult result = rf_image_write(name, image);
    return result == RF_OK ? CODE_DONE : fail_result(result, name);
}

/// PNG shows colour and alpha; each other map gets an EXR of its own beside it.
static int write_png(const Outputs *outputs, const Output *output, int frame, const RfImage *pixels,
                     const Layout *layout)
{
    RfImage *image = NULL;
    RfImageView view = rf_image_view(pixels);
    int code = frame_colour(pixels, layout, output->text, &image);
    if (!code)
        code = write_file(outputs, output, frame, NULL, image ? image : pixels);
    rf_image_destroy(image);
    for (int m = 0; m < layout->map_count && !code; ++m)
    {
        const LayoutMap *map = &layout->maps[m];
        if (map->first < layout->colours)
            continue;
        image = NULL;
        RfResult result = layout_channels(&view, layout, map->first, map->channels, &image);
        if (result != RF_OK)
            return fail_result(result, output->text);
        rf_image_set_origin(image, layout->format, RF_ENCODING_DATA);
        code = write_file(outputs, output, frame, map->name, image);
        rf_image_destroy(image);
    }
    return code;
}

static int write_image(const Outputs *outputs, const Output *output, int frame, const RfImage *pixels,
                       const Layout *layout)
{
    if (text_extension_in(output->text, "npy"))
        return write_file(outputs, output, frame, NULL, pixels);
    if (text_extension_in(output->text, "png"))
        return write_png(outputs, output, frame, pixels, layout);
    RfImage *image = NULL;
    RfImageView view = rf_image_view(pixels);
    RfResult result = layout_linear(&view, layout, &image);
    if (result != RF_OK)
        return fail_result(result, output->text);
    int code = write_file(outputs, output, frame, NULL, image);
    rf_image_destroy(image);
    return code;
}

static int write_one(Outputs *outputs, Output *output, int frame, const RfImage *pixels, const Layout *layout)
{
    switch (output->kind)
    {
    case OUTPUT_IMAGE:
        return write_image(outputs, output, frame, pixels, layout);
    case OUTPUT_VIDEO:
        return write_video(outputs, output, frame, pixels, layout);
    case OUTPUT_MD5:
        return frame_md5(pixels, frame);
    case OUTPUT_STDOUT:
        return frame_pnm(pixels, layout);
    case OUTPUT_NULL:
    case OUTPUT_FLOW:
    case OUTPUT_ARRAY:
        break;
    }
    return CODE_DONE;
}

int outputs_write(Outputs *outputs, int frame, const RfImage *pixels, const Layout *layout, const RfImage *uv)
{
    const Output *first = outputs_first_image(outputs);
    int code = uv && first ? write_file(outputs, first, frame, "uv", uv) : CODE_DONE;
    for (int i = 0; i < outputs->count && !code; ++i)
        code = write_one(outputs, &outputs->list[i], frame, pixels, layout);
    return code;
}

static int write_flow_file(const Outputs *outputs, const Output *output, int frame, const RfFlowView *flow)
{
    char name[PATH_SIZE];
    if (!pattern_name(&output->pattern, frame, NULL, NULL, name))
        return fail(CODE_USAGE, NULL, NULL, "an output's name is longer than %d characters", PATH_SIZE - 1);
    int code = check_file(outputs, name);
    RfResult result = code ? RF_OK : rf_flow_write(name, flow, (float)outputs->settings->fps);
    return result == RF_OK ? code : fail_result(result, name);
}

static int write_array(const Outputs *outputs, Output *output, const RfFlowView *flow)
{
    RfResult result = RF_OK;
    if (!output->array)
        result = rf_flow_array_open(output->text, flow->width, flow->height, outputs->count_of_frames, &output->array);
    if (result == RF_OK)
        result = rf_flow_array_write(output->array, flow);
    return result == RF_OK ? CODE_DONE : fail_result(result, output->text);
}

int outputs_write_flow(Outputs *outputs, int frame, const RfFlowView *flow)
{
    int code = CODE_DONE;
    for (int i = 0; i < outputs->count && !code; ++i)
    {
        Output *output = &outputs->list[i];
        if (output->kind == OUTPUT_MD5)
            code = flow_md5(flow, frame);
        else if (output->kind == OUTPUT_FLOW)
            code = write_flow_file(outputs, output, frame, flow);
        else if (output->kind == OUTPUT_ARRAY)
            code = write_array(outputs, output, flow);
    }
    return code;
}

int outputs_replay(Outputs *outputs, int frame)
{
    const Output *image = outputs_first_image(outputs);
    if (!image || !outputs_have(outputs, OUTPUT_VIDEO))
        return CODE_DONE;
    char name[PATH_SIZE];
    RfImage *file = NULL, *pixels = NULL;
    Layout layout;
    if (!pattern_name(&image->pattern, frame, NULL, NULL, name))
        return fail(CODE_USAGE, NULL, NULL, "an output's name is longer than %d characters", PATH_SIZE - 1);
    RfResult result = rf_image_read(name, &file);
    if (result == RF_OK)
        result = layout_split(file, &layout, &pixels);
    int code = result == RF_OK ? CODE_DONE : fail_result(result, name);
    for (int i = 0; i < outputs->count && !code; ++i)
        if (outputs->list[i].kind == OUTPUT_VIDEO)
            code = write_video(outputs, &outputs->list[i], frame, pixels, &layout);
    rf_image_destroy(file);
    rf_image_destroy(pixels);
    return code;
}

int outputs_close(Outputs *outputs, bool keep)
{
    int code = CODE_DONE;
    for (int i = 0; i < outputs->count; ++i)
    {
        Output *output = &outputs->list[i];
        RfResult result = rf_video_close(output->video, keep && !code);
        if (result == RF_OK)
            result = rf_flow_array_close(output->array, keep && !code);
        else
            rf_flow_array_close(output->array, false);
        output->video = NULL;
        output->array = NULL;
        if (result != RF_OK && keep && !code)
            code = fail_result(result, output->text);
    }
    if (keep && !code && outputs->video_missing)
    {
        adopt_fault(&outputs->missing);
        code = CODE_FAILED;
    }
    return code;
}
