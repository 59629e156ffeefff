// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/texture.h"

#include <kiss_fftnd.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 64
};

static float g_pixels[N * N * 4], g_other[N * N * 4];

// The slow, obvious sampler: four texels at exemplar coordinates u, v.
static float sample(const RfTexture *texture, int n, float u, float v, int lane)
{
    const RfTextureLevel *level = &texture->levels[n];
    const float *plane = level->texels + (size_t)(lane / 4) * rf_texture_plane(level) + lane % 4;
    float s = (u - 0.5f) * level->scale_x, t = (v - 0.5f) * level->scale_y;
    int i = (int)floorf(s), j = (int)floorf(t);
    float fx = s - (float)i, fy = t - (float)j, sum = 0;
    for (int k = 0; k < 4; ++k)
    {
        int x = i + k % 2, y = j + k / 2;
        x = texture->tiles ? rf_wrap_int(x, level->width) : rf_clamp_int(x, 0, level->width - 1);
        y = texture->tiles ? rf_wrap_int(y, level->height) : rf_clamp_int(y, 0, level->height - 1);
        sum +=
            (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy) * plane[((size_t)y * (size_t)level->stride + (size_t)x) * 4];
    }
    return sum;
}

static RfTexture make(const float *pixels, int width, int height, int quads, bool tiles)
{
    RfTexture texture;
    assert_int_equal(rf_texture_create(pixels, width, height, quads, tiles, &texture), RF_OK);
    return texture;
}

// Radially averaged power of a picture, by whole cycles a picture.
static void add_spectrum(const kiss_fft_cpx *picture, double power[N / 2])
{
    static kiss_fft_cpx spectrum[N * N];
    double count[N / 2] = {0}, sum[N / 2] = {0};
    kiss_fftnd_cfg plan = kiss_fftnd_alloc((int[]){N, N}, 2, 0, NULL, NULL);
    kiss_fftnd(plan, picture, spectrum);
    kiss_fft_free(plan);
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
        {
            int bin = (int)lrint(hypot(x <= N / 2 ? x : x - N, y <= N / 2 ? y : y - N));
            if (bin < 1 || bin >= N / 2)
                continue;
            kiss_fft_cpx c = spectrum[y * N + x];
            sum[bin] += (double)(c.r * c.r + c.i * c.i);
            count[bin] += 1;
        }
    for (int bin = 1; bin < N / 2; ++bin)
        power[bin] += sum[bin] / count[bin];
}

static void samples_at_random_phases_keep_the_spectrum_of_white_noise(void **state)
{
    (void)state;
    static kiss_fft_cpx picture[N * N];
    for (size_t k = 0; k < N * N * 4; ++k)
        g_pixels[k] = rf_random_float(1, 0, k, 0) - 0.5f;
    RfTexture texture = make(g_pixels, N, N, 1, true);
    enum
    {
        PHASES = 48
    };
    double before[N / 2] = {0}, after[N / 2] = {0};
    for (int lane = 0; lane < 4; ++lane)
    {
        for (int k = 0; k < N * N; ++k)
            picture[k] = (kiss_fft_cpx){g_pixels[4 * k + lane], 0};
        add_spectrum(picture, before);
        for (uint64_t phase = 0; phase < PHASES; ++phase)
        {
            float dx = rf_random_float(2, 0, phase, 0), dy = rf_random_float(2, 0, phase, 1);
            for (int k = 0; k < N * N; ++k)
                picture[k] = (kiss_fft_cpx){
                    sample(&texture, 0, (float)(k % N) + 0.5f + dx, (float)(k / N) + 0.5f + dy, lane), 0};
            add_spectrum(picture, after);
        }
    }
    double squares = 0, greatest = 0;
    for (int bin = 1; bin < N / 2; ++bin)
    {
        double decibels = 10 * log10(after[bin] / PHASES / before[bin]);
        squares += decibels * decibels / (N / 2 - 1);
        greatest = fmax(greatest, fabs(decibels));
    }
    print_message("white noise through the sampler: %.2f dB rms, at most %.2f dB\n", sqrt(squares), greatest);
    assert_true(sqrt(squares) < 0.5);
    rf_texture_free(&texture);
}

static void a_constant_stays_itself_on_every_level(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        for (int k = 0; k < 23 * 17 * 8; ++k)
            g_pixels[k] = k % 8 == 5 ? 0 : 0.3f * (float)(k % 8) - 1;
        RfTexture texture = make(g_pixels, 23, 17, 2, tiles);
        for (int n = 0; n < texture.level_count; ++n)
            for (int lane = 0; lane < 8; ++lane)
                for (uint64_t k = 0; k < 200; ++k)
                {
                    float value = sample(&texture, n, 60 * rf_random_float(3, 0, k, 0) - 20,
                                         60 * rf_random_float(3, 0, k, 1) - 20, lane);
                    assert_true(lane == 5 ? value == 0 : fabsf(value - g_pixels[lane]) < 2e-6f);
                }
        rf_texture_free(&texture);
    }
}

