// SPDX-License-Identifier: Apache-2.0
// Texture coordinates carried by the flow for ever.
//
// Max, Becker. Flow visualization using moving textures. 1995.
// Stam. Stable fluids. 1999 (tracing back).
// Sampling: Heckbert. Fundamentals of texture mapping and image warping. 1989.
//
// What is carried is not the coordinate but its offset from the pixel,
//
//     coordinate(x) = origin + x + offset(x),    offset'(x) = (p - x) + offset(p),
//
// p the point where x was at the last step. The offset starts at 0 and is extended beyond the domain by its border's
// value, so that what flows in continues the exemplar instead of repeating a border pixel. p is found by the midpoint
// rule through the unsteady velocity, the offset is interpolated once a step by cubic splines: bilinear interpolation
// would smooth the coordinates by a pixel in some tens of frames, and the texture would straighten where it should wind
// up. On land the offset of the nearest fluid pixel stands, so that the spline sees no jump at the shore.
//
// Nothing is ever reset: the frame follows the flow exactly and is stretched without end. Where the map compresses, up
// to 16 samples are averaged along the axis that is compressed most.
#include "riffle/warp.h"

#include "core/hash.h"
#include "core/memory.h"
#include "core/options.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "core/simd.h"
#include "data/exemplar.h"
#include "data/flow_field.h"
#include "kernels/cubic_spline.h"
#include "kernels/texture.h"

#include <string.h>

enum
{
    STATE_VERSION = 1,
    BAND = 8,
    MAX_TAPS = 16,
    MAX_QUADS = (RF_MAX_EXEMPLAR_CHANNELS + 3) / 4
};

// Longest stretch of a path, in flow cells, that one midpoint step traces.
static const float PATH_STEP = 4.0f;
// Offsets in pixels stay under it, so that absurd speeds cannot make them infinite.
static const float FARTHEST = 1e6f;

struct RfWarp
{
    const RfExemplar *exemplar;
    RfWarpOptions options;
    RfTexture texture;
    /// Exemplar coordinate of the frame's corner before anything moves.
    RfVec2 origin;
    bool turns;

    int width, height;
    bool placed;
    double time;
    /// [height][width][2]
    float *offset, *next;
    /// Index of the nearest fluid pixel, where there is a mask.
    int32_t *nearest;
};

typedef struct StateHeader
{
    char magic[8];
    uint32_t version, simd;
    /// Of exemplar and options; and of the whole block with this field 0.
    uint64_t inputs, content;
    int32_t width, height;
    double time;
} StateHeader;

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfWarpOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where the exemplar starts in the frame is drawn from it."},
};

const RfOption *rf_warp_option_table(int *count)
{
    if (count)
        *count = (int)(sizeof g_options / sizeof *g_options);
    return g_options;
}

RfWarpOptions rf_warp_defaults(void)
{
    return (RfWarpOptions){.struct_size = sizeof(RfWarpOptions), .seed = 1};
}

// ---- carrying ----------------------------------------------------------------------------------------------------

typedef struct Carry
{
    RfWarp *warp;
    const RfFlowView *flow;
    /// Flow cells a pixel.
    float scale_x, scale_y;
    double from;
    int path_steps;
} Carry;

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

static int path_steps(const RfFlowView *flow, double dt)
{
    size_t cells = (size_t)flow->width * (size_t)flow->height;
    float speed = max_speed(flow->velocity, cells);
    if (flow->next_velocity)
        speed = fmaxf(speed, max_speed(flow->next_velocity, cells));
    // At least a step a frame, since the velocity may change from frame to frame.
    double steps = ceil(fmax(dt * (double)speed / (double)PATH_STEP, dt));
    return steps > 256 ? 256 : steps > 1 ? (int)steps : 1;
}

// Where the point was at the last step, in flow cells.
static RfVec2 trace_back(const Carry *carry, RfVec2 p)
{
    double dt = (carry->flow->time - carry->from) / carry->path_steps, time = carry->flow->time;
    for (int i = 0; i < carry->path_steps; ++i, time -= dt)
    {
        RfVec2 v = rf_flow_sample(carry->flow, p.x, p.y, rf_flow_blend(carry->flow, time));
        float half = 0.5f * (float)dt;
        v = rf_flow_sample(carry->flow, p.x - half * v.x, p.y - half * v.y,
                           rf_flow_blend(carry->flow, time - 0.5 * dt));
        p = (RfVec2){p.x - (float)dt * v.x, p.y - (float)dt * v.y};
    }
    return p;
}

