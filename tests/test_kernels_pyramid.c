// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/pyramid.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

enum
{
    MOST = 40,
    CHANNELS = 3,
    NUMBERS = MOST * MOST * CHANNELS
};

static float g_picture[NUMBERS], g_half[NUMBERS], g_other[NUMBERS];

static void fill_noise(int width, int height, int channels)
{
    for (int i = 0; i < width * height * channels; ++i)
        g_picture[i] = 2 * rf_random_float(5, 0, (uint64_t)i, 0) - 1;
}

static float at(const float *pixels, int width, int x, int y)
{
    return pixels[y * width + x];
}

static double mean_of(const float *numbers, int count)
{
    double sum = 0;
    for (int i = 0; i < count; ++i)
        sum += (double)numbers[i];
    return sum / count;
}

static void a_constant_stays_what_it_is_at_any_size(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1, 1}, {1, 2}, {2, 1}, {1, 9}, {3, 3}, {8, 8}, {5, 4}, {17, 6}, {40, 39}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; ++s)
        for (int tiles = 0; tiles < 2; ++tiles)
        {
            int w = sizes[s][0], h = sizes[s][1], count = (w + 1) / 2 * ((h + 1) / 2);
            for (int i = 0; i < w * h; ++i)
                for (int c = 0; c < CHANNELS; ++c)
                    g_picture[i * CHANNELS + c] = 0.1f + 0.7f * (float)c;
            memset(g_half, 0, sizeof g_half);
            rf_halve(g_picture, w, h, CHANNELS, tiles, g_half);
            for (int i = 0; i < count; ++i)
                for (int c = 0; c < CHANNELS; ++c)
                    assert_true(fabsf(g_half[i * CHANNELS + c] - (0.1f + 0.7f * (float)c)) < 1e-6f);
            // Nothing is written behind the half.
            assert_true(g_half[count * CHANNELS] == 0);
        }
}

static void the_mean_of_an_even_size_is_kept(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
        for (int w = 2; w <= 16; w += 2)
        {
            fill_noise(w, 10, 1);
            rf_halve(g_picture, w, 10, 1, tiles, g_half);
            assert_true(fabs(mean_of(g_picture, w * 10) - mean_of(g_half, w / 2 * 5)) < 1e-6);
        }
}

static void channels_do_not_mix(void **state)
{
    (void)state;
    fill_noise(9, 8, CHANNELS);
    rf_halve(g_picture, 9, 8, CHANNELS, true, g_half);
    for (int c = 0; c < CHANNELS; ++c)
    {
        static float one[9 * 8], half[5 * 4];
        for (int i = 0; i < 9 * 8; ++i)
            one[i] = g_picture[i * CHANNELS + c];
        rf_halve(one, 9, 8, 1, true, half);
        for (int i = 0; i < 5 * 4; ++i)
            assert_true(half[i] == g_half[i * CHANNELS + c]);
    }
}

// 2 pixels there are 1 here, round the borders too; a mirrored picture has no such symmetry.
static void halving_goes_with_shifts_round_the_borders(void **state)
{
    (void)state;
    enum
    {
        W = 12,
        H = 8
    };
    static float shifted[W * H];
    bool mirrored_differs = false;
    fill_noise(W, H, 1);
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            shifted[y * W + x] = at(g_picture, W, rf_wrap_int(x + 2, W), rf_wrap_int(y + 4, H));
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        rf_halve(g_picture, W, H, 1, tiles, g_half);
        rf_halve(shifted, W, H, 1, tiles, g_other);
        for (int y = 0; y < H / 2; ++y)
            for (int x = 0; x < W / 2; ++x)
            {
                float a = at(g_other, W / 2, x, y), b = at(g_half, W / 2, (x + 1) % (W / 2), (y + 2) % (H / 2));
                if (tiles)
                    assert_true(a == b);
                mirrored_differs |= !tiles && fabsf(a - b) > 0.01f;
            }
    }
    assert_true(mirrored_differs);
}

