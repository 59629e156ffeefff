// SPDX-License-Identifier: Apache-2.0
// Max, Becker. Flow visualization using moving textures. 1995.
// Stam. Stable fluids. 1999 (tracing back).
//
// What is carried is not the coordinate but its offset from the pixel,
//
//     coordinate(x) = origin + x + offset(x),    offset'(x) = (p - x) + offset(p),
//
// p the point where x was at the last step. The offset starts at 0 and is extended beyond the domain by its border's
// value, so that what flows in continues the exemplar instead of repeating a border pixel. p is found by the midpoint
// rule through the unsteady velocity, once for all sets; the offset is interpolated once a step by cubic splines:
// bilinear interpolation would smooth the coordinates by a pixel in some tens of frames, and the texture would
// straighten where it should wind up. On land the offset of the nearest fluid pixel stands, so that the spline sees no
// jump at the shore.
#include "kernels/coordinates.h"

#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "core/saved_state.h"
#include "kernels/cubic_spline.h"
#include "kernels/nearest_known.h"
#include "kernels/tracing.h"

#include <string.h>

enum
{
    BAND = 8
};

// Offsets in pixels stay under it, so that absurd speeds cannot make them infinite.
static const float FARTHEST = 1e6f;

typedef struct Carry
{
    RfCoordinates *coordinates;
    const RfFlowView *flow;
    /// Flow cells a pixel.
    float scale_x, scale_y;
    double from;
    int path_steps;
} Carry;

static void carry_band(void *context, int item, int worker)
{
    (void)worker;
    const Carry *carry = context;
    const RfCoordinates *c = carry->coordinates;
    int end = rf_min_int((item + 1) * BAND, c->height), numbers = 2 * c->sets;
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < c->width; ++x)
        {
            RfVec2 here = {((float)x + 0.5f) * carry->scale_x, ((float)y + 0.5f) * carry->scale_y};
            RfVec2 there = rf_trace(carry->flow, here, carry->flow->time, carry->from, carry->path_steps);
            float moved[2] = {(there.x - here.x) / carry->scale_x, (there.y - here.y) / carry->scale_y};
            float old[2 * RF_MAX_COORDINATE_SETS];
            rf_spline_sample(c->offset, c->width, c->height, numbers, numbers, (float)x + moved[0], (float)y + moved[1],
                             old);
            float *out = c->next + (size_t)numbers * ((size_t)y * (size_t)c->width + (size_t)x);
            for (int k = 0; k < numbers; ++k)
                out[k] = rf_clamp(moved[k % 2] + old[k], -FARTHEST, FARTHEST);
        }
}

// Land takes the offsets of its nearest fluid pixel.
static void extend_over_land(const RfCoordinates *c, const RfFlowView *flow)
{
    int w = c->width, h = c->height;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            c->nearest[k] = rf_pixel_inside(flow, w, h, x, y) ? (int32_t)k : -1;
        }
    rf_spread_nearest(c->nearest, w, h);
    size_t numbers = 2 * (size_t)c->sets;
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
        if (c->nearest[k] >= 0 && c->nearest[k] != (int32_t)k)
            memcpy(c->offset + numbers * k, c->offset + numbers * (size_t)c->nearest[k], numbers * sizeof(float));
}

static void carry_offsets(RfCoordinates *c, const RfFlowView *flow)
{
    Carry carry = {.coordinates = c,
                   .flow = flow,
                   .scale_x = (float)flow->width / (float)c->width,
                   .scale_y = (float)flow->height / (float)c->height,
                   .from = c->time,
                   .path_steps = rf_path_steps(flow, flow->time - c->time)};
    rf_spline_prefilter(c->offset, c->width, c->height, 2 * c->sets);
    rf_parallel_for((c->height + BAND - 1) / BAND, carry_band, &carry);
    float *swap = c->offset;
    c->offset = c->next;
    c->next = swap;
    if (flow->mask)
        extend_over_land(c, flow);
}

static RfResult place(RfCoordinates *c, int width, int height)
{
    size_t pixels = (size_t)width * (size_t)height, pixel = 2 * (size_t)c->sets * sizeof(float);
    float *offset = rf_allocate_zero(pixels, pixel), *next = rf_allocate(pixels, pixel);
    if (!offset || !next)
    {
        rf_release(offset);
        rf_release(next);
        // The next try may be of another size.
        rf_release(c->nearest);
        c->nearest = NULL;
        return RF_OUT_OF_MEMORY;
    }
    c->offset = offset;
    c->next = next;
    c->width = width;
    c->height = height;
    return RF_OK;
}

