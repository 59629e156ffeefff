// SPDX-License-Identifier: Apache-2.0
#include "exemplar_input.h"
#include "errors.h"
#include "inputs.h"
#include "progress.h"
#include "text.h"

#include <stdio.h>
#include <string.h>

enum
{
    /// EXEMPLAR and its maps.
    MAX_FILES = RF_MAX_MAPS
};

/// Everything read, before it is an exemplar. Views point into the images.
typedef struct Parts
{
    RfImage *images[MAX_FILES];
    int image_count;
    RfMapView maps[RF_MAX_MAPS];
    char names[RF_MAX_MAPS][NAME_SIZE];
    const char *files[RF_MAX_MAPS];
    int map_count;
    RfSampleFormat format;
} Parts;

static int add_map(Parts *parts, const char *file, const char *name, RfMapKind kind, RfImageView view)
{
    for (int i = 0; i < parts->map_count; ++i)
        if (strcmp(parts->names[i], name) == 0)
            return fail(CODE_BAD_INPUT, file, NULL, "a map named %s is there already, in %s", name, parts->files[i]);
    if (parts->map_count == RF_MAX_MAPS)
        return fail(CODE_BAD_INPUT, file, NULL, "there are more than %d maps with this one", RF_MAX_MAPS);
    int index = parts->map_count++;
    snprintf(parts->names[index], NAME_SIZE, "%s", name);
    parts->files[index] = file;
    parts->maps[index] = (RfMapView){.name = parts->names[index], .kind = kind, .image = view, .weight = 1};
    return CODE_DONE;
}

/// A map of a file's layout needs an image of its own: views of maps have no gaps between pixels.
static int add_part(Parts *parts, const char *file, const Layout *layout, const RfImageView *frame, int map)
{
    if (parts->image_count == MAX_FILES)
        return fail(CODE_BAD_INPUT, file, NULL, "there are more than %d maps with this one", RF_MAX_MAPS);
    RfImage *image = NULL;
    RfResult result = layout_channels(frame, layout, layout->maps[map].first, layout->maps[map].channels, &image);
    if (result != RF_OK)
        return fail_result(result, file);
    parts->images[parts->image_count++] = image;
    return add_map(parts, file, layout->maps[map].name, layout->maps[map].kind, rf_image_view(image));
}

static int read_exemplar(Parts *parts, const char *path, bool colour_only)
{
    RfImage *file = NULL, *pixels = NULL;
    Layout layout;
    RfResult result = rf_image_read(path, &file);
    if (result == RF_OK)
        result = layout_split(file, &layout, &pixels);
    int code = result == RF_OK ? CODE_DONE : fail_result(result, path);
    if (!code && layout.colours == 0)
        code = fail(CODE_BAD_INPUT, path, NULL,
                    "no colour here: looked for R G B or Y; its first channel is %s; give a colour image, and this one "
                    "with --map NAME=IMAGE",
                    rf_image_channel_name(file, 0));
    RfImageView view = code ? (RfImageView){0} : rf_image_view(pixels);
    if (!code && layout_encode(&view, &layout, RF_ENCODING_SRGB) != RF_OK)
        code = fail_result(rf_last_error()->result, path);
    int count = code ? 0 : colour_only ? 1 : layout.map_count;
    for (int m = 0; m < count && !code; ++m)
        code = add_part(parts, path, &layout, &view, m);
    if (!code)
        parts->format = layout.format;
    rf_image_destroy(file);
    rf_image_destroy(pixels);
    return code;
}

static RfMapKind kind_of(const char *name, int channels)
{
    if (strcmp(name, "normal") == 0)
        return RF_MAP_NORMAL;
    if (channels == 2 && (strcmp(name, "motion") == 0 || strcmp(name, "velocity") == 0))
        return RF_MAP_VECTOR;
    return strcmp(name, "alpha") == 0 ? RF_MAP_ALPHA : RF_MAP_DATA;
}

/// A misspelt "normal" would not be turned with the texture, and nobody could see why.
static void warn_of_data(const Settings *settings, const MapArgument *argument, RfMapKind kind, int channels)
{
    static const char turned[] = "motion|velocity";
    static const char plain[] = "height|displacement|bump|roughness|gloss|specular|metallic|occlusion|emission|"
                                "temperature|density";
    // optimize refuses a guide, and says so itself.
    bool knows = settings->verb->bit == VERB_SYNTH || strcmp(settings->method->name, "optimize") == 0;
    bool guide = knows && strcmp(argument->name, "guide") == 0;
    if (guide || kind != RF_MAP_DATA || text_choice(plain, argument->name) >= 0)
        return;
    char list[256];
    text_list(plain, list, sizeof list);
    if (text_choice(turned, argument->name) >= 0)
        warn(settings, argument->file, "map %s has %d channels, not 2: it is treated as plain data and not turned",
             argument->name, channels);
    else
        warn(settings, argument->file,
             "map %s is treated as plain data, as %s are; known beside them: alpha, normal, motion and velocity",
             argument->name, list);
}

