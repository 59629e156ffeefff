// SPDX-License-Identifier: Apache-2.0
// A run of frames: computing one while the one before is written, telling, stopping, and going on where a run stopped.
#pragma once

#include "image_input.h"
#include "outputs.h"
#include "progress.h"

/// The frames of a run: first, first + 1, ..., or the numbers of a sequence. All are computed in order, and every
/// `step`-th is written.
typedef struct FramePlan
{
    int first, count, step;
    /// NULL: consecutive.
    const int *numbers;
} FramePlan;

int plan_number(const FramePlan *plan, int index);
bool plan_drawn(const FramePlan *plan, int index);
/// How many are written.
int plan_drawn_count(const FramePlan *plan);

/// What a source makes of one frame. Images belong to the slot; a source makes them when they are NULL or of the wrong
/// size.
typedef struct FrameSlot
{
    RfImage *pixels;
    RfImage *uv;
    /// In place of pixels: a field. Velocity and mask are the slot's, from malloc.
    RfFlowView flow;
    float *velocity;
    uint8_t *mask;
    Layout layout;
    FrameReport report;
    /// Computing alone, as the source measures it; and all it took, reading or simulating its inputs included.
    double seconds, busy_seconds;
    /// The source's state behind this frame, where it was asked for; from malloc by rf_free's rules.
    void *block;
    size_t block_size;
    double save_seconds;
} FrameSlot;

typedef struct FrameSource
{
    void *context;
    /// Computes the index-th frame of the plan; fills the slot if it is drawn.
    int (*produce)(void *context, int index, int frame, bool drawn, FrameSlot *slot);
    /// State behind the last frame. NULL: there is none, frames do not depend on each other.
    int (*save)(void *context, void **block, size_t *size);
    int (*load)(void *context, const void *block, size_t size);
    /// Of inputs and options.
    uint64_t hash;
} FrameSource;

/// Runs the plan; the outputs are open and not yet checked, and are closed in every case.
int run_frames(const Settings *settings, const FramePlan *plan, const FrameSource *source, Outputs *outputs);

/// The plan for a flow: --frames, or all there are. Frames that a flow of many moments does not have are refused at its
/// beginning and told of at its end.
int plan_of_flow(const Settings *settings, const RfFlow *flow, const char *path, FramePlan *plan);
/// The plan for a numbered sequence, and where each of its frames stands in it: free both with plan_free and free.
int plan_of_images(const Settings *settings, const ImageInput *images, FramePlan *plan, int **indices);
void plan_free(FramePlan *plan);
