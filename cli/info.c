// SPDX-License-Identifier: Apache-2.0
// riffle info FILE...
#include "errors.h"
#include "flow_input.h"
#include "image_input.h"
#include "layout.h"
#include "verbs.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char *format_name(RfSampleFormat format)
{
    static const char *const names[] = {"8 bit", "16 bit", "half", "float"};
    return names[format];
}

static const char *encoding_name(RfEncoding encoding)
{
    static const char *const names[] = {"sRGB-encoded", "linear", "data"};
    return names[encoding];
}

/// Of one channel's finite values.
typedef struct Range
{
    double minimum, maximum, mean;
    int64_t not_finite;
} Range;

static Range channel_range(const RfImageView *view, int channel)
{
    Range range = {.minimum = INFINITY, .maximum = -INFINITY};
    double sum = 0;
    int64_t count = 0;
    for (int y = 0; y < view->height; ++y)
        for (int x = 0; x < view->width; ++x)
        {
            double value = (double)view->pixels[y * view->row_stride + (ptrdiff_t)x * view->channels + channel];
            if (!isfinite(value))
            {
                ++range.not_finite;
                continue;
            }
            range.minimum = fmin(range.minimum, value);
            range.maximum = fmax(range.maximum, value);
            sum += value;
            ++count;
        }
    range.mean = count ? sum / (double)count : NAN;
    return range;
}

/// What an image would be as an exemplar or a flow.
typedef struct Uses
{
    bool exemplar, tiles;
    double border_roughness;
    /// The lagrangian method's default, and the largest it takes; 0: any.
    double radius, largest_radius;
    /// Main direction in degrees, how much of one it has, 0 to 1, and whether that is too little. NAN: too small.
    double direction, directionality;
    bool isotropic;
    /// "R,G": its channels are as those of a flow, and there are no others.
    const char *flow;
} Uses;

static const char *flow_channels(const RfImage *image)
{
    static const char *const pairs[] = {"R,G", "X,Y", "u,v", "forward.u,forward.v", "velocity.x,velocity.y"};
    char names[80];
    snprintf(names, sizeof names, "%s,%s", rf_image_channel_name(image, 0), rf_image_channel_name(image, 1));
    for (size_t i = 0; i < sizeof pairs / sizeof pairs[0]; ++i)
        if (strcmp(names, pairs[i]) == 0)
            return pairs[i];
    return NULL;
}

static void judge_direction(const RfExemplar *exemplar, Uses *uses)
{
    RfDirectionalOptions options = rf_directional_defaults();
    RfDirectional *directional = NULL;
    uses->direction = uses->directionality = NAN;
    if (rf_directional_create(exemplar, &options, &directional) != RF_OK)
        return;
    RfDirectionalStats stats = rf_directional_stats(directional);
    uses->direction = (double)stats.direction;
    uses->directionality = (double)stats.directionality;
    uses->isotropic = stats.isotropic;
    rf_directional_destroy(directional);
}

/// The sizes in grids and radii are those of rf_lagrangian_create.
static void judge_exemplar(const RfExemplar *exemplar, Uses *uses)
{
    const double default_radius = 64, least_sides = 3.9, least_sides_tiling = 2.6;
    double side = fmin(rf_exemplar_width(exemplar), rf_exemplar_height(exemplar));
    uses->exemplar = true;
    uses->tiles = rf_exemplar_tiles(exemplar);
    uses->border_roughness = (double)rf_exemplar_border_roughness(exemplar);
    // Rounded down, so that what is printed is taken.
    uses->largest_radius = uses->tiles ? 0 : floor(10 * side / least_sides) / 10;
    double fits = uses->tiles ? floor(10 * side / least_sides_tiling) / 10 : uses->largest_radius;
    uses->radius = fmax(2, fmin(default_radius, fits));
    judge_direction(exemplar, uses);
}

