// SPDX-License-Identifier: Apache-2.0
#include "methods.h"

#include <assert.h>
#include <string.h>

static_assert(sizeof(RfLagrangianOptions) <= METHOD_OPTIONS_SIZE, "room for the options");
static_assert(sizeof(RfWarpOptions) <= METHOD_OPTIONS_SIZE, "room for the options");

static void lagrangian_defaults(int preset, MethodOptions *options)
{
    RfLagrangianOptions values = preset == 1 ? rf_lagrangian_paper() : rf_lagrangian_defaults();
    memcpy(options, &values, sizeof values);
}

static RfResult lagrangian_create(const RfExemplar *exemplar, const MethodOptions *options, void **out)
{
    RfLagrangian *lagrangian = NULL;
    RfResult result = rf_lagrangian_create(exemplar, (const RfLagrangianOptions *)options, &lagrangian);
    *out = lagrangian;
    return result;
}

static RfResult lagrangian_step(void *method, const RfFlowView *flow, const RfImageView *frame)
{
    return rf_lagrangian_step(method, flow, frame);
}

static RfResult lagrangian_advance(void *method, const RfFlowView *flow, int width, int height)
{
    return rf_lagrangian_advance(method, flow, width, height);
}

static RfResult lagrangian_save(const void *method, void **block, size_t *size)
{
    return rf_lagrangian_save(method, block, size);
}

static RfResult lagrangian_load(const RfExemplar *exemplar, const MethodOptions *options, const void *block,
                                size_t size, void **out)
{
    RfLagrangian *lagrangian = NULL;
    RfResult result = rf_lagrangian_load(exemplar, (const RfLagrangianOptions *)options, block, size, &lagrangian);
    *out = lagrangian;
    return result;
}

static void lagrangian_destroy(void *method)
{
    rf_lagrangian_destroy(method);
}

static RfResult lagrangian_layers(const void *method, const RfImageView *layers)
{
    return rf_lagrangian_layers(method, layers);
}

static int lagrangian_stages(const void *method, Stage stages[MAX_STAGES])
{
    RfLagrangianStats stats = rf_lagrangian_stats(method);
    stages[0] = (Stage){"advect", stats.advect_seconds};
    stages[1] = (Stage){"distribute", stats.distribute_seconds};
    stages[2] = (Stage){"draw", stats.draw_seconds};
    return 3;
}

static void warp_defaults(int preset, MethodOptions *options)
{
    (void)preset;
    RfWarpOptions values = rf_warp_defaults();
    memcpy(options, &values, sizeof values);
}

static RfResult warp_create(const RfExemplar *exemplar, const MethodOptions *options, void **out)
{
    RfWarp *warp = NULL;
    RfResult result = rf_warp_create(exemplar, (const RfWarpOptions *)options, &warp);
    *out = warp;
    return result;
}

static RfResult warp_step(void *method, const RfFlowView *flow, const RfImageView *frame)
{
    return rf_warp_step(method, flow, frame);
}

static RfResult warp_advance(void *method, const RfFlowView *flow, int width, int height)
{
    return rf_warp_advance(method, flow, width, height);
}

static RfResult warp_save(const void *method, void **block, size_t *size)
{
    return rf_warp_save(method, block, size);
}

static RfResult warp_load(const RfExemplar *exemplar, const MethodOptions *options, const void *block, size_t size,
                          void **out)
{
    RfWarp *warp = NULL;
    RfResult result = rf_warp_load(exemplar, (const RfWarpOptions *)options, block, size, &warp);
    *out = warp;
    return result;
}

static void warp_destroy(void *method)
{
    rf_warp_destroy(method);
}

static const Method g_methods[] = {
    {"lagrangian", "textured grids that follow the flow, fade in and out and are blended: the spectrum stays",
     "default|paper", rf_lagrangian_option_table, lagrangian_defaults, lagrangian_create, lagrangian_step,
     lagrangian_advance, lagrangian_save, lagrangian_load, lagrangian_destroy, lagrangian_layers, lagrangian_stages},
    {"warp", "coordinates carried for ever: follows exactly and stretches without end, for comparison", NULL,
     rf_warp_option_table, warp_defaults, warp_create, warp_step, warp_advance, warp_save, warp_load, warp_destroy,
     NULL, NULL},
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
