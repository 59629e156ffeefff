// SPDX-License-Identifier: Apache-2.0
// What tests of the synthesis kernels share: exemplars of whole numbers, which fixed point holds exactly, and frames
// that are pieces of them. Header only, since the support library does without cmocka.
#pragma once

#include "core/maths.h"
#include "core/memory.h"
#include "core/random.h"
#include "kernels/synthesis.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// Noise, smoothed along x so that neighbours are not wholly unlike.
static inline RfSynthesisExemplar make_exemplar(int width, int height, int channels, bool tiles, uint64_t seed)
{
    RfSynthesisExemplar e;
    float *pixels = rf_allocate((size_t)width * (size_t)height * (size_t)channels, sizeof *pixels);
    assert_non_null(pixels);
    for (int i = 0; i < width * height; ++i)
        for (int c = 0; c < channels; ++c)
        {
            int sum = -400;
            for (int k = 0; k < 4; ++k)
                sum += (int)rf_random_below(200, seed, (uint64_t)c, (uint64_t)(i + k), 0);
            pixels[i * channels + c] = (float)sum;
        }
    assert_int_equal(rf_synthesis_exemplar_create(pixels, width, height, channels, tiles, 1, 2, NULL, &e), RF_OK);
    return e;
}

// Shows the exemplar from (x, y) on; windows every `spacing` pixels know so, unless they are scattered later.
static inline RfSynthesisFrame make_piece(const RfSynthesisExemplar *e, int width, int height, bool tiles, int x, int y,
                                          int spacing)
{
    RfSynthesisFrame f;
    assert_int_equal(rf_synthesis_frame_create(width, height, e->channels, tiles, &f), RF_OK);
    for (int i = 0; i < width * height; ++i)
        f.sources[i] = (RfVec2){(float)(x + i % width), (float)(y + i / width)};
    rf_synthesis_show(&f, e, 0, (RfSynthesisHeld){0});
    assert_int_equal(rf_synthesis_cut(&f, spacing), RF_OK);
    rf_synthesis_place(&f, NULL);
    return f;
}

static inline int window_count(const RfSynthesisFrame *f)
{
    return f->columns * f->rows;
}

// Unlike the exemplar, but made of it: windows at random places, one assignment.
static inline RfSynthesisFrame make_muddle(const RfSynthesisExemplar *e, int width, int height, bool tiles, int side,
                                           uint64_t seed)
{
    RfSynthesisFrame f = make_piece(e, width, height, tiles, 0, 0, side / 4);
    rf_synthesis_scatter(&f, e, side, seed);
    RfSynthesisAssign assign = {.exemplar = e, .frame = &f, .side = side, .all = true};
    assert_int_equal(rf_synthesis_assign(&assign), RF_OK);
    return f;
}

static inline RfWindowDatabase *all_windows(const RfSynthesisExemplar *e, int side)
{
    RfWindowSource source = {.image = {e->pixels, e->width, e->height, e->channels, (ptrdiff_t)e->width * e->channels}};
    RfWindowOptions options = {.side = side, .tiles = e->tiles};
    RfWindowDatabase *windows;
    assert_int_equal(rf_windows_create(&source, 1, &options, &windows), RF_OK);
    return windows;
}

static inline double search_with(RfSynthesisSearch search)
{
    RfSynthesisEnergy energy = {-1, -1};
    assert_int_equal(rf_synthesis_search(&search, &energy), RF_OK);
    return energy.mean;
}

static inline void assign_with(RfSynthesisAssign assign)
{
    assert_int_equal(rf_synthesis_assign(&assign), RF_OK);
}

/// What the exemplar shows at a place.
static inline const int16_t *shown_at(const RfSynthesisExemplar *e, float x, float y)
{
    return rf_fixed_at(&e->fixed, rf_wrap_int((int)floorf(x + 0.5f), e->width),
                       rf_wrap_int((int)floorf(y + 0.5f), e->height));
}

static inline bool same_pixel(const RfSynthesisFrame *f, int x, int y, const int16_t *pixel)
{
    return memcmp(rf_fixed_at(&f->picture, x, y), pixel, (size_t)f->picture.channels * sizeof *pixel) == 0;
}
