// SPDX-License-Identifier: Apache-2.0
// The built-in inputs: flows computed or simulated, exemplars drawn. A spec is "name" or "name?key=value&key=value",
// without "builtin:".
#pragma once

#include "data/flow_field.h"
#include "riffle/io.h"

/// A flow that is computed moment by moment; moment 0 is the first.
typedef struct RfFlowScene RfFlowScene;

/// Unknown names and parameters, and values out of range, give RF_BAD_INPUT with `file` = "builtin:SPEC", the place =
/// the parameter, and what is there instead.
RfResult rf_flow_scene_create(const char *spec, RfFlowScene **out);
void rf_flow_scene_destroy(RfFlowScene *scene);
/// 1: steady; 0: endless.
int rf_flow_scene_moment_count(const RfFlowScene *scene);
/// Fills *out (made by the call, freed by the caller with rf_flow_field_free) with velocity in cells a frame, and a
/// mask where there is an obstacle. Going forward continues the simulation; going back starts it again. Same bytes
/// either way.
RfResult rf_flow_scene_moment(RfFlowScene *scene, int moment, RfFlowField *out);

/// Draws an exemplar: sRGB-encoded 0 to 1, RF_SAMPLE_U8. All but noise of wrapping kind tile.
RfResult rf_exemplar_draw(const char *spec, RfImage **out);
