// SPDX-License-Identifier: Apache-2.0
// Baker, Scharstein, Lewis, Roth, Black, Szeliski. A database and evaluation methodology for optical flow. 2011: the
// colour coding of velocities. Its wheel has 55 hues, more of them where the eye tells them apart better.
#include "render/flow_picture.h"

#include "core/memory.h"
#include "core/options.h"
#include "core/parallel.h"
#include "core/result.h"

enum
{
    HUES = 55,
    BAND = 8
};

// Where each of the six ramps of the wheel starts: red, yellow, green, cyan, blue, magenta, red again.
static const int g_ramp_start[7] = {0, 15, 21, 25, 36, 49, 55};
static const RfColour g_ramp_colour[7] = {{1, 0, 0}, {1, 1, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};

static RfColour wheel_hue(float position)
{
    int ramp = 0;
    while (ramp < 5 && position >= (float)g_ramp_start[ramp + 1])
        ++ramp;
    float t = (position - (float)g_ramp_start[ramp]) / (float)(g_ramp_start[ramp + 1] - g_ramp_start[ramp]);
    return rf_colour_mix(g_ramp_colour[ramp], g_ramp_colour[ramp + 1], t);
}

RfColour rf_flow_colour(RfVec2 velocity, float full_speed)
{
    float radius = full_speed > 0 ? rf_vec2_length(velocity) / full_speed : 0;
    if (radius == 0)
        return (RfColour){1, 1, 1};
    float turn = atan2f(-velocity.y, -velocity.x) / RF_PI;
    RfColour hue = wheel_hue(rf_clamp(0.5f * (turn + 1) * HUES, 0, HUES - 1e-4f));
    // The database's own code darkens what is out of range by a quarter. Full speed itself may come out of the
    // interpolation a rounding error too fast.
    return radius < 1.0001f ? rf_colour_mix((RfColour){1, 1, 1}, hue, fminf(radius, 1)) : rf_colour_scale(hue, 0.75f);
}

static void draw_wheel_band(void *context, int item, int worker)
{
    (void)worker;
    const RfFlowCanvas *canvas = context;
    int end = rf_min_int((item + 1) * BAND, canvas->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < canvas->width; ++x)
        {
            size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
            rf_colour_put(canvas->frame, x, y,
                          canvas->fluid[k] ? rf_flow_colour(canvas->velocity[k], canvas->full_speed) : RF_LAND);
        }
}

// ---- the canvas --------------------------------------------------------------------------------------------------

typedef struct Resampling
{
    const RfFlowView *view;
    RfFlowCanvas *canvas;
    float blend;
} Resampling;

static void resample_band(void *context, int item, int worker)
{
    (void)worker;
    const Resampling *r = context;
    RfFlowCanvas *canvas = r->canvas;
    int end = rf_min_int((item + 1) * BAND, canvas->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < canvas->width; ++x)
        {
            size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
            float fx = ((float)x + 0.5f) / canvas->scale_x, fy = ((float)y + 0.5f) / canvas->scale_y;
            canvas->velocity[k] = rf_flow_sample(r->view, fx, fy, r->blend);
            canvas->fluid[k] = rf_flow_inside(r->view, fx, fy);
        }
}

static float greatest_speed(const RfFlowCanvas *canvas)
{
    float speed = 0;
    for (size_t k = 0; k < (size_t)canvas->width * (size_t)canvas->height; ++k)
        if (canvas->fluid[k])
            speed = fmaxf(speed, rf_vec2_length(canvas->velocity[k]));
    return speed;
}

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfFlowPictureOptions, seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Picks the noise that is convolved."},
    {"picture", RF_OPTION_CHOICE, offsetof(RfFlowPictureOptions, picture), "", 0, 2, 0, "wheel|arrows|lic",
     "Colours, arrows over dimmed colours, or noise smeared along the flow."},
    {"full-speed", RF_OPTION_FLOAT, offsetof(RfFlowPictureOptions, full_speed), "cells/frame", 0, 1e30, 0, NULL,
     "Speed of full saturation and the longest arrow; 0 takes the greatest of the view."},
};

RfFlowPictureOptions rf_flow_picture_defaults(void)
{
    return (RfFlowPictureOptions){.struct_size = sizeof(RfFlowPictureOptions), .seed = 1};
}

static RfResult draw(const RfFlowCanvas *canvas, RfFlowPicture picture, RfVec2 *scratch)
{
    if (picture == RF_FLOW_LIC)
        return rf_draw_lic(canvas, scratch);
    rf_parallel_for((canvas->height + BAND - 1) / BAND, draw_wheel_band, (void *)canvas);
    if (picture == RF_FLOW_ARROWS)
        rf_draw_arrows(canvas);
    return RF_OK;
}

RfResult rf_flow_picture(const RfFlowView *view, const RfFlowPictureOptions *options, const RfImageView *frame)
{
    RF_REQUIRE(view && options && frame && frame->pixels, "rf_flow_picture: view, options or frame is NULL");
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_flow_picture_defaults", g_options,
                            (int)(sizeof g_options / sizeof *g_options)));
    RF_REQUIRE(frame->channels == 3 && frame->width >= 1 && frame->width <= RF_MAX_SIZE && frame->height >= 1 &&
                   frame->height <= RF_MAX_SIZE && frame->row_stride >= 3 * (ptrdiff_t)frame->width,
               "frame: must have 3 channels and sides of 1 to %d", RF_MAX_SIZE);
    RF_TRY(rf_flow_view_check(view));
    size_t pixels = (size_t)frame->width * (size_t)frame->height;
    RfFlowCanvas canvas = {.frame = frame,
                           .width = frame->width,
                           .height = frame->height,
                           .velocity = rf_allocate(pixels, sizeof(RfVec2)),
                           .fluid = rf_allocate(pixels, 1),
                           .scale_x = (float)frame->width / (float)view->width,
                           .scale_y = (float)frame->height / (float)view->height,
                           .seed = options->seed};
    RfVec2 *scratch = options->picture == RF_FLOW_LIC ? rf_allocate(pixels, 2 * sizeof(RfVec2)) : NULL;
    RfResult result =
        canvas.velocity && canvas.fluid && (scratch || options->picture != RF_FLOW_LIC) ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
    {
        Resampling resampling = {view, &canvas, rf_flow_blend(view, view->time)};
        rf_parallel_for((frame->height + BAND - 1) / BAND, resample_band, &resampling);
        canvas.full_speed = options->full_speed > 0 ? options->full_speed : greatest_speed(&canvas);
        result = draw(&canvas, options->picture, scratch);
    }
    rf_release(scratch);
    rf_release(canvas.fluid);
    rf_release(canvas.velocity);
    return result;
}