static float wave(float u, float v)
{
    return cosf(2 * RF_PI * (u / N + 0.1f)) * sinf(2 * RF_PI * v / N);
}

static void every_level_of_a_smooth_picture_equals_it_and_continues_across_the_border(void **state)
{
    (void)state;
    for (int k = 0; k < N * N; ++k)
        for (int c = 0; c < 4; ++c)
            g_pixels[4 * k + c] = wave((float)(k % N) + 0.5f, (float)(k / N) + 0.5f);
    RfTexture texture = make(g_pixels, N, N, 1, true);
    assert_true(texture.level_count >= 4);
    // The band of level 3 ends at four cycles a picture; bilinear samples of one cycle then lose 5 % of the amplitude
    // between texels, half of which is put back on them.
    static const float tolerance[] = {2e-3f, 4e-3f, 1.2e-2f, 5e-2f};
    for (int n = 0; n < 4; ++n)
        for (uint64_t k = 0; k < 2000; ++k)
        {
            float u = 3 * N * rf_random_float(4, 0, k, 0) - N, v = 3 * N * rf_random_float(4, 0, k, 1) - N;
            assert_true(fabsf(sample(&texture, n, u, v, (int)k % 4) - wave(u, v)) < tolerance[n]);
        }
    rf_texture_free(&texture);
}

static void texels_beyond_the_end_repeat_the_first_or_the_last_ones(void **state)
{
    (void)state;
    for (size_t k = 0; k < N * N * 4; ++k)
        g_pixels[k] = rf_random_float(1, 0, k, 0) - 0.5f;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfTexture texture = make(g_pixels, 21, 9, 2, tiles);
        for (int n = 0; n < texture.level_count; ++n)
        {
            const RfTextureLevel *level = &texture.levels[n];
            assert_int_equal(level->stride, level->width + 2);
            for (int q = 0; q < 2; ++q)
                for (int y = 0; y < level->height + 2; ++y)
                    for (int x = 0; x < level->width + 2; ++x)
                    {
                        int sx = tiles ? x % level->width : rf_min_int(x, level->width - 1);
                        int sy = tiles ? y % level->height : rf_min_int(y, level->height - 1);
                        const float *plane = level->texels + (size_t)q * rf_texture_plane(level);
                        assert_memory_equal(plane + (y * level->stride + x) * 4, plane + (sy * level->stride + sx) * 4,
                                            4 * sizeof(float));
                    }
        }
        rf_texture_free(&texture);
    }
}

static void one_that_does_not_tile_knows_nothing_of_the_far_border(void **state)
{
    (void)state;
    for (size_t k = 0; k < N * N * 4; ++k)
        g_pixels[k] = g_other[k] = rf_random_float(1, 0, k, 0) - 0.5f;
    // The last columns and rows are something else in the second picture.
    for (int k = 0; k < N * N; ++k)
        if (k % N >= N - 8 || k / N >= N - 8)
            g_other[4 * k] = 1000;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfTexture a = make(g_pixels, N, N, 1, tiles), b = make(g_other, N, N, 1, tiles);
        bool equal = true;
        for (int y = 0; y < 2 * (N - 17); ++y)
            for (int x = 0; x < 2 * (N - 17); ++x)
            {
                size_t k = ((size_t)y * (size_t)a.levels[0].stride + (size_t)x) * 4;
                equal = equal && a.levels[0].texels[k] == b.levels[0].texels[k];
            }
        assert_int_equal(equal, !tiles);
        rf_texture_free(&a);
        rf_texture_free(&b);
    }
}

static void the_smallest_pictures_have_levels(void **state)
{
    (void)state;
    for (int k = 0; k < 8 * 8 * 4; ++k)
        g_pixels[k] = k % 8 < 4 ? -1.0f : 1.0f;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        static const int sides[][2] = {{8, 8}, {1, 1}, {1, 40}, {3, 2}};
        for (int i = 0; i < 4; ++i)
        {
            RfTexture texture = make(g_pixels, sides[i][0], sides[i][1], 1, tiles);
            assert_true(texture.level_count >= 1);
            for (int n = 0; n < texture.level_count; ++n)
                for (int x = -3; x < 50; ++x)
                    assert_true(fabsf(sample(&texture, n, 0.7f * (float)x, 0.3f * (float)x, 0)) < 3);
            rf_texture_free(&texture);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_at_random_phases_keep_the_spectrum_of_white_noise),
        cmocka_unit_test(a_constant_stays_itself_on_every_level),
        cmocka_unit_test(every_level_of_a_smooth_picture_equals_it_and_continues_across_the_border),
        cmocka_unit_test(texels_beyond_the_end_repeat_the_first_or_the_last_ones),
        cmocka_unit_test(one_that_does_not_tile_knows_nothing_of_the_far_border),
        cmocka_unit_test(the_smallest_pictures_have_levels),
    };
    return cmocka_run_group_tests_name("texture", tests, NULL, NULL);
}
