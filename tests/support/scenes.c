// SPDX-License-Identifier: Apache-2.0
#include "support/scenes.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/random.h"

#include <assert.h>
#include <kiss_fftnd.h>

#define TAU 6.283185307179586

typedef struct Vortex
{
    double x, y, core, peak;
} Vortex;

// Lamb and Oseen's vortex: solid rotation in its core, 1 / r outside. `peak` is the greatest speed, reached at 1.1209
// core radii, where (1 - exp(-r^2)) / r is 0.6382.
static void add_vortex(const Vortex *vortex, double x, double y, double v[2])
{
    double dx = (x - vortex->x) / vortex->core, dy = (y - vortex->y) / vortex->core;
    double square = dx * dx + dy * dy;
    double turn = square < 1e-8 ? 1 : (1 - exp(-square)) / square;
    v[0] -= vortex->peak / 0.6382 * turn * dy;
    v[1] += vortex->peak / 0.6382 * turn * dx;
}

void scene_two_vortices(int w, int h, double frame, float *velocity)
{
    // Speeds of the two add to at most 1.3 + 1.3 cells between them, the shear gives 0.35 more.
    double a = TAU * frame / 90, b = TAU * frame / 130, core = 0.13 * (w < h ? w : h);
    Vortex left = {w * (0.32 + 0.06 * cos(a)), h * (0.42 + 0.12 * sin(a)), core, 1.3};
    Vortex right = {w * (0.68 + 0.07 * sin(b)), h * (0.56 + 0.12 * cos(b)), core, -1.3};
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            double v[2] = {0.35 * cos(TAU * (y + 0.5) / h), 0};
            add_vortex(&left, x + 0.5, y + 0.5, v);
            add_vortex(&right, x + 0.5, y + 0.5, v);
            float *out = velocity + 2 * ((size_t)y * (size_t)w + (size_t)x);
            out[0] = (float)v[0];
            out[1] = (float)v[1];
        }
}

void scene_uniform(int w, int h, RfVec2 v, float *velocity)
{
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
    {
        velocity[2 * k] = v.x;
        velocity[2 * k + 1] = v.y;
    }
}

void scene_translation(int w, int h, double frame, float *velocity)
{
    (void)frame;
    scene_uniform(w, h, (RfVec2){2.25f, -1.5f}, velocity);
}

void scene_rotation(int w, int h, double frame, float *velocity)
{
    (void)frame;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            float *out = velocity + 2 * ((size_t)y * (size_t)w + (size_t)x);
            out[0] = (float)(-TAU / 120 * (y + 0.5 - 0.5 * h));
            out[1] = (float)(TAU / 120 * (x + 0.5 - 0.5 * w));
        }
}

SceneMoments scene_moments(SceneFlow *flow, int w, int h)
{
    size_t count = 2 * (size_t)w * (size_t)h;
    SceneMoments moments = {flow, w, h, rf_allocate(count, sizeof(float)), rf_allocate(count, sizeof(float))};
    assert(moments.before && moments.after);
    return moments;
}

RfFlowView scene_step(SceneMoments *moments, double frame)
{
    moments->flow(moments->w, moments->h, frame - 1, moments->before);
    moments->flow(moments->w, moments->h, frame, moments->after);
    return (RfFlowView){.width = moments->w,
                        .height = moments->h,
                        .velocity = moments->before,
                        .next_velocity = moments->after,
                        .velocity_time = frame - 1,
                        .next_time = frame,
                        .time = frame};
}

void scene_moments_free(SceneMoments *moments)
{
    rf_release(moments->before);
    rf_release(moments->after);
    *moments = (SceneMoments){0};
}

static kiss_fft_cpx *random_spectrum(int w, int h, float low, float high, uint64_t seed)
{
    kiss_fft_cpx *spectrum = rf_allocate_zero((size_t)w * (size_t)h, sizeof *spectrum);
    assert(spectrum);
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            double fx = (x <= w / 2 ? x : x - w) / (double)w, fy = (y <= h / 2 ? y : y - h) / (double)h;
            double f = sqrt(fx * fx + fy * fy);
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            double phase = TAU * (double)rf_random_float(seed, 0, k, 0);
            if (f >= (double)low && f <= (double)high && f > 0)
                spectrum[k] = (kiss_fft_cpx){(float)cos(phase), (float)sin(phase)};
        }
    return spectrum;
}

void scene_noise(int w, int h, float low, float high, uint64_t seed, float *grey)
{
    size_t count = (size_t)w * (size_t)h;
    kiss_fft_cpx *spectrum = random_spectrum(w, h, low, high, seed), *noise = rf_allocate(count, sizeof *noise);
    kiss_fftnd_cfg plan = kiss_fftnd_alloc((int[]){h, w}, 2, 1, NULL, NULL);
    assert(noise && plan);
    kiss_fftnd(plan, spectrum, noise);
    double power = 0;
    for (size_t k = 0; k < count; ++k)
        power += (double)(noise[k].r * noise[k].r);
    // A standard deviation of 0.11 keeps all but one pixel in 100000 inside 0..1: clipping would fill the empty bands.
    float gain = power > 0 ? 0.11f / sqrtf((float)(power / (double)count)) : 0;
    for (size_t k = 0; k < count; ++k)
        grey[k] = rf_clamp(0.5f + gain * noise[k].r, 0, 1);
    kiss_fft_free(plan);
    rf_release(noise);
    rf_release(spectrum);
}

double scene_elongation(const float *pixels, int stride, int x0, int y0, int x1, int y1)
{
    double along = 0, across = 0;
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
        {
            const float *p = pixels + 3 * (y * stride + x), *above = p - 3 * stride, *below = p + 3 * stride;
            along += (double)((p[3] - p[-3]) * (p[3] - p[-3]));
            across += (double)((*below - *above) * (*below - *above));
        }
    return sqrt(across / along);
}

RfExemplar *scene_noise_exemplar(int size, uint64_t seed)
{
    size_t count = (size_t)size * (size_t)size;
    float *planes = rf_allocate(4 * count, sizeof(float)), *pixels = rf_allocate(3 * count, sizeof(float));
    assert(planes && pixels);
    for (int c = 0; c < 4; ++c)
        scene_noise(size, size, 0.02f, 0.12f, seed + (uint64_t)c, planes + (size_t)c * count);
    for (size_t k = 0; k < count; ++k)
        for (size_t c = 0; c < 3; ++c)
            pixels[3 * k + c] = 0.75f * planes[k] + 0.25f * planes[(c + 1) * count + k];
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, size, size, 3, 3 * size}, 1};
    RfExemplar *exemplar = NULL;
    RfResult result = rf_exemplar_create(&map, 1, RF_TILING_YES, &exemplar);
    assert(result == RF_OK);
    (void)result;
    rf_release(pixels);
    rf_release(planes);
    return exemplar;
}
