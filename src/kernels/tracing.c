// SPDX-License-Identifier: Apache-2.0
#include "kernels/tracing.h"

enum
{
    MAX_STEPS = 256
};

// Longest stretch of a path, in flow cells, that one midpoint step traces.
static const float PATH_STEP = 4.0f;

static float max_speed(const float *velocity, size_t cells)
{
    float square = 0;
    for (size_t k = 0; k < cells; ++k)
    {
        float s = velocity[2 * k] * velocity[2 * k] + velocity[2 * k + 1] * velocity[2 * k + 1];
        square = s > square ? s : square;
    }
    return sqrtf(square);
}

int rf_path_steps(const RfFlowView *flow, double dt)
{
    size_t cells = (size_t)flow->width * (size_t)flow->height;
    float speed = max_speed(flow->velocity, cells);
    if (flow->next_velocity)
        speed = fmaxf(speed, max_speed(flow->next_velocity, cells));
    // At least a step a frame, since the velocity may change from frame to frame.
    double steps = ceil(fmax(dt * (double)speed / (double)PATH_STEP, dt));
    return steps > MAX_STEPS ? MAX_STEPS : steps > 1 ? (int)steps : 1;
}

RfVec2 rf_trace(const RfFlowView *flow, RfVec2 point, double from, double to, int steps)
{
    double dt = (to - from) / steps, time = from;
    float whole = (float)dt, half = 0.5f * whole;
    for (int i = 0; i < steps; ++i, time += dt)
    {
        RfVec2 v = rf_flow_sample(flow, point.x, point.y, rf_flow_blend(flow, time));
        v = rf_flow_sample(flow, point.x + half * v.x, point.y + half * v.y, rf_flow_blend(flow, time + 0.5 * dt));
        point = (RfVec2){point.x + whole * v.x, point.y + whole * v.y};
    }
    return point;
}
