// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/histogram.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    SIDE = 64,
    COUNT = SIDE * SIDE,
    STRIDE = 4
};

static float g_pixels[COUNT * STRIDE], g_given[COUNT * STRIDE], g_sorted[COUNT];

static float noise(size_t pixel, int channel)
{
    return rf_random_float(1, 0, pixel, (uint64_t)channel);
}

// A skewed distribution with two humps; channels partly alike. Channel 3 is another map's and must stay as it is.
static void make_pixels(void)
{
    for (size_t i = 0; i < COUNT; ++i)
    {
        float common = noise(i, 0) * noise(i, 0) + (noise(i, 5) < 0.3f ? 1 : 0);
        for (int c = 0; c < STRIDE; ++c)
            g_given[i * STRIDE + (size_t)c] = common * (1 + 0.5f * (float)c) + 0.2f * noise(i, c + 1);
    }
    memcpy(g_pixels, g_given, sizeof g_pixels);
}

static void assert_gaussian(int channels)
{
    for (int c = 0; c < channels; ++c)
    {
        double sum = 0, squares = 0, fourth = 0;
        for (size_t i = 0; i < COUNT; ++i)
        {
            double g = (double)g_pixels[i * STRIDE + (size_t)c];
            sum += g / COUNT;
            squares += g * g / COUNT;
            fourth += g * g * g * g / COUNT;
        }
        assert_true(fabs(sum) < 1e-3);
        assert_true(fabs(squares - 1) < 5e-3);
        assert_true(fabs(fourth - 3) < 0.1);
    }
}

static int compare(const void *a, const void *b)
{
    return *(const float *)a < *(const float *)b ? -1 : *(const float *)a > *(const float *)b;
}

// Along an axis: a value of the picture before it was made Gaussian.
static float along(const RfHistogram *h, const float *pixel, int axis)
{
    if (h->channels < 3)
        return pixel[axis];
    return h->axes[axis][0] * pixel[0] + h->axes[axis][1] * pixel[1] + h->axes[axis][2] * pixel[2];
}

// Every pixel maps back to a value whose rank is its own, give or take what lies between two entries of the table.
static void assert_round_trip(const RfHistogram *h)
{
    const int slack = 2 + (int)ceil(COUNT * 0.3990 * 2 * (double)RF_INVERSE_REACH / (RF_INVERSE_SIZE - 1));
    for (int axis = 0; axis < h->channels; ++axis)
    {
        for (size_t i = 0; i < COUNT; ++i)
            g_sorted[i] = along(h, g_given + i * STRIDE, axis);
        qsort(g_sorted, COUNT, sizeof *g_sorted, compare);
        for (size_t i = 0; i < COUNT; ++i)
        {
            float back[3], value = along(h, g_given + i * STRIDE, axis);
            rf_histogram_invert(h, 0, g_pixels + i * STRIDE, back);
            float mapped = along(h, back, axis);
            int rank = 0;
            for (int step = COUNT / 2; step > 0; step /= 2)
                if (rank + step < COUNT && g_sorted[rank + step] <= value)
                    rank += step;
            int low = rf_max_int(rank - slack, 0), high = rf_min_int(rank + slack, COUNT - 1);
            assert_true(mapped >= g_sorted[low] - 1e-4f && mapped <= g_sorted[high] + 1e-4f);
        }
    }
}

static void assert_orthonormal(const RfHistogram *h)
{
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
        {
            float dot = 0;
            for (int c = 0; c < 3; ++c)
                dot += h->axes[a][c] * h->axes[b][c];
            assert_true(fabsf(dot - (a == b ? 1.0f : 0.0f)) < 1e-5f);
        }
}

static void values_become_gaussian_and_come_back_within_a_quantile_whatever_the_channels(void **state)
{
    (void)state;
    for (int channels = 1; channels <= 3; ++channels)
    {
        RfHistogram h;
        make_pixels();
        assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, channels, &h), RF_OK);
        assert_int_equal(h.channels, channels);
        assert_orthonormal(&h);
        assert_gaussian(channels);
        assert_round_trip(&h);
        for (size_t i = 0; i < COUNT; ++i)
            assert_true(g_pixels[i * STRIDE + 3] == g_given[i * STRIDE + 3]);
        for (int a = 0; channels < 3 && a < 3; ++a)
            assert_true(h.axes[a][a] == 1);
        rf_histogram_free(&h);
    }
}

static void principal_axes_are_uncorrelated_and_the_largest_comes_first(void **state)
{
    (void)state;
    RfHistogram h;
    make_pixels();
    assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, 3, &h), RF_OK);
    assert_true(h.variance[0] > h.variance[1] && h.variance[1] >= h.variance[2]);
    double mean[3] = {0}, covariance[3][3] = {{0}};
    for (size_t i = 0; i < COUNT; ++i)
        for (int a = 0; a < 3; ++a)
            mean[a] += (double)along(&h, g_given + i * STRIDE, a) / COUNT;
    for (size_t i = 0; i < COUNT; ++i)
        for (int a = 0; a < 3; ++a)
            for (int b = 0; b < 3; ++b)
                covariance[a][b] += ((double)along(&h, g_given + i * STRIDE, a) - mean[a]) *
                                    ((double)along(&h, g_given + i * STRIDE, b) - mean[b]) / COUNT;
    for (int a = 0; a < 3; ++a)
        for (int b = 0; b < 3; ++b)
            assert_true(fabs(covariance[a][b] - (a == b ? (double)h.variance[a] : 0)) < 1e-4 * covariance[0][0]);
    rf_histogram_free(&h);
}