static void mirroring_a_picture_mirrors_its_half(void **state)
{
    (void)state;
    enum
    {
        W = 14,
        H = 10
    };
    static float mirrored[W * H];
    fill_noise(W, H, 1);
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            mirrored[y * W + x] = at(g_picture, W, W - 1 - x, H - 1 - y);
    rf_halve(g_picture, W, H, 1, false, g_half);
    rf_halve(mirrored, W, H, 1, false, g_other);
    for (int y = 0; y < H / 2; ++y)
        for (int x = 0; x < W / 2; ++x)
            assert_true(fabsf(at(g_other, W / 2, x, y) - at(g_half, W / 2, W / 2 - 1 - x, H / 2 - 1 - y)) < 1e-6f);
}

// Inside, a ramp is met at the middle of the four pixels that one covers, and a chequerboard vanishes.
static void a_ramp_stays_a_ramp_and_the_finest_pattern_is_gone(void **state)
{
    (void)state;
    enum
    {
        W = 20,
        H = 14
    };
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            g_picture[y * W + x] = (float)x + 3 * (float)y;
    rf_halve(g_picture, W, H, 1, false, g_half);
    for (int y = 1; y < H / 2 - 1; ++y)
        for (int x = 1; x < W / 2 - 1; ++x)
            assert_true(fabsf(at(g_half, W / 2, x, y) - (2 * (float)x + 0.5f + 3 * (2 * (float)y + 0.5f))) < 1e-4f);
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            g_picture[y * W + x] = (x + y) % 2 ? 1 : -1;
    rf_halve(g_picture, W, H, 1, true, g_half);
    for (int i = 0; i < W / 2 * (H / 2); ++i)
        assert_true(fabsf(g_half[i]) < 1e-6f);
}

// Against the definition, at every small size: odd ones round up and reach beyond their last column.
static void halves_of_every_size_are_weighted_means_of_sixteen(void **state)
{
    (void)state;
    static const double taps[4] = {1, 3, 3, 1};
    for (int w = 1; w <= 9; ++w)
        for (int h = 1; h <= 9; ++h)
            for (int tiles = 0; tiles < 2; ++tiles)
            {
                fill_noise(w, h, 1);
                rf_halve(g_picture, w, h, 1, tiles, g_half);
                for (int y = 0; y < (h + 1) / 2; ++y)
                    for (int x = 0; x < (w + 1) / 2; ++x)
                    {
                        double sum = 0;
                        for (int k = 0; k < 16; ++k)
                        {
                            int u = 2 * x - 1 + k % 4, v = 2 * y - 1 + k / 4;
                            // Once or twice over the border in pictures of one or two pixels.
                            while (!tiles && (u < 0 || u >= w))
                                u = u < 0 ? -1 - u : 2 * w - 1 - u;
                            while (!tiles && (v < 0 || v >= h))
                                v = v < 0 ? -1 - v : 2 * h - 1 - v;
                            sum += taps[k % 4] * taps[k / 4] / 64 *
                                   (double)at(g_picture, w, (u + 2 * w) % w, (v + 2 * h) % h);
                        }
                        assert_true(fabs(sum - (double)at(g_half, (w + 1) / 2, x, y)) < 1e-6);
                    }
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_constant_stays_what_it_is_at_any_size),
        cmocka_unit_test(the_mean_of_an_even_size_is_kept),
        cmocka_unit_test(channels_do_not_mix),
        cmocka_unit_test(halving_goes_with_shifts_round_the_borders),
        cmocka_unit_test(mirroring_a_picture_mirrors_its_half),
        cmocka_unit_test(a_ramp_stays_a_ramp_and_the_finest_pattern_is_gone),
        cmocka_unit_test(halves_of_every_size_are_weighted_means_of_sixteen),
    };
    return cmocka_run_group_tests_name("pyramid", tests, NULL, NULL);
}
