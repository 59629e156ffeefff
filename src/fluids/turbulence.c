// SPDX-License-Identifier: Apache-2.0
// Two-dimensional turbulence that never ends: the vorticity equation on a periodic domain, pseudo-spectral.
//
//   dw/dt + u . grad w = -r(k) w,   u = (-psi_y, psi_x),   laplace psi = w
//
// Products are taken on a grid of at most 128 cells along the shorter side and dealiased by the 2/3 rule (Orszag 1971);
// time goes by Williamson's three-stage Runge-Kutta scheme (1980), the linear loss r(k) exactly after each step. r(k)
// is hyperviscosity at the fine end and a drag on waves longer than the forced ones, against the inverse cascade that
// would end in one pair of vortices. The forcing is the multiplication of a band of wavenumbers by the factor that
// brings the energy back to its first value, so the rms speed is the same for ever and no second constant is needed.
//
// A moment is drawn by putting the modes into a spectrum of the output's size: exact interpolation, free of divergence
// at any size. Sums run in a fixed order, and the transforms do not depend on the number of threads.
#include "core/memory.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"
#include "fluids/fourier.h"
#include "fluids/scene.h"

#include <math.h>
#include <string.h>

enum
{
    SHORT_SIDE = 128,
    LONG_SIDE = 1024
};

// In waves along the shorter side: the forced band, and below it the drag.
static const float forced_from = 3, forced_to = 6;
// Greatest over rms speed; 2.6 to 3.4 were seen over 2000 frames.
static const float peak = 3;

typedef struct Turbulence
{
    int width, height;
    /// Of the output, in cells.
    int out_width, out_height;
    int steps_a_frame;
    float rms, time_step;
    RfFourier *fourier, *out_fourier;
    RfComplex *vorticity, *first, *slope, *flow, *gradient, *out;
    /// Factor of the linear loss in one step.
    float *loss;
} Turbulence;

/// Signed wavenumber of a mode along an axis.
static inline int wave(int index, int count)
{
    return index <= count / 2 ? index : index - count;
}

static inline float wavenumber_x(const Turbulence *t, int i)
{
    return 2 * RF_PI * (float)wave(i, t->width) / (float)t->out_width;
}

static inline float wavenumber_y(const Turbulence *t, int j)
{
    return 2 * RF_PI * (float)wave(j, t->height) / (float)t->out_height;
}

static inline bool kept(const Turbulence *t, int i, int j)
{
    int a = wave(i, t->width), b = wave(j, t->height);
    return 3 * abs(a) < t->width && 3 * abs(b) < t->height && (a != 0 || b != 0);
}

/// Wavenumber in waves along the shorter side.
static inline float waves(const Turbulence *t, int i, int j)
{
    float kx = wavenumber_x(t, i), ky = wavenumber_y(t, j);
    return sqrtf(kx * kx + ky * ky) * (float)rf_min_int(t->out_width, t->out_height) / (2 * RF_PI);
}

/// flow = u + i v in the mode (i, j): (kx + i ky) w / k^2.
static inline RfComplex flow_mode(const Turbulence *t, int i, int j)
{
    RfComplex w = t->vorticity[(size_t)j * (size_t)t->width + (size_t)i];
    float kx = wavenumber_x(t, i), ky = wavenumber_y(t, j), scale = 1 / (kx * kx + ky * ky);
    return (RfComplex){scale * (kx * w.r - ky * w.i), scale * (kx * w.i + ky * w.r)};
}

/// Fills `flow` and `gradient` (w_x + i w_y) as fields in space.
static void to_space(Turbulence *t)
{
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
        {
            size_t k = (size_t)j * (size_t)t->width + (size_t)i;
            t->flow[k] = t->gradient[k] = (RfComplex){0, 0};
            if (!kept(t, i, j))
                continue;
            RfComplex w = t->vorticity[k];
            float kx = wavenumber_x(t, i), ky = wavenumber_y(t, j);
            t->flow[k] = flow_mode(t, i, j);
            t->gradient[k] = (RfComplex){-kx * w.i - ky * w.r, kx * w.r - ky * w.i};
        }
    rf_fourier_transform(t->fourier, t->flow, true);
    rf_fourier_transform(t->fourier, t->gradient, true);
}

/// gradient = -(u . grad w) of the vorticity as it is, as modes.
static void find_advection(Turbulence *t)
{
    to_space(t);
    size_t count = (size_t)t->width * (size_t)t->height;
    float scale = -1 / (float)count;
    for (size_t k = 0; k < count; ++k)
    {
        RfComplex u = t->flow[k], g = t->gradient[k];
        t->gradient[k] = (RfComplex){scale * (u.r * g.r + u.i * g.i), 0};
    }
    rf_fourier_transform(t->fourier, t->gradient, false);
}

