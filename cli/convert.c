// SPDX-License-Identifier: Apache-2.0
// riffle convert INPUT OUTPUT
#include "errors.h"
#include "flow_input.h"
#include "image_input.h"
#include "run.h"
#include "text.h"
#include "verbs.h"

#include <stdlib.h>
#include <string.h>

typedef struct Convert
{
    const Settings *settings;
    ImageInput images;
    FlowInput flow;
    /// Where the plan's frames stand among the images.
    int *indices;
} Convert;

static int produce_image(void *context, int index, int frame, bool drawn, FrameSlot *slot)
{
    (void)frame, (void)drawn;
    Convert *convert = context;
    RfImage *image = NULL;
    rf_image_destroy(slot->pixels);
    slot->pixels = NULL;
    int code = image_input_read(&convert->images, convert->indices[index], &image);
    if (code)
        return code;
    RfResult result = layout_split(image, &slot->layout, &slot->pixels);
    rf_image_destroy(image);
    return result == RF_OK ? CODE_DONE
                           : fail_result(result, image_input_path(&convert->images, convert->indices[index]));
}

/// The velocity at view->time, which the view holds as two moments.
static void fill_field(const RfFlowView *view, FrameSlot *slot)
{
    size_t cells = (size_t)view->width * (size_t)view->height;
    double span = view->next_time - view->velocity_time;
    double part = view->next_velocity && span > 0 ? (view->time - view->velocity_time) / span : 0;
    float t = part > 0 ? (part < 1 ? (float)part : 1) : 0;
    for (size_t i = 0; i < 2 * cells; ++i)
    {
        float a = view->velocity[i], b = view->next_velocity ? view->next_velocity[i] : a;
        slot->velocity[i] = t == 1 ? b : a + t * (b - a);
    }
    if (view->mask)
        memcpy(slot->mask, view->mask, cells);
    slot->flow = (RfFlowView){.width = view->width,
                              .height = view->height,
                              .velocity = slot->velocity,
                              .velocity_time = view->time,
                              .next_time = view->time,
                              .time = view->time,
                              .mask = view->mask ? slot->mask : NULL};
}

static int produce_flow(void *context, int index, int frame, bool drawn, FrameSlot *slot)
{
    (void)index;
    Convert *convert = context;
    RfFlowView view;
    int code = drawn ? flow_input_at(&convert->flow, frame, &view) : CODE_DONE;
    if (code || !drawn)
        return code;
    size_t cells = (size_t)view.width * (size_t)view.height;
    slot->velocity = slot->velocity ? slot->velocity : malloc(2 * cells * sizeof(float));
    slot->mask = slot->mask ? slot->mask : malloc(cells);
    if (!slot->velocity || !slot->mask)
        return fail(CODE_FAILED, convert->flow.path, NULL, "out of memory");
    fill_field(&view, slot);
    return CODE_DONE;
}

static int convert_images(Convert *convert, const InputFiles *inputs, Outputs *outputs)
{
    const Settings *settings = convert->settings;
    FramePlan plan = {0};
    FrameSource source = {.context = convert, .produce = produce_image};
    int code = image_input_open(&convert->images, settings->words[0]);
    if (!code)
        code = plan_of_images(settings, &convert->images, &plan, &convert->indices);
    if (!code)
    {
        source.hash = hash_add_text(inputs->hash, "convert images");
        source.hash = hash_add(source.hash, &plan.numbers[0], sizeof plan.numbers[0]);
        source.hash = hash_add(source.hash, &settings->frame_step, sizeof settings->frame_step);
        code = run_frames(settings, &plan, &source, outputs);
    }
    plan_free(&plan);
    return code;
}

static int convert_flow(Convert *convert, const InputFiles *inputs, Outputs *outputs)
{
    const Settings *settings = convert->settings;
    FramePlan plan;
    FrameSource source = {.context = convert, .produce = produce_flow};
    int code = flow_input_open(&convert->flow, settings, settings->words[0]);
    if (!code)
        code = plan_of_flow(settings, convert->flow.flow, settings->words[0], &plan);
    // A steady flow is one field, not a hundred.
    if (!code && convert->flow.info.moment_count == 1 && !settings->frames_given)
        plan.count = 1;
    if (code)
        return code;
    source.hash = hash_add_text(inputs->hash, "convert flow");
    source.hash = hash_add(source.hash, &plan.step, sizeof plan.step);
    code = flow_input_hash(&convert->flow, settings, plan.first, &source.hash);
    return code ? code : run_frames(settings, &plan, &source, outputs);
}

int run_convert(Settings *settings)
{
    const char *from = settings->words[0], *to = settings->words[1];
    Convert convert = {.settings = settings};
    InputFiles inputs = {0};
    Outputs outputs;
    InputKind kind = INPUT_IMAGES;
    bool to_field = text_extension_in(to, "flo|vti");
    bool to_picture = text_extension_in(to, "png|mp4|webm|mov|gif");
    int code = input_kind(from, to_field || settings->variables, !to_picture, &kind);
    if (code)
        return code;
    inputs_add(&inputs, from, kind == INPUT_FLOW ? FLOW_EXTENSIONS : IMAGE_EXTENSIONS);
    code = outputs_open(&outputs, settings, to, kind == INPUT_FLOW, &inputs);
    if (!code && kind == INPUT_FLOW)
        code = convert_flow(&convert, &inputs, &outputs);
    else if (!code)
        code = convert_images(&convert, &inputs, &outputs);
    image_input_close(&convert.images);
    flow_input_close(&convert.flow);
    free(convert.indices);
    inputs_free(&inputs);
    return code;
}
