// SPDX-License-Identifier: Apache-2.0
// Everything a run writes: OUTPUT and each -o, fed frame by frame.
#pragma once

#include "errors.h"
#include "inputs.h"
#include "layout.h"
#include "options.h"
#include "pattern.h"

typedef enum OutputKind
{
    OUTPUT_IMAGE,
    OUTPUT_FLOW,
    /// All moments of a flow in one file.
    OUTPUT_ARRAY,
    OUTPUT_VIDEO,
    OUTPUT_NULL,
    OUTPUT_MD5,
    OUTPUT_STDOUT
} OutputKind;

typedef struct Output
{
    OutputKind kind;
    const char *text;
    Pattern pattern;
    RfVideo *video;
    RfFlowArray *array;
    /// Of the open video.
    int width, height;
    /// There is no encoder: the frames go on, the run ends with this fault.
    bool without_video;
} Output;

typedef struct Outputs
{
    Output list[MAX_OUTPUTS];
    int count;
    const Settings *settings;
    const InputFiles *inputs;
    /// What is there may be replaced: -y, or a resumed run's own frames.
    bool replace;
    /// Of frames, once the outputs are gathered.
    int count_of_frames;
    /// A failure to report at the end of a run that went on without a video.
    bool video_missing;
    Fault missing;
} Outputs;

/// Finds what each output is; `flows` says that fields are written, not pictures. The inputs must outlive the outputs.
int outputs_open(Outputs *outputs, const Settings *settings, const char *destination, bool flows,
                 const InputFiles *inputs);
/// With `count` frames to come: one .npy for many moments of a flow takes them all. These cannot be resumed.
int outputs_gather(Outputs *outputs, int count);
/// Refuses what cannot work before anything is computed: one name for many frames, files that exist, inputs, folders
/// that do not. `number(context, i)` is the i-th frame written, of `count`.
int outputs_check(Outputs *outputs, int (*number)(const void *context, int index), const void *context, int count);
/// True if every file of the run is there: what `--resume` finds behind a run that came to its end.
bool outputs_complete(const Outputs *outputs, int (*number)(const void *context, int index), const void *context,
                      int count);
/// The first image output, NULL if there is none.
const Output *outputs_first_image(const Outputs *outputs);
bool outputs_have(const Outputs *outputs, OutputKind kind);
/// Images alone, each of one name without a number: room for one frame.
bool outputs_hold_one(const Outputs *outputs);
/// Only null:, so that nothing is gained by writing while computing.
bool outputs_idle(const Outputs *outputs);

/// Writes one frame to all outputs; `pixels` has the layout's channels and is not changed. uv may be NULL.
int outputs_write(Outputs *outputs, int frame, const RfImage *pixels, const Layout *layout, const RfImage *uv);
/// One field to all outputs.
int outputs_write_flow(Outputs *outputs, int frame, const RfFlowView *flow);
/// Removes the temporary files that a killed run left beside its frames.
void outputs_sweep(const Outputs *outputs);
/// Encodes a frame written by an earlier run again.
int outputs_replay(Outputs *outputs, int frame);
/// Ends the videos; without `keep` they vanish. Reports a missing encoder. Does nothing the second time.
int outputs_close(Outputs *outputs, bool keep);
