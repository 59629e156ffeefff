// SPDX-License-Identifier: Apache-2.0
#include "data/flow_field.h"
#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <string.h>

RfResult rf_flow_field_create(int width, int height, RfFlowField *out)
{
    *out = (RfFlowField){0};
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "flow: %d x %d cells: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    out->velocity = rf_allocate_zero((size_t)width * (size_t)height, 2 * sizeof(float));
    if (!out->velocity)
        return RF_OUT_OF_MEMORY;
    out->width = width;
    out->height = height;
    return RF_OK;
}

RfResult rf_flow_field_add_mask(RfFlowField *field)
{
    if (field->mask)
        return RF_OK;
    size_t cells = (size_t)field->width * (size_t)field->height;
    field->mask = rf_allocate(cells, 1);
    if (!field->mask)
        return RF_OUT_OF_MEMORY;
    memset(field->mask, 1, cells);
    return RF_OK;
}

void rf_flow_field_free(RfFlowField *field)
{
    rf_release(field->velocity);
    rf_release(field->mask);
    *field = (RfFlowField){0};
}

// Mean of the known neighbours of cell (x, y); their number is returned.
static int neighbour_mean(const RfFlowField *field, const uint8_t *known, int x, int y, float mean[2])
{
    int count = 0;
    float sum[2] = {0, 0};
    for (int j = rf_max_int(y - 1, 0); j <= rf_min_int(y + 1, field->height - 1); ++j)
        for (int i = rf_max_int(x - 1, 0); i <= rf_min_int(x + 1, field->width - 1); ++i)
        {
            size_t k = (size_t)j * (size_t)field->width + (size_t)i;
            if (known[k] != 1)
                continue;
            sum[0] += field->velocity[2 * k];
            sum[1] += field->velocity[2 * k + 1];
            ++count;
        }
    mean[0] = count ? sum[0] / (float)count : 0;
    mean[1] = count ? sum[1] / (float)count : 0;
    return count;
}

int rf_flow_field_fill_invalid(RfFlowField *field, const uint8_t *valid)
{
    size_t cells = (size_t)field->width * (size_t)field->height;
    uint8_t *known = rf_allocate(cells, 1);
    int filled = 0;
    for (size_t k = 0; k < cells; ++k)
        if (!valid[k])
        {
            field->velocity[2 * k] = field->velocity[2 * k + 1] = 0;
            ++filled;
        }
    if (!known)
        return filled; // Out of memory: zeros stand for the invalid vectors.
    for (size_t k = 0; k < cells; ++k)
        known[k] = valid[k] != 0;

    // 0 unknown, 1 known, 2 found in this ring: a ring sees only the rings before it.
    for (bool changed = filled > 0; changed;)
    {
        changed = false;
        for (int y = 0; y < field->height; ++y)
            for (int x = 0; x < field->width; ++x)
            {
                size_t k = (size_t)y * (size_t)field->width + (size_t)x;
                float mean[2];
                if (known[k] || neighbour_mean(field, known, x, y, mean) == 0)
                    continue;
                field->velocity[2 * k] = mean[0];
                field->velocity[2 * k + 1] = mean[1];
                known[k] = 2;
                changed = true;
            }
        for (size_t k = 0; k < cells; ++k)
            known[k] = known[k] != 0;
    }
    rf_release(known);
    return filled;
}

RfFlowView rf_flow_field_view(const RfFlowField *field, double time)
{
    return (RfFlowView){.width = field->width,
                        .height = field->height,
                        .velocity = field->velocity,
                        .velocity_time = time,
                        .next_time = time,
                        .mask = field->mask,
                        .time = time};
}

static RfResult check_velocity(const RfFlowView *view, const float *velocity)
{
    size_t count = 2 * (size_t)view->width * (size_t)view->height;
    // 0 times a finite number is 0, times anything else NaN: one sum proves all finite, without a branch a number.
    float sum = 0;
    for (size_t k = 0; k < count; ++k)
        sum += velocity[k] * 0.0f;
    if (sum == 0)
        return RF_OK;
    for (size_t k = 0; k < count; ++k)
        if (!isfinite(velocity[k]))
        {
            char place[64];
            snprintf(place, sizeof place, "cell %zu, %zu", k / 2 % (size_t)view->width, k / 2 / (size_t)view->width);
            return rf_fail(RF_BAD_INPUT, NULL, place, "velocity is %g: only finite numbers can be followed",
                           (double)velocity[k]);
        }
    return RF_OK;
}

RfResult rf_flow_view_check(const RfFlowView *view)
{
    RF_REQUIRE(view && view->velocity, "flow: no velocity");
    RF_REQUIRE(view->width >= 1 && view->width <= RF_MAX_SIZE && view->height >= 1 && view->height <= RF_MAX_SIZE,
               "flow: %d x %d cells: each side must be 1 to %d", view->width, view->height, RF_MAX_SIZE);
    RF_REQUIRE(isfinite(view->time) && isfinite(view->velocity_time) && isfinite(view->next_time),
               "flow: a time is not finite");
    RF_TRY(check_velocity(view, view->velocity));
    return view->next_velocity ? check_velocity(view, view->next_velocity) : RF_OK;
}
