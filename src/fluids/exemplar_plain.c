// SPDX-License-Identifier: Apache-2.0
// Two plain exemplars: noise for shaders and measurements, and a checker that shows every distortion.
//
// The noise is Gaussian with a chosen spectrum, made in the Fourier domain, so it tiles and has no lattice: amplitude
// falls as 1 / k^1.5 (each octave has half the variance of the coarser one) from waves of a quarter of the shorter side
// to 3 pixels, with soft ends. It is then squeezed a little at its tails so that it stays inside 0..1 without clipping.
#include "core/maths.h"
#include "core/memory.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"
#include "fluids/drawing.h"
#include "fluids/fourier.h"
#include "fluids/scene.h"

/// A standard normal number (Box and Muller).
static float normal(uint64_t seed, uint64_t item)
{
    float a = 1 - rf_random_float(seed, 0, item, 0), b = rf_random_float(seed, 0, item, 1);
    return sqrtf(-2 * logf(a)) * cosf(2 * RF_PI * b);
}

static float noise_amplitude(float k, float low, float high)
{
    if (k == 0)
        return 0;
    float rise = k / low, fall = k / high;
    rise = rise * rise * rise * rise;
    fall = fall * fall * fall * fall;
    return rise / (1 + rise) / (1 + fall) / (k * sqrtf(k));
}

/// Modes of white noise times the amplitude, in place.
static void filter(RfComplex *field, int width, int height, double scale)
{
    float side = (float)rf_min_int(width, height);
    float low = (float)(4 / scale) / side, high = fminf(0.33f, (float)(96 / scale) / side);
    for (int j = 0; j < height; ++j)
        for (int i = 0; i < width; ++i)
        {
            float kx = (float)(i <= width / 2 ? i : i - width) / (float)width;
            float ky = (float)(j <= height / 2 ? j : j - height) / (float)height;
            RfComplex *z = &field[(size_t)j * (size_t)width + (size_t)i];
            float amplitude = noise_amplitude(sqrtf(kx * kx + ky * ky), low, high);
            z->r *= amplitude;
            z->i *= amplitude;
        }
}

/// White noise in space, filtered there and back.
static RfResult make_field(const RfParameters *parameters, const RfImageView *image, RfFourier *fourier,
                           RfComplex *field)
{
    static const char stage[] = "drawing the exemplar";
    size_t width = (size_t)image->width;
    uint64_t seed = (uint64_t)rf_parameter(parameters, "seed");
    for (int j = 0; j < image->height; ++j)
    {
        if (j % 64 == 0)
            RF_TRY(rf_progress(stage, 0.4 * j / image->height));
        for (size_t k = (size_t)j * width; k < (size_t)(j + 1) * width; ++k)
            field[k] = (RfComplex){normal(seed, k), 0};
    }
    rf_fourier_transform(fourier, field, false);
    RF_TRY(rf_progress(stage, 0.6));
    filter(field, image->width, image->height, rf_parameter(parameters, "scale"));
    RF_TRY(rf_progress(stage, 0.7));
    rf_fourier_transform(fourier, field, true);
    return rf_progress(stage, 0.9);
}

static void show_field(const RfComplex *field, const RfImageView *image)
{
    size_t count = (size_t)image->width * (size_t)image->height;
    double squares = 0;
    for (size_t k = 0; k < count; ++k)
        squares += (double)field[k].r * field[k].r;
    float gain = squares > 0 ? (float)(0.42 / sqrt(squares / (double)count)) : 0;
    for (int j = 0; j < image->height; ++j)
        for (int i = 0; i < image->width; ++i)
        {
            float x = gain * field[(size_t)j * (size_t)image->width + (size_t)i].r;
            image->pixels[(ptrdiff_t)j * image->row_stride + i] = 0.5f + 0.5f * x / sqrtf(1 + x * x);
        }
}

static RfResult draw_noise(const RfParameters *parameters, const RfImageView *image)
{
    RfFourier *fourier;
    RF_TRY(rf_fourier_create(image->width, image->height, &fourier));
    RfComplex *field = rf_allocate((size_t)image->width * (size_t)image->height, sizeof *field);
    RfResult result = field ? make_field(parameters, image, fourier, field) : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
        show_field(field, image);
    rf_release(field);
    rf_fourier_destroy(fourier);
    return result;
}

/// Two colours of tile, each tile its own shade, so that one can be told from the next.
static void checker_colour(int x, int y, uint64_t seed, float colour[3])
{
    static const float tiles[2][3] = {{0.90f, 0.88f, 0.82f}, {0.15f, 0.30f, 0.47f}};
    float shade = 0.92f + 0.16f * rf_random_float(seed, (uint64_t)y, (uint64_t)x, 0);
    for (int c = 0; c < 3; ++c)
        colour[c] = shade * tiles[(x + y) & 1][c];
}

static RfResult draw_checker(const RfParameters *parameters, const RfImageView *image)
{
    uint64_t seed = (uint64_t)rf_parameter(parameters, "seed");
    // As square as the picture allows, and an even number each way, so that colours alternate across the border.
    float side = (float)rf_min_int(image->width, image->height) / (float)rf_parameter(parameters, "squares");
    int columns = 2 * rf_max_int(1, (int)lroundf((float)image->width / side / 2));
    int rows = 2 * rf_max_int(1, (int)lroundf((float)image->height / side / 2));
    for (int j = 0; j < image->height; ++j)
        for (int i = 0; i < image->width; ++i)
            checker_colour((int)((int64_t)i * columns / image->width), (int)((int64_t)j * rows / image->height), seed,
                           image->pixels + (ptrdiff_t)j * image->row_stride + 3 * i);
    return RF_OK;
}

const RfExemplarClass rf_exemplar_noise = {
    .name = "noise",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Smooth grey noise of many octaves, the same in every direction, for shaders and measurements.",
    .channels = 1,
    .draw = draw_noise,
};

const RfExemplarClass rf_exemplar_checker = {
    .name = "checker",
    .defaults = "size=256&seed=1&squares=8",
    .ranges = (const RfParameterRange[]){{"size", RF_PARAMETER_SIZE, 8, 4096},
                                         {"seed", RF_PARAMETER_INTEGER, 0, 4294967295.0},
                                         {"squares", RF_PARAMETER_INTEGER, 1, 512},
                                         {0}},
    .sentence = "Squares in two colours, each of its own shade; squares is their number along the shorter side.",
    .channels = 3,
    .draw = draw_checker,
};