RfResult rf_coordinates_move(RfCoordinates *c, const char *stage, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(flow));
    RF_REQUIRE(!c->placed || (width == c->width && height == c->height),
               "frame: %d x %d after frames of %d x %d: the size must stay", width, height, c->width, c->height);
    RF_REQUIRE(!c->placed || flow->time >= c->time, "flow: time %g after %g: times must not decrease", flow->time,
               c->time);
    // At the door: a step, once begun, is ended.
    RF_TRY(rf_progress(stage, 0));
    if (flow->mask && !c->nearest)
    {
        c->nearest = rf_allocate((size_t)width * (size_t)height, sizeof(int32_t));
        if (!c->nearest)
            return RF_OUT_OF_MEMORY;
    }
    if (!c->placed)
    {
        RF_TRY(place(c, width, height));
        c->start = flow->time;
    }
    else if (flow->time > c->time)
        carry_offsets(c, flow);
    c->placed = true;
    c->time = flow->time;
    return RF_OK;
}

void rf_coordinates_reset(RfCoordinates *c, int set)
{
    size_t pixels = (size_t)c->width * (size_t)c->height, numbers = 2 * (size_t)c->sets;
    for (size_t k = 0; k < pixels; ++k)
        c->offset[k * numbers + 2 * (size_t)set] = c->offset[k * numbers + 2 * (size_t)set + 1] = 0;
}

void rf_coordinates_free(RfCoordinates *c)
{
    rf_release(c->offset);
    rf_release(c->next);
    rf_release(c->nearest);
    *c = (RfCoordinates){0};
}

RfJacobian rf_coordinates_jacobian(const RfCoordinates *c, int set, int x, int y)
{
    int left = rf_max_int(x - 1, 0), right = rf_min_int(x + 1, c->width - 1);
    int up = rf_max_int(y - 1, 0), down = rf_min_int(y + 1, c->height - 1);
    RfVec2 l = rf_coordinates_offset(c, set, left, y), r = rf_coordinates_offset(c, set, right, y),
           u = rf_coordinates_offset(c, set, x, up), d = rf_coordinates_offset(c, set, x, down);
    float ix = 1.0f / (float)rf_max_int(right - left, 1), iy = 1.0f / (float)rf_max_int(down - up, 1);
    return (RfJacobian){1 + (r.x - l.x) * ix, (d.x - u.x) * iy, (r.y - l.y) * ix, 1 + (d.y - u.y) * iy};
}

// ---- saved state -------------------------------------------------------------------------------------------------

enum
{
    STATE_VERSION = 3
};

typedef struct StateHeader
{
    RfStateHead head;
    int32_t width, height, sets, padding;
    double start, time;
} StateHeader;

RfResult rf_coordinates_save(const RfCoordinates *c, const char *method, uint64_t inputs, void **block, size_t *size)
{
    *block = NULL;
    StateHeader header = {.width = c->width, .height = c->height, .sets = c->sets, .start = c->start, .time = c->time};
    size_t offsets = 2 * sizeof(float) * (size_t)c->sets * (size_t)c->width * (size_t)c->height;
    uint8_t *bytes = rf_allocate(sizeof header + offsets, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    if (offsets)
        memcpy(bytes + sizeof header, c->offset, offsets);
    memcpy(bytes, &header, sizeof header);
    rf_state_seal(bytes, sizeof header + offsets, method, STATE_VERSION, inputs);
    *block = bytes;
    *size = sizeof header + offsets;
    return RF_OK;
}

static bool has_its_size(const StateHeader *header, int sets, size_t size)
{
    bool empty = header->width == 0 && header->height == 0;
    bool sized = header->width >= 1 && header->width <= RF_MAX_SIZE && header->height >= 1 &&
                 header->height <= RF_MAX_SIZE && isfinite(header->start) && isfinite(header->time) &&
                 header->start <= header->time;
    uint64_t offsets = 2 * sizeof(float) * (uint64_t)(uint32_t)sets * (uint64_t)(uint32_t)header->width *
                       (uint64_t)(uint32_t)header->height;
    return header->sets == sets && (empty || sized) && size - sizeof *header == offsets;
}

RfResult rf_coordinates_load(RfCoordinates *out, const char *method, uint64_t inputs, const void *block, size_t size)
{
    StateHeader header;
    RF_TRY(rf_state_check(block, size, sizeof header, method, STATE_VERSION, inputs));
    memcpy(&header, block, sizeof header);
    if (!has_its_size(&header, out->sets, size))
        return rf_state_damaged();
    if (header.width)
    {
        RF_TRY(place(out, header.width, header.height));
        memcpy(out->offset, (const uint8_t *)block + sizeof header, size - sizeof header);
    }
    out->placed = header.width > 0;
    out->start = header.start;
    out->time = header.time;
    return RF_OK;
}
