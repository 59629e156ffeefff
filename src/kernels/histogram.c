// SPDX-License-Identifier: Apache-2.0
// Heitz, Neyret. High-performance by-example noise using a histogram-preserving blending operator. 2018.
// Deliot, Heitz. Procedural stochastic textures by tiling and blending. GPU Zen 2, 2019 (tables prefiltered by level).
//
// Forward: along each principal axis a pixel's value is replaced by the Gaussian quantile of its rank, ties in the
// order of the pixels. Blending Gaussians with weights of unit square sum keeps them Gaussian, and the inverse table,
// which is the sorted list of values read at the Gaussian's distribution function, brings the histogram back exactly.
// Ties cost nothing: their quantiles all map back to one value.
//
// A texture level L is an average: its variance is v_L < 1. What was averaged away is N(0, 1 - v_L), so the table of
// level L is the first one convolved with that Gaussian.

#include "kernels/histogram.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <stdlib.h>
#include <string.h>

typedef struct Ranked
{
    float value;
    uint32_t pixel;
} Ranked;

static int compare_ranked(const void *left, const void *right)
{
    const Ranked *p = left, *q = right;
    if (p->value != q->value)
        return p->value < q->value ? -1 : 1;
    return p->pixel < q->pixel ? -1 : p->pixel > q->pixel;
}

// The inverse of the standard normal's distribution function, by bisection refined with Newton's rule: made once a
// pixel, at creation only.
static double normal_quantile(double p)
{
    double low = -9, high = 9;
    for (int i = 0; i < 20; ++i)
    {
        double middle = 0.5 * (low + high);
        if (0.5 * erfc(-middle * M_SQRT1_2) < p)
            low = middle;
        else
            high = middle;
    }
    double x = 0.5 * (low + high);
    return x - (0.5 * erfc(-x * M_SQRT1_2) - p) * sqrt(2 * M_PI) * exp(0.5 * x * x);
}

// Jacobi rotations on the symmetric matrix m; the columns of v become its eigenvectors.
static void eigen_3x3(double m[3][3], double v[3][3])
{
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j)
            v[i][j] = i == j;
    for (int sweep = 0; sweep < 16; ++sweep)
        for (int p = 0; p < 2; ++p)
            for (int q = p + 1; q < 3; ++q)
            {
                if (fabs(m[p][q]) < 1e-30)
                    continue;
                double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
                double t = copysign(1, theta) / (fabs(theta) + sqrt(theta * theta + 1)), c = 1 / sqrt(t * t + 1),
                       s = t * c;
                for (int k = 0; k < 3; ++k)
                {
                    double a = m[k][p], b = m[k][q];
                    m[k][p] = c * a - s * b;
                    m[k][q] = s * a + c * b;
                }
                for (int k = 0; k < 3; ++k)
                {
                    double a = m[p][k], b = m[q][k];
                    m[p][k] = c * a - s * b;
                    m[q][k] = s * a + c * b;
                    a = v[k][p];
                    b = v[k][q];
                    v[k][p] = c * a - s * b;
                    v[k][q] = s * a + c * b;
                }
            }
}

static void principal_axes(const float *pixels, size_t count, size_t stride, float axes[3][3])
{
    double mean[3] = {0}, m[3][3] = {{0}}, v[3][3];
    for (size_t i = 0; i < count; ++i)
        for (int c = 0; c < 3; ++c)
            mean[c] += (double)pixels[i * stride + (size_t)c] / (double)count;
    for (size_t i = 0; i < count; ++i)
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
                m[a][b] += ((double)pixels[i * stride + (size_t)a] - mean[a]) *
                           ((double)pixels[i * stride + (size_t)b] - mean[b]);
    eigen_3x3(m, v);
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 2; ++i)
        for (int j = 0; j < 2 - i; ++j)
            if (m[order[j]][order[j]] < m[order[j + 1]][order[j + 1]])
            {
                int swap = order[j];
                order[j] = order[j + 1];
                order[j + 1] = swap;
            }
    for (int a = 0; a < 3; ++a)
        for (int c = 0; c < 3; ++c)
            axes[a][c] = (float)v[c][order[a]];
}

static void measure_range(const float *pixels, size_t count, size_t stride, RfHistogram *out)
{
    for (int c = 0; c < out->channels; ++c)
    {
        out->low[c] = out->high[c] = pixels[c];
        for (size_t i = 1; i < count; ++i)
        {
            out->low[c] = rf_min(out->low[c], pixels[i * stride + (size_t)c]);
            out->high[c] = rf_max(out->high[c], pixels[i * stride + (size_t)c]);
        }
    }
}

static void rotate_to_axes(float *pixels, size_t count, size_t stride, const float axes[3][3])
{
    for (size_t i = 0; i < count; ++i)
    {
        float *p = pixels + i * stride, r[3];
        for (int a = 0; a < 3; ++a)
            r[a] = axes[a][0] * p[0] + axes[a][1] * p[1] + axes[a][2] * p[2];
        memcpy(p, r, sizeof r);
    }
}

