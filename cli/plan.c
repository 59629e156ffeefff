// SPDX-License-Identifier: Apache-2.0
#include "errors.h"
#include "run.h"

#include <stdlib.h>

int plan_number(const FramePlan *plan, int index)
{
    return plan->numbers ? plan->numbers[index] : plan->first + index;
}

bool plan_drawn(const FramePlan *plan, int index)
{
    return index % plan->step == 0;
}

int plan_drawn_count(const FramePlan *plan)
{
    return (plan->count - 1) / plan->step + 1;
}

int plan_of_flow(const Settings *settings, const RfFlow *flow, const char *path, FramePlan *plan)
{
    RfFlowInfo info = rf_flow_info(flow);
    int first = settings->frames_given ? settings->first_frame : info.first_frame;
    int last = settings->frames_given ? settings->last_frame : info.last_frame;
    if (info.moment_count > 1 && (first < info.first_frame || first > info.last_frame))
        return fail(CODE_USAGE, NULL, NULL, "--frames %d-%d: %s has the frames %d to %d", first, last, path,
                    info.first_frame, info.last_frame);
    if (info.moment_count > 1 && last > info.last_frame)
        warn(settings, path, "has the frames %d to %d; behind them its velocity stays as it is", info.first_frame,
             info.last_frame);
    int64_t count = (int64_t)last - first + 1;
    // What would be passed over behind the last frame written is not computed.
    count = (count - 1) / settings->frame_step * settings->frame_step + 1;
    *plan = (FramePlan){.first = first, .count = (int)count, .step = settings->frame_step};
    return CODE_DONE;
}

int plan_of_images(const Settings *settings, const ImageInput *images, FramePlan *plan, int **indices)
{
    int count = image_input_count(images), kept = 0;
    int *numbers = malloc((size_t)count * sizeof *numbers);
    *indices = malloc((size_t)count * sizeof **indices);
    *plan = (FramePlan){.step = 1, .numbers = numbers};
    if (!numbers || !*indices)
        return fail(CODE_FAILED, images->path, NULL, "out of memory");
    for (int i = 0; i < count; ++i)
    {
        int number = image_input_number(images, i);
        int64_t from_first = (int64_t)number - (settings->frames_given ? settings->first_frame : 0);
        bool wanted = !settings->frames_given ||
                      (from_first >= 0 && number <= settings->last_frame && from_first % settings->frame_step == 0);
        if (!wanted)
            continue;
        numbers[kept] = number;
        (*indices)[kept] = i;
        ++kept;
    }
    plan->count = kept;
    if (kept == 0)
        return fail(CODE_USAGE, NULL, NULL, "--frames %d-%d: %s has the frames %d to %d", settings->first_frame,
                    settings->last_frame, images->path, image_input_number(images, 0),
                    image_input_number(images, count - 1));
    return CODE_DONE;
}

void plan_free(FramePlan *plan)
{
    free((void *)plan->numbers);
    plan->numbers = NULL;
}
