// SPDX-License-Identifier: Apache-2.0
#include "flow_input.h"
#include "errors.h"
#include "inputs.h"
#include "mask_input.h"
#include "progress.h"

#include <math.h>
#include <stdlib.h>

static int read_mask(FlowInput *input, const char *path)
{
    int width = input->info.width, height = input->info.height;
    int code = mask_read(path, width, height, &input->mask);
    if (!code)
        input->mask_hash = hash_add(1, input->mask, (size_t)width * (size_t)height);
    return code;
}

/// Where the files' numbers are not the frames', someone may have meant them to be.
static void warn_of_gaps(const FlowInput *input, const Settings *settings)
{
    const RfFlowInfo *info = &input->info;
    int64_t last = info->first_frame + (int64_t)(info->moment_count - 1) * info->number_step;
    if (info->number_step == 0)
        warn(settings, input->path,
             "the files' numbers have gaps, which are passed over: each file is one moment, frames %d to %d",
             info->first_frame, info->last_frame);
    else if (info->number_step > 1 && settings->moment_every == 1)
        warn(settings, input->path,
             "the files' numbers go up by %d, but each file is one moment, frames %d to %d; --moment-every %d makes "
             "them frames %d to %lld",
             info->number_step, info->first_frame, info->last_frame, info->number_step, info->first_frame,
             (long long)last);
}

int flow_input_open(FlowInput *input, const Settings *settings, const char *path)
{
    *input = (FlowInput){.path = path, .moment_every = settings->moment_every};
    RfFlowReadOptions options = rf_flow_read_defaults();
    options.fps = (float)settings->fps;
    options.velocity_scale = (float)settings->velocity_scale;
    options.moment_every = settings->moment_every;
    options.variables = settings->variables;
    RfResult result = rf_flow_open(path, &options, &input->flow);
    if (result != RF_OK)
        return fail_result(result, path);
    input->info = rf_flow_info(input->flow);
    warn_of_gaps(input, settings);
    return settings->mask ? read_mask(input, settings->mask) : CODE_DONE;
}

void flow_input_close(FlowInput *input)
{
    rf_flow_close(input->flow);
    free(input->mask);
    *input = (FlowInput){0};
}

void flow_input_warn_of_size(const FlowInput *input, const Settings *settings, int width, int height)
{
    const RfFlowInfo *info = &input->info;
    double stretch = (double)width / info->width * info->height / height;
    // Less than a pixel is rounding.
    bool rounding = fabs((double)height * info->width / info->height - width) < 1;
    if (rounding || (stretch < 1.02 && stretch > 1 / 1.02))
        return;
    warn(settings, input->path,
         "%d x %d cells in frames of %d x %d pixels: all is stretched %.3g times along %s; %s%.0fx%d would not",
         info->width, info->height, width, height, stretch > 1 ? stretch : 1 / stretch, stretch > 1 ? "x" : "y",
         settings->verb->bit == VERB_MEASURE ? "frames of " : "--size ",
         fmax(1, round((double)height * info->width / info->height)), height);
}

void flow_input_warn_of_speed(const FlowInput *input, const Settings *settings)
{
    const RfFlowInfo *info = &input->info;
    double side = fmin(info->width, info->height), share = (double)info->max_speed / side;
    if (share > 0.25)
        warn(settings, input->path,
             "crosses %.3g of its domain in a frame (%.4g of %.0f cells at its fastest): is it in other units? "
             "--velocity-scale %.2g would make it 0.01",
             share, (double)info->max_speed, side, settings->velocity_scale * 0.01 / share);
}

int flow_input_at(FlowInput *input, int frame, RfFlowView *view)
{
    RfResult result = rf_flow_at(input->flow, frame, view);
    if (result != RF_OK)
        return fail_result(result, input->path);
    if (input->mask)
        view->mask = input->mask;
    return CODE_DONE;
}

static float greatest_in(const float *velocity, const uint8_t *mask, size_t cells)
{
    float square = 0;
    for (size_t k = 0; k < cells; ++k)
        if (!mask || mask[k])
            square = fmaxf(square, velocity[2 * k] * velocity[2 * k] + velocity[2 * k + 1] * velocity[2 * k + 1]);
    return sqrtf(square);
}

int flow_input_greatest(FlowInput *input, int first_frame, int last_frame, float *speed)
{
    *speed = 0;
    // Between two moments velocities are means of theirs, so only moments count: one step sees two.
    for (int64_t frame = first_frame, last = first_frame - 1; last < last_frame; frame += input->moment_every)
    {
        RfFlowView view;
        last = frame < last_frame ? frame : last_frame;
        int code = flow_input_at(input, (int)last, &view);
        if (code)
            return code;
        size_t cells = (size_t)view.width * (size_t)view.height;
        if (last == first_frame || !view.next_velocity)
            *speed = fmaxf(*speed, greatest_in(view.velocity, view.mask, cells));
        if (!view.next_velocity)
            break;
        *speed = fmaxf(*speed, greatest_in(view.next_velocity, view.mask, cells));
    }
    return CODE_DONE;
}

int flow_input_hash(FlowInput *input, const Settings *settings, int first_frame, uint64_t *hash)
{
    RfFlowView view;
    int code = flow_input_at(input, first_frame, &view);
    if (code)
        return code;
    double numbers[] = {settings->fps, settings->velocity_scale, view.width,
                        view.height,   input->info.first_frame,  settings->moment_every};
    *hash = hash_add(*hash, numbers, sizeof numbers);
    *hash = hash_add(*hash, view.velocity, (size_t)view.width * (size_t)view.height * 2 * sizeof(float));
    *hash = hash_add(*hash, &input->mask_hash, sizeof input->mask_hash);
    *hash = hash_add_text(*hash, settings->variables ? settings->variables : "");
    return CODE_DONE;
}