/// Images that are no exemplar (too small, without colour, not finite) have no uses; that is no failure.
static Uses uses_of(const RfImage *image)
{
    Uses uses = {0};
    Layout layout;
    RfImage *pixels = NULL;
    RfExemplar *exemplar = NULL;
    if (rf_image_view(image).channels == 2)
        uses.flow = flow_channels(image);
    if (layout_split(image, &layout, &pixels) != RF_OK)
        return uses;
    RfImageView view = rf_image_view(pixels);
    RfMapView map = {.name = "all", .kind = RF_MAP_DATA, .image = view, .weight = 1};
    if (layout.colours > 0 && layout_encode(&view, &layout, RF_ENCODING_SRGB) == RF_OK &&
        rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar) == RF_OK)
        judge_exemplar(exemplar, &uses);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(pixels);
    return uses;
}

static void print_uses_json(const Uses *uses)
{
    if (uses->exemplar)
    {
        printf(",\"exemplar\":{\"tiles\":%s,\"border_roughness\":", uses->tiles ? "true" : "false");
        print_json_number(stdout, uses->border_roughness);
        printf(",\"particle_radius\":%g,\"largest_particle_radius\":", uses->radius);
        print_json_number(stdout, uses->largest_radius > 0 ? uses->largest_radius : NAN);
        fputs(",\"direction\":", stdout);
        print_json_number(stdout, uses->isotropic ? NAN : uses->direction);
        fputs(",\"directionality\":", stdout);
        print_json_number(stdout, uses->directionality);
        fputc('}', stdout);
    }
    if (uses->flow)
    {
        fputc(',', stdout);
        print_json_member(stdout, "flow_variables", uses->flow);
    }
}

static void print_uses(const Uses *uses)
{
    if (uses->flow)
        printf("  can be a flow: --variables %s reads it as one\n", uses->flow);
    if (!uses->exemplar)
        return;
    printf("  tiles: %s (borders %.3g times as rough as the inside)%s\n", uses->tiles ? "seems so" : "seems not",
           uses->border_roughness, uses->tiles ? "" : "; --exemplar-tiles yes says otherwise");
    if (uses->tiles)
        printf("  particle radius: %g unless given, any fits\n", uses->radius);
    else
        printf("  particle radius: %g unless given, %g at most\n", uses->radius, uses->largest_radius);
    if (uses->isotropic)
        printf("  main direction: none to be seen (directionality %.2f)\n", uses->directionality);
    else if (!isnan(uses->direction))
        printf("  main direction: %.0f degrees, clockwise from the x axis (directionality %.2f)\n", uses->direction,
               uses->directionality);
}

static void print_image_json(const ImageInput *input, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    int count = image_input_count(input);
    fputc('{', stdout);
    print_json_member(stdout, "file", input->path);
    printf(",\"kind\":\"image\",\"files\":%d,\"first_frame\":%d,\"last_frame\":%d,\"width\":%d,\"height\":%d,", count,
           image_input_number(input, 0), image_input_number(input, count - 1), view.width, view.height);
    print_json_member(stdout, "samples", format_name(rf_image_format(image)));
    fputc(',', stdout);
    print_json_member(stdout, "encoding", encoding_name(rf_image_encoding(image)));
    fputs(",\"channels\":[", stdout);
    for (int c = 0; c < view.channels; ++c)
    {
        Range range = channel_range(&view, c);
        fputs(c ? ",{" : "{", stdout);
        print_json_member(stdout, "name", rf_image_channel_name(image, c));
        fputs(",\"minimum\":", stdout);
        print_json_number(stdout, range.minimum);
        fputs(",\"maximum\":", stdout);
        print_json_number(stdout, range.maximum);
        fputs(",\"mean\":", stdout);
        print_json_number(stdout, range.mean);
        printf(",\"not_finite\":%lld}", (long long)range.not_finite);
    }
    fputc(']', stdout);
    Uses uses = uses_of(image);
    print_uses_json(&uses);
    fputs("}\n", stdout);
}