/// Alpha is one channel: the file's first. Other maps are what the file has.
static int read_map(const Settings *settings, Parts *parts, const MapArgument *argument)
{
    RfImage *image = NULL;
    RfResult result = rf_image_read(argument->file, &image);
    if (result != RF_OK)
        return fail_result(result, argument->file);
    RfImageView view = rf_image_view(image);
    RfMapKind kind = kind_of(argument->name, view.channels);
    warn_of_data(settings, argument, kind, view.channels);
    int channels = kind == RF_MAP_ALPHA ? 1 : kind == RF_MAP_NORMAL && view.channels > 3 ? 3 : view.channels;
    if (channels < view.channels)
    {
        RfImage *part = NULL;
        Layout plain = {.format = rf_image_format(image)};
        result = layout_channels(&view, &plain, 0, channels, &part);
        rf_image_destroy(image);
        if (result != RF_OK)
            return fail_result(result, argument->file);
        image = part;
    }
    if (parts->image_count == MAX_FILES)
    {
        rf_image_destroy(image);
        return fail(CODE_BAD_INPUT, argument->file, NULL, "there are more than %d maps with this one", RF_MAX_MAPS);
    }
    parts->images[parts->image_count++] = image;
    return add_map(parts, argument->file, argument->name, kind, rf_image_view(image));
}

/// Frames hold alpha right behind colour, wherever it was given.
static void order_alpha(Parts *parts)
{
    int alpha = 0;
    while (alpha < parts->map_count && parts->maps[alpha].kind != RF_MAP_ALPHA)
        ++alpha;
    if (alpha == parts->map_count)
        return;
    RfMapView map = parts->maps[alpha];
    for (int i = alpha; i > 1; --i)
        parts->maps[i] = parts->maps[i - 1];
    parts->maps[1] = map;
}

static int set_weights(const Settings *settings, Parts *parts)
{
    for (int w = 0; w < settings->weight_count; ++w)
    {
        const WeightArgument *weight = &settings->weights[w];
        bool found = false;
        char names[256] = "";
        for (int m = 0; m < parts->map_count; ++m)
        {
            bool same = strcmp(parts->maps[m].name, weight->name) == 0;
            found = found || same;
            if (same)
                parts->maps[m].weight = weight->weight;
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", m ? ", " : "", parts->maps[m].name);
        }
        if (!found)
            return fail(CODE_USAGE, NULL, NULL, "--map-weight %s=%g: there is no such map; there are: %s", weight->name,
                        (double)weight->weight, names);
    }
    return CODE_DONE;
}

static uint64_t hash_map(uint64_t hash, const RfMapView *map)
{
    int facts[] = {(int)map->kind, map->image.width, map->image.height, map->image.channels};
    hash = hash_add_text(hash, map->name);
    hash = hash_add(hash, facts, sizeof facts);
    hash = hash_add(hash, &map->weight, sizeof map->weight);
    for (int y = 0; y < map->image.height; ++y)
        hash = hash_add(hash, map->image.pixels + y * map->image.row_stride,
                        (size_t)map->image.width * (size_t)map->image.channels * sizeof(float));
    return hash;
}

/// The library names the map that is wrong; the user knows its file.
static int refuse(const Parts *parts, RfResult result, const char *path)
{
    const char *place = rf_last_error()->place;
    for (int m = 0; m < parts->map_count; ++m)
        if (strcmp(parts->names[m], place) == 0)
            path = parts->files[m];
    return fail_result(result, path);
}

static int make(const Settings *settings, const char *path, Parts *parts, ExemplarInput *input)
{
    order_alpha(parts);
    int code = set_weights(settings, parts);
    if (code)
        return code;
    RfResult result = rf_exemplar_create(parts->maps, parts->map_count, settings->tiling, &input->exemplar);
    if (result != RF_OK)
        return refuse(parts, result, path);
    for (int m = 0; m < parts->map_count; ++m)
    {
        const RfMapView *map = &parts->maps[m];
        layout_add(&input->layout, map->name, map->kind, map->image.channels);
        input->hash = hash_map(input->hash, map);
    }
    input->layout.format = parts->format;
    return CODE_DONE;
}

int exemplar_input_read(const Settings *settings, const char *path, bool colour_only, ExemplarInput *input)
{
    *input = (ExemplarInput){0};
    Parts parts = {0};
    int code = read_exemplar(&parts, path, colour_only);
    for (int i = 0; i < settings->map_count && !code; ++i)
        code = read_map(settings, &parts, &settings->maps[i]);
    if (!code)
        code = make(settings, path, &parts, input);
    for (int i = 0; i < parts.image_count; ++i)
        rf_image_destroy(parts.images[i]);
    return code;
}

void exemplar_input_close(ExemplarInput *input)
{
    rf_exemplar_destroy(input->exemplar);
    *input = (ExemplarInput){0};
}
