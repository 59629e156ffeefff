// SPDX-License-Identifier: Apache-2.0
#include "constraint_input.h"
#include "errors.h"
#include "text.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

// Of 1 in --target IMAGE@W: from there on nothing of the exemplar would be left.
static const double g_most_weight = 1e6;

// Of RfOptimizeConstraints.scale.
static const float g_least_scale = 1.0f / 16, g_most_scale = 16;

static const char *const g_guide = "guide";

// ---- files -------------------------------------------------------------------------------------------------------

/// IMAGE@W, where there is no file of that whole name.
static int split_target(ConstraintInput *input, const char *text)
{
    const char *at = strrchr(text, '@');
    double number = 1;
    if (at == text || (at && at[1] == '\0'))
        return fail(CODE_USAGE, NULL, NULL, "--target %s: must be IMAGE or IMAGE@W", text);
    if (at && access(text, F_OK) == 0)
        at = NULL;
    input->target = at ? strndup(text, (size_t)(at - text)) : strdup(text);
    if (!input->target)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    if (at && !text_to_double(at + 1, &number))
    {
        input->weight = strdup(at + 1);
        return input->weight ? CODE_DONE : fail(CODE_FAILED, NULL, NULL, "out of memory");
    }
    if (number < 0 || number > g_most_weight)
        return fail(CODE_USAGE, NULL, NULL, "--target %s: the weight must be 0 to %g, or an image", text,
                    g_most_weight);
    input->weight_number = (float)number;
    return CODE_DONE;
}

int constraints_begin(ConstraintInput *input, const Settings *settings, InputFiles *files)
{
    *input = (ConstraintInput){.weight_number = 1};
    int code = settings->target ? split_target(input, settings->target) : CODE_DONE;
    const char *const paths[] = {settings->fixed,           input->target,      input->weight, settings->guide,
                                 settings->orientation_map, settings->scale_map};
    for (size_t i = 0; i < sizeof paths / sizeof paths[0]; ++i)
        if (paths[i])
            inputs_add(files, paths[i], IMAGE_EXTENSIONS);
    return code;
}

/// Keeps the image, which is destroyed with the others, if it has the result's size.
static int keep(ConstraintInput *input, const char *path, RfImage *image, RfImageView *view)
{
    input->images[input->image_count++] = image;
    *view = rf_image_view(image);
    if (input->width == 0)
    {
        input->width = view->width;
        input->height = view->height;
        input->sized_by = path;
    }
    if (view->width == input->width && view->height == input->height)
        return CODE_DONE;
    return fail(CODE_BAD_INPUT, path, NULL, "is %d x %d pixels, %s %d x %d: they need one size", view->width,
                view->height, input->sized_by ? input->sized_by : "the result", input->width, input->height);
}

// ---- pictures of the result: --fixed, --target ---------------------------------------------------------------------

/// A picture's file, split by its channels, sRGB-encoded as the exemplar is.
typedef struct PictureFile
{
    const char *path;
    Layout layout;
    RfImage *pixels;
    RfImageView view;
} PictureFile;

static int picture_read(const char *path, PictureFile *picture)
{
    RfImage *file = NULL;
    *picture = (PictureFile){.path = path};
    RfResult result = rf_image_read(path, &file);
    if (result == RF_OK)
        result = layout_split(file, &picture->layout, &picture->pixels);
    rf_image_destroy(file);
    if (result == RF_OK)
    {
        picture->view = rf_image_view(picture->pixels);
        result = layout_encode(&picture->view, &picture->layout, RF_ENCODING_SRGB);
    }
    return result == RF_OK ? CODE_DONE : fail_result(result, path);
}

static const LayoutMap *find_map(const Layout *layout, const char *name)
{
    for (int m = 0; m < layout->map_count; ++m)
        if (strcmp(layout->maps[m].name, name) == 0)
            return &layout->maps[m];
    return NULL;
}

/// Copies one map of the file to channels `first`... of `to`; grey becomes colour.
static void copy_map(const PictureFile *picture, const LayoutMap *from, const RfImageView *to, const LayoutMap *map)
{
    for (int y = 0; y < to->height; ++y)
        for (int x = 0; x < to->width; ++x)
        {
            const float *source = picture->view.pixels + y * picture->view.row_stride +
                                  (ptrdiff_t)x * picture->view.channels + from->first;
            float *values = to->pixels + y * to->row_stride + (ptrdiff_t)x * to->channels + map->first;
            for (int c = 0; c < map->channels; ++c)
                values[c] = source[c < from->channels ? c : from->channels - 1];
        }
}