static void carry_band(void *context, int item, int worker)
{
    (void)worker;
    const Carry *carry = context;
    const RfWarp *warp = carry->warp;
    int end = rf_min_int((item + 1) * BAND, warp->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < warp->width; ++x)
        {
            RfVec2 here = {((float)x + 0.5f) * carry->scale_x, ((float)y + 0.5f) * carry->scale_y};
            RfVec2 there = trace_back(carry, here);
            float dx = (there.x - here.x) / carry->scale_x, dy = (there.y - here.y) / carry->scale_y, old[2];
            rf_spline_sample(warp->offset, warp->width, warp->height, 2, 2, (float)x + dx, (float)y + dy, old);
            float *out = warp->next + 2 * ((size_t)y * (size_t)warp->width + (size_t)x);
            out[0] = rf_clamp(dx + old[0], -FARTHEST, FARTHEST);
            out[1] = rf_clamp(dy + old[1], -FARTHEST, FARTHEST);
        }
}

static bool pixel_inside(const RfFlowView *flow, int width, int height, int x, int y)
{
    return rf_flow_inside(flow, ((float)x + 0.5f) * (float)flow->width / (float)width,
                          ((float)y + 0.5f) * (float)flow->height / (float)height);
}

// Takes neighbour (x + dx, y + dy)'s nearest fluid pixel if that is nearer to (x, y).
static void pass_on(const RfWarp *warp, int x, int y, int dx, int dy)
{
    if (x + dx < 0 || x + dx >= warp->width || y + dy < 0 || y + dy >= warp->height)
        return;
    int32_t *own = warp->nearest + (size_t)y * (size_t)warp->width + (size_t)x;
    int32_t other = own[(ptrdiff_t)dy * warp->width + dx];
    if (other < 0)
        return;
    int64_t ox = other % warp->width - x, oy = other / warp->width - y;
    int64_t nx = *own % warp->width - x, ny = *own / warp->width - y;
    if (*own < 0 || ox * ox + oy * oy < nx * nx + ny * ny)
        *own = other;
}

// Land takes the offset of its nearest fluid pixel (Danielsson. Euclidean distance mapping. 1980).
static void extend_over_land(const RfWarp *warp, const RfFlowView *flow)
{
    int w = warp->width, h = warp->height;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            warp->nearest[k] = pixel_inside(flow, w, h, x, y) ? (int32_t)k : -1;
        }
    for (int y = 0; y < h; ++y)
    {
        for (int x = 0; x < w; ++x)
            for (int dx = -1; dx <= 1; ++dx)
                pass_on(warp, x, y, dx, dx < 0 ? 0 : -1);
        for (int x = w - 1; x >= 0; --x)
            pass_on(warp, x, y, 1, 0);
    }
    for (int y = h - 1; y >= 0; --y)
    {
        for (int x = w - 1; x >= 0; --x)
            for (int dx = -1; dx <= 1; ++dx)
                pass_on(warp, x, y, dx, dx > 0 ? 0 : 1);
        for (int x = 0; x < w; ++x)
            pass_on(warp, x, y, -1, 0);
    }
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
        if (warp->nearest[k] >= 0 && warp->nearest[k] != (int32_t)k)
            memcpy(warp->offset + 2 * k, warp->offset + 2 * (size_t)warp->nearest[k], 2 * sizeof(float));
}

static void carry_offsets(RfWarp *warp, const RfFlowView *flow)
{
    Carry carry = {.warp = warp,
                   .flow = flow,
                   .scale_x = (float)flow->width / (float)warp->width,
                   .scale_y = (float)flow->height / (float)warp->height,
                   .from = warp->time,
                   .path_steps = path_steps(flow, flow->time - warp->time)};
    rf_spline_prefilter(warp->offset, warp->width, warp->height, 2);
    rf_parallel_for((warp->height + BAND - 1) / BAND, carry_band, &carry);
    float *swap = warp->offset;
    warp->offset = warp->next;
    warp->next = swap;
    if (flow->mask)
        extend_over_land(warp, flow);
}

