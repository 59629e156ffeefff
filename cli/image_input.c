// SPDX-License-Identifier: Apache-2.0
#include "image_input.h"
#include "errors.h"
#include "inputs.h"
#include "text.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

int image_input_open(ImageInput *input, const char *path)
{
    *input = (ImageInput){.path = path};
    if (text_starts(path, "builtin:"))
        return CODE_DONE;
    RfResult result = rf_sequence_open(path, IMAGE_EXTENSIONS, &input->sequence);
    return result == RF_OK ? CODE_DONE : fail_result(result, path);
}

void image_input_close(ImageInput *input)
{
    rf_sequence_destroy(input->sequence);
    *input = (ImageInput){0};
}

int image_input_count(const ImageInput *input)
{
    return input->sequence ? rf_sequence_count(input->sequence) : 1;
}

int image_input_number(const ImageInput *input, int index)
{
    return input->sequence ? rf_sequence_number(input->sequence, index) : 1;
}

const char *image_input_path(const ImageInput *input, int index)
{
    return input->sequence ? rf_sequence_path(input->sequence, index) : input->path;
}

int image_input_find(const ImageInput *input, int number)
{
    for (int i = 0; i < image_input_count(input); ++i)
        if (image_input_number(input, i) == number)
            return i;
    return -1;
}

int image_input_read(const ImageInput *input, int index, RfImage **out)
{
    const char *path = image_input_path(input, index);
    RfResult result = rf_image_read(path, out);
    return result == RF_OK ? CODE_DONE : fail_result(result, path);
}

static int builtin_kind(const char *path, InputKind *kind)
{
    const char *name = path + strlen("builtin:");
    size_t length = strcspn(name, "?");
    int count = 0;
    const RfBuiltin *table = rf_builtin_table(&count);
    for (int i = 0; i < count; ++i)
        if (strlen(table[i].name) == length && strncmp(table[i].name, name, length) == 0)
        {
            *kind = strcmp(table[i].kind, "flow") == 0 ? INPUT_FLOW : INPUT_IMAGES;
            return CODE_DONE;
        }
    return fail(CODE_BAD_INPUT, path, NULL, "there is no such built-in input; riffle --help lists them");
}

static bool has_json(const char *path)
{
    char name[4096];
    size_t stem = strlen(path) - strlen(text_extension(path));
    if (stem + 5 >= sizeof name)
        return false;
    snprintf(name, sizeof name, "%.*sjson", (int)stem, path);
    return access(name, F_OK) == 0;
}

/// The first file of a pattern or directory, copied; the path itself where it is one file, or nothing that opens.
static void first_file(const char *path, char *out, size_t size)
{
    RfSequence *sequence = NULL;
    snprintf(out, size, "%s", path);
    if (rf_sequence_open(path, FLOW_EXTENSIONS "," IMAGE_EXTENSIONS, &sequence) != RF_OK)
        return;
    snprintf(out, size, "%s", rf_sequence_path(sequence, 0));
    rf_sequence_destroy(sequence);
}

int input_kind(const char *path, bool exr_is_flow, bool png_is_flow, InputKind *kind)
{
    if (text_starts(path, "builtin:"))
        return builtin_kind(path, kind);
    char first[4096];
    first_file(path, first, sizeof first);
    bool flow = text_extension_in(first, "flo|npy|npz|nc|vti|vec|txt|pvd|series") ||
                (exr_is_flow && text_extension_in(first, "exr")) ||
                (png_is_flow && text_extension_in(first, "png") && has_json(first));
    *kind = flow ? INPUT_FLOW : INPUT_IMAGES;
    return CODE_DONE;
}
