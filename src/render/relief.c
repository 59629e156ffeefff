// SPDX-License-Identifier: Apache-2.0
// A height field as a lit slab in perspective.
//
// All light is independent of the view, so it is computed once a texel and the rays only look it up:
//
//     colour = albedo (sun * shadow * max(n . l, 0)  +  sky * openness * (0.6 + 0.4 n.y)  +  bounce)
//
// shadow is soft, from the narrowest gap between the way to the sun and the surface (Quilez. Free penumbra shadows for
// raymarching distance functions. 2010); openness is the mean over eight directions of 1 - sin(horizon) (Bavoil, Sainz,
// Dimitrov. Image-space horizon-based ambient occlusion. 2008). Rays march through the field in steps of half a texel
// or half a pixel, whichever is longer, and end by bisection; four of them a pixel, on a rotated grid.
//
//            y up                 row 0 of the field is far, its last row is near; x runs right.
//            |   ______           The field is 1 wide and height / width deep, the slab reaches a little under height
//            0. |  /     / | /_____/---- x      The camera stands in front and above, as near as lets the whole slab be
//            seen.
#include "render/flow_picture.h"

#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "data/colour.h"

#include <stdlib.h>

enum
{
    BAND = 4,
    HORIZONS = 8,
    HORIZON_STEPS = 9,
    SHADOW_STEPS = 40,
    BISECTIONS = 8,
    BLOCK = 8
};

typedef struct Vec3
{
    float x, y, z;
} Vec3;

typedef struct Slab
{
    int width, height;
    /// [height][width]: heights in field widths, albedo and light in linear colour.
    float *heights;
    RfColour *albedo, *lit;
    /// [blocks_y][blocks_x]: no point within BLOCK texels of a block's own is higher.
    float *ceiling;
    int blocks_x, blocks_y;
    float depth, top, bottom;
    const RfImageView *height_image, *colour_image, *frame;
} Slab;

typedef struct Camera
{
    Vec3 eye, right, up, forward;
    /// Tangents of half the field of view, and where the slab's middle lies in the picture.
    float tan_x, tan_y, shift_x, shift_y;
} Camera;

static Vec3 vec3(float x, float y, float z)
{
    return (Vec3){x, y, z};
}

