// SPDX-License-Identifier: Apache-2.0
// What tests of rf_optimize_still share: exemplars made here, and frames of them. Header only, since the support
// library does without cmocka.
#pragma once

#include "core/maths.h"
#include "core/random.h"
#include "riffle/riffle.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static inline RfImageView picture_of(float *pixels, int width, int height, int channels)
{
    return (RfImageView){pixels, width, height, channels, (ptrdiff_t)width * channels};
}

static inline float *numbers_of(int width, int height, int channels)
{
    float *numbers = calloc((size_t)width * (size_t)height * (size_t)channels, sizeof *numbers);
    assert_non_null(numbers);
    return numbers;
}

// Spots of all sizes, channels partly alike; wraps round its borders.
static inline float *spots(int width, int height, int channels, uint64_t seed)
{
    float *pixels = numbers_of(width, height, channels);
    for (int i = 0; i < width * height / 12 + 4; ++i)
    {
        int x0 = (int)rf_random_below((uint32_t)width, seed, 0, (uint64_t)i, 0);
        int y0 = (int)rf_random_below((uint32_t)height, seed, 0, (uint64_t)i, 1);
        int radius = 1 + (int)rf_random_below(4, seed, 0, (uint64_t)i, 2);
        for (int y = -radius; y <= radius; ++y)
            for (int x = -radius; x <= radius; ++x)
                for (int c = 0; c < channels && x * x + y * y <= radius * radius; ++c)
                    pixels[(rf_wrap_int(y0 + y, height) * width + rf_wrap_int(x0 + x, width)) * channels + c] =
                        rf_random_float(seed, 0, (uint64_t)i, (uint64_t)(3 + c % 3));
    }
    return pixels;
}

static inline RfExemplar *exemplar_of(const RfMapView *maps, int count, RfTiling tiling)
{
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(maps, count, tiling, &exemplar), RF_OK);
    return exemplar;
}

static inline RfExemplar *spotted_exemplar(int width, int height, int channels, RfTiling tiling)
{
    float *pixels = spots(width, height, channels, 1);
    RfMapView map = {"spots", RF_MAP_DATA, picture_of(pixels, width, height, channels), 1};
    RfExemplar *exemplar = exemplar_of(&map, 1, tiling);
    free(pixels);
    return exemplar;
}

static inline float *still_of(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                              const RfOptimizeConstraints *constraints, int width, int height)
{
    int channels = rf_optimize_channels(exemplar);
    float *pixels = numbers_of(width, height, channels);
    RfImageView view = picture_of(pixels, width, height, channels);
    RfResult result = rf_optimize_still(exemplar, options, constraints, &view);
    if (result != RF_OK)
        print_message("%s\n", rf_last_error()->message);
    assert_int_equal(result, RF_OK);
    return pixels;
}
