// SPDX-License-Identifier: Apache-2.0
// The exemplar of a run: EXEMPLAR's own channels and each --map, as registered maps.
#pragma once

#include "layout.h"
#include "options.h"

typedef struct ExemplarInput
{
    RfExemplar *exemplar;
    /// Of the frames made from it.
    Layout layout;
    /// Of all pixels, kinds, names and weights.
    uint64_t hash;
} ExemplarInput;

/// With `colour_only`, for shaders, everything but the colour is left out.
int exemplar_input_read(const Settings *settings, const char *path, bool colour_only, ExemplarInput *input);
void exemplar_input_close(ExemplarInput *input);
