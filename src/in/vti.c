// SPDX-License-Identifier: Apache-2.0
// A plane of VTK image data as a flow. The flat axis is left out: of an xz plane, x and z are the two. The second axis
// runs up, so rows and the second component are turned round. Velocities are world units a second.
//
// Points are taken as the centres of cells, one cell a point.
#include "in/flow_format.h"
#include "in/vtk_xml.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <string.h>

static const char *const vector_names[] = {"velocity", "U", "vel", "v", "velocities"};
static const char *const scalar_names[][2] = {
    {"u", "v"}, {"velocity_x", "velocity_y"}, {"velocity:0", "velocity:1"}, {"vx", "vy"}, {"U_0", "U_1"}};

/// Where the flow stands in the file.
typedef struct Plane
{
    /// Both the same for a vector.
    const RfVtkArray *components[2];
    /// Of x, y, z: along the rows, and up.
    int axes[2];
    int64_t width, height;
} Plane;

static bool vti_probe(const uint8_t *bytes, size_t size)
{
    const char *text = (const char *)bytes;
    return memmem(text, size, "<VTKFile", 8) && memmem(text, size, "ImageData", 9);
}

static RfResult no_velocity(const RfFlowSource *source, const RfVtkImage *image)
{
    char names[400] = "";
    for (int i = 0; i < image->array_count; ++i)
    {
        size_t used = strlen(names);
        if (used + RF_VTK_NAME + 8 > sizeof names)
            break;
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", image->arrays[i].name);
    }
    const char *wanted = source->options->variables;
    return rf_fail(
        RF_BAD_INPUT, source->path, NULL, "no velocity here: looked for %s; it has: %s; name them with --variables",
        wanted ? wanted
               : "velocity, U, vel or v of 2 or 3 components, or u, v (also velocity_x, velocity_y; vx, vy) of one",
        names[0] ? names : "no arrays");
}

static bool take_pair(const RfVtkImage *image, const char *u, const char *v, Plane *out)
{
    // The same name twice means a vector.
    int components = strcmp(u, v) == 0 ? 3 : 1;
    out->components[0] = rf_vtk_image_find(image, u, components > 1 ? 2 : 1, components);
    out->components[1] = rf_vtk_image_find(image, v, components > 1 ? 2 : 1, components);
    return out->components[0] && out->components[1] && out->components[0]->place == out->components[1]->place;
}

static RfResult find_arrays(const RfFlowSource *source, const RfVtkImage *image, Plane *out)
{
    char wanted[2][64];
    if (rf_flow_wanted_names(source->options, wanted[0], wanted[1]))
        return take_pair(image, wanted[0], wanted[1], out) ? RF_OK : no_velocity(source, image);
    for (size_t i = 0; i < sizeof vector_names / sizeof vector_names[0]; ++i)
        if (take_pair(image, vector_names[i], vector_names[i], out))
            return RF_OK;
    for (size_t i = 0; i < sizeof scalar_names / sizeof scalar_names[0]; ++i)
        if (take_pair(image, scalar_names[i][0], scalar_names[i][1], out))
            return RF_OK;
    return no_velocity(source, image);
}

static RfResult find_plane(const RfFlowSource *source, const RfVtkImage *image, Plane *out)
{
    RF_TRY(find_arrays(source, image, out));
    int64_t counts[3];
    for (int a = 0; a < 3; ++a)
        counts[a] = rf_vtk_image_count(image, out->components[0]->place, a);
    int flat = counts[2] == 1 ? 2 : counts[1] == 1 ? 1 : 0;
    if (counts[flat] != 1)
        return rf_fail(RF_BAD_INPUT, source->path, "WholeExtent",
                       "a volume of %lld x %lld x %lld where a plane was expected: cut one slice out of it and save "
                       "that as image data",
                       (long long)counts[0], (long long)counts[1], (long long)counts[2]);
    out->axes[0] = flat == 0 ? 1 : 0;
    out->axes[1] = flat == 2 ? 1 : 2;
    out->width = counts[out->axes[0]];
    out->height = counts[out->axes[1]];
    if (out->components[0]->components > 1 && out->axes[1] >= out->components[0]->components)
        return rf_fail(RF_BAD_INPUT, source->path, "WholeExtent",
                       "the plane stands upright, but the vectors have only two components");
    for (int a = 0; a < 2; ++a)
        if (!(image->spacing[out->axes[a]] > 0))
            return rf_fail(RF_BAD_INPUT, source->path, "Spacing", "the spacing must be greater than 0");
    return RF_OK;
}

/// The first component's numbers are read before the field is made, so that a small file with a large extent is refused
/// before much memory is asked for.
static RfResult take_component(const RfFlowSource *source, const RfVtkImage *image, const Plane *plane, int c,
                               RfFlowMoment *out)
{
    const RfVtkArray *array = plane->components[c];
    size_t cells = (size_t)plane->width * (size_t)plane->height, step = (size_t)array->components;
    float *numbers;
    RF_TRY(rf_vtk_array_read(image, array, cells * step, &numbers));
    RfResult result = c == 0 ? rf_flow_moment_create(source, plane->width, plane->height, out) : RF_OK;
    double scale = 1 / (image->spacing[plane->axes[c]] * (double)source->options->fps);
    // Names of two scalars are those of the components in the plane.
    size_t part = step > 1 ? (size_t)plane->axes[c] : 0;
    for (size_t k = 0; result == RF_OK && k < cells; ++k)
        out->field.velocity[2 * k + (size_t)c] = (float)((c ? -scale : scale) * (double)numbers[k * step + part]);
    rf_release(numbers);
    return result;
}

static RfResult take_mask(const RfVtkImage *image, const Plane *plane, RfFlowField *field)
{
    const RfVtkArray *array = rf_vtk_image_find(image, "mask", 1, 1);
    if (!array || array->place != plane->components[0]->place)
        return RF_OK;
    size_t cells = (size_t)plane->width * (size_t)plane->height;
    float *numbers;
    RF_TRY(rf_vtk_array_read(image, array, cells, &numbers));
    RfResult result = rf_flow_field_add_mask(field);
    for (size_t k = 0; result == RF_OK && k < cells; ++k)
        field->mask[k] = numbers[k] != 0;
    rf_release(numbers);
    return result;
}

static RfResult vti_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    RfVtkImage image;
    Plane plane = {0};
    RF_TRY(rf_vtk_image_parse(source->path, source->bytes, source->size, &image));
    RF_TRY(find_plane(source, &image, &plane));
    for (int c = 0; c < 2; ++c)
        RF_TRY(take_component(source, &image, &plane, c, out));
    RF_TRY(take_mask(&image, &plane, &out->field));
    rf_flow_field_flip_rows(&out->field);
    out->moment_count = 1;
    snprintf(out->conventions, sizeof out->conventions,
             "units a second over %.4g x %.4g unit cells, at %g frames a second; %s data; %c ran up: rows and the "
             "second component turned round",
             image.spacing[plane.axes[0]], image.spacing[plane.axes[1]], (double)source->options->fps,
             plane.components[0]->place == RF_VTK_CELLS ? "cell" : "point", "xyz"[plane.axes[1]]);
    return RF_OK;
}

const RfFlowFormat rf_flow_format_vti = {.name = "vti", .extensions = "vti", .probe = vti_probe, .read = vti_read};
