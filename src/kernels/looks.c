// SPDX-License-Identifier: Apache-2.0
#include "kernels/looks.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <math.h>
#include <stdlib.h>

typedef struct Ranked
{
    float mean, deviation;
    int pixel;
} Ranked;

// Of equals the first pixel comes first, so that classes do not depend on the sorting.
static int by_mean(const void *a, const void *b)
{
    const Ranked *p = a, *q = b;
    return p->mean != q->mean ? (p->mean > q->mean) - (p->mean < q->mean) : p->pixel - q->pixel;
}

static int by_deviation(const void *a, const void *b)
{
    const Ranked *p = a, *q = b;
    return p->deviation != q->deviation ? (p->deviation > q->deviation) - (p->deviation < q->deviation)
                                        : p->pixel - q->pixel;
}

// Sums over the squares, by sums over rows.
static void rank(const float *values, int width, int height, bool tiles, int radius, double (*rows)[2], Ranked *out)
{
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            double *sums = rows[(size_t)y * (size_t)width + (size_t)x];
            sums[0] = sums[1] = 0;
            for (int i = -radius; i <= radius; ++i)
            {
                double value = (double)values[(ptrdiff_t)y * width + rf_border_int(x + i, width, tiles)];
                sums[0] += value;
                sums[1] += value * value;
            }
        }
    double area = (double)(2 * radius + 1) * (double)(2 * radius + 1);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            double sum = 0, squares = 0;
            for (int j = -radius; j <= radius; ++j)
            {
                const double *sums = rows[(ptrdiff_t)rf_border_int(y + j, height, tiles) * width + x];
                sum += sums[0];
                squares += sums[1];
            }
            int pixel = y * width + x;
            out[pixel] =
                (Ranked){(float)(sum / area), (float)sqrt(fmax(squares / area - sum * sum / area / area, 0)), pixel};
        }
}

RfResult rf_looks_find(const float *values, int width, int height, bool tiles, int radius, uint8_t *looks)
{
    size_t pixels = (size_t)width * (size_t)height;
    double(*rows)[2] = rf_allocate(pixels, sizeof *rows);
    Ranked *ranked = rf_allocate(pixels, sizeof *ranked);
    if (rows && ranked)
    {
        rank(values, width, height, tiles, radius, rows, ranked);
        qsort(ranked, pixels, sizeof *ranked, by_mean);
        for (size_t q = 0; q < RF_LOOK_QUANTILES; ++q)
        {
            size_t from = q * pixels / RF_LOOK_QUANTILES, to = (q + 1) * pixels / RF_LOOK_QUANTILES;
            qsort(ranked + from, to - from, sizeof *ranked, by_deviation);
            for (size_t i = from; i < to; ++i)
                looks[ranked[i].pixel] =
                    (uint8_t)(q * RF_LOOK_QUANTILES + (i - from) * RF_LOOK_QUANTILES / (to - from));
        }
    }
    RfResult result = rows && ranked ? RF_OK : RF_OUT_OF_MEMORY;
    rf_release(rows);
    rf_release(ranked);
    return result;
}

void rf_looks_shares(const int64_t count[RF_LOOKS], float most, float shares[RF_LOOKS])
{
    int64_t total = 0;
    for (int k = 0; k < RF_LOOKS; ++k)
        total += count[k];
    for (int k = 0; k < RF_LOOKS; ++k)
        shares[k] = total > 0 ? rf_min((float)count[k] * RF_LOOKS / (float)total, most) : 1;
}
