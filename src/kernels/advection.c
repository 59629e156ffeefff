// SPDX-License-Identifier: Apache-2.0
// The classical fourth-order Runge-Kutta rule along the path, with the velocity linear in time between two moments and
// bilinear in space. A step is cut until no vertex crosses more than two cells at once, 16 times at most: beyond that
// (32 cells a frame) paths are cut short of features they jump over.
//
// Every stage is taken by the whole grid, since vertices outside the fluid have no velocity of their own: they take the
// one that push-pull finds from the grid's other vertices at the same stage.

#include "kernels/advection.h"
#include "kernels/extrapolation.h"

#include <assert.h>

// Pixels; what an absurd velocity carries farther (or to NaN) stops here, where integers still hold it.
#define FARTHEST 1e6f

enum
{
    MAX_SUBSTEPS = 16,
    MAX_NODES = RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES
};

bool rf_flow_velocity(const RfFlowView *view, RfVec2 point, float scale_x, float scale_y, float blend, RfVec2 *velocity)
{
    float x = point.x / scale_x, y = point.y / scale_y;
    if (!rf_flow_inside(view, x, y))
        return false;
    RfVec2 v = rf_flow_sample(view, x, y, blend);
    *velocity = (RfVec2){v.x * scale_x, v.y * scale_y};
    return true;
}

typedef struct Stage
{
    const RfFlowView *view;
    float scale_x, scale_y;
    int count, side;
} Stage;

// k = u(x + h * before, time) at every vertex.
static void evaluate(const Stage *stage, const float *x, const float *y, const RfVec2 *before, float h, double time,
                     RfVec2 *k)
{
    bool known[MAX_NODES];
    float blend = rf_flow_blend(stage->view, time);
    for (int i = 0; i < stage->count; ++i)
    {
        RfVec2 p = {x[i], y[i]};
        if (before)
            p = (RfVec2){p.x + h * before[i].x, p.y + h * before[i].y};
        known[i] = rf_flow_velocity(stage->view, p, stage->scale_x, stage->scale_y, blend, &k[i]);
    }
    rf_push_pull(k, known, stage->side);
}

static float greatest_speed_in_cells(const Stage *stage, const RfVec2 *k)
{
    float greatest = 0;
    for (int i = 0; i < stage->count; ++i)
        greatest = fmaxf(greatest, fmaxf(fabsf(k[i].x) / stage->scale_x, fabsf(k[i].y) / stage->scale_y));
    return greatest;
}

int rf_advect_grid(float *x, float *y, bool *inside, int n, const RfFlowView *view, double from, int width, int height)
{
    assert(n >= 1 && n <= RF_MAX_GRID_VERTICES);
    RfVec2 k1[MAX_NODES], k2[MAX_NODES], k3[MAX_NODES], k4[MAX_NODES];
    Stage stage = {view, (float)width / (float)view->width, (float)height / (float)view->height, n * n, n};
    double span = view->time - from;
    if (span > 0)
    {
        evaluate(&stage, x, y, NULL, 0, from, k1);
        int steps = (int)rf_clamp(ceilf(greatest_speed_in_cells(&stage, k1) * (float)span * 0.5f), 1, MAX_SUBSTEPS);
        float h = (float)(span / steps);
        for (int s = 0; s < steps; ++s)
        {
            double t = from + span * s / steps;
            if (s > 0)
                evaluate(&stage, x, y, NULL, 0, t, k1);
            evaluate(&stage, x, y, k1, 0.5f * h, t + 0.5 * h, k2);
            evaluate(&stage, x, y, k2, 0.5f * h, t + 0.5 * h, k3);
            evaluate(&stage, x, y, k3, h, t + h, k4);
            for (int i = 0; i < n * n; ++i)
            {
                x[i] = rf_clamp(x[i] + h / 6 * (k1[i].x + 2 * k2[i].x + 2 * k3[i].x + k4[i].x), -FARTHEST, FARTHEST);
                y[i] = rf_clamp(y[i] + h / 6 * (k1[i].y + 2 * k2[i].y + 2 * k3[i].y + k4[i].y), -FARTHEST, FARTHEST);
            }
        }
    }
    int count = 0;
    for (int i = 0; i < n * n; ++i)
    {
        inside[i] = rf_flow_inside(view, x[i] / stage.scale_x, y[i] / stage.scale_y);
        count += inside[i];
    }
    return count;
}
