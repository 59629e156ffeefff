// SPDX-License-Identifier: Apache-2.0
// The methods of `riffle texture`, as one table: a new method is one entry.
#pragma once

#include "riffle/riffle.h"

enum
{
    MAX_STAGES = 4,
    MAX_FIGURES = 4,
    /// Room for the largest options struct, checked when the table is used.
    METHOD_OPTIONS_SIZE = 256
};

/// Part of a frame's time.
typedef struct Stage
{
    const char *name;
    double seconds;
} Stage;

typedef struct Figure
{
    const char *name;
    double value;
} Figure;

/// What a method tells of a frame: how long its parts took, and figures of its own.
typedef struct FrameReport
{
    Stage stages[MAX_STAGES];
    int stage_count;
    Figure figures[MAX_FIGURES];
    int figure_count;
    /// What the user should know before anything is made; empty: nothing.
    char remark[200];
} FrameReport;

/// A method's options struct, whichever it is.
typedef union MethodOptions
{
    uint64_t align;
    unsigned char bytes[METHOD_OPTIONS_SIZE];
} MethodOptions;

typedef struct Method
{
    const char *name;
    const char *sentence;
    /// "default|paper", or NULL where there is only one.
    const char *presets;
    const RfOption *(*table)(int *count);
    /// `preset` is the index in `presets`.
    void (*defaults)(int preset, MethodOptions *options);
    RfResult (*create)(const RfExemplar *exemplar, const MethodOptions *options, void **out);
    RfResult (*step)(void *method, const RfFlowView *flow, const RfImageView *frame);
    RfResult (*advance)(void *method, const RfFlowView *flow, int width, int height);
    RfResult (*save)(const void *method, void **block, size_t *size);
    RfResult (*load)(const RfExemplar *exemplar, const MethodOptions *options, const void *block, size_t size,
                     void **out);
    void (*destroy)(void *method);
    /// NULL: the method has no layers to write.
    RfResult (*layers)(const void *method, const RfImageView *layers);
    /// Of the last step; NULL: there is nothing to tell.
    void (*report)(const void *method, FrameReport *report);
} Method;

const Method *method_table(int *count);
/// NULL if there is none of the name.
const Method *method_find(const char *name);
/// The first method that has an option of this name, and the option; NULL if none has.
const Method *method_with_option(const char *name, const RfOption **option);
/// NULL if the method has none of the name.
const RfOption *method_option(const Method *method, const char *name);
