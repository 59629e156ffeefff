// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch 2009, equations 2 and 3 (3 with its root and mean put back), and one between them.
//
// With pictures of equal variance v and pairwise correlation rho_ij, sum_i w_i T_i has the variance v (sum w_i^2 +
// sum_(i != j) rho_ij w_i w_j). Dividing by the root of the bracket brings v back. Independent pictures (rho = 0) give
// equation 3; equal ones (rho = 1) give the plain mean.
//
// Deviation: of a colour only the luma is blended so, and the plainly blended colour is brought to that luma. Taken
// channel by channel the form overshoots in each by itself, and two dark greys on a warm mean come out blue.

#include "kernels/resolving.h"
#include "core/maths.h"
#include "core/simd.h"

#include <assert.h>
#include <math.h>

// 1 / sqrt(x) by three of Newton's steps from an estimate by exponent: as exact as a float holds, for a third of what
// root and division take.
RF_WIDE_BODY float inverse_root(float x)
{
    union
    {
        float f;
        int32_t i;
    } bits = {x};
    bits.i = 0x5f3759df - (bits.i >> 1);
    float y = bits.f, half = 0.5f * x;
    y *= 1.5f - half * y * y;
    y *= 1.5f - half * y * y;
    return y * (1.5f - half * y * y);
}

RF_WIDE_BODY void rf_resolve_scales_body(const float *restrict weight, const float *restrict weight2,
                                         const float *restrict rho, int count, float *restrict inverse_sum,
                                         float *restrict inverse_norm)
{
#pragma omp simd
    for (int k = 0; k < count; ++k)
    {
        float w = weight[k], w2 = weight2[k], norm2 = w2 + rho[k] * rf_max(w * w - w2, 0), sum = w > 0 ? 1 / w : 0;
        inverse_sum[k] = sum;
        // Squares of weights under 1e-18 are no numbers to take a root of; the mean stands in.
        inverse_norm[k] = norm2 > 1e-36f ? inverse_root(norm2) : sum;
    }
}

RF_WIDE(rf_resolve_scales,
        (const float *weight, const float *weight2, const float *rho, int count, float *inverse_sum,
         float *inverse_norm),
        (weight, weight2, rho, count, inverse_sum, inverse_norm))

// How much brighter the contrast-preserving blend is than the plain one; 1 where that means nothing.
RF_WIDE_BODY float luma_ratio(const float *colour, float middle, float inverse_sum, float inverse_norm)
{
    float sum = rf_luma(colour[0], colour[1], colour[2]), plain = middle + sum * inverse_sum,
          wanted = middle + sum * inverse_norm;
    float ratio = rf_min(rf_max(wanted / rf_max(plain, 1e-3f), 0), 4);
    return plain > 1e-3f ? ratio : 1;
}

RF_WIDE_BODY void rf_resolve_row_body(const float *restrict colour, const float *restrict inverse_sum,
                                      const float *restrict inverse_norm, const RfResolveQuad *quad, int count,
                                      float *restrict values)
{
    for (int k = 0; k < count; ++k)
    {
        float ratio = quad->colour ? luma_ratio(colour + 4 * k, rf_luma(quad->mean[0], quad->mean[1], quad->mean[2]),
                                                inverse_sum[k], inverse_norm[k])
                                   : 1;
        for (int c = 0; c < 4; ++c)
        {
            bool plain = quad->plain[c] > 0 || (quad->colour && c < 3);
            float value = quad->mean[c] + colour[4 * k + c] * (plain ? inverse_sum[k] : inverse_norm[k]);
            value = quad->colour && c < 3 ? value * ratio : value;
            value = value > quad->low[c] ? value : quad->low[c];
            values[4 * k + c] = value < quad->high[c] ? value : quad->high[c];
        }
    }
}

RF_WIDE(rf_resolve_row,
        (const float *colour, const float *inverse_sum, const float *inverse_norm, const RfResolveQuad *quad, int count,
         float *values),
        (colour, inverse_sum, inverse_norm, quad, count, values))

typedef float Vec4 __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t Mask4 __attribute__((vector_size(16), may_alias));

RF_WIDE_BODY Vec4 select4(Mask4 mask, Vec4 yes, Vec4 no)
{
    return (Vec4)((mask & (Mask4)yes) | (~mask & (Mask4)no));
}

RF_WIDE_BODY void rf_resolve_rgb_body(const float *restrict colour, const float *restrict inverse_sum,
                                      const float *restrict inverse_norm, const RfResolveQuad *quad, int count,
                                      float *restrict values)
{
    Vec4 mean = *(const Vec4 *)quad->mean, low = *(const Vec4 *)quad->low, high = *(const Vec4 *)quad->high;
    float ratio[RF_TILE_COLUMNS];
    float middle = rf_luma(quad->mean[0], quad->mean[1], quad->mean[2]);
#pragma omp simd
    for (int k = 0; k < count; ++k)
        ratio[k] = luma_ratio(colour + 4 * k, middle, inverse_sum[k], inverse_norm[k]);
    for (int k = 0; k < count; ++k)
    {
        Vec4 value = (mean + *(const Vec4 *)(colour + 4 * k) * inverse_sum[k]) * ratio[k];
        value = select4(value > low, value, low);
        value = select4(value < high, value, high);
        if (k + 1 < count)
            *(Vec4 *)(values + 3 * k) = value; // The fourth number is the next pixel's first, written after this.
        else
            for (int c = 0; c < 3; ++c)
                values[3 * k + c] = value[c];
    }
}

RF_WIDE(rf_resolve_rgb,
        (const float *colour, const float *inverse_sum, const float *inverse_norm, const RfResolveQuad *quad, int count,
         float *values),
        (colour, inverse_sum, inverse_norm, quad, count, values))
