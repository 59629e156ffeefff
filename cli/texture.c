// SPDX-License-Identifier: Apache-2.0
// riffle texture FLOW EXEMPLAR OUTPUT
#include "errors.h"
#include "exemplar_input.h"
#include "flow_input.h"
#include "run.h"
#include "verbs.h"

#include <stdio.h>
#include <string.h>

enum
{
    UV_CHANNELS = 16
};

typedef struct Texture
{
    const Settings *settings;
    const Method *method;
    MethodOptions options;
    void *state;
    FlowInput flow;
    ExemplarInput exemplar;
    /// Blended noise, where a shader makes the colour.
    RfImage *parameters;
    int width, height;
} Texture;

static RfResult make_image(const Texture *texture, int channels, RfImage **image)
{
    return *image ? RF_OK : rf_image_create(texture->width, texture->height, channels, image);
}

static RfResult make_uv(const Texture *texture, RfImage **image)
{
    static const char *const names[] = {"u", "v", "weight", "id"};
    RfResult result = make_image(texture, UV_CHANNELS, image);
    if (result != RF_OK)
        return result;
    for (int c = 0; c < UV_CHANNELS; ++c)
    {
        char name[16];
        snprintf(name, sizeof name, "%s%d", names[c % 4], c / 4);
        rf_image_set_channel_name(*image, c, name);
    }
    rf_image_set_origin(*image, RF_SAMPLE_FLOAT, RF_ENCODING_DATA);
    return RF_OK;
}

static RfResult step_shaded(Texture *texture, const RfFlowView *flow, FrameSlot *slot)
{
    RfResult result = make_image(texture, rf_exemplar_channels(texture->exemplar.exemplar), &texture->parameters);
    if (result == RF_OK)
        result = make_image(texture, 3, &slot->pixels);
    if (result != RF_OK)
        return result;
    RfImageView parameters = rf_image_view(texture->parameters), colour = rf_image_view(slot->pixels);
    result = texture->method->step(texture->state, flow, &parameters);
    if (result == RF_OK)
        result = rf_shade(texture->settings->shader, &parameters, &colour);
    slot->layout = (Layout){.format = texture->exemplar.layout.format};
    layout_add(&slot->layout, "colour", RF_MAP_COLOUR, 3);
    return result;
}

static RfResult step_plain(Texture *texture, const RfFlowView *flow, FrameSlot *slot)
{
    RfResult result = make_image(texture, rf_exemplar_channels(texture->exemplar.exemplar), &slot->pixels);
    if (result != RF_OK)
        return result;
    RfImageView frame = rf_image_view(slot->pixels);
    slot->layout = texture->exemplar.layout;
    return texture->method->step(texture->state, flow, &frame);
}

static RfResult draw(Texture *texture, const RfFlowView *flow, FrameSlot *slot)
{
    bool shaded = texture->settings->shader != RF_SHADER_NONE;
    RfResult result = shaded ? step_shaded(texture, flow, slot) : step_plain(texture, flow, slot);
    if (result != RF_OK)
        return result;
    rf_image_set_origin(slot->pixels, slot->layout.format, RF_ENCODING_SRGB);
    if (texture->method->report)
        texture->method->report(texture->state, &slot->report);
    if (!texture->settings->uv)
        return RF_OK;
    result = make_uv(texture, &slot->uv);
    if (result != RF_OK)
        return result;
    RfImageView uv = rf_image_view(slot->uv);
    return texture->method->layers(texture->state, &uv);
}

static int produce(void *context, int index, int frame, bool drawn, FrameSlot *slot)
{
    (void)index;
    Texture *texture = context;
    RfFlowView flow;
    int code = flow_input_at(&texture->flow, frame, &flow);
    if (code)
        return code;
    double start = now_seconds();
    RfResult result = drawn ? draw(texture, &flow, slot)
                            : texture->method->advance(texture->state, &flow, texture->width, texture->height);
    slot->seconds = now_seconds() - start;
    if (result == RF_OUT_OF_MEMORY)
        return fail(CODE_FAILED, NULL, NULL, "out of memory with frames of %d x %d pixels; give a smaller --size",
                    texture->width, texture->height);
    return result == RF_OK ? CODE_DONE : fail_result(result, NULL);
}

static int save(void *context, void **block, size_t *size)
{
    const Texture *texture = context;
    RfResult result = texture->method->save(texture->state, block, size);
    return result == RF_OK ? CODE_DONE : fail_result(result, NULL);
}

static int load(void *context, const void *block, size_t size)
{
    Texture *texture = context;
    texture->method->destroy(texture->state);
    texture->state = NULL;
    RfResult result =
        texture->method->load(texture->exemplar.exemplar, &texture->options, block, size, &texture->state);
    return result == RF_OK ? CODE_DONE : fail_result(result, NULL);
}

/// The options by value, so that padding between fields and the struct's growth do not matter.
static uint64_t hash_options(const Texture *texture, uint64_t hash)
{
    int count = 0;
    const RfOption *table = texture->method->table(&count);
    static const size_t sizes[] = {sizeof(float), sizeof(int), sizeof(uint64_t),
                                   sizeof(bool),  sizeof(int), RF_MAX_OPTION_INTS * sizeof(int)};
    hash = hash_add_text(hash, texture->method->name);
    for (int i = 0; i < count; ++i)
    {
        hash = hash_add_text(hash, table[i].name);
        hash = hash_add(hash, texture->options.bytes + table[i].offset, sizes[table[i].kind]);
    }
    return hash;
}

