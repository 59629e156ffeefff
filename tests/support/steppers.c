// SPDX-License-Identifier: Apache-2.0
#include "support/steppers.h"

#include <stdlib.h>
#include <string.h>

#define VERBS(name, Type)                                                                                              \
    static StepperOptions name##_defaults(void)                                                                        \
    {                                                                                                                  \
        return (StepperOptions){.name = rf_##name##_defaults()};                                                       \
    }                                                                                                                  \
    static RfResult name##_create(const RfExemplar *exemplar, const StepperOptions *options, void **out)               \
    {                                                                                                                  \
        return rf_##name##_create(exemplar, &options->name, (Type **)out);                                             \
    }                                                                                                                  \
    static RfResult name##_step(void *method, const RfFlowView *flow, const RfImageView *frame)                        \
    {                                                                                                                  \
        return rf_##name##_step(method, flow, frame);                                                                  \
    }                                                                                                                  \
    static RfResult name##_advance(void *method, const RfFlowView *flow, int width, int height)                        \
    {                                                                                                                  \
        return rf_##name##_advance(method, flow, width, height);                                                       \
    }                                                                                                                  \
    static RfResult name##_save(const void *method, void **block, size_t *size)                                        \
    {                                                                                                                  \
        return rf_##name##_save(method, block, size);                                                                  \
    }                                                                                                                  \
    static RfResult name##_load(const RfExemplar *exemplar, const StepperOptions *options, const void *block,          \
                                size_t size, void **out)                                                               \
    {                                                                                                                  \
        return rf_##name##_load(exemplar, &options->name, block, size, (Type **)out);                                  \
    }                                                                                                                  \
    static void name##_destroy(void *method)                                                                           \
    {                                                                                                                  \
        rf_##name##_destroy(method);                                                                                   \
    }

VERBS(lagrangian, RfLagrangian)
VERBS(optimize, RfOptimize)
VERBS(directional, RfDirectional)
VERBS(eulerian, RfEulerian)
VERBS(dual, RfDual)
VERBS(sprites, RfSprites)
VERBS(warp, RfWarp)

static StepperOptions paper_defaults(void)
{
    return (StepperOptions){.lagrangian = rf_lagrangian_paper()};
}

static RfLagrangianStats lagrangian_stats(const void *method)
{
    return rf_lagrangian_stats(method);
}

static RfLagrangianStats sprites_stats(const void *method)
{
    return rf_sprites_stats(method);
}

#define STEPPER(as, defaults, name, stats)                                                                             \
    {                                                                                                                  \
        as, rf_##name##_option_table, defaults, name##_create, name##_step, name##_advance, name##_save, name##_load,  \
            name##_destroy, stats                                                                                      \
    }

static const Stepper g_steppers[] = {
    STEPPER("lagrangian", lagrangian_defaults, lagrangian, lagrangian_stats),
    STEPPER("paper", paper_defaults, lagrangian, lagrangian_stats),
    STEPPER("optimize", optimize_defaults, optimize, NULL),
    STEPPER("directional", directional_defaults, directional, NULL),
    STEPPER("eulerian", eulerian_defaults, eulerian, NULL),
    STEPPER("dual", dual_defaults, dual, NULL),
    STEPPER("sprites", sprites_defaults, sprites, sprites_stats),
    STEPPER("warp", warp_defaults, warp, NULL),
};

const Stepper *stepper_find(const char *name)
{
    for (size_t i = 0; i < sizeof g_steppers / sizeof g_steppers[0]; ++i)
        if (strcmp(g_steppers[i].name, name) == 0)
            return &g_steppers[i];
    return NULL;
}

void *stepper_field(const Stepper *stepper, StepperOptions *options, const char *name, RfOptionKind *kind)
{
    int count;
    const RfOption *table = stepper->table(&count);
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
        {
            *kind = table[i].kind;
            return (uint8_t *)options + table[i].offset;
        }
    return NULL;
}

bool stepper_set(const Stepper *stepper, StepperOptions *options, const char *name, const char *value)
{
    RfOptionKind kind;
    void *field = stepper_field(stepper, options, name, &kind);
    if (!field)
        return false;
    if (kind == RF_OPTION_FLOAT)
        *(float *)field = (float)atof(value);
    else if (kind == RF_OPTION_UINT64)
        *(uint64_t *)field = strtoull(value, NULL, 10);
    else if (kind == RF_OPTION_BOOL)
        *(bool *)field = atoi(value) != 0;
    else
        *(int *)field = atoi(value);
    return true;
}