// ---- drawing -----------------------------------------------------------------------------------------------------

// How the exemplar's coordinates change from pixel to pixel, without the mirroring.
typedef struct Jacobian
{
    float xx, xy, yx, yy;
} Jacobian;

static Jacobian offset_jacobian(const RfWarp *warp, int x, int y)
{
    int left = rf_max_int(x - 1, 0), right = rf_min_int(x + 1, warp->width - 1);
    int up = rf_max_int(y - 1, 0), down = rf_min_int(y + 1, warp->height - 1);
    size_t w = (size_t)warp->width;
    const float *l = warp->offset + 2 * ((size_t)y * w + (size_t)left);
    const float *r = warp->offset + 2 * ((size_t)y * w + (size_t)right);
    const float *u = warp->offset + 2 * ((size_t)up * w + (size_t)x);
    const float *d = warp->offset + 2 * ((size_t)down * w + (size_t)x);
    float ix = 1.0f / (float)rf_max_int(right - left, 1), iy = 1.0f / (float)rf_max_int(down - up, 1);
    return (Jacobian){1 + (r[0] - l[0]) * ix, (d[0] - u[0]) * iy, (r[1] - l[1]) * ix, 1 + (d[1] - u[1]) * iy};
}

// The footprint of a pixel in the exemplar: `taps` samples along `axis`, from a level that holds the rest.
typedef struct Footprint
{
    int taps, level;
    RfVec2 axis;
} Footprint;

static Footprint footprint(const RfWarp *warp, Jacobian j)
{
    // Singular values from J J^T = [a b; b c]; the larger one's direction is the footprint's long axis.
    float a = j.xx * j.xx + j.xy * j.xy, b = j.xx * j.yx + j.xy * j.yy, c = j.yx * j.yx + j.yy * j.yy;
    float mean = 0.5f * (a + c), spread = sqrtf(0.25f * (a - c) * (a - c) + b * b);
    float longest = sqrtf(mean + spread), shortest = sqrtf(fmaxf(mean - spread, 0));
    Footprint print = {0};
    // One sample reaches 1.2 pixels before anything is seen to alias.
    float across = fmaxf(fmaxf(shortest, longest / MAX_TAPS), 1);
    print.taps = (int)ceilf(rf_clamp(longest / across - 0.2f, 1, MAX_TAPS));
    if (across > 1)
        print.level = (int)rf_clamp(log2f(across) + 0.5f, 0, (float)(warp->texture.level_count - 1));
    if (print.taps > 1)
    {
        float angle = 0.5f * atan2f(2 * b, a - c);
        print.axis = (RfVec2){longest * cosf(angle), longest * sinf(angle)};
    }
    return print;
}

// A coordinate along one axis brought into 0..size: wrapped, or mirrored with the sign of its slope in *sign.
static float fold(float u, int size, bool tiles, float *sign)
{
    float period = (float)(tiles ? size : 2 * size);
    u -= period * floorf(u / period);
    *sign = 1;
    if (!tiles && u > (float)size)
    {
        u = period - u;
        *sign = -1;
    }
    return u;
}

// Texel and fraction of a folded coordinate.
static int texel(float u, float scale, int size, bool tiles, float *fraction)
{
    float t = (u - 0.5f) * scale;
    if (tiles && t < 0)
        t += (float)size;
    t = rf_clamp(t, 0, tiles ? (float)size - 1e-3f : (float)(size - 1));
    int i = rf_min_int((int)t, size - 1);
    *fraction = t - (float)i;
    return i;
}