static void print_image(const ImageInput *input, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    int count = image_input_count(input);
    printf("%s: image, %d x %d pixels, %d channel%s, %s, %s\n", input->path, view.width, view.height, view.channels,
           view.channels == 1 ? "" : "s", format_name(rf_image_format(image)), encoding_name(rf_image_encoding(image)));
    if (count > 1)
        printf("  %d files, frames %d to %d; what follows is of the first\n", count, image_input_number(input, 0),
               image_input_number(input, count - 1));
    for (int c = 0; c < view.channels; ++c)
    {
        Range range = channel_range(&view, c);
        printf("  %s: %.4g to %.4g, mean %.4g", rf_image_channel_name(image, c), range.minimum, range.maximum,
               range.mean);
        if (range.not_finite > 0)
            printf(", %lld not finite", (long long)range.not_finite);
        fputc('\n', stdout);
    }
    Uses uses = uses_of(image);
    print_uses(&uses);
}

static int image_info(const Settings *settings, const char *path)
{
    ImageInput input;
    RfImage *image = NULL;
    int code = image_input_open(&input, path);
    if (!code)
        code = image_input_read(&input, 0, &image);
    if (!code && settings_json(settings))
        print_image_json(&input, image);
    else if (!code)
        print_image(&input, image);
    rf_image_destroy(image);
    image_input_close(&input);
    return code;
}

static void print_flow_json(const char *path, const RfFlowInfo *info)
{
    fputc('{', stdout);
    print_json_member(stdout, "file", path);
    fputs(",\"kind\":\"flow\",", stdout);
    print_json_member(stdout, "format", info->format);
    printf(",\"width\":%d,\"height\":%d,\"moments\":%d,\"first_frame\":%d,\"last_frame\":%d,\"mask\":%s,", info->width,
           info->height, info->moment_count, info->first_frame, info->last_frame, info->has_mask ? "true" : "false");
    printf("\"filled_vectors\":%d,\"max_speed\":", info->filled_vectors);
    print_json_number(stdout, (double)info->max_speed);
    fputs(",\"mean_speed\":", stdout);
    print_json_number(stdout, (double)info->mean_speed);
    fputc(',', stdout);
    print_json_member(stdout, "conventions", info->conventions);
    fputs("}\n", stdout);
}

static void print_flow(const char *path, const RfFlowInfo *info)
{
    printf("%s: 2D flow (%s), %d x %d cells, ", path, info->format, info->width, info->height);
    if (info->moment_count == 1)
        printf("steady");
    else if (info->moment_count == 0)
        printf("endless, from frame %d", info->first_frame);
    else
        printf("%d moments, frames %d to %d", info->moment_count, info->first_frame, info->last_frame);
    printf(", %s\n  speed: greatest %.4g, mean %.4g cells a frame\n", info->has_mask ? "with a mask" : "no mask",
           (double)info->max_speed, (double)info->mean_speed);
    if (info->filled_vectors > 0)
        printf("  %d invalid vector%s, filled from %s neighbours\n", info->filled_vectors,
               info->filled_vectors == 1 ? "" : "s", info->filled_vectors == 1 ? "its" : "their");
    if (info->conventions[0])
        printf("  %s\n", info->conventions);
}

static int flow_info(const Settings *settings, const char *path)
{
    FlowInput input;
    int code = flow_input_open(&input, settings, path);
    if (!code && settings_json(settings))
        print_flow_json(path, &input.info);
    else if (!code)
        print_flow(path, &input.info);
    flow_input_close(&input);
    return code;
}

int run_info(Settings *settings)
{
    int code = CODE_DONE;
    for (int i = 0; i < settings->word_count && !code; ++i)
    {
        InputKind kind = INPUT_IMAGES;
        code = input_kind(settings->words[i], settings->variables != NULL, true, &kind);
        if (!code)
            code =
                kind == INPUT_FLOW ? flow_info(settings, settings->words[i]) : image_info(settings, settings->words[i]);
    }
    return code;
}