static void a_constant_picture_comes_back_whatever_was_blended(void **state)
{
    (void)state;
    for (int channels = 1; channels <= 3; ++channels)
    {
        RfHistogram h;
        for (size_t i = 0; i < COUNT * STRIDE; ++i)
            g_pixels[i] = 0.25f * (float)(1 + i % STRIDE);
        assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, channels, &h), RF_OK);
        assert_orthonormal(&h);
        static const float blended[] = {-1e30f, -5, -0.3f, 0, 1.7f, 9};
        for (size_t k = 0; k < sizeof blended / sizeof *blended; ++k)
        {
            float g[3] = {blended[k], -blended[k], 0.5f}, value[3];
            rf_histogram_invert(&h, 0, g, value);
            for (int c = 0; c < channels; ++c)
                assert_true(value[c] == 0.25f * (float)(1 + c));
        }
        rf_histogram_free(&h);
    }
}

static void whatever_was_blended_maps_back_into_the_pictures_range(void **state)
{
    (void)state;
    RfHistogram h;
    make_pixels();
    assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, 3, &h), RF_OK);
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {0};
    for (size_t k = 0; k < COUNT * STRIDE; ++k)
        if (k % STRIDE < 3)
        {
            low[k % STRIDE] = fminf(low[k % STRIDE], g_given[k]);
            high[k % STRIDE] = fmaxf(high[k % STRIDE], g_given[k]);
        }
    bool reached = false;
    for (uint64_t k = 0; k < 5000; ++k)
    {
        float g[3], value[3];
        for (int c = 0; c < 3; ++c)
            g[c] = 10 * rf_random_float(8, 0, k, (uint64_t)c) - 5;
        rf_histogram_invert(&h, 0, g, value);
        for (int c = 0; c < 3; ++c)
        {
            assert_true(value[c] >= low[c] && value[c] <= high[c]);
            reached = reached || value[c] == low[c];
        }
    }
    assert_true(reached);
    rf_histogram_free(&h);
}

static void ties_are_ranked_by_pixel_and_map_back_to_one_value(void **state)
{
    (void)state;
    RfHistogram h;
    for (size_t i = 0; i < COUNT; ++i)
        g_pixels[i * STRIDE] = g_given[i * STRIDE] = noise(i, 0) < 0.7f ? 0.0f : noise(i, 1) < 0.5f ? 0.5f : 1.0f;
    assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, 1, &h), RF_OK);
    assert_gaussian(1);
    int wrong = 0;
    float last[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < COUNT; ++i)
    {
        float value, g = g_pixels[i * STRIDE], given = g_given[i * STRIDE];
        int kind = (int)(2 * given);
        assert_true(g > last[kind]);
        last[kind] = g;
        rf_histogram_invert(&h, 0, &g, &value);
        wrong += value != given;
    }
    // Only at the two jumps, between two entries of the table.
    assert_in_range(wrong, 0, 2 * COUNT / 250);
    rf_histogram_free(&h);
}

static void a_coarser_level_keeps_the_mean_colour(void **state)
{
    (void)state;
    RfHistogram h;
    RfTexture texture;
    const int lanes[] = {0, 1};
    make_pixels();
    assert_int_equal(rf_histogram_create(g_pixels, COUNT, STRIDE, 2, &h), RF_OK);
    assert_int_equal(rf_texture_create(g_pixels, SIDE, SIDE, 1, true, &texture), RF_OK);
    rf_histogram_fit_levels(&h, &texture, lanes);
    for (int c = 0; c < 2; ++c)
    {
        double mean = 0, deviation = 0, level_mean[RF_TEXTURE_LEVELS] = {0};
        for (size_t i = 0; i < COUNT; ++i)
            mean += (double)g_given[i * STRIDE + (size_t)c] / COUNT;
        for (size_t i = 0; i < COUNT; ++i)
            deviation += pow((double)g_given[i * STRIDE + (size_t)c] - mean, 2) / COUNT;
        for (int n = 0; n < texture.level_count; ++n)
        {
            const RfTextureLevel *level = &texture.levels[n];
            for (int y = 0; y < level->height; ++y)
                for (int x = 0; x < level->width; ++x)
                {
                    float value[2];
                    rf_histogram_invert(&h, n, level->texels + ((size_t)y * (size_t)level->stride + (size_t)x) * 4,
                                        value);
                    level_mean[n] += (double)value[c] / (level->width * level->height);
                }
            assert_true(fabs(level_mean[n] - mean) < 0.06 * sqrt(deviation));
        }
    }
    rf_texture_free(&texture);
    rf_histogram_free(&h);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_become_gaussian_and_come_back_within_a_quantile_whatever_the_channels),
        cmocka_unit_test(principal_axes_are_uncorrelated_and_the_largest_comes_first),
        cmocka_unit_test(a_constant_picture_comes_back_whatever_was_blended),
        cmocka_unit_test(whatever_was_blended_maps_back_into_the_pictures_range),
        cmocka_unit_test(ties_are_ranked_by_pixel_and_map_back_to_one_value),
        cmocka_unit_test(a_coarser_level_keeps_the_mean_colour),
    };
    return cmocka_run_group_tests_name("histogram", tests, NULL, NULL);
}
