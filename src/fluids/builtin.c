// SPDX-License-Identifier: Apache-2.0
#include "fluids/builtin.h"

#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"
#include "fluids/scene.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>

static const RfSceneClass *const scenes[] = {
    &rf_scene_vortex,   &rf_scene_shear,      &rf_scene_gyre,     &rf_scene_uniform,
    &rf_scene_rotation, &rf_scene_turbulence, &rf_scene_cylinder, &rf_scene_river,
};

static const RfExemplarClass *const exemplars[] = {
    &rf_exemplar_foam,  &rf_exemplar_bubbles,   &rf_exemplar_lava,  &rf_exemplar_pebbles,
    &rf_exemplar_canes, &rf_exemplar_chocolate, &rf_exemplar_noise, &rf_exemplar_checker,
};

enum
{
    SCENE_COUNT = sizeof scenes / sizeof scenes[0],
    EXEMPLAR_COUNT = sizeof exemplars / sizeof exemplars[0],
    /// Of an exemplar.
    MAX_ASPECT = 8
};

struct RfFlowScene
{
    const RfSceneClass *class;
    RfParameters parameters;
    void *state;
    /// Where the state stands.
    int moment;
};

static RfResult refuse_name(const char *spec, const char *kind)
{
    char file[400], names[400] = "";
    snprintf(file, sizeof file, "builtin:%.380s", spec);
    int count;
    const RfBuiltin *entries = rf_builtin_table(&count);
    for (int i = 0; i < count; ++i)
    {
        size_t used = strlen(names);
        if (strcmp(entries[i].kind, kind) == 0)
            snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", entries[i].name);
    }
    return rf_fail(RF_BAD_INPUT, file, NULL, "there is no built-in %s of that name; there are: %s", kind, names);
}

/// Simulations and drawings bound their cost by it.
static RfResult check_aspect(const char *spec, const RfParameters *parameters, int most)
{
    int shorter = rf_min_int(parameters->width, parameters->height);
    if (most == 0 || rf_max_int(parameters->width, parameters->height) <= (int64_t)most * shorter)
        return RF_OK;
    char file[400];
    snprintf(file, sizeof file, "builtin:%.380s", spec);
    return rf_fail(RF_BAD_INPUT, file, "size", "the longer side may be %d times the shorter at the most", most);
}

RfResult rf_flow_scene_create(const char *spec, RfFlowScene **out)
{
    RF_REQUIRE(spec && out, "a flow scene needs a name and a place to put it");
    *out = NULL;
    const RfSceneClass *class = NULL;
    for (int i = 0; i < SCENE_COUNT && !class; ++i)
        if (rf_parameters_named(spec, scenes[i]->name))
            class = scenes[i];
    if (!class)
        return refuse_name(spec, "flow");
    RfParameters parameters;
    RF_TRY(rf_parameters_read(spec, class->defaults, class->ranges, &parameters));
    RF_TRY(check_aspect(spec, &parameters, class->most_aspect));
    RfFlowScene *scene = rf_allocate_zero(1, sizeof *scene);
    if (!scene)
        return RF_OUT_OF_MEMORY;
    *scene = (RfFlowScene){.class = class, .parameters = parameters};
    RfResult result = class->create ? class->create(&parameters, &scene->state) : RF_OK;
    if (result != RF_OK)
        rf_release(scene);
    else
        *out = scene;
    return result;
}

void rf_flow_scene_destroy(RfFlowScene *scene)
{
    if (!scene)
        return;
    if (scene->class->destroy)
        scene->class->destroy(scene->state);
    rf_release(scene);
}

int rf_flow_scene_moment_count(const RfFlowScene *scene)
{
    return scene->class->moment_count;
}

RfResult rf_flow_scene_moment(RfFlowScene *scene, int moment, RfFlowField *out)
{
    RF_REQUIRE(scene && out && moment >= 0, "a moment of a flow scene is 0 or more");
    if (scene->class->advance)
    {
        if (moment < scene->moment)
        {
            scene->class->restart(scene->state);
            scene->moment = 0;
        }
        for (; scene->moment < moment; ++scene->moment)
        {
            // Between two moments, where the state is sound.
            RF_TRY(rf_progress("running the flow", (double)scene->moment / moment));
            scene->class->advance(scene->state);
        }
    }
    RF_TRY(rf_flow_field_create(scene->parameters.width, scene->parameters.height, out));
    RfResult result = scene->class->draw(&scene->parameters, scene->state, moment, out);
    if (result != RF_OK)
        rf_flow_field_free(out);
    return result;
}

/// Clamps, and rounds colours to 8 bits so that a picture written as PNG and read again is the same exemplar. Height
/// stays as fine as it was computed.
static void finish(RfImage *image)
{
    RfImageView view = rf_image_view(image);
    for (int j = 0; j < view.height; ++j)
        for (int i = 0; i < view.width * view.channels; ++i)
        {
            float *value = view.pixels + (ptrdiff_t)j * view.row_stride + i;
            *value = rf_clamp(*value, 0, 1);
            if (view.channels < 4 || i % view.channels < 3)
                *value = floorf(*value * 255 + 0.5f) / 255;
        }
    if (view.channels == 4)
        rf_image_set_channel_name(image, 3, "height");
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
}

RfResult rf_exemplar_draw(const char *spec, RfImage **out)
{
    RF_REQUIRE(spec && out, "an exemplar needs a name and a place to put it");
    *out = NULL;
    const RfExemplarClass *class = NULL;
    for (int i = 0; i < EXEMPLAR_COUNT && !class; ++i)
        if (rf_parameters_named(spec, exemplars[i]->name))
            class = exemplars[i];
    if (!class)
        return refuse_name(spec, "exemplar");
    RfParameters parameters;
    RF_TRY(rf_parameters_read(spec, class->defaults, class->ranges, &parameters));
    RF_TRY(check_aspect(spec, &parameters, MAX_ASPECT));
    RfImage *image;
    RF_TRY(rf_image_create(parameters.width, parameters.height, class->channels, &image));
    RfImageView view = rf_image_view(image);
    RfResult result = class->draw(&parameters, &view);
    if (result != RF_OK)
    {
        rf_image_destroy(image);
        return result;
    }
    finish(image);
    *out = image;
    return RF_OK;
}

// The classes are the only list; the public table is copied from them at its first use.
static RfBuiltin table[SCENE_COUNT + EXEMPLAR_COUNT];
static pthread_once_t table_once = PTHREAD_ONCE_INIT;

static void fill_table(void)
{
    for (int i = 0; i < SCENE_COUNT; ++i)
        table[i] = (RfBuiltin){scenes[i]->name, "flow", scenes[i]->defaults, scenes[i]->sentence};
    for (int i = 0; i < EXEMPLAR_COUNT; ++i)
        table[SCENE_COUNT + i] =
            (RfBuiltin){exemplars[i]->name, "exemplar", exemplars[i]->defaults, exemplars[i]->sentence};
}

const RfBuiltin *rf_builtin_table(int *count)
{
    pthread_once(&table_once, fill_table);
    if (count)
        *count = SCENE_COUNT + EXEMPLAR_COUNT;
    return table;
}