static double energy(const Turbulence *t, float from, float to)
{
    double sum = 0;
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
        {
            float k = waves(t, i, j);
            if (!kept(t, i, j) || k < from || k >= to)
                continue;
            RfComplex u = flow_mode(t, i, j);
            sum += (double)(u.r * u.r + u.i * u.i);
        }
    return sum;
}

/// Multiplies the forced band so that the mean square speed is rms^2 again.
static void force(Turbulence *t)
{
    double wanted = (double)t->rms * t->rms, all = energy(t, 0, INFINITY), band = energy(t, forced_from, forced_to);
    float factor = (float)sqrt(fmax(0.25, 1 + (wanted - all) / fmax(band, 1e-30)));
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
        {
            float k = waves(t, i, j);
            RfComplex *w = &t->vorticity[(size_t)j * (size_t)t->width + (size_t)i];
            float scale = k >= forced_from && k < forced_to ? factor : 1;
            *w = (RfComplex){scale * w->r, scale * w->i};
        }
}

static void step(Turbulence *t)
{
    static const float keep[3] = {0, -5.0f / 9, -153.0f / 128}, add[3] = {1.0f / 3, 15.0f / 16, 8.0f / 15};
    size_t count = (size_t)t->width * (size_t)t->height;
    for (int stage = 0; stage < 3; ++stage)
    {
        find_advection(t);
        for (size_t k = 0; k < count; ++k)
        {
            RfComplex *s = &t->slope[k], *w = &t->vorticity[k];
            s->r = (stage ? keep[stage] * s->r : 0) + t->time_step * t->gradient[k].r;
            s->i = (stage ? keep[stage] * s->i : 0) + t->time_step * t->gradient[k].i;
            w->r += add[stage] * s->r;
            w->i += add[stage] * s->i;
        }
    }
    for (size_t k = 0; k < count; ++k)
    {
        t->vorticity[k].r *= t->loss[k];
        t->vorticity[k].i *= t->loss[k];
    }
    force(t);
}

/// White noise in space, then the forced band of it with the right energy.
static void start(Turbulence *t, uint64_t seed)
{
    size_t count = (size_t)t->width * (size_t)t->height;
    for (size_t k = 0; k < count; ++k)
        t->vorticity[k] = (RfComplex){rf_random_float(seed, 0, k, 0) - 0.5f, 0};
    rf_fourier_transform(t->fourier, t->vorticity, false);
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
            if (waves(t, i, j) < forced_from || waves(t, i, j) >= forced_to || !kept(t, i, j))
                t->vorticity[(size_t)j * (size_t)t->width + (size_t)i] = (RfComplex){0, 0};
    double all = energy(t, 0, INFINITY);
    float scale = all > 0 ? (float)(t->rms / sqrt(all)) : 0;
    for (size_t k = 0; k < count; ++k)
        t->vorticity[k] = (RfComplex){scale * t->vorticity[k].r, scale * t->vorticity[k].i};
}

/// Loss in a step of time_step. The rate of a turn in the forced band sets both ends.
static void find_losses(Turbulence *t)
{
    float side = (float)rf_min_int(t->out_width, t->out_height);
    float turn = t->rms * 2 * RF_PI * forced_from / side;
    float finest = (float)rf_min_int(t->width, t->height) / 3;
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
        {
            float k = waves(t, i, j), fine = k / finest;
            float rate = 6 * turn * fine * fine * fine * fine + (k < forced_from ? 0.25f * turn : 0);
            t->loss[(size_t)j * (size_t)t->width + (size_t)i] = kept(t, i, j) ? expf(-rate * t->time_step) : 0;
        }
}

static int power_of_two_up_to(int x)
{
    int power = 4;
    while (2 * power <= x)
        power *= 2;
    return power;
}

static void choose_grid(Turbulence *t, int width, int height)
{
    int small = rf_min_int(rf_min_int(width, height), SHORT_SIDE);
    double longer = (double)rf_max_int(width, height) / rf_min_int(width, height) * small;
    int short_side = power_of_two_up_to(small), long_side = power_of_two_up_to((int)fmin(longer * 1.42, LONG_SIDE));
    long_side = rf_min_int(long_side, power_of_two_up_to(rf_max_int(width, height)));
    t->width = width >= height ? long_side : short_side;
    t->height = width >= height ? short_side : long_side;
    t->out_width = width;
    t->out_height = height;
}

static void destroy(void *state)
{
    Turbulence *t = state;
    if (!t)
        return;
    rf_fourier_destroy(t->fourier);
    rf_fourier_destroy(t->out_fourier);
    void *blocks[] = {t->vorticity, t->first, t->slope, t->flow, t->gradient, t->out, t->loss, t};
    for (size_t i = 0; i < sizeof blocks / sizeof blocks[0]; ++i)
        rf_release(blocks[i]);
}

