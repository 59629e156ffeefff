// SPDX-License-Identifier: Apache-2.0
// The methods behind one type, so that a test or a benchmark can be said of all of them.
#pragma once

#include "riffle/riffle.h"

typedef union StepperOptions
{
    RfLagrangianOptions lagrangian;
    RfOptimizeOptions optimize;
    RfDirectionalOptions directional;
    RfEulerianOptions eulerian;
    RfDualOptions dual;
    RfSpritesOptions sprites;
    RfWarpOptions warp;
} StepperOptions;

typedef struct Stepper
{
    const char *name;
    const RfOption *(*table)(int *count);
    StepperOptions (*defaults)(void);
    RfResult (*create)(const RfExemplar *exemplar, const StepperOptions *options, void **out);
    RfResult (*step)(void *method, const RfFlowView *flow, const RfImageView *frame);
    RfResult (*advance)(void *method, const RfFlowView *flow, int width, int height);
    RfResult (*save)(const void *method, void **block, size_t *size);
    RfResult (*load)(const RfExemplar *exemplar, const StepperOptions *options, const void *block, size_t size,
                     void **out);
    void (*destroy)(void *method);
    /// NULL: the method has no particles to count.
    RfLagrangianStats (*stats)(const void *method);
} Stepper;

/// "lagrangian", "paper" (lagrangian with the paper's constants), "optimize", "directional", "eulerian", "dual",
/// "sprites", "warp"; NULL if there is none of the name.
const Stepper *stepper_find(const char *name);

/// The field of `options` that an option stands for, and its kind; NULL if there is none of the name.
void *stepper_field(const Stepper *stepper, StepperOptions *options, const char *name, RfOptionKind *kind);
/// Numbers for every kind. False if there is none of the name.
bool stepper_set(const Stepper *stepper, StepperOptions *options, const char *name, const char *value);