static void fill_inverse(const Ranked *ranked, size_t count, float *table)
{
    for (int i = 0; i < RF_INVERSE_SIZE; ++i)
    {
        double g = ((double)i / (RF_INVERSE_SIZE - 1) * 2 - 1) * RF_INVERSE_REACH;
        double rank = 0.5 * erfc(-g * M_SQRT1_2) * (double)count - 0.5;
        rank = fmin(fmax(rank, 0), (double)(count - 1));
        size_t low = (size_t)rank, high = low + 1 < count ? low + 1 : low;
        table[i] = rf_lerp(ranked[low].value, ranked[high].value, (float)(rank - (double)low));
    }
}

static float ranked_variance(const Ranked *ranked, size_t count)
{
    double mean = 0, sum = 0;
    for (size_t i = 0; i < count; ++i)
        mean += (double)ranked[i].value / (double)count;
    for (size_t i = 0; i < count; ++i)
        sum += ((double)ranked[i].value - mean) * ((double)ranked[i].value - mean) / (double)count;
    return (float)sum;
}

static float *table_of(const RfHistogram *histogram, int level, int channel)
{
    return histogram->inverse + (size_t)(level * histogram->channels + channel) * RF_INVERSE_SIZE;
}

RfResult rf_histogram_create(float *pixels, size_t count, size_t stride, int channels, RfHistogram *out)
{
    assert(channels >= 1 && channels <= RF_HISTOGRAM_CHANNELS && count > 0 && count <= UINT32_MAX);
    *out = (RfHistogram){.channels = channels, .axes = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    out->inverse = rf_allocate((size_t)(RF_TEXTURE_LEVELS * channels), RF_INVERSE_SIZE * sizeof(float));
    Ranked *ranked = rf_allocate(count, sizeof *ranked);
    if (!out->inverse || !ranked)
    {
        rf_release(ranked);
        rf_histogram_free(out);
        return RF_OUT_OF_MEMORY;
    }
    measure_range(pixels, count, stride, out);
    if (channels == 3)
    {
        principal_axes(pixels, count, stride, out->axes);
        rotate_to_axes(pixels, count, stride, (const float(*)[3])out->axes);
    }
    for (int c = 0; c < channels; ++c)
    {
        for (size_t i = 0; i < count; ++i)
            ranked[i] = (Ranked){pixels[i * stride + (size_t)c], (uint32_t)i};
        qsort(ranked, count, sizeof *ranked, compare_ranked);
        out->variance[c] = ranked_variance(ranked, count);
        for (int level = 0; level < RF_TEXTURE_LEVELS; ++level)
            fill_inverse(ranked, count, table_of(out, level, c));
        for (size_t i = 0; i < count; ++i)
            pixels[ranked[i].pixel * stride + (size_t)c] = (float)normal_quantile(((double)i + 0.5) / (double)count);
    }
    rf_release(ranked);
    return RF_OK;
}

void rf_histogram_free(RfHistogram *histogram)
{
    rf_release(histogram->inverse);
    histogram->inverse = NULL;
}

void rf_histogram_fit_levels(RfHistogram *histogram, const RfTexture *texture, const int *lanes)
{
    const double step = 2 * RF_INVERSE_REACH / (RF_INVERSE_SIZE - 1);
    for (int c = 0; c < histogram->channels; ++c)
    {
        const float *sharp = table_of(histogram, 0, c);
        for (int level = 1; level < texture->level_count; ++level)
        {
            double lost = sqrt(fmax(1 - rf_texture_variance(texture, level, lanes[c]), 0));
            float *table = table_of(histogram, level, c);
            int reach = (int)(3 * lost / step);
            for (int i = 0; i < RF_INVERSE_SIZE && reach > 0; ++i)
            {
                double sum = 0, total = 0;
                for (int k = -reach; k <= reach; ++k)
                {
                    double x = k * step / lost, weight = exp(-0.5 * x * x);
                    sum += weight * (double)sharp[rf_clamp_int(i + k, 0, RF_INVERSE_SIZE - 1)];
                    total += weight;
                }
                table[i] = (float)(sum / total);
            }
        }
    }
}

void rf_histogram_invert(const RfHistogram *histogram, int level, const float *g, float *value)
{
    float along[3];
    for (int c = 0; c < histogram->channels; ++c)
    {
        const float *table = table_of(histogram, level, c);
        float x = rf_clamp((g[c] + RF_INVERSE_REACH) * ((RF_INVERSE_SIZE - 1) / (2 * RF_INVERSE_REACH)), 0,
                           RF_INVERSE_SIZE - 1.001f);
        int i = (int)x;
        along[c] = rf_lerp(table[i], table[i + 1], x - (float)i);
    }
    if (histogram->channels < 3)
    {
        memcpy(value, along, (size_t)histogram->channels * sizeof *value);
        return;
    }
    for (int c = 0; c < 3; ++c)
        value[c] = rf_clamp(histogram->axes[0][c] * along[0] + histogram->axes[1][c] * along[1] +
                                histogram->axes[2][c] * along[2],
                            histogram->low[c], histogram->high[c]);
}