static void add_tap(const RfTexture *texture, const RfTextureLevel *level, float u, float v, float weight, float *sum)
{
    float s, t;
    int x = texel(u, level->scale_x, level->width, texture->tiles, &s);
    int y = texel(v, level->scale_y, level->height, texture->tiles, &t);
    float w00 = weight * (1 - s) * (1 - t), w10 = weight * s * (1 - t), w01 = weight * (1 - s) * t,
          w11 = weight * s * t;
    for (int q = 0; q < texture->quads; ++q)
    {
        const float *row0 =
            level->texels + (size_t)q * rf_texture_plane(level) + 4 * ((size_t)y * (size_t)level->stride + (size_t)x);
        const float *row1 = row0 + 4 * (size_t)level->stride;
        for (int c = 0; c < 4; ++c)
            sum[4 * q + c] += w00 * row0[c] + w10 * row0[c + 4] + w01 * row1[c] + w11 * row1[c + 4];
    }
}

// Turns direction-valued channels from the exemplar's axes into the frame's, by the rotation part of J's inverse; a
// mirrored exemplar's own axis is flipped first. Normals have y up.
static void turn_directions(const RfExemplar *exemplar, Jacobian j, float mirror_x, float mirror_y, float *values)
{
    float length = sqrtf((j.xx + j.yy) * (j.xx + j.yy) + (j.yx - j.xy) * (j.yx - j.xy));
    float c = length > 0 ? (j.xx + j.yy) / length : 1, s = length > 0 ? (j.xy - j.yx) / length : 0;
    for (int m = 0; m < exemplar->map_count; ++m)
    {
        float *p = values + exemplar->first_channel[m];
        if (exemplar->maps[m].kind == RF_MAP_VECTOR)
        {
            float x = mirror_x * p[0], y = mirror_y * p[1];
            p[0] = c * x - s * y;
            p[1] = s * x + c * y;
        }
        else if (exemplar->maps[m].kind == RF_MAP_NORMAL)
        {
            float x = mirror_x * (2 * p[0] - 1), y = -mirror_y * (2 * p[1] - 1), z = 2 * p[2] - 1;
            float norm = sqrtf(x * x + y * y + z * z), scale = norm > 0 ? 0.5f / norm : 0;
            p[0] = 0.5f + scale * (c * x - s * y);
            p[1] = 0.5f - scale * (s * x + c * y);
            p[2] = 0.5f + scale * z;
        }
    }
}

static void draw_pixel(const RfWarp *warp, int x, int y, float *out)
{
    const RfTexture *texture = &warp->texture;
    const float *offset = warp->offset + 2 * ((size_t)y * (size_t)warp->width + (size_t)x);
    RfVec2 centre = {warp->origin.x + (float)x + 0.5f + offset[0], warp->origin.y + (float)y + 0.5f + offset[1]};
    Jacobian j = offset_jacobian(warp, x, y);
    Footprint print = footprint(warp, j);
    float sum[4 * MAX_QUADS] = {0}, mirror_x, mirror_y;
    for (int i = 0; i < print.taps; ++i)
    {
        float along = ((float)i + 0.5f) / (float)print.taps - 0.5f;
        float u = fold(centre.x + along * print.axis.x, texture->width, texture->tiles, &mirror_x);
        float v = fold(centre.y + along * print.axis.y, texture->height, texture->tiles, &mirror_y);
        add_tap(texture, &texture->levels[print.level], u, v, 1.0f / (float)print.taps, sum);
    }
    if (warp->turns)
    {
        fold(centre.x, texture->width, texture->tiles, &mirror_x);
        fold(centre.y, texture->height, texture->tiles, &mirror_y);
        turn_directions(warp->exemplar, j, mirror_x, mirror_y, sum);
    }
    memcpy(out, sum, (size_t)warp->exemplar->channels * sizeof(float));
}

typedef struct Draw
{
    const RfWarp *warp;
    const RfFlowView *flow;
    const RfImageView *frame;
} Draw;

static void draw_band(void *context, int item, int worker)
{
    (void)worker;
    const Draw *draw = context;
    const RfImageView *frame = draw->frame;
    int end = rf_min_int((item + 1) * BAND, frame->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < frame->width; ++x)
        {
            float *out = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            if (!draw->flow->mask || pixel_inside(draw->flow, frame->width, frame->height, x, y))
                draw_pixel(draw->warp, x, y, out);
            else
                memset(out, 0, (size_t)frame->channels * sizeof(float));
        }
}

// ---- the four verbs ----------------------------------------------------------------------------------------------