/// Brings the maps of `made` from the file into the first channels of `to`. One that is not compared may be missing
/// where `some` says so.
static int copy_maps(const PictureFile *picture, const RfExemplar *exemplar, const Layout *made, bool some,
                     const RfImageView *to)
{
    for (int m = 0; m < made->map_count; ++m)
    {
        const LayoutMap *map = &made->maps[m], *from = find_map(&picture->layout, map->name);
        float weight = 1;
        for (int i = 0; i < rf_exemplar_map_count(exemplar); ++i)
            if (strcmp(rf_exemplar_map(exemplar, i, NULL).name, map->name) == 0)
                weight = rf_exemplar_map(exemplar, i, NULL).weight;
        bool grey = from && from->channels == 1 && map->kind == RF_MAP_COLOUR;
        if (from && (from->channels == map->channels || grey))
            copy_map(picture, from, to, map);
        else if (from)
            return fail(CODE_BAD_INPUT, picture->path, map->name, "has %d channels, the exemplar's map %d",
                        from->channels, map->channels);
        else if (!some || weight > 0)
            return fail(CODE_BAD_INPUT, picture->path, NULL,
                        "has no %s, which the exemplar has: give one EXR with all its maps%s%s%s", map->name,
                        some ? ", or --map-weight " : "", some ? map->name : "", some ? "=0" : "");
    }
    return CODE_DONE;
}

static int take_picture(ConstraintInput *input, const PictureFile *picture, int channels, RfImageView *view)
{
    RfImage *image = NULL;
    RfResult result = rf_image_create(picture->view.width, picture->view.height, channels, &image);
    return result == RF_OK ? keep(input, picture->path, image, view) : fail_result(result, picture->path);
}

/// Behind the made channels stands what is given: where alpha is half or more.
static int read_fixed(ConstraintInput *input, const char *path, const RfExemplar *exemplar, const Layout *made)
{
    PictureFile picture;
    RfImageView *view = &input->constraints.fixed;
    int code = picture_read(path, &picture);
    if (!code && !picture.layout.alpha)
        code = fail(CODE_BAD_INPUT, path, NULL, "has no alpha: transparent pixels are those to be made");
    if (!code)
        code = take_picture(input, &picture, made->channels + 1, view);
    if (!code)
        code = copy_maps(&picture, exemplar, made, false, view);
    if (!code)
        copy_map(&picture, find_map(&picture.layout, "alpha"), view,
                 &(LayoutMap){.first = made->channels, .channels = 1});
    rf_image_destroy(picture.pixels);
    return code;
}

static int read_target(ConstraintInput *input, const RfExemplar *exemplar, const Layout *made)
{
    PictureFile picture;
    RfImageView *view = &input->constraints.target;
    int code = picture_read(input->target, &picture);
    if (!code)
        code = take_picture(input, &picture, made->channels, view);
    if (!code)
        code = copy_maps(&picture, exemplar, made, true, view);
    rf_image_destroy(picture.pixels);
    return code;
}

// ---- numbers over the result ---------------------------------------------------------------------------------------

/// An image's numbers as they are in the file; without `path` all are `number`.
static int read_numbers(ConstraintInput *input, const char *path, RfImageView *view, RfEncoding *encoding)
{
    RfImage *image = NULL;
    RfResult result = rf_image_read(path, &image);
    if (result != RF_OK)
        return fail_result(result, path);
    *encoding = rf_image_encoding(image);
    return keep(input, path, image, view);
}

/// The first channel of a grey image in an image of its own; colours are refused.
static int read_grey(ConstraintInput *input, const char *path, RfImageView *view, RfEncoding *encoding)
{
    RfImage *file = NULL, *grey = NULL;
    RfResult result = rf_image_read(path, &file);
    if (result == RF_OK)
        result = rf_image_create(rf_image_view(file).width, rf_image_view(file).height, 1, &grey);
    if (result != RF_OK)
    {
        rf_image_destroy(file);
        return fail_result(result, path);
    }
    RfImageView from = rf_image_view(file), to = rf_image_view(grey);
    int code = CODE_DONE;
    *encoding = rf_image_encoding(file);
    for (int y = 0; y < from.height && !code; ++y)
        for (int x = 0; x < from.width && !code; ++x)
        {
            const float *pixel = from.pixels + y * from.row_stride + (ptrdiff_t)x * from.channels;
            char place[64];
            snprintf(place, sizeof place, "pixel (%d, %d)", x, y);
            to.pixels[y * to.row_stride + x] = pixel[0];
            if (from.channels >= 3 && (pixel[1] != pixel[0] || pixel[2] != pixel[0]))
                code = fail(CODE_BAD_INPUT, path, place, "is no grey: one number a pixel is needed");
        }
    rf_image_destroy(file);
    if (code)
        rf_image_destroy(grey);
    return code ? code : keep(input, path, grey, view);
}

