// SPDX-License-Identifier: Apache-2.0
// The flow of a run, with the mask that the user gives in place of its own.
#pragma once

#include "options.h"

typedef struct FlowInput
{
    RfFlow *flow;
    RfFlowInfo info;
    const char *path;
    int moment_every;
    /// [height][width]; NULL: the flow's own.
    uint8_t *mask;
    uint64_t mask_hash;
} FlowInput;

/// Reads the mask of --mask too, if the verb has it.
int flow_input_open(FlowInput *input, const Settings *settings, const char *path);
void flow_input_close(FlowInput *input);
/// Warns of frames that stretch the flow by more than 2 %.
void flow_input_warn_of_size(const FlowInput *input, const Settings *settings, int width, int height);
/// Warns of a flow that crosses a quarter of its domain in a frame: nothing can be seen to move so fast.
void flow_input_warn_of_speed(const FlowInput *input, const Settings *settings);
int flow_input_at(FlowInput *input, int frame, RfFlowView *view);
/// The greatest speed of the fluid over some frames, in cells a frame: all their moments are read (or simulated) once.
int flow_input_greatest(FlowInput *input, int first_frame, int last_frame, float *speed);
/// Of everything that a flow's frames depend on: options, sizes and first moment; files are in InputFiles' hash.
int flow_input_hash(FlowInput *input, const Settings *settings, int first_frame, uint64_t *hash);