static RfResult make_texture(RfWarp *warp)
{
    const RfExemplar *exemplar = warp->exemplar;
    int quads = (exemplar->channels + 3) / 4;
    size_t count = (size_t)exemplar->width * (size_t)exemplar->height, channels = (size_t)exemplar->channels;
    float *padded = rf_allocate_zero(count, (size_t)(4 * quads) * sizeof(float));
    if (!padded)
        return RF_OUT_OF_MEMORY;
    for (size_t k = 0; k < count; ++k)
        memcpy(padded + k * (size_t)(4 * quads), exemplar->pixels + k * channels, channels * sizeof(float));
    RfResult result =
        rf_texture_create(padded, exemplar->width, exemplar->height, quads, exemplar->tiles, &warp->texture);
    rf_release(padded);
    return result;
}

RfResult rf_warp_create(const RfExemplar *exemplar, const RfWarpOptions *options, RfWarp **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_warp_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_warp_defaults", g_options,
                            (int)(sizeof g_options / sizeof *g_options)));
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RfWarp *warp = rf_allocate_zero(1, sizeof *warp);
    if (!warp)
        return RF_OUT_OF_MEMORY;
    warp->exemplar = exemplar;
    warp->options = *options;
    warp->origin = (RfVec2){(float)exemplar->width * rf_random_float(options->seed, 0, 0, 0),
                            (float)exemplar->height * rf_random_float(options->seed, 0, 0, 1)};
    for (int m = 0; m < exemplar->map_count; ++m)
        warp->turns |= exemplar->maps[m].kind == RF_MAP_NORMAL || exemplar->maps[m].kind == RF_MAP_VECTOR;
    RfResult result = make_texture(warp);
    if (result != RF_OK)
    {
        rf_warp_destroy(warp);
        return result;
    }
    *out = warp;
    return RF_OK;
}

void rf_warp_destroy(RfWarp *warp)
{
    if (!warp)
        return;
    rf_texture_free(&warp->texture);
    rf_release(warp->offset);
    rf_release(warp->next);
    rf_release(warp->nearest);
    rf_release(warp);
}

static RfResult make_offsets(RfWarp *warp, int width, int height)
{
    size_t pixels = (size_t)width * (size_t)height;
    float *offset = rf_allocate_zero(pixels, 2 * sizeof(float)), *next = rf_allocate(pixels, 2 * sizeof(float));
    if (!offset || !next)
    {
        rf_release(offset);
        rf_release(next);
        return RF_OUT_OF_MEMORY;
    }
    warp->offset = offset;
    warp->next = next;
    warp->width = width;
    warp->height = height;
    return RF_OK;
}

RfResult rf_warp_advance(RfWarp *warp, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(warp, "rf_warp_advance: warp is NULL");
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be 1 to %d", width, height, RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(flow));
    RF_REQUIRE(!warp->placed || (width == warp->width && height == warp->height),
               "frame: %d x %d after frames of %d x %d: the size must stay", width, height, warp->width, warp->height);
    RF_REQUIRE(!warp->placed || flow->time >= warp->time, "flow: time %g after %g: times must not decrease", flow->time,
               warp->time);
    // At the door: a step, once begun, is ended.
    RF_TRY(rf_progress("warping", 0));
    if (flow->mask && !warp->nearest)
    {
        warp->nearest = rf_allocate((size_t)width * (size_t)height, sizeof(int32_t));
        if (!warp->nearest)
            return RF_OUT_OF_MEMORY;
    }
    if (!warp->placed)
        RF_TRY(make_offsets(warp, width, height));
    else if (flow->time > warp->time)
        carry_offsets(warp, flow);
    warp->placed = true;
    warp->time = flow->time;
    return RF_OK;
}

RfResult rf_warp_step(RfWarp *warp, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(warp && frame && frame->pixels, "rf_warp_step: warp or frame is NULL");
    RF_REQUIRE(frame->channels == warp->exemplar->channels, "frame: %d channels: the exemplar has %d", frame->channels,
               warp->exemplar->channels);
    RF_REQUIRE(frame->row_stride >= (ptrdiff_t)frame->width * frame->channels,
               "frame: row_stride is less than width * channels");
    RF_TRY(rf_warp_advance(warp, flow, frame->width, frame->height));
    Draw draw = {warp, flow, frame};
    rf_parallel_for((frame->height + BAND - 1) / BAND, draw_band, &draw);
    return RF_OK;
}

