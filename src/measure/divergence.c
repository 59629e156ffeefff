// SPDX-License-Identifier: Apache-2.0
// Is it a fluid? Divergence by central differences, over the speed: independent of units and of the time step.
#include "riffle/measure.h"

#include "core/result.h"
#include "data/flow_field.h"

static RfVec2 velocity_at(const RfFlowView *flow, int x, int y, float blend)
{
    size_t k = 2 * ((size_t)y * (size_t)flow->width + (size_t)x);
    RfVec2 v = {flow->velocity[k], flow->velocity[k + 1]};
    if (flow->next_velocity && blend > 0)
        v = (RfVec2){rf_lerp(v.x, flow->next_velocity[k], blend), rf_lerp(v.y, flow->next_velocity[k + 1], blend)};
    return v;
}

static bool is_fluid(const RfFlowView *flow, int x, int y)
{
    return !flow->mask || flow->mask[(size_t)y * (size_t)flow->width + (size_t)x];
}

RfResult rf_measure_divergence(const RfFlowView *flow, RfMeasureDivergence *out)
{
    RF_REQUIRE(out, "rf_measure_divergence: out is NULL");
    RF_TRY(rf_flow_view_check(flow));
    float blend = rf_flow_blend(flow, flow->time);
    double divergence = 0, speed = 0, cells = 0;
    for (int y = 1; y < flow->height - 1; ++y)
        for (int x = 1; x < flow->width - 1; ++x)
        {
            if (!is_fluid(flow, x, y) || !is_fluid(flow, x - 1, y) || !is_fluid(flow, x + 1, y) ||
                !is_fluid(flow, x, y - 1) || !is_fluid(flow, x, y + 1))
                continue;
            RfVec2 v = velocity_at(flow, x, y, blend);
            float dx = velocity_at(flow, x + 1, y, blend).x - velocity_at(flow, x - 1, y, blend).x;
            float dy = velocity_at(flow, x, y + 1, blend).y - velocity_at(flow, x, y - 1, blend).y;
            divergence += 0.25 * (double)(dx + dy) * (double)(dx + dy);
            speed += (double)v.x * (double)v.x + (double)v.y * (double)v.y;
            cells += 1;
        }
    double nan = (double)NAN;
    *out = (RfMeasureDivergence){.rms_divergence = cells > 0 ? sqrt(divergence / cells) : nan,
                                 .rms_speed = cells > 0 ? sqrt(speed / cells) : nan,
                                 .relative = speed > 0 ? sqrt(divergence / speed) : nan,
                                 .cells = (int64_t)cells};
    return RF_OK;
}