static float dot(Vec3 a, Vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static Vec3 along(Vec3 origin, Vec3 direction, float t)
{
    return (Vec3){origin.x + t * direction.x, origin.y + t * direction.y, origin.z + t * direction.z};
}

static Vec3 normalised(Vec3 a)
{
    float length = sqrtf(dot(a, a));
    return (Vec3){a.x / length, a.y / length, a.z / length};
}

static Vec3 cross(Vec3 a, Vec3 b)
{
    return (Vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static Vec3 to_sun(void)
{
    return normalised(vec3(-0.66f, 0.62f, -0.36f));
}

static const RfColour g_sun = {2.05f, 1.90f, 1.64f};
static const RfColour g_sky_light = {0.50f, 0.62f, 0.80f};
static const RfColour g_bounce = {0.07f, 0.06f, 0.05f};

// ---- the field ---------------------------------------------------------------------------------------------------

// Bilinear place in the field of a point of its plane, clamped to the outermost texels.
typedef struct Place
{
    size_t texel;
    size_t right, down;
    float s, t;
} Place;

static Place place_of(const Slab *slab, float x, float z)
{
    float u = rf_clamp((x + 0.5f) * (float)slab->width - 0.5f, 0, (float)(slab->width - 1));
    float v = rf_clamp((z / slab->depth + 0.5f) * (float)slab->height - 0.5f, 0, (float)(slab->height - 1));
    int i = (int)u, j = (int)v;
    return (Place){(size_t)j * (size_t)slab->width + (size_t)i, i + 1 < slab->width ? 1 : 0,
                   j + 1 < slab->height ? (size_t)slab->width : 0, u - (float)i, v - (float)j};
}

static float height_at(const Slab *slab, float x, float z)
{
    Place p = place_of(slab, x, z);
    const float *h = slab->heights + p.texel;
    return rf_lerp(rf_lerp(h[0], h[p.right], p.s), rf_lerp(h[p.down], h[p.down + p.right], p.s), p.t);
}

static RfColour colour_at(const Slab *slab, const RfColour *colours, float x, float z)
{
    Place p = place_of(slab, x, z);
    const RfColour *c = colours + p.texel;
    return rf_colour_mix(rf_colour_mix(c[0], c[p.right], p.s), rf_colour_mix(c[p.down], c[p.down + p.right], p.s), p.t);
}

// A binomial mean of 3 x 3: enough to round the facets that bilinear interpolation would show.
static float smooth_height(const RfImageView *height, int x, int y)
{
    float sum = 0;
    for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i)
        {
            int row = rf_clamp_int(y + j, 0, height->height - 1), column = rf_clamp_int(x + i, 0, height->width - 1);
            float h = height->pixels[(ptrdiff_t)row * height->row_stride + (ptrdiff_t)column * height->channels];
            sum += (float)((2 - abs(i)) * (2 - abs(j))) / 16 * rf_clamp(h, 0, 1);
        }
    return sum;
}

static void read_band(void *context, int item, int worker)
{
    (void)worker;
    const Slab *slab = context;
    const RfImageView *height = slab->height_image, *colour = slab->colour_image;
    int end = rf_min_int((item + 1) * BAND, slab->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < slab->width; ++x)
        {
            size_t k = (size_t)y * (size_t)slab->width + (size_t)x;
            const float *c = colour->pixels + (ptrdiff_t)y * colour->row_stride + 3 * (ptrdiff_t)x;
            slab->heights[k] = slab->top * smooth_height(height, x, y);
            slab->albedo[k] =
                (RfColour){rf_srgb_to_linear(rf_clamp(c[0], 0, 1)), rf_srgb_to_linear(rf_clamp(c[1], 0, 1)),
                           rf_srgb_to_linear(rf_clamp(c[2], 0, 1))};
        }
}

static void raise_ceiling(void *context, int item, int worker)
{
    (void)worker;
    const Slab *slab = context;
    int y0 = rf_max_int((item - 1) * BLOCK - 1, 0), y1 = rf_min_int((item + 2) * BLOCK + 1, slab->height);
    for (int block = 0; block < slab->blocks_x; ++block)
    {
        int x0 = rf_max_int((block - 1) * BLOCK - 1, 0), x1 = rf_min_int((block + 2) * BLOCK + 1, slab->width);
        float highest = 0;
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x)
                highest = fmaxf(highest, slab->heights[(size_t)y * (size_t)slab->width + (size_t)x]);
        slab->ceiling[(size_t)item * (size_t)slab->blocks_x + (size_t)block] = highest;
    }
}

// How far a ray may go from p without meeting the surface: until it falls to the ceiling or leaves the blocks round p.
static float free_way(const Slab *slab, Vec3 p, Vec3 ray)
{
    int bx = rf_clamp_int((int)((p.x + 0.5f) * (float)slab->width) / BLOCK, 0, slab->blocks_x - 1);
    int by = rf_clamp_int((int)((p.z / slab->depth + 0.5f) * (float)slab->height) / BLOCK, 0, slab->blocks_y - 1);
    float air = p.y - slab->ceiling[(size_t)by * (size_t)slab->blocks_x + (size_t)bx];
    if (air <= 0)
        return 0;
    float sideways = (float)BLOCK / (float)slab->width / sqrtf(ray.x * ray.x + ray.z * ray.z + 1e-12f);
    return ray.y < 0 ? fminf(sideways, air / -ray.y) : sideways;
}

// ---- light -------------------------------------------------------------------------------------------------------

static Vec3 normal_at(const Slab *slab, float x, float z)
{
    float step = 1.0f / (float)slab->width;
    float dx = height_at(slab, x + step, z) - height_at(slab, x - step, z);
    float dz = height_at(slab, x, z + step) - height_at(slab, x, z - step);
    return normalised(vec3(-dx, 2 * step, -dz));
}

static bool over_field(const Slab *slab, float x, float z)
{
    return fabsf(x) <= 0.5f && fabsf(z) <= 0.5f * slab->depth;
}

static float sun_seen_from(const Slab *slab, Vec3 p)
{
    Vec3 sun = to_sun();
    float gap = 1, longest = (slab->top - p.y) / sun.y, texel = 1.0f / (float)slab->width;
    float step = fmaxf(longest / SHADOW_STEPS, 0.7f * texel);
    for (float t = 1.5f * texel; t < longest; t += step)
    {
        Vec3 q = along(p, sun, t);
        if (!over_field(slab, q.x, q.z))
            break;
        // The sun's disc, four times too large: soft shadows.
        gap = fminf(gap, 0.5f + 14 * (q.y - height_at(slab, q.x, q.z)) / t);
        if (gap <= 0)
            return 0;
    }
    return gap * gap * (3 - 2 * gap);
}

static float openness(const Slab *slab, Vec3 p)
{
    float sum = 0, reach = fminf(0.14f, 1.2f * slab->top + 4.0f / (float)slab->width);
    for (int i = 0; i < HORIZONS; ++i)
    {
        float angle = 2 * RF_PI * ((float)i + 0.5f) / HORIZONS, cx = cosf(angle), cz = sinf(angle), horizon = 0;
        for (int k = 1; k <= HORIZON_STEPS; ++k)
        {
            float share = (float)k / HORIZON_STEPS, r = reach * share * share + (float)k / (float)slab->width;
            float x = p.x + r * cx, z = p.z + r * cz;
            if (!over_field(slab, x, z))
                break;
            float rise = height_at(slab, x, z) - p.y;
            // Far obstacles count less.
            horizon = fmaxf(horizon, rise / sqrtf(rise * rise + r * r) * (1 - 0.5f * share * share));
        }
        sum += 1 - horizon;
    }
    return sum / HORIZONS;
}

static RfColour light_on(Vec3 normal, float sun, float open)
{
    float direct = sun * fmaxf(dot(normal, to_sun()), 0), sky = open * (0.6f + 0.4f * normal.y);
    return (RfColour){g_sun.r * direct + g_sky_light.r * sky + g_bounce.r,
                      g_sun.g * direct + g_sky_light.g * sky + g_bounce.g,
                      g_sun.b * direct + g_sky_light.b * sky + g_bounce.b};
}

static RfColour colour_product(RfColour a, RfColour b)
{
    return (RfColour){a.r * b.r, a.g * b.g, a.b * b.b};
}

static void light_band(void *context, int item, int worker)
{
    (void)worker;
    const Slab *slab = context;
    int end = rf_min_int((item + 1) * BAND, slab->height);
    for (int j = item * BAND; j < end; ++j)
        for (int i = 0; i < slab->width; ++i)
        {
            size_t k = (size_t)j * (size_t)slab->width + (size_t)i;
            Vec3 p = {((float)i + 0.5f) / (float)slab->width - 0.5f, slab->heights[k],
                      (((float)j + 0.5f) / (float)slab->height - 0.5f) * slab->depth};
            RfColour light = light_on(normal_at(slab, p.x, p.z), sun_seen_from(slab, p), openness(slab, p));
            slab->lit[k] = colour_product(slab->albedo[k], light);
        }
}

// ---- view --------------------------------------------------------------------------------------------------------

static void look_from(Camera *camera, float distance, const Slab *slab)
{
    const float elevation = 0.66f;
    Vec3 middle = {0, 0.5f * (slab->top + slab->bottom), 0};
    camera->eye = vec3(middle.x, middle.y + distance * sinf(elevation), middle.z + distance * cosf(elevation));
    camera->forward = normalised(vec3(0, middle.y - camera->eye.y, middle.z - camera->eye.z));
    camera->right = vec3(1, 0, 0);
    camera->up = cross(camera->right, camera->forward);
}

// Bounds of the slab's corners in the picture, -1 to 1.
static void project_corners(const Camera *camera, const Slab *slab, float low[2], float high[2])
{
    low[0] = low[1] = 1e30f;
    high[0] = high[1] = -1e30f;
    for (int corner = 0; corner < 8; ++corner)
    {
        Vec3 p = {corner & 1 ? 0.5f : -0.5f, corner & 2 ? slab->top : slab->bottom,
                  corner & 4 ? 0.5f * slab->depth : -0.5f * slab->depth};
        Vec3 q = {p.x - camera->eye.x, p.y - camera->eye.y, p.z - camera->eye.z};
        float ahead = fmaxf(dot(q, camera->forward), 1e-3f);
        float seen[2] = {dot(q, camera->right) / (ahead * camera->tan_x), dot(q, camera->up) / (ahead * camera->tan_y)};
        for (int i = 0; i < 2; ++i)
        {
            low[i] = fminf(low[i], seen[i]);
            high[i] = fmaxf(high[i], seen[i]);
        }
    }
}

// As near as lets the whole slab be seen with a margin, by halving the interval.
static Camera make_camera(const Slab *slab)
{
    const float margin = 0.93f;
    Camera camera = {.tan_x = 0.36f, .tan_y = 0.36f};
    if (slab->frame->width > slab->frame->height)
        camera.tan_y *= (float)slab->frame->height / (float)slab->frame->width;
    else
        camera.tan_x *= (float)slab->frame->width / (float)slab->frame->height;
    float size = sqrtf(1 + slab->depth * slab->depth + slab->top * slab->top), near = 0.6f * size, far = 200 * size;
    float low[2], high[2];
    for (int i = 0; i < 40; ++i)
    {
        float distance = 0.5f * (near + far);
        look_from(&camera, distance, slab);
        project_corners(&camera, slab, low, high);
        bool seen = high[0] - low[0] < 2 * margin && high[1] - low[1] < 2 * margin;
        near = seen ? near : distance;
        far = seen ? distance : far;
    }
    look_from(&camera, far, slab);
    project_corners(&camera, slab, low, high);
    camera.shift_x = 0.5f * (low[0] + high[0]);
    camera.shift_y = 0.5f * (low[1] + high[1]);
    return camera;
}

// Part of the ray inside the slab's box; false if none.
static bool box_span(const Slab *slab, Vec3 eye, Vec3 ray, float *enter, float *leave)
{
    const float low[3] = {-0.5f, slab->bottom, -0.5f * slab->depth}, high[3] = {0.5f, slab->top, 0.5f * slab->depth};
    const float origin[3] = {eye.x, eye.y, eye.z}, direction[3] = {ray.x, ray.y, ray.z};
    *enter = 0;
    *leave = 1e30f;
    for (int i = 0; i < 3; ++i)
    {
        if (fabsf(direction[i]) < 1e-9f)
        {
            if (origin[i] < low[i] || origin[i] > high[i])
                return false;
            continue;
        }
        float a = (low[i] - origin[i]) / direction[i], b = (high[i] - origin[i]) / direction[i];
        *enter = fmaxf(*enter, fminf(a, b));
        *leave = fminf(*leave, fmaxf(a, b));
    }
    return *enter < *leave;
}

// The cut side of the slab: the border's colour, darker downwards.
static RfColour wall_colour(const Slab *slab, Vec3 p)
{
    bool front = fabsf(p.z) > 0.5f * slab->depth - 1e-4f && fabsf(p.x) < 0.5f - 1e-4f;
    Vec3 normal = front ? vec3(0, 0, p.z > 0 ? 1.0f : -1.0f) : vec3(p.x > 0 ? 1.0f : -1.0f, 0, 0);
    float rise = (p.y - slab->bottom) / (slab->top - slab->bottom);
    const RfColour stone = {0.20f, 0.20f, 0.21f};
    RfColour albedo = rf_colour_mix(stone, colour_at(slab, slab->albedo, p.x, p.z), 0.22f);
    albedo = rf_colour_scale(albedo, 0.40f + 0.35f * rf_clamp(rise, 0, 1));
    return colour_product(albedo, light_on(normal, 1, 0.9f));
}

static RfColour sky_colour(float down)
{
    const RfColour zenith = {0.30f, 0.47f, 0.72f}, haze = {0.86f, 0.89f, 0.92f};
    return rf_colour_mix(zenith, haze, rf_smoothstep(-0.15f, 0.95f, down));
}

// What a ray meets, in linear colour; false if only the sky.
static bool trace(const Slab *slab, Vec3 eye, Vec3 ray, float pixel, RfColour *colour)
{
    float enter, leave;
    if (!box_span(slab, eye, ray, &enter, &leave))
        return false;
    Vec3 p = along(eye, ray, enter);
    if (p.y < height_at(slab, p.x, p.z) && p.y < slab->top - 1e-5f)
    {
        *colour = wall_colour(slab, p);
        return true;
    }
    float step = 0.5f * fmaxf(1.0f / (float)slab->width, pixel * enter), before = enter;
    for (float t = enter; before < leave; t += step)
    {
        p = along(eye, ray, fminf(t, leave));
        if (p.y > height_at(slab, p.x, p.z))
        {
            before = t;
            t += fmaxf(free_way(slab, p, ray) - step, 0);
            continue;
        }
        float above = before, below = fminf(t, leave);
        for (int i = 0; i < BISECTIONS; ++i)
        {
            float middle = 0.5f * (above + below);
            p = along(eye, ray, middle);
            if (p.y > height_at(slab, p.x, p.z))
                above = middle;
            else
                below = middle;
        }
        *colour = colour_at(slab, slab->lit, p.x, p.z);
        return true;
    }
    return false;
}

typedef struct View
{
    const Slab *slab;
    Camera camera;
    /// [height][width] of the frame, which gets them when all are there.
    RfColour *pixels;
} View;

static RfColour view_pixel(const View *view, int x, int y)
{
    static const float grid[4][2] = {{0.375f, 0.125f}, {0.875f, 0.375f}, {0.125f, 0.625f}, {0.625f, 0.875f}};
    const RfImageView *frame = view->slab->frame;
    const Camera *c = &view->camera;
    RfColour sum = {0, 0, 0}, sky = sky_colour(((float)y + 0.5f) / (float)frame->height);
    for (int i = 0; i < 4; ++i)
    {
        float u = 2 * ((float)x + grid[i][0]) / (float)frame->width - 1 + c->shift_x;
        float v = 1 - 2 * ((float)y + grid[i][1]) / (float)frame->height + c->shift_y;
        Vec3 ray = normalised(along(along(c->forward, c->right, u * c->tan_x), c->up, v * c->tan_y));
        RfColour seen;
        if (trace(view->slab, c->eye, ray, 2 * c->tan_x / (float)frame->width, &seen))
            // Encoded before averaging, so that the slab's outline is smooth as it is displayed.
            seen = (RfColour){rf_linear_to_srgb(fminf(seen.r, 1)), rf_linear_to_srgb(fminf(seen.g, 1)),
                              rf_linear_to_srgb(fminf(seen.b, 1))};
        else
            seen = sky;
        sum = (RfColour){sum.r + 0.25f * seen.r, sum.g + 0.25f * seen.g, sum.b + 0.25f * seen.b};
    }
    return sum;
}

static void view_band(void *context, int item, int worker)
{
    (void)worker;
    const View *view = context;
    const RfImageView *frame = view->slab->frame;
    int end = rf_min_int((item + 1) * BAND, frame->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < frame->width; ++x)
            view->pixels[(size_t)y * (size_t)frame->width + (size_t)x] = view_pixel(view, x, y);
}

static RfResult draw_view(const View *view)
{
    const Slab *slab = view->slab;
    const RfImageView *frame = slab->frame;
    int bands = (slab->height + BAND - 1) / BAND;
    rf_parallel_for(bands, read_band, (void *)(uintptr_t)slab);
    rf_parallel_for(slab->blocks_y, raise_ceiling, (void *)(uintptr_t)slab);
    RF_TRY(rf_progress_for("lighting the relief", 0, 1, bands, light_band, (void *)(uintptr_t)slab));
    bands = (frame->height + BAND - 1) / BAND;
    RF_TRY(rf_progress_for("drawing the relief", 0, 1, bands, view_band, (void *)(uintptr_t)view));
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
            rf_colour_put(frame, x, y, view->pixels[(size_t)y * (size_t)frame->width + (size_t)x]);
    return RF_OK;
}

// ---- the call ----------------------------------------------------------------------------------------------------

static bool usable(const RfImageView *image, int channels)
{
    return image && image->pixels && image->width >= 1 && image->width <= RF_MAX_SIZE && image->height >= 1 &&
           image->height <= RF_MAX_SIZE && image->channels >= 1 && (channels == 0 || image->channels == channels) &&
           image->row_stride >= (ptrdiff_t)image->width * image->channels;
}

RfResult rf_render_relief(const RfImageView *height, const RfImageView *colour, float relief, const RfImageView *frame)
{
    RF_REQUIRE(usable(height, 0) && usable(colour, 3) && usable(frame, 3),
               "relief: height needs a channel, colour and frame need 3, and a size each");
    RF_REQUIRE(height->width == colour->width && height->height == colour->height,
               "relief: height is %d x %d, colour is %d x %d: must be the same", height->width, height->height,
               colour->width, colour->height);
    RF_REQUIRE(relief >= 0 && relief <= 10, "relief %g: must be 0 to 10 widths of the field", (double)relief);
    size_t texels = (size_t)height->width * (size_t)height->height;
    Slab slab = {.width = height->width,
                 .height = height->height,
                 .heights = rf_allocate(texels, sizeof(float)),
                 .albedo = rf_allocate(texels, sizeof(RfColour)),
                 .lit = rf_allocate(texels, sizeof(RfColour)),
                 .blocks_x = (height->width + BLOCK - 1) / BLOCK,
                 .blocks_y = (height->height + BLOCK - 1) / BLOCK,
                 .depth = (float)height->height / (float)height->width,
                 .top = fmaxf(relief, 1e-4f),
                 .bottom = -0.03f - 0.15f * relief,
                 .height_image = height,
                 .colour_image = colour,
                 .frame = frame};
    slab.ceiling = rf_allocate((size_t)slab.blocks_x * (size_t)slab.blocks_y, sizeof(float));
    View view = {&slab, make_camera(&slab),
                 rf_allocate((size_t)frame->width * (size_t)frame->height, sizeof(RfColour))};
    bool made = slab.heights && slab.albedo && slab.lit && slab.ceiling && view.pixels;
    RfResult result = made ? draw_view(&view) : RF_OUT_OF_MEMORY;
    rf_release(view.pixels);
    rf_release(slab.ceiling);
    rf_release(slab.lit);
    rf_release(slab.albedo);
    rf_release(slab.heights);
    return result;
}
