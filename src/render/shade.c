// SPDX-License-Identifier: Apache-2.0
// Procedural shaders for blended parameters: the noise is blended first and shaded afterwards, as Yu, Neyret, Bruneton
// and Holzschuch (2009) ask, since a blend of two flames is no flame while a blend of two noises is a noise.
//
// Both shaders read the frame of noise as a field they may look around in: clouds need the density towards the light.
#include "riffle/render.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "render/flow_picture.h"

enum
{
    BAND = 8,
    LIGHT_STEPS = 14
};

typedef struct Field
{
    /// [height][width], the parameter, 0 to 1; and the same over a small neighbourhood averaged.
    float *value, *smooth;
    int width, height;
    const RfImageView *parameters, *colour;
    RfShader shader;
} Field;

static float field_at(const float *field, const Field *f, float x, float y)
{
    x = rf_clamp(x, 0, (float)(f->width - 1));
    y = rf_clamp(y, 0, (float)(f->height - 1));
    int i = (int)x, j = (int)y, right = i + 1 < f->width, down = j + 1 < f->height ? f->width : 0;
    const float *p = field + (size_t)j * (size_t)f->width + (size_t)i;
    float s = x - (float)i, t = y - (float)j;
    return rf_lerp(rf_lerp(p[0], p[right], s), rf_lerp(p[down], p[down + right], s), t);
}

// ---- fire --------------------------------------------------------------------------------------------------------

typedef struct Stop
{
    float at;
    RfColour colour;
} Stop;

// Of a sooty flame by its heat: dark smoke, then a black body's red, orange, yellow, nearly white.
static const Stop g_flame[] = {
    {0.00f, {0.012f, 0.011f, 0.014f}}, {0.20f, {0.075f, 0.062f, 0.062f}}, {0.34f, {0.24f, 0.055f, 0.032f}},
    {0.48f, {0.62f, 0.115f, 0.025f}},  {0.62f, {0.93f, 0.34f, 0.04f}},    {0.77f, {1.00f, 0.66f, 0.14f}},
    {0.90f, {1.00f, 0.90f, 0.50f}},    {1.00f, {1.00f, 0.99f, 0.88f}},
};

static RfColour flame_colour(float heat)
{
    int last = (int)(sizeof g_flame / sizeof *g_flame) - 1, i = 0;
    heat = rf_clamp(heat, 0, 1);
    while (i < last - 1 && heat >= g_flame[i + 1].at)
        ++i;
    float t = (heat - g_flame[i].at) / (g_flame[i + 1].at - g_flame[i].at);
    return rf_colour_mix(g_flame[i].colour, g_flame[i + 1].colour, rf_clamp(t, 0, 1));
}

// Hot below, burnt out above: the noise decides how high each tongue reaches, and the fire below glows into the gaps.
static RfColour shade_fire(const Field *f, int x, int y)
{
    size_t k = (size_t)y * (size_t)f->width + (size_t)x;
    float value = 0.3f * f->value[k] + 0.7f * f->smooth[k], up = 1 - ((float)y + 0.5f) / (float)f->height;
    // Steep where soot meets flame, flat inside the flame.
    float tongue = rf_smoothstep(0.12f, 0.95f, value);
    float heat = tongue * (1.04f - 0.48f * up) + 0.10f - 0.20f * up;
    RfColour glow = rf_colour_scale((RfColour){0.30f, 0.07f, 0.015f}, 1 - 0.8f * up), flame = flame_colour(heat);
    return (RfColour){flame.r + glow.r * (1 - flame.r), flame.g + glow.g * (1 - flame.g),
                      flame.b + glow.b * (1 - flame.b)};
}

// ---- clouds ------------------------------------------------------------------------------------------------------

static float cloud_density(float value)
{
    return rf_smoothstep(0.42f, 0.80f, value);
}

// How much of the sun reaches a point: Beer's law over the density on the way to it, in growing steps.
static float sun_through(const Field *f, int x, int y, RfVec2 to_sun)
{
    float unit = 0.0022f * (float)rf_max_int(f->width, f->height) + 0.4f, depth = 0, distance = 0;
    for (int i = 1; i <= LIGHT_STEPS; ++i)
    {
        float step = unit * (1 + 0.22f * (float)i);
        distance += step;
        float d = cloud_density(field_at(f->smooth, f, (float)x + distance * to_sun.x, (float)y + distance * to_sun.y));
        depth += d * step / unit;
    }
    return expf(-0.085f * depth);
}