// ---- saved state -------------------------------------------------------------------------------------------------

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfWarpOptions *options)
{
    return rf_hash64(exemplar->hash ^ rf_hash64(options->seed));
}

// Of header and offsets, the header's own hash taken as 0.
static uint64_t content_hash(StateHeader header, const void *offsets, size_t size)
{
    header.content = 0;
    return rf_hash_bytes(offsets, size, rf_hash_bytes(&header, sizeof header, 0));
}

RfResult rf_warp_save(const RfWarp *warp, void **block, size_t *size)
{
    RF_REQUIRE(warp && block && size, "rf_warp_save: warp, block or size is NULL");
    *block = NULL;
    StateHeader header = {.magic = "rf-warp",
                          .version = STATE_VERSION,
                          .simd = (uint32_t)rf_simd_level(),
                          .inputs = inputs_hash(warp->exemplar, &warp->options),
                          .width = warp->width,
                          .height = warp->height,
                          .time = warp->time};
    size_t offsets = 2 * sizeof(float) * (size_t)warp->width * (size_t)warp->height;
    uint8_t *bytes = rf_allocate(sizeof header + offsets, 1);
    if (!bytes)
        return RF_OUT_OF_MEMORY;
    if (offsets)
        memcpy(bytes + sizeof header, warp->offset, offsets);
    header.content = content_hash(header, bytes + sizeof header, offsets);
    memcpy(bytes, &header, sizeof header);
    *block = bytes;
    *size = sizeof header + offsets;
    return RF_OK;
}

static RfResult check_state(const StateHeader *header, const RfExemplar *exemplar, const RfWarpOptions *options,
                            const void *block, size_t size)
{
    if (memcmp(header->magic, "rf-warp", 8) != 0)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "not a saved state of warp");
    if (header->version != STATE_VERSION)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved by version %u of the format, this is %d: start again",
                       header->version, STATE_VERSION);
    if (header->simd != (uint32_t)rf_simd_level())
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved under another instruction set: set RF_SIMD as it was");
    if (header->inputs != inputs_hash(exemplar, options))
        return rf_fail(RF_BAD_INPUT, NULL, "header", "saved with another exemplar or other options: start again");
    bool empty = header->width == 0 && header->height == 0;
    bool sized = header->width >= 1 && header->width <= RF_MAX_SIZE && header->height >= 1 &&
                 header->height <= RF_MAX_SIZE && isfinite(header->time);
    uint64_t offsets = 2 * sizeof(float) * (uint64_t)(uint32_t)header->width * (uint64_t)(uint32_t)header->height;
    if ((!empty && !sized) || size - sizeof *header != offsets ||
        header->content != content_hash(*header, (const uint8_t *)block + sizeof *header, size - sizeof *header))
        return rf_fail(RF_BAD_INPUT, NULL, "saved state", "damaged: start again");
    return RF_OK;
}

RfResult rf_warp_load(const RfExemplar *exemplar, const RfWarpOptions *options, const void *block, size_t size,
                      RfWarp **out)
{
    RF_REQUIRE(exemplar && options && block && out, "rf_warp_load: an argument is NULL");
    *out = NULL;
    StateHeader header;
    if (size < sizeof header)
        return rf_fail(RF_BAD_INPUT, NULL, "header", "a saved state is at least %zu bytes, this is %zu", sizeof header,
                       size);
    memcpy(&header, block, sizeof header);
    RF_TRY(check_state(&header, exemplar, options, block, size));
    RfWarp *warp = NULL;
    RF_TRY(rf_warp_create(exemplar, options, &warp));
    RfResult result = header.width ? make_offsets(warp, header.width, header.height) : RF_OK;
    if (result != RF_OK)
    {
        rf_warp_destroy(warp);
        return result;
    }
    if (header.width)
        memcpy(warp->offset, (const uint8_t *)block + sizeof header, size - sizeof header);
    warp->placed = header.width > 0;
    warp->time = header.time;
    *out = warp;
    return RF_OK;
}
