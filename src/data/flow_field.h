// SPDX-License-Identifier: Apache-2.0
// One moment of a 2D flow, owned: what readers and simulators produce, and sampling of views.
#pragma once

#include "core/maths.h"
#include "riffle/data.h"

typedef struct RfFlowField
{
    int width, height;
    /// [height][width][2], cells a frame, y down.
    float *velocity;
    /// [height][width], 0 outside the fluid; NULL: fluid everywhere.
    uint8_t *mask;
} RfFlowField;

/// Velocities 0, no mask. Refuses sizes over RF_MAX_SIZE with RF_INVALID_ARGUMENT, so readers check before with their
/// own message.
RfResult rf_flow_field_create(int width, int height, RfFlowField *out);
/// Adds a mask of 1s to a field that has none.
RfResult rf_flow_field_add_mask(RfFlowField *field);
void rf_flow_field_free(RfFlowField *field);
/// Fills the vectors where valid[] is 0 from their valid neighbours, ring by ring (mean of the known 8 neighbours);
/// returns how many. All invalid: zeros.
int rf_flow_field_fill_invalid(RfFlowField *field, const uint8_t *valid);
/// Borrowed view of a single moment at `time`.
RfFlowView rf_flow_field_view(const RfFlowField *field, double time);

/// Checks a view at the door: sizes, pointers, times, and that every number is finite (with the place).
RfResult rf_flow_view_check(const RfFlowView *view);

/// 0 at velocity_time and before, 1 at next_time and after.
static inline float rf_flow_blend(const RfFlowView *view, double time)
{
    if (!view->next_velocity || view->next_time <= view->velocity_time)
        return 0;
    double t = (time - view->velocity_time) / (view->next_time - view->velocity_time);
    return t > 0 ? (t < 1 ? (float)t : 1.0f) : 0.0f;
}

/// The four cells round a point in flow cells, clamped to the domain, with their bilinear weights. Clamping before the
/// cast keeps far-away and NaN points defined.
typedef struct RfFlowCorners
{
    size_t cell[4];
    float weight[4];
} RfFlowCorners;

static inline RfFlowCorners rf_flow_corners(const RfFlowView *view, float x, float y)
{
    float u = rf_clamp(x - 0.5f, 0, (float)(view->width - 1)), v = rf_clamp(y - 0.5f, 0, (float)(view->height - 1));
    int i0 = (int)u, i1 = rf_min_int(i0 + 1, view->width - 1);
    int j0 = (int)v, j1 = rf_min_int(j0 + 1, view->height - 1);
    float s = u - (float)i0, t = v - (float)j0;
    size_t row0 = (size_t)j0 * (size_t)view->width, row1 = (size_t)j1 * (size_t)view->width;
    return (RfFlowCorners){{row0 + (size_t)i0, row0 + (size_t)i1, row1 + (size_t)i0, row1 + (size_t)i1},
                           {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t}};
}

/// True if the point, in flow cells, lies in the domain and in the fluid: where the mask, interpolated between cell
/// centres, is half or more. So the shore is a smooth line at any frame size.
static inline bool rf_flow_inside(const RfFlowView *view, float x, float y)
{
    if (!(x >= 0 && y >= 0 && x < (float)view->width && y < (float)view->height))
        return false;
    if (!view->mask)
        return true;
    RfFlowCorners c = rf_flow_corners(view, x, y);
    float fluid = 0;
    for (int k = 0; k < 4; ++k)
        fluid += view->mask[c.cell[k]] ? c.weight[k] : 0;
    return fluid >= 0.5f;
}

/// The same for the centre of a pixel of a width x height frame.
static inline bool rf_pixel_inside(const RfFlowView *view, int width, int height, int x, int y)
{
    return rf_flow_inside(view, ((float)x + 0.5f) * (float)view->width / (float)width,
                          ((float)y + 0.5f) * (float)view->height / (float)height);
}

/// Velocity at a point in flow cells (cell (i, j) is centred on i + 0.5, j + 0.5), bilinear over the fluid's cells
/// alone, so that land does not slow the shore; 0 with no fluid cell near; outside the domain the border's. `blend`
/// from rf_flow_blend.
static inline RfVec2 rf_flow_sample(const RfFlowView *view, float x, float y, float blend)
{
    RfFlowCorners c = rf_flow_corners(view, x, y);
    float total = 0;
    RfVec2 r = {0, 0};
    const float *a = view->velocity, *b = view->next_velocity && blend > 0 ? view->next_velocity : NULL;
    for (int k = 0; k < 4; ++k)
    {
        float w = view->mask && !view->mask[c.cell[k]] ? 0 : c.weight[k];
        const float *p = a + 2 * c.cell[k];
        RfVec2 v = {p[0], p[1]};
        if (b)
        {
            const float *q = b + 2 * c.cell[k];
            v = (RfVec2){v.x + blend * (q[0] - v.x), v.y + blend * (q[1] - v.y)};
        }
        r.x += w * v.x;
        r.y += w * v.y;
        total += w;
    }
    return total > 0 ? (RfVec2){r.x / total, r.y / total} : r;
}
