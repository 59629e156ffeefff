// SPDX-License-Identifier: Apache-2.0
#include "fluids/drawing.h"

#include "core/progress.h"
#include "data/colour.h"

enum
{
    SAMPLES = 2
};

const RfParameterRange rf_drawing_ranges[] = {{"size", RF_PARAMETER_SIZE, 8, 4096},
                                              {"seed", RF_PARAMETER_INTEGER, 0, 4294967295.0},
                                              {"scale", RF_PARAMETER_NUMBER, 0.5, 4},
                                              {0}};

typedef struct Canvas
{
    const RfTorus *torus;
    const RfImageView *image;
    RfPaintFn *paint;
    const void *context;
} Canvas;

RfTorus rf_torus(const RfParameters *parameters)
{
    float unit = (float)rf_min_int(parameters->width, parameters->height) * (float)rf_parameter(parameters, "scale");
    return (RfTorus){.span_x = (float)parameters->width / unit,
                     .span_y = (float)parameters->height / unit,
                     .seed = (uint64_t)rf_parameter(parameters, "seed")};
}

static void paint_pixel(const Canvas *canvas, int i, int j, float *pixel)
{
    const RfImageView *image = canvas->image;
    float sum[RF_MAX_CHANNELS] = {0}, colour[RF_MAX_CHANNELS];
    for (int k = 0; k < SAMPLES * SAMPLES; ++k)
    {
        float x = (float)i + ((float)(k % SAMPLES) + 0.5f) / SAMPLES;
        float y = (float)j + ((float)(k / SAMPLES) + 0.5f) / SAMPLES;
        canvas->paint(canvas->context, x / (float)image->width * canvas->torus->span_x,
                      y / (float)image->height * canvas->torus->span_y, colour);
        for (int c = 0; c < image->channels; ++c)
            sum[c] += c < 3 ? rf_srgb_to_linear(rf_clamp(colour[c], 0, 1)) : colour[c];
    }
    for (int c = 0; c < image->channels; ++c)
    {
        float mean = sum[c] / (SAMPLES * SAMPLES);
        pixel[c] = c < 3 ? rf_linear_to_srgb(mean) : mean;
    }
}

static void paint_row(void *context, int item, int worker)
{
    (void)worker;
    const Canvas *canvas = context;
    for (int i = 0; i < canvas->image->width; ++i)
        paint_pixel(canvas, i, item,
                    canvas->image->pixels + (ptrdiff_t)item * canvas->image->row_stride + i * canvas->image->channels);
}

RfResult rf_paint(const RfTorus *torus, const RfImageView *image, RfPaintFn *paint, const void *context)
{
    Canvas canvas = {torus, image, paint, context};
    return rf_progress_for("drawing the exemplar", 0, 1, image->height, paint_row, &canvas);
}

/// Dot product of a lattice point's random direction, one of sixteen, with the way from it to the point.
static inline float lattice_slope(uint64_t key, int i, int j, float s, float t)
{
    static const float ways[16] = {1,  0.92388f,  0.70711f,  0.38268f,  0, -0.38268f, -0.70711f, -0.92388f,
                                   -1, -0.92388f, -0.70711f, -0.38268f, 0, 0.38268f,  0.70711f,  0.92388f};
    uint64_t way = rf_hash64(key ^ (((uint64_t)(uint32_t)j << 32) | (uint32_t)i)) >> 60;
    return ways[way] * s + ways[(way + 12) & 15] * t;
}

/// floorf as an int, without a call into the mathematics library.
static inline int floor_int(float x)
{
    int i = (int)x;
    return i - (x < (float)i);
}

float rf_torus_noise(const RfTorus *torus, float x, float y, float cells, uint64_t stream)
{
    uint64_t key = rf_hash64(torus->seed ^ (stream << 32));
    int columns = rf_max_int(1, (int)(cells * torus->span_x + 0.5f));
    int rows = rf_max_int(1, (int)(cells * torus->span_y + 0.5f));
    float u = x / torus->span_x * (float)columns, v = y / torus->span_y * (float)rows;
    int iu = floor_int(u), iv = floor_int(v);
    float s = u - (float)iu, t = v - (float)iv;
    int i0 = rf_wrap_int(iu, columns), i1 = i0 + 1 < columns ? i0 + 1 : 0;
    int j0 = rf_wrap_int(iv, rows), j1 = j0 + 1 < rows ? j0 + 1 : 0;
    float fade_s = s * s * s * (s * (s * 6 - 15) + 10), fade_t = t * t * t * (t * (t * 6 - 15) + 10);
    float top = rf_lerp(lattice_slope(key, i0, j0, s, t), lattice_slope(key, i1, j0, s - 1, t), fade_s);
    float bottom = rf_lerp(lattice_slope(key, i0, j1, s, t - 1), lattice_slope(key, i1, j1, s - 1, t - 1), fade_s);
    return 1.5f * rf_lerp(top, bottom, fade_t);
}

float rf_torus_octaves(const RfTorus *torus, float x, float y, float cells, int octaves, uint64_t stream)
{
    float sum = 0, amplitude = 0.6f;
    for (int octave = 0; octave < octaves; ++octave)
    {
        sum += amplitude * rf_torus_noise(torus, x, y, cells, stream + (uint64_t)octave);
        amplitude *= 0.5f;
        cells *= 2;
    }
    return sum;
}
