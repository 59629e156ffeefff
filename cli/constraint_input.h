// SPDX-License-Identifier: Apache-2.0
// What a still texture is bound to: --fixed, --target, --guide, --orientation-map and --scale-map.
#pragma once

#include "exemplar_input.h"
#include "inputs.h"

enum
{
    MAX_CONSTRAINTS = 6
};

typedef struct ConstraintInput
{
    RfOptimizeConstraints constraints;
    RfImage *images[MAX_CONSTRAINTS];
    int image_count;
    /// Of the result: --size, else the first constraint's, else twice the exemplar's.
    int width, height;
    /// The image that has that size; NULL: none.
    const char *sized_by;
    /// The IMAGE and the WEIGHT of --target, and that as a number (no file).
    char *target, *weight;
    float weight_number;
} ConstraintInput;

/// Finds the files of --target, and adds all of them to the inputs.
int constraints_begin(ConstraintInput *input, const Settings *settings, InputFiles *files);
/// Reads them; `made` is what the result holds.
int constraints_read(ConstraintInput *input, const Settings *settings, const RfExemplar *exemplar, const Layout *made);
void constraints_close(ConstraintInput *input);
