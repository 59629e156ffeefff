// SPDX-License-Identifier: Apache-2.0
#include "kernels/pyramid.h"
#include "core/maths.h"
#include "core/parallel.h"

typedef struct Halving
{
    const float *pixels;
    float *half;
    int width, height, channels;
    bool tiles;
} Halving;

static int reflect(const Halving *h, int i, int n)
{
    return h->tiles ? rf_wrap_int(i, n) : rf_mirror_int(i, n);
}

// (1 3 3 1) / 8 in both directions.
static void halve_row(void *context, int y, int worker)
{
    (void)worker;
    static const float taps[4] = {0.125f, 0.375f, 0.375f, 0.125f};
    const Halving *h = context;
    int width = (h->width + 1) / 2;
    for (int x = 0; x < width; ++x)
        for (int c = 0; c < h->channels; ++c)
        {
            float sum = 0;
            for (int j = 0; j < 4; ++j)
            {
                const float *row =
                    h->pixels + (size_t)reflect(h, 2 * y + j - 1, h->height) * (size_t)h->width * (size_t)h->channels;
                for (int i = 0; i < 4; ++i)
                    sum += taps[j] * taps[i] * row[reflect(h, 2 * x + i - 1, h->width) * h->channels + c];
            }
            h->half[((size_t)y * (size_t)width + (size_t)x) * (size_t)h->channels + (size_t)c] = sum;
        }
}

void rf_halve(const float *pixels, int width, int height, int channels, bool tiles, float *half)
{
    Halving h = {pixels, half, width, height, channels, tiles};
    rf_parallel_for((height + 1) / 2, halve_row, &h);
}
