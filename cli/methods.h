// SPDX-License-Identifier: Apache-2.0
// The methods of `riffle texture`, as one table: a new method is one entry.
#pragma once

#include "riffle/riffle.h"

enum
{
    MAX_STAGES = 4,
    /// Room for the largest options struct, checked when the table is used.
    METHOD_OPTIONS_SIZE = 256
};

/// Part of a frame's time.
typedef struct Stage
{
    const char *name;
    double seconds;
} Stage;

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
    /// The last step's times; NULL: the whole step is one stage.
    int (*stages)(const void *method, Stage stages[MAX_STAGES]);
} Method;

const Method *method_table(int *count);
/// NULL if there is none of the name.
const Method *method_find(const char *name);
/// The first method that has an option of this name, and the option; NULL if none has.
const Method *method_with_option(const char *name, const RfOption **option);
/// NULL if the method has none of the name.
const RfOption *method_option(const Method *method, const char *name);
