// SPDX-License-Identifier: Apache-2.0
// What a built-in flow and a built-in exemplar are made of: one constant table entry each, listed in builtin.c.
#pragma once

#include "data/flow_field.h"
#include "fluids/parameters.h"

typedef struct RfSceneClass
{
    const char *name;
    /// "size=256x256&speed=2", and the range of each.
    const char *defaults;
    const RfParameterRange *ranges;
    const char *sentence;
    /// 1: steady; 0: endless.
    int moment_count;
    /// How many times the shorter side the longer may be; 0: any number.
    int most_aspect;
    /// Makes what the scene keeps, standing at moment 0; NULL where draw() needs the parameters only.
    RfResult (*create)(const RfParameters *parameters, void **state);
    /// Back to moment 0, and on by one moment. Both NULL where any moment can be drawn at once.
    void (*restart)(void *state);
    void (*advance)(void *state);
    /// Fills a field of the right size, with or without a mask, from where the state stands.
    RfResult (*draw)(const RfParameters *parameters, void *state, int moment, RfFlowField *field);
    void (*destroy)(void *state);
} RfSceneClass;

extern const RfSceneClass rf_scene_vortex, rf_scene_shear, rf_scene_gyre, rf_scene_uniform, rf_scene_rotation,
    rf_scene_turbulence, rf_scene_cylinder, rf_scene_river;

typedef struct RfExemplarClass
{
    const char *name;
    const char *defaults;
    const RfParameterRange *ranges;
    const char *sentence;
    /// 1, 3, or 4 with a height.
    int channels;
    /// Fills an image of the right size with values that are then clamped to 0..1 and, but for height, rounded to 8
    /// bits.
    RfResult (*draw)(const RfParameters *parameters, const RfImageView *image);
} RfExemplarClass;

extern const RfExemplarClass rf_exemplar_foam, rf_exemplar_bubbles, rf_exemplar_lava, rf_exemplar_canes,
    rf_exemplar_pebbles, rf_exemplar_chocolate, rf_exemplar_noise, rf_exemplar_checker;
