// SPDX-License-Identifier: Apache-2.0
#include "methods.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

// The verbs of a method, behind one type for all of them.
#define METHOD_VERBS(name, Type)                                                                                       \
    static_assert(sizeof(Type##Options) <= METHOD_OPTIONS_SIZE, "room for the options");                               \
                                                                                                                       \
    static RfResult name##_create(const RfExemplar *exemplar, const MethodOptions *options, void **out)                \
    {                                                                                                                  \
        Type *method = NULL;                                                                                           \
        RfResult result = rf_##name##_create(exemplar, (const Type##Options *)options, &method);                       \
        *out = method;                                                                                                 \
        return result;                                                                                                 \
    }                                                                                                                  \
                                                                                                                       \
    static RfResult name##_step(void *method, const RfFlowView *flow, const RfImageView *frame)                        \
    {                                                                                                                  \
        return rf_##name##_step(method, flow, frame);                                                                  \
    }                                                                                                                  \
                                                                                                                       \
    static RfResult name##_advance(void *method, const RfFlowView *flow, int width, int height)                        \
    {                                                                                                                  \
        return rf_##name##_advance(method, flow, width, height);                                                       \
    }                                                                                                                  \
                                                                                                                       \
    static RfResult name##_save(const void *method, void **block, size_t *size)                                        \
    {                                                                                                                  \
        return rf_##name##_save(method, block, size);                                                                  \
    }                                                                                                                  \
                                                                                                                       \
    static RfResult name##_load(const RfExemplar *exemplar, const MethodOptions *options, const void *block,           \
                                size_t size, void **out)                                                               \
    {                                                                                                                  \
        Type *method = NULL;                                                                                           \
        RfResult result = rf_##name##_load(exemplar, (const Type##Options *)options, block, size, &method);            \
        *out = method;                                                                                                 \
        return result;                                                                                                 \
    }                                                                                                                  \
                                                                                                                       \
    static void name##_destroy(void *method)                                                                           \
    {                                                                                                                  \
        rf_##name##_destroy(method);                                                                                   \
    }

// The defaults of a method without presets.
#define METHOD_DEFAULTS(name, Type)                                                                                    \
    static void name##_defaults(int preset, MethodOptions *options)                                                    \
    {                                                                                                                  \
        (void)preset;                                                                                                  \
        Type##Options values = rf_##name##_defaults();                                                                 \
        memcpy(options, &values, sizeof values);                                                                       \
    }

METHOD_VERBS(lagrangian, RfLagrangian)
METHOD_VERBS(optimize, RfOptimize)
METHOD_DEFAULTS(optimize, RfOptimize)
METHOD_VERBS(directional, RfDirectional)
METHOD_DEFAULTS(directional, RfDirectional)
METHOD_VERBS(eulerian, RfEulerian)
METHOD_DEFAULTS(eulerian, RfEulerian)
METHOD_VERBS(dual, RfDual)
METHOD_DEFAULTS(dual, RfDual)
METHOD_VERBS(sprites, RfSprites)
METHOD_DEFAULTS(sprites, RfSprites)
METHOD_VERBS(warp, RfWarp)
METHOD_DEFAULTS(warp, RfWarp)

static void lagrangian_defaults(int preset, MethodOptions *options)
{
    RfLagrangianOptions values = preset == 1 ? rf_lagrangian_paper() : rf_lagrangian_defaults();
    memcpy(options, &values, sizeof values);
}

static RfResult lagrangian_layers(const void *method, const RfImageView *layers)
{
    return rf_lagrangian_layers(method, layers);
}

static void add_stage(FrameReport *report, const char *name, double seconds)
{
    report->stages[report->stage_count++] = (Stage){name, seconds};
}

static void add_figure(FrameReport *report, const char *name, double value)
{
    report->figures[report->figure_count++] = (Figure){name, value};
}

static void tell_particles(RfLagrangianStats stats, FrameReport *report)
{
    add_stage(report, "advect", stats.advect_seconds);
    add_stage(report, "distribute", stats.distribute_seconds);
    add_stage(report, "draw", stats.draw_seconds);
}

static void lagrangian_report(const void *method, FrameReport *report)
{
    tell_particles(rf_lagrangian_stats(method), report);
}

static void sprites_report(const void *method, FrameReport *report)
{
    tell_particles(rf_sprites_stats(method), report);
}

static void optimize_report(const void *method, FrameReport *report)
{
    RfOptimizeStats stats = rf_optimize_stats(method);
    add_stage(report, "carry", stats.carry_seconds);
    add_stage(report, "search", stats.search_seconds);
    add_stage(report, "draw", stats.draw_seconds);
    add_figure(report, "energy", stats.energy);
    add_figure(report, "patches", stats.patches);
}

static void directional_report(const void *method, FrameReport *report)
{
    RfDirectionalStats stats = rf_directional_stats(method);
    add_stage(report, "move", stats.move_seconds);
    add_stage(report, "fill", stats.fill_seconds);
    add_stage(report, "renew", stats.renew_seconds);
    add_figure(report, "filled", (double)stats.filled);
    add_figure(report, "continued", (double)stats.continued);
    add_figure(report, "renewed", (double)stats.renewed);
    if (stats.isotropic)
        snprintf(report->remark, sizeof report->remark,
                 "has no main direction to be seen (directionality %.2f): the texture will not show the flow's; "
                 "--method optimize or lagrangian suit it better",
                 (double)stats.directionality);
}

// The last three differ: presets, layers, report.
#define METHOD(name, sentence, presets, layers, report)                                                                \
    {                                                                                                                  \
#name, sentence, presets, rf_##name##_option_table, name##_defaults, name##_create, name##_step,               \
            name##_advance, name##_save, name##_load, name##_destroy, layers, report                                   \
    }

static const Method g_methods[] = {
    METHOD(lagrangian, "textured grids that follow the flow, fade in and out and are blended: the spectrum stays",
           "default|paper", lagrangian_layers, lagrangian_report),
    METHOD(optimize,
           "a still that the flow carries and bends, and pieces of the exemplar that fit where it is worn: shapes stay",
           NULL, NULL, optimize_report),
    METHOD(directional,
           "pieces of the exemplar, turned downstream, that the flow carries and does not bend: canes point along it",
           NULL, NULL, directional_report),
    METHOD(eulerian, "layers of carried coordinates, regenerated sooner where the flow deforms more", NULL, NULL, NULL),
    METHOD(dual, "two layers of carried coordinates that start afresh in turn", NULL, NULL, NULL),
    METHOD(sprites, "round pieces of the exemplar that the flow carries and does not bend", NULL, NULL, sprites_report),
    METHOD(warp, "coordinates carried for ever: follows exactly and stretches without end", NULL, NULL, NULL),
};

const Method *method_table(int *count)
{
    *count = sizeof g_methods / sizeof g_methods[0];
    return g_methods;
}

const Method *method_find(const char *name)
{
    for (size_t i = 0; i < sizeof g_methods / sizeof g_methods[0]; ++i)
        if (strcmp(g_methods[i].name, name) == 0)
            return &g_methods[i];
    return NULL;
}

const RfOption *method_option(const Method *method, const char *name)
{
    int count = 0;
    const RfOption *table = method->table(&count);
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

const Method *method_with_option(const char *name, const RfOption **option)
{
    for (size_t i = 0; i < sizeof g_methods / sizeof g_methods[0]; ++i)
    {
        *option = method_option(&g_methods[i], name);
        if (*option)
            return &g_methods[i];
    }
    return NULL;
}