static RfResult allocate(Turbulence *t)
{
    size_t count = (size_t)t->width * (size_t)t->height;
    RfComplex **fields[] = {&t->vorticity, &t->first, &t->slope, &t->flow, &t->gradient};
    for (size_t i = 0; i < sizeof fields / sizeof fields[0]; ++i)
        if (!(*fields[i] = rf_allocate_zero(count, sizeof(RfComplex))))
            return RF_OUT_OF_MEMORY;
    t->loss = rf_allocate(count, sizeof(float));
    t->out = rf_allocate((size_t)t->out_width * (size_t)t->out_height, sizeof(RfComplex));
    if (!t->loss || !t->out)
        return RF_OUT_OF_MEMORY;
    RF_TRY(rf_fourier_create(t->width, t->height, &t->fourier));
    return rf_fourier_create(t->out_width, t->out_height, &t->out_fourier);
}

/// Runs long enough for the first vortices to roll up: half a shorter side at the greatest speed.
static RfResult settle(Turbulence *t, float speed)
{
    float side = (float)rf_min_int(t->out_width, t->out_height);
    float cell = fminf((float)t->out_width / (float)t->width, (float)t->out_height / (float)t->height);
    float frame_step = t->time_step;
    t->time_step = 0.5f * cell / speed;
    find_losses(t);
    int steps = (int)(0.7f * side / (speed * t->time_step));
    for (int i = 0; i < steps; ++i)
    {
        RF_TRY(rf_progress("starting the turbulence", (double)i / steps));
        step(t);
    }
    t->time_step = frame_step;
    find_losses(t);
    return RF_OK;
}

static RfResult create(const RfParameters *parameters, void **state)
{
    Turbulence *t = rf_allocate_zero(1, sizeof *t);
    if (!t)
        return RF_OUT_OF_MEMORY;
    choose_grid(t, parameters->width, parameters->height);
    RfResult result = allocate(t);
    if (result != RF_OK)
    {
        destroy(t);
        return result;
    }
    float speed = (float)rf_parameter(parameters, "speed");
    float cell = fminf((float)t->out_width / (float)t->width, (float)t->out_height / (float)t->height);
    t->rms = speed / peak;
    t->steps_a_frame = rf_max_int(1, (int)ceilf(speed / (0.5f * cell)));
    t->time_step = 1 / (float)t->steps_a_frame;
    start(t, (uint64_t)rf_parameter(parameters, "seed"));
    result = settle(t, speed);
    if (result != RF_OK)
    {
        destroy(t);
        return result;
    }
    memcpy(t->first, t->vorticity, (size_t)t->width * (size_t)t->height * sizeof *t->first);
    *state = t;
    return RF_OK;
}

static void restart(void *state)
{
    Turbulence *t = state;
    memcpy(t->vorticity, t->first, (size_t)t->width * (size_t)t->height * sizeof *t->first);
}

static void advance(void *state)
{
    Turbulence *t = state;
    for (int i = 0; i < t->steps_a_frame; ++i)
        step(t);
}

static RfResult draw(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)parameters;
    (void)moment;
    Turbulence *t = state;
    size_t count = (size_t)t->out_width * (size_t)t->out_height;
    memset(t->out, 0, count * sizeof *t->out);
    for (int j = 0; j < t->height; ++j)
        for (int i = 0; i < t->width; ++i)
        {
            int x = rf_wrap_int(wave(i, t->width), t->out_width), y = rf_wrap_int(wave(j, t->height), t->out_height);
            if (kept(t, i, j))
                t->out[(size_t)y * (size_t)t->out_width + (size_t)x] = flow_mode(t, i, j);
        }
    rf_fourier_transform(t->out_fourier, t->out, true);
    for (size_t k = 0; k < count; ++k)
    {
        field->velocity[2 * k] = t->out[k].r;
        field->velocity[2 * k + 1] = t->out[k].i;
    }
    return RF_OK;
}

const RfSceneClass rf_scene_turbulence = {
    .name = "turbulence",
    .defaults = "size=256x256&speed=2&seed=1",
    .ranges = (const RfParameterRange[]){{"size", RF_PARAMETER_SIZE, 16, 4096},
                                         {"speed", RF_PARAMETER_NUMBER, 0.001, 100},
                                         {"seed", RF_PARAMETER_INTEGER, 0, 4294967295.0},
                                         {0}},
    .sentence = "Forced two-dimensional turbulence on a periodic domain (a Navier-Stokes run), without end; speed is "
                "about its greatest.",
    .most_aspect = 8,
    .moment_count = 0,
    .create = create,
    .restart = restart,
    .advance = advance,
    .draw = draw,
    .destroy = destroy,
};