static RfColour shade_clouds(const Field *f, int x, int y)
{
    const RfVec2 to_sun = {-0.78f, -0.62f};
    const RfColour lit = {1.0f, 0.985f, 0.955f}, shaded = {0.53f, 0.60f, 0.70f};
    float down = ((float)y + 0.5f) / (float)f->height;
    RfColour sky = rf_colour_mix((RfColour){0.16f, 0.38f, 0.72f}, (RfColour){0.55f, 0.75f, 0.93f}, down);
    size_t k = (size_t)y * (size_t)f->width + (size_t)x;
    float density = cloud_density(f->value[k]), cover = 1 - expf(-3.6f * density);
    if (cover <= 0)
        return sky;
    // The slope towards the sun, in the unit of the light's steps.
    float reach = 0.004f * (float)rf_max_int(f->width, f->height) + 0.75f;
    float ahead = field_at(f->smooth, f, (float)x + reach * to_sun.x, (float)y + reach * to_sun.y);
    float behind = field_at(f->smooth, f, (float)x - reach * to_sun.x, (float)y - reach * to_sun.y);
    float slope = rf_clamp(0.5f + 3.2f * (behind - ahead), 0, 1);
    // Thin edges scatter forward and stay bright.
    float light = sun_through(f, x, y, to_sun) * (0.45f + 0.75f * slope) + 0.22f * (1 - density);
    return rf_colour_mix(sky, rf_colour_mix(shaded, lit, rf_clamp(light * 1.4f, 0, 1)), cover);
}

// ---- the frame ---------------------------------------------------------------------------------------------------

static void read_band(void *context, int item, int worker)
{
    (void)worker;
    const Field *f = context;
    int channels = f->parameters->channels, used = channels >= 3 ? 3 : 1,
        end = rf_min_int((item + 1) * BAND, f->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < f->width; ++x)
        {
            const float *p = f->parameters->pixels + (ptrdiff_t)y * f->parameters->row_stride + (ptrdiff_t)x * channels;
            float value = used == 3 ? (p[0] + p[1] + p[2]) / 3 : p[0];
            f->value[(size_t)y * (size_t)f->width + (size_t)x] = rf_clamp(value, 0, 1);
        }
}

static void smooth_band(void *context, int item, int worker)
{
    (void)worker;
    static const float taps[5] = {1.0f / 16, 4.0f / 16, 6.0f / 16, 4.0f / 16, 1.0f / 16};
    const Field *f = context;
    int end = rf_min_int((item + 1) * BAND, f->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < f->width; ++x)
        {
            float sum = 0;
            for (int i = 0; i < 25; ++i)
            {
                int row = rf_clamp_int(y + i / 5 - 2, 0, f->height - 1);
                int column = rf_clamp_int(x + i % 5 - 2, 0, f->width - 1);
                sum += taps[i / 5] * taps[i % 5] * f->value[(size_t)row * (size_t)f->width + (size_t)column];
            }
            f->smooth[(size_t)y * (size_t)f->width + (size_t)x] = sum;
        }
}

static void shade_band(void *context, int item, int worker)
{
    (void)worker;
    const Field *f = context;
    int end = rf_min_int((item + 1) * BAND, f->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < f->width; ++x)
        {
            float value = f->value[(size_t)y * (size_t)f->width + (size_t)x];
            RfColour colour = {value, value, value};
            if (f->shader == RF_SHADER_FIRE)
                colour = shade_fire(f, x, y);
            else if (f->shader == RF_SHADER_CLOUDS)
                colour = shade_clouds(f, x, y);
            rf_colour_put(f->colour, x, y, colour);
        }
}

static bool usable(const RfImageView *image)
{
    return image->pixels && image->width >= 1 && image->width <= RF_MAX_SIZE && image->height >= 1 &&
           image->height <= RF_MAX_SIZE && image->channels >= 1 &&
           image->row_stride >= (ptrdiff_t)image->width * image->channels;
}

RfResult rf_shade(RfShader shader, const RfImageView *parameters, const RfImageView *colour)
{
    RF_REQUIRE(parameters && colour && usable(parameters) && usable(colour), "rf_shade: no pixels, or no size");
    RF_REQUIRE(shader >= RF_SHADER_NONE && shader <= RF_SHADER_CLOUDS, "rf_shade: there is no shader %d", (int)shader);
    RF_REQUIRE(colour->channels == 3, "colour: %d channels: must have 3", colour->channels);
    RF_REQUIRE(parameters->width == colour->width && parameters->height == colour->height,
               "parameters are %d x %d, colour is %d x %d: must be the same", parameters->width, parameters->height,
               colour->width, colour->height);
    size_t pixels = (size_t)colour->width * (size_t)colour->height;
    float *values = rf_allocate(pixels, 2 * sizeof(float));
    if (!values)
        return RF_OUT_OF_MEMORY;
    Field field = {values, values + pixels, colour->width, colour->height, parameters, colour, shader};
    int bands = (colour->height + BAND - 1) / BAND;
    rf_parallel_for(bands, read_band, &field);
    rf_parallel_for(bands, smooth_band, &field);
    rf_parallel_for(bands, shade_band, &field);
    rf_release(values);
    return RF_OK;
}
