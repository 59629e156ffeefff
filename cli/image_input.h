// SPDX-License-Identifier: Apache-2.0
// Images by number: a file, a pattern, a directory or a built-in exemplar.
#pragma once

#include "riffle/riffle.h"

typedef struct ImageInput
{
    const char *path;
    /// NULL: built in, one image.
    RfSequence *sequence;
} ImageInput;

int image_input_open(ImageInput *input, const char *path);
void image_input_close(ImageInput *input);
int image_input_count(const ImageInput *input);
int image_input_number(const ImageInput *input, int index);
const char *image_input_path(const ImageInput *input, int index);
/// Index of the image with that number, -1 if there is none.
int image_input_find(const ImageInput *input, int number);
int image_input_read(const ImageInput *input, int index, RfImage **out);

typedef enum InputKind
{
    INPUT_IMAGES,
    INPUT_FLOW
} InputKind;

/// What a path holds, by its name. An EXR may be either, and so may a PNG with a JSON beside it: the caller says which.
int input_kind(const char *path, bool exr_is_flow, bool png_is_flow, InputKind *kind);
