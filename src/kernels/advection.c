// SPDX-License-Identifier: Apache-2.0
// The classical fourth-order Runge-Kutta rule along the path, with the velocity linear in time between two moments and
// bilinear in space. A step is cut until no vertex crosses more than two cells at once, 16 times at most: beyond that
// (32 cells a frame) paths are cut short of features they jump over.
//
// Every stage is taken by the whole grid, since vertices outside the fluid have no velocity of their own: they take the
// one that push-pull finds from the grid's other vertices at the same stage.
//
// Deviation: push-pull alone continues a velocity as a constant. In a rotation or a shear the part of a grid that hangs
// over the border then lags, and comes in torn. So an affine velocity is fitted to the known vertices first, and
// push-pull continues what it leaves.

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

// An affine velocity v = mean + A (p - centre) fitted to the known vertices, damped where they span too little to tell
// A.
typedef struct Affine
{
    RfVec2 centre, mean;
    float a[4];
} Affine;

// As if the known vertices had this much more spread along every axis, in cells of the grid; keeps a few vertices from
// shooting off to the others.
#define FIT_DAMPING 0.5f

static Affine fit_affine(const RfVec2 *p, const RfVec2 *k, const bool *known, int count, float cell2)
{
    Affine f = {{0, 0}, {0, 0}, {0, 0, 0, 0}};
    float n = 0, xx = 0, xy = 0, yy = 0, b[4] = {0};
    for (int i = 0; i < count; ++i)
        if (known[i])
        {
            f.centre = (RfVec2){f.centre.x + p[i].x, f.centre.y + p[i].y};
            f.mean = (RfVec2){f.mean.x + k[i].x, f.mean.y + k[i].y};
            n += 1;
        }
    if (n == 0)
        return f;
    f.centre = (RfVec2){f.centre.x / n, f.centre.y / n};
    f.mean = (RfVec2){f.mean.x / n, f.mean.y / n};
    for (int i = 0; i < count; ++i)
        if (known[i])
        {
            float dx = p[i].x - f.centre.x, dy = p[i].y - f.centre.y, u = k[i].x - f.mean.x, v = k[i].y - f.mean.y;
            xx += dx * dx;
            xy += dx * dy;
            yy += dy * dy;
            b[0] += u * dx;
            b[1] += u * dy;
            b[2] += v * dx;
            b[3] += v * dy;
        }
    xx += FIT_DAMPING * cell2;
    yy += FIT_DAMPING * cell2;
    float det = xx * yy - xy * xy;
    if (!(det > 0))
        return f;
    for (int row = 0; row < 2; ++row)
    {
        f.a[2 * row] = (b[2 * row] * yy - b[2 * row + 1] * xy) / det;
        f.a[2 * row + 1] = (b[2 * row + 1] * xx - b[2 * row] * xy) / det;
    }
    return f;
}

static RfVec2 affine_at(const Affine *f, RfVec2 p)
{
    float dx = p.x - f->centre.x, dy = p.y - f->centre.y;
    return (RfVec2){f->mean.x + f->a[0] * dx + f->a[1] * dy, f->mean.y + f->a[2] * dx + f->a[3] * dy};
}

// Vertices without a velocity take the affine one, plus what push-pull makes of the others' differences from it.
static void extrapolate(const RfVec2 *p, const bool *known, int side, RfVec2 *k)
{
    int count = side * side;
    float dx = p[side - 1].x - p[0].x, dy = p[side - 1].y - p[0].y,
          cell2 = (dx * dx + dy * dy) / (float)((side - 1) * (side - 1) + 1);
    Affine f = fit_affine(p, k, known, count, cell2);
    for (int i = 0; i < count; ++i)
    {
        RfVec2 v = affine_at(&f, p[i]);
        k[i] = (RfVec2){k[i].x - v.x, k[i].y - v.y};
    }
    rf_push_pull(k, known, side);
    for (int i = 0; i < count; ++i)
    {
        RfVec2 v = affine_at(&f, p[i]);
        k[i] = (RfVec2){k[i].x + v.x, k[i].y + v.y};
    }
}

// k = u(x + h * before, time) at every vertex.
static void evaluate(const Stage *stage, const float *x, const float *y, const RfVec2 *before, float h, double time,
                     RfVec2 *k)
{
    bool known[MAX_NODES];
    RfVec2 p[MAX_NODES];
    float blend = rf_flow_blend(stage->view, time);
    int known_count = 0;
    for (int i = 0; i < stage->count; ++i)
    {
        p[i] = (RfVec2){x[i], y[i]};
        if (before)
            p[i] = (RfVec2){p[i].x + h * before[i].x, p[i].y + h * before[i].y};
        known[i] = rf_flow_velocity(stage->view, p[i], stage->scale_x, stage->scale_y, blend, &k[i]);
        known_count += known[i];
    }
    if (known_count < stage->count)
    {
        for (int i = 0; i < stage->count; ++i)
            if (!known[i])
                k[i] = (RfVec2){0, 0};
        extrapolate(p, known, stage->side, k);
    }
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