static int make_weight(ConstraintInput *input)
{
    RfImageView *view = &input->constraints.target_weight;
    RfEncoding encoding;
    if (input->weight)
        return read_grey(input, input->weight, view, &encoding);
    if (input->weight_number == 1)
        return CODE_DONE;
    RfImage *image = NULL;
    RfResult result = rf_image_create(input->width, input->height, 1, &image);
    if (result != RF_OK)
        return fail_result(result, NULL);
    *view = rf_image_view(image);
    for (ptrdiff_t i = 0; i < view->row_stride * view->height; ++i)
        view->pixels[i] = input->weight_number;
    return keep(input, NULL, image, view);
}

static int read_guide(ConstraintInput *input, const char *path, const RfExemplar *exemplar)
{
    int channels = rf_exemplar_channels(exemplar) - rf_optimize_channels(exemplar);
    RfEncoding encoding;
    RfImageView *view = &input->constraints.guide;
    int code = read_numbers(input, path, view, &encoding);
    if (!code && view->channels != channels)
        code = fail(CODE_BAD_INPUT, path, NULL, "has %d channel%s, the exemplar's map %s %d: they are compared",
                    view->channels, view->channels == 1 ? "" : "s", g_guide, channels);
    return code;
}

/// Grey 0 to 1 is 0 to 360 degrees.
static int read_orientation(ConstraintInput *input, const char *path)
{
    RfEncoding encoding;
    RfImageView *view = &input->constraints.orientation;
    int code = read_grey(input, path, view, &encoding);
    for (ptrdiff_t i = 0; !code && encoding == RF_ENCODING_SRGB && i < view->row_stride * view->height; ++i)
        view->pixels[i] *= 360;
    return code;
}

/// Grey g is 4^(2 g - 1).
static int read_scale(ConstraintInput *input, const char *path)
{
    RfEncoding encoding;
    RfImageView *view = &input->constraints.scale;
    int code = read_grey(input, path, view, &encoding);
    for (ptrdiff_t i = 0; !code && i < view->row_stride * view->height; ++i)
    {
        float *scale = &view->pixels[i];
        *scale = encoding == RF_ENCODING_SRGB ? powf(4, 2 * *scale - 1) : *scale;
        char place[64];
        snprintf(place, sizeof place, "pixel (%d, %d)", (int)(i % view->row_stride), (int)(i / view->row_stride));
        if (!(*scale >= g_least_scale && *scale <= g_most_scale))
            code = fail(CODE_BAD_INPUT, path, place, "a scale of %g: must be %g to %g", (double)*scale,
                        (double)g_least_scale, (double)g_most_scale);
    }
    return code;
}

// ---- all of them ---------------------------------------------------------------------------------------------------

static int check_guide(const Settings *settings, const RfExemplar *exemplar)
{
    bool has_map = rf_optimize_channels(exemplar) < rf_exemplar_channels(exemplar);
    if (settings->guide && !has_map)
        return fail(CODE_USAGE, NULL, NULL,
                    "--guide %s: the exemplar has no such map to compare it with; give it with "
                    "--map %s=IMAGE",
                    settings->guide, g_guide);
    if (!settings->guide && has_map)
        return fail(CODE_USAGE, NULL, NULL,
                    "the exemplar has a map named %s: say with --guide IMAGE what should be "
                    "where",
                    g_guide);
    return CODE_DONE;
}

int constraints_read(ConstraintInput *input, const Settings *settings, const RfExemplar *exemplar, const Layout *made)
{
    input->width = settings->width;
    input->height = settings->height;
    int code = check_guide(settings, exemplar);
    if (!code && settings->fixed)
        code = read_fixed(input, settings->fixed, exemplar, made);
    if (!code && input->target)
        code = read_target(input, exemplar, made);
    if (!code && input->target)
        code = make_weight(input);
    if (!code && settings->guide)
        code = read_guide(input, settings->guide, exemplar);
    if (!code && settings->orientation_map)
        code = read_orientation(input, settings->orientation_map);
    if (!code && settings->scale_map)
        code = read_scale(input, settings->scale_map);
    if (input->width == 0)
    {
        input->width = 2 * rf_exemplar_width(exemplar);
        input->height = 2 * rf_exemplar_height(exemplar);
    }
    return code;
}

void constraints_close(ConstraintInput *input)
{
    for (int i = 0; i < input->image_count; ++i)
        rf_image_destroy(input->images[i]);
    free(input->target);
    free(input->weight);
    *input = (ConstraintInput){0};
}
