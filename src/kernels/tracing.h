// SPDX-License-Identifier: Apache-2.0
// Paths of single points through a flow, forwards and backwards in time.
#pragma once

#include "data/flow_field.h"

/// Steps that a path of `dt` frames is cut into, by the flow's greatest speed: 1 to 256.
int rf_path_steps(const RfFlowView *flow, double dt);

/// Where a point, in flow cells, that is at `point` at time `from` is at time `to`, by midpoint steps (second order).
/// Outside the domain it moves with the border's velocity, far inside land not at all.
RfVec2 rf_trace(const RfFlowView *flow, RfVec2 point, double from, double to, int steps);
