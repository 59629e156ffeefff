// SPDX-License-Identifier: Apache-2.0
// Reading and writing: images, 2D flows, numbered sequences, video.
//
// Every file's fault comes back as a result with file, place and remedy in rf_last_error(). Files are written under a
// temporary name in the same folder, flushed and renamed, so a reader never sees half of one.
#pragma once

#include "data.h"

// ---- images ------------------------------------------------------------------------------------------------------

/// Reads PNG (8, 16 bit), JPEG, EXR (half, float, any named channels), PGM or PPM, known by content, or a built-in
/// exemplar
/// ("builtin:foam?size=128", the names of rf_builtin_table). PNG, JPEG, PGM and PPM come as sRGB-encoded 0 to 1, EXR as
/// linear. EXR channels come in the order R G B A, then the others by name.
RF_API RF_MUST_USE RfResult rf_image_read(const char *path, RfImage **out);

/// Writes PNG, EXR or NPY by the extension. PNG: 8 bit for RF_SAMPLE_U8, else 16; 1 to 4 channels, values clamped to
/// 0..1 and taken as they are. EXR: half for RF_SAMPLE_HALF (limited to 65504), else float; sRGB-encoded colour is made
/// linear. NPY: float32 [H, W, C] as they are. Replaces `path` whether it exists or not; asking first is the caller's
/// affair.
RF_API RF_MUST_USE RfResult rf_image_write(const char *path, const RfImage *image);

/// The bytes of a PNG, as rf_image_write would put them into a file but smaller and slower; freed with rf_free.
RF_API RF_MUST_USE RfResult rf_image_encode_png(const RfImage *image, void **block, size_t *size);

// ---- numbered sequences ------------------------------------------------------------------------------------------

/// The files that a pattern (name.%04d.ext, name.####.ext, name.$F4.ext), a directory or a single file stands for, in
/// the order of their numbers.
typedef struct RfSequence RfSequence;

/// Extensions as "png,jpg,exr" pick the files of a directory; NULL takes all. A single file is a sequence of one.
RF_API RF_MUST_USE RfResult rf_sequence_open(const char *path, const char *extensions, RfSequence **out);
RF_API void rf_sequence_destroy(RfSequence *sequence);
RF_API int rf_sequence_count(const RfSequence *sequence);
RF_API const char *rf_sequence_path(const RfSequence *sequence, int index);
/// The number in the file's name; for names without one, its place in the order, from 1.
RF_API int rf_sequence_number(const RfSequence *sequence, int index);

// ---- 2D flows ----------------------------------------------------------------------------------------------------

typedef struct RfFlowReadOptions
{
    /// Set by rf_flow_read_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Frames a second, > 0. Turns velocities given in world units a second into cells a frame. Default 24.
    float fps;
    /// Multiplies every velocity. Default 1.
    float velocity_scale;
    /// Frames from one moment of the file to the next, >= 1. Default 1.
    int moment_every;
    /// "U,V": names of the two components in NetCDF, VTK and EXR. NULL: found by the usual names.
    const char *variables;
} RfFlowReadOptions;

RF_API RfFlowReadOptions rf_flow_read_defaults(void);

/// A flow of one or many moments, read (or simulated) as it is needed: at most two moments are in memory.
typedef struct RfFlow RfFlow;

typedef struct RfFlowInfo
{
    /// Cells.
    int width, height;
    /// Number of moments; 1 is a steady flow, 0 an endless one (a built-in simulation).
    int moment_count;
    /// The frame of the first moment: the number in the first file's name, the container's first index, or 1.
    int first_frame;
    /// The frame of the last moment: first_frame + (moment_count - 1) * moment_every. For steady and endless flows
    /// first_frame + 99.
    int last_frame;
    /// What the numbers of the files go up by from one to the next, 0 where that changes. They are no times: file n is
    /// moment n, and a missing number is passed over. 1 where there are no numbers.
    int number_step;
    bool has_mask;
    /// Vectors marked invalid in the first moment and filled from their neighbours.
    int filled_vectors;
    /// Greatest and mean speed of the first moment's fluid, in cells a frame after all scaling; land does not count.
    float max_speed, mean_speed;
    /// "flo", "npy", "nc", "builtin", ...
    char format[16];
    /// What the reader did about units and axes, one line: "m/s over 0.25 m cells at 24 frames a second; y flipped".
    char conventions[256];
} RfFlowInfo;

/// Opens a file, a pattern, a directory, a container with time in it or a built-in flow
/// ("builtin:gyre?size=512x256&speed=2"). options may be NULL.
RF_API RF_MUST_USE RfResult rf_flow_open(const char *path, const RfFlowReadOptions *options, RfFlow **out);
RF_API void rf_flow_close(RfFlow *flow);
RF_API RfFlowInfo rf_flow_info(const RfFlow *flow);

/// The moments between which the step from frame - 1 to frame lies, and `time` = frame. Borrowed until the next call
/// with the same flow. Any order of frames is allowed; going forward is fast.
RF_API RF_MUST_USE RfResult rf_flow_at(RfFlow *flow, int frame, RfFlowView *out);

/// Writes the velocity at view->velocity_time, in cells a frame, as .flo, .npy ([H, W, 2]), .exr (R, G) or .vti (world
/// units a second, y up, cell size 1, at `fps` frames a second). The mask is written where the format can (.vti), else
/// zero velocity marks the land.
RF_API RF_MUST_USE RfResult rf_flow_write(const char *path, const RfFlowView *view, float fps);

/// Several moments of one size being written to one .npy ([T, H, W, 2]), in the order of time.
typedef struct RfFlowArray RfFlowArray;

RF_API RF_MUST_USE RfResult rf_flow_array_open(const char *path, int width, int height, int moments, RfFlowArray **out);
/// Land is written as zero velocity.
RF_API RF_MUST_USE RfResult rf_flow_array_write(RfFlowArray *array, const RfFlowView *view);
/// Finishes and renames the file once all moments are there; on failure, and when `keep` is false, nothing stays. Frees
/// the array in every case; accepts NULL.
RF_API RfResult rf_flow_array_close(RfFlowArray *array, bool keep);

// ---- built-in inputs ---------------------------------------------------------------------------------------------

typedef struct RfBuiltin
{
    /// Without the "builtin:".
    const char *name;
    /// "flow" or "exemplar".
    const char *kind;
    /// "size=256x256&speed=1": every parameter with its default.
    const char *parameters;
    /// One sentence.
    const char *sentence;
} RfBuiltin;

RF_API const RfBuiltin *rf_builtin_table(int *count);

// ---- video -------------------------------------------------------------------------------------------------------

/// A video being encoded by the `ffmpeg` program, fed raw frames through a pipe.
typedef struct RfVideo RfVideo;

/// .mp4, .webm, .mov or .gif. Odd sizes are padded by a row or column. RF_UNSUPPORTED, with the remedy, if there is no
/// ffmpeg.
RF_API RF_MUST_USE RfResult rf_video_open(const char *path, int width, int height, float fps, RfVideo **out);
/// Takes 1, 3 or 4 sRGB-encoded channels, 0 to 1; alpha is laid over black.
RF_API RF_MUST_USE RfResult rf_video_write(RfVideo *video, const RfImageView *frame);
/// Finishes and renames the file; on failure, and when `keep` is false, nothing stays. Frees the video in every case;
/// accepts NULL.
RF_API RfResult rf_video_close(RfVideo *video, bool keep);
