// SPDX-License-Identifier: Apache-2.0
// Carries the vertices of one small grid along a flow.
#pragma once

#include "data/flow_field.h"

/// Moves the n x n vertices (pixels of a frame of width x height that covers the flow's domain) from time `from` to
/// view->time along their paths. Vertices outside the fluid or the domain move with the velocity extrapolated inside
/// the grid. inside[] tells afterwards which vertices are in the fluid; returns their number.
int rf_advect_grid(float *x, float *y, bool *inside, int n, const RfFlowView *view, double from, int width, int height);

/// Velocity at a point of the frame, in pixels a frame, from the fluid's cells alone; false outside the fluid. blend:
/// rf_flow_blend.
bool rf_flow_velocity(const RfFlowView *view, RfVec2 point, float scale_x, float scale_y, float blend,
                      RfVec2 *velocity);