static int hash_run(Texture *texture, const FramePlan *plan, const InputFiles *inputs, uint64_t *hash)
{
    const Settings *settings = texture->settings;
    int facts[] = {texture->width, texture->height,  plan->first,          plan->step,
                   settings->uv,   settings->shader, (int)settings->tiling};
    uint64_t files[] = {inputs->hash, texture->exemplar.hash};
    *hash = hash_add_text(0, "texture");
    *hash = hash_add_text(*hash, rf_version());
    *hash = hash_options(texture, *hash);
    *hash = hash_add(*hash, facts, sizeof facts);
    *hash = hash_add(*hash, files, sizeof files);
    return flow_input_hash(&texture->flow, settings, plan->first, hash);
}

static int open_texture(Texture *texture, const Settings *settings)
{
    int code = settings_method_options(settings, &texture->options);
    if (!code)
        code = flow_input_open(&texture->flow, settings, settings->words[0]);
    if (!code)
        code =
            exemplar_input_read(settings, settings->words[1], settings->shader != RF_SHADER_NONE, &texture->exemplar);
    if (code)
        return code;
    texture->width = settings->width ? settings->width : texture->flow.info.width;
    texture->height = settings->height ? settings->height : texture->flow.info.height;
    RfResult result = texture->method->create(texture->exemplar.exemplar, &texture->options, &texture->state);
    // An option that the method refuses is not the exemplar's fault.
    return result == RF_OK ? CODE_DONE : fail_result(result, result == RF_INVALID_ARGUMENT ? NULL : settings->words[1]);
}

static void tell_texture(const Texture *texture, const FramePlan *plan)
{
    const RfFlowInfo *info = &texture->flow.info;
    const RfExemplar *exemplar = texture->exemplar.exemplar;
    const Settings *settings = texture->settings;
    tell(settings, "flow: %s, %d x %d cells, %s; %s; greatest speed %.3g cells a frame", info->format, info->width,
         info->height, info->has_mask ? "with a mask" : "no mask", info->conventions, (double)info->max_speed);
    tell(settings, "exemplar: %d x %d pixels, %d channels, %s", rf_exemplar_width(exemplar),
         rf_exemplar_height(exemplar), rf_exemplar_channels(exemplar),
         rf_exemplar_tiles(exemplar) ? "tiles" : "does not tile");
    tell(settings, "method: %s, frames %d to %d, %d x %d pixels, %s, %d thread%s", texture->method->name,
         plan_number(plan, 0), plan_number(plan, plan->count - 1), texture->width, texture->height, rf_simd_name(),
         rf_threads(), rf_threads() == 1 ? "" : "s");
    flow_input_warn_of_size(&texture->flow, settings, texture->width, texture->height);
    flow_input_warn_of_speed(&texture->flow, settings);
    FrameReport report = {.stage_count = 0};
    if (texture->method->report)
        texture->method->report(texture->state, &report);
    if (report.remark[0])
        warn(settings, settings->words[1], "%s", report.remark);
    if (info->filled_vectors > 0)
        warn(settings, settings->words[0], "%d invalid vector%s filled from %s neighbours", info->filled_vectors,
             info->filled_vectors == 1 ? " was" : "s were", info->filled_vectors == 1 ? "its" : "their");
}

static int stream_texture(Texture *texture, const InputFiles *inputs)
{
    const Settings *settings = texture->settings;
    FrameSource source = {.context = texture, .produce = produce, .save = save, .load = load};
    FramePlan plan;
    Outputs outputs;
    int code = outputs_open(&outputs, settings, settings->words[2], false, inputs);
    if (!code)
        code = open_texture(texture, settings);
    if (!code)
        code = plan_of_flow(settings, texture->flow.flow, settings->words[0], &plan);
    if (!code)
        code = hash_run(texture, &plan, inputs, &source.hash);
    if (code)
        return code;
    tell_texture(texture, &plan);
    return run_frames(settings, &plan, &source, &outputs);
}

int run_texture(Settings *settings)
{
    Texture texture = {.settings = settings, .method = settings->method};
    InputFiles inputs = {0};
    inputs_add(&inputs, settings->words[0], FLOW_EXTENSIONS);
    inputs_add(&inputs, settings->words[1], IMAGE_EXTENSIONS);
    for (int i = 0; i < settings->map_count; ++i)
        inputs_add(&inputs, settings->maps[i].file, IMAGE_EXTENSIONS);
    if (settings->mask)
        inputs_add(&inputs, settings->mask, IMAGE_EXTENSIONS);
    int code = stream_texture(&texture, &inputs);
    if (texture.state)
        texture.method->destroy(texture.state);
    rf_image_destroy(texture.parameters);
    exemplar_input_close(&texture.exemplar);
    flow_input_close(&texture.flow);
    inputs_free(&inputs);
    return code;
}
