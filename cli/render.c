// SPDX-License-Identifier: Apache-2.0
// riffle render INPUT OUTPUT: flows as wheel, arrows or streaks; heights as a relief.
#include "errors.h"
#include "flow_input.h"
#include "image_input.h"
#include "run.h"
#include "verbs.h"

#include <stdlib.h>
#include <string.h>

typedef struct Render
{
    const Settings *settings;
    FlowInput flow;
    RfFlowPictureOptions picture;
    /// Relief: INPUT, and the heights of --map height=FRAMES.
    ImageInput images, heights;
    int *indices;
    int width, height;
} Render;

// Of a relief without colours of its own.
static const float g_plain_grey = 0.75f;

static RfResult make_frame(Render *render, FrameSlot *slot)
{
    slot->layout = (Layout){.format = RF_SAMPLE_U8};
    layout_add(&slot->layout, "colour", RF_MAP_COLOUR, 3);
    if (slot->pixels)
        return RF_OK;
    RfResult result = rf_image_create(render->width, render->height, 3, &slot->pixels);
    if (result == RF_OK)
        rf_image_set_origin(slot->pixels, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    return result;
}

static int produce_picture(void *context, int index, int frame, bool drawn, FrameSlot *slot)
{
    (void)index;
    Render *render = context;
    RfFlowView view;
    int code = drawn ? flow_input_at(&render->flow, frame, &view) : CODE_DONE;
    if (code || !drawn)
        return code;
    RfResult result = make_frame(render, slot);
    if (result != RF_OK)
        return fail_result(result, NULL);
    RfImageView to = rf_image_view(slot->pixels);
    double start = now_seconds();
    result = rf_flow_picture(&view, &render->picture, &to);
    slot->seconds = now_seconds() - start;
    return result == RF_OK ? CODE_DONE : fail_result(result, render->flow.path);
}

/// A file's maps: its heights as one channel, and its colours (grey where it has none) as three, sRGB-encoded.
typedef struct Relief
{
    RfImage *height, *colour;
} Relief;

static void relief_free(Relief *relief)
{
    rf_image_destroy(relief->height);
    rf_image_destroy(relief->colour);
    *relief = (Relief){0};
}

static RfResult make_colour(const RfImageView *frame, const Layout *layout, bool shown, RfImage **out)
{
    RfResult result = rf_image_create(frame->width, frame->height, 3, out);
    if (result != RF_OK)
        return result;
    RfImageView to = rf_image_view(*out);
    bool grey = layout->colours < 3;
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
            for (int c = 0; c < 3; ++c)
            {
                const float *pixel = frame->pixels + y * frame->row_stride + (ptrdiff_t)x * frame->channels;
                to.pixels[y * to.row_stride + (ptrdiff_t)x * 3 + c] = shown ? pixel[grey ? 0 : c] : g_plain_grey;
            }
    return RF_OK;
}

/// The channel named height, else the first; `named` says which.
static int height_channel(const Layout *layout, bool *named)
{
    for (int m = 0; m < layout->map_count; ++m)
        if (strcmp(layout->maps[m].name, "height") == 0)
        {
            *named = true;
            return layout->maps[m].first;
        }
    *named = false;
    return 0;
}

/// Reads one file; `colours` where it is known to hold colours and no heights.
static RfResult split_relief(const RfImage *image, bool colours, Relief *relief)
{
    Layout layout;
    RfImage *pixels = NULL;
    RfResult result = layout_split(image, &layout, &pixels);
    if (result != RF_OK)
        return result;
    RfImageView view = rf_image_view(pixels);
    bool named = false;
    int channel = height_channel(&layout, &named);
    result = layout_channels(&view, &layout, channel, 1, &relief->height);
    if (result == RF_OK)
        result = layout_encode(&view, &layout, RF_ENCODING_SRGB);
    bool shown = layout.colours > 0 && (colours || named);
    if (result == RF_OK)
        result = make_colour(&view, &layout, shown, &relief->colour);
    rf_image_destroy(pixels);
    return result;
}

static int read_relief(const ImageInput *input, int index, bool colours, Relief *relief)
{
    RfImage *image = NULL;
    *relief = (Relief){0};
    int code = image_input_read(input, index, &image);
    if (code)
        return code;
    RfResult result = split_relief(image, colours, relief);
    rf_image_destroy(image);
    return result == RF_OK ? CODE_DONE : fail_result(result, image_input_path(input, index));
}

/// Takes the heights of the frame's partner in place of its own.
static int take_heights(const Render *render, int frame, Relief *relief)
{
    int partner = image_input_find(&render->heights, frame);
    if (partner < 0)
        return fail(CODE_BAD_INPUT, render->heights.path, NULL, "has no frame %d, which the colours have", frame);
    Relief heights;
    int code = read_relief(&render->heights, partner, false, &heights);
    if (!code)
    {
        RfImage *own = relief->height;
        relief->height = heights.height;
        heights.height = own;
        RfImageView a = rf_image_view(relief->height), b = rf_image_view(relief->colour);
        if (a.width != b.width || a.height != b.height)
            code = fail(CODE_BAD_INPUT, image_input_path(&render->heights, partner), NULL,
                        "is %d x %d pixels, the colours %d x %d: they need one size", a.width, a.height, b.width,
                        b.height);
    }
    relief_free(&heights);
    return code;
}

static int draw_relief(Render *render, const Relief *relief, FrameSlot *slot)
{
    RfImageView height = rf_image_view(relief->height), colour = rf_image_view(relief->colour);
    render->width = render->width ? render->width : height.width;
    render->height = render->height ? render->height : height.height;
    RfResult result = make_frame(render, slot);
    if (result != RF_OK)
        return fail_result(result, render->images.path);
    RfImageView to = rf_image_view(slot->pixels);
    double start = now_seconds();
    result = rf_render_relief(&height, &colour, (float)render->settings->displace, &to);
    slot->seconds = now_seconds() - start;
    return result == RF_OK ? CODE_DONE : fail_result(result, render->images.path);
}

static int produce_relief(void *context, int index, int frame, bool drawn, FrameSlot *slot)
{
    Render *render = context;
    if (!drawn)
        return CODE_DONE;
    Relief relief = {0};
    bool mapped = render->heights.path != NULL;
    int code = read_relief(&render->images, render->indices[index], mapped, &relief);
    if (!code && mapped)
        code = take_heights(render, frame, &relief);
    if (!code)
        code = draw_relief(render, &relief, slot);
    relief_free(&relief);
    return code;
}

static uint64_t hash_settings(const Render *render, const InputFiles *inputs)
{
    const Settings *settings = render->settings;
    double numbers[] = {render->width,      render->height,       settings->picture, (double)render->picture.full_speed,
                        settings->displace, settings->frame_step, settings->fps};
    uint64_t hash = hash_add_text(inputs->hash, "render");
    hash = hash_add(hash, &settings->seed, sizeof settings->seed);
    return hash_add(hash, numbers, sizeof numbers);
}

static int render_flow(Render *render, const InputFiles *inputs, Outputs *outputs)
{
    static const RfFlowPicture pictures[] = {RF_FLOW_WHEEL, RF_FLOW_ARROWS, RF_FLOW_LIC};
    const Settings *settings = render->settings;
    FramePlan plan;
    FrameSource source = {.context = render, .produce = produce_picture};
    int code = flow_input_open(&render->flow, settings, settings->words[0]);
    if (!code)
        code = plan_of_flow(settings, render->flow.flow, settings->words[0], &plan);
    if (code)
        return code;
    // A steady flow looks the same in every frame: one name takes one of them.
    if (render->flow.info.moment_count == 1 && !settings->frames_given && outputs_hold_one(outputs))
        plan.count = 1;
    render->width = settings->width ? settings->width : render->flow.info.width;
    render->height = settings->height ? settings->height : render->flow.info.height;
    flow_input_warn_of_size(&render->flow, settings, render->width, render->height);
    render->picture = rf_flow_picture_defaults();
    render->picture.picture = pictures[settings->picture];
    render->picture.seed = settings->seed;
    // One scale for the whole run, so that colours do not flicker from frame to frame.
    render->picture.full_speed = (float)settings->full_speed;
    if (settings->full_speed == 0)
        code = flow_input_greatest(&render->flow, plan.first, plan_number(&plan, plan.count - 1),
                                   &render->picture.full_speed);
    if (code)
        return code;
    tell(settings, "full speed: %.4g cells a frame", (double)render->picture.full_speed);
    source.hash = hash_settings(render, inputs);
    code = flow_input_hash(&render->flow, settings, plan.first, &source.hash);
    return code ? code : run_frames(settings, &plan, &source, outputs);
}

static int render_relief(Render *render, const InputFiles *inputs, Outputs *outputs)
{
    const Settings *settings = render->settings;
    FramePlan plan = {0};
    FrameSource source = {.context = render, .produce = produce_relief};
    int code = image_input_open(&render->images, settings->words[0]);
    if (!code && settings->map_count)
        code = image_input_open(&render->heights, settings->maps[0].file);
    if (!code)
        code = plan_of_images(settings, &render->images, &plan, &render->indices);
    if (!code)
    {
        render->width = settings->width;
        render->height = settings->height;
        source.hash = hash_settings(render, inputs);
        source.hash = hash_add(source.hash, &plan.numbers[0], sizeof plan.numbers[0]);
        code = run_frames(settings, &plan, &source, outputs);
    }
    plan_free(&plan);
    return code;
}

static int check_options(const Settings *settings)
{
    bool relief = settings->picture == PICTURE_RELIEF;
    if (settings->map_count > 0 && !relief)
        return fail(CODE_USAGE, NULL, NULL, "--map belongs to --as relief");
    if (settings->map_count > 1 || (settings->map_count == 1 && strcmp(settings->maps[0].name, "height") != 0))
        return fail(CODE_USAGE, NULL, NULL, "--map %s: render takes height=FRAMES only", settings->maps[0].name);
    return CODE_DONE;
}

int run_render(Settings *settings)
{
    Render render = {.settings = settings};
    InputFiles inputs = {0};
    Outputs outputs;
    bool relief = settings->picture == PICTURE_RELIEF;
    int code = check_options(settings);
    if (code)
        return code;
    inputs_add(&inputs, settings->words[0], relief ? IMAGE_EXTENSIONS : FLOW_EXTENSIONS);
    if (settings->map_count)
        inputs_add(&inputs, settings->maps[0].file, IMAGE_EXTENSIONS);
    code = outputs_open(&outputs, settings, settings->words[1], false, &inputs);
    if (!code && relief)
        code = render_relief(&render, &inputs, &outputs);
    else if (!code)
        code = render_flow(&render, &inputs, &outputs);
    flow_input_close(&render.flow);
    image_input_close(&render.images);
    image_input_close(&render.heights);
    free(render.indices);
    inputs_free(&inputs);
    return code;
}
