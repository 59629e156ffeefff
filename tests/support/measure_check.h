// SPDX-License-Identifier: Apache-2.0
// What tests of rf_measure_* share: a texture, the same carried by one step of a flow, and judging one frame or two.
// Header only, since the support library does without cmocka.
#pragma once

#include "measure/picture.h"
#include "riffle/measure.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    N = 128,
    PIXELS = N * N
};

static float g_texture[PIXELS], g_next[PIXELS], g_velocity[2 * PIXELS], g_displacement[2 * PIXELS],
    g_backward[2 * PIXELS];

static inline RfImageView grey(float *pixels)
{
    return (RfImageView){pixels, N, N, 1, N};
}

static inline RfFlowView flow_of(const float *velocity, double time)
{
    return (RfFlowView){.width = N, .height = N, .velocity = velocity, .time = time};
}

// g_texture, and g_next: carried one step by a steady flow in g_velocity.
static inline int make_inputs(void **state)
{
    (void)state;
    scene_noise(N, N, 0.02f, 0.25f, 3, g_texture);
    scene_two_vortices(N, N, 5, g_velocity);
    RfFlowView flow = flow_of(g_velocity, 1);
    rf_measure_displacement(&flow, 0, N, N, g_displacement);
    assert_int_equal(rf_measure_invert(g_displacement, N, N, g_backward), RF_OK);
    assert_int_equal(rf_measure_warp(g_texture, g_backward, N, N, g_next), RF_OK);
    return 0;
}

static inline RfMeasure *make(const RfImageView *exemplar, RfMeasureOptions options)
{
    RfMeasure *measure = NULL;
    assert_int_equal(rf_measure_create(exemplar, &options, &measure), RF_OK);
    return measure;
}

// One frame alone, against g_texture.
static inline RfMeasureFrame judge_with(RfMeasureOptions options, const RfImageView *frame, const uint8_t *mask)
{
    RfImageView exemplar = grey(g_texture);
    RfMeasure *measure = make(&exemplar, options);
    RfMeasureFrame result;
    assert_int_equal(rf_measure_step(measure, NULL, mask, frame, &result), RF_OK);
    rf_measure_destroy(measure);
    return result;
}

static inline RfMeasureFrame judge(float *pixels)
{
    RfImageView frame = grey(pixels);
    return judge_with(rf_measure_defaults(), &frame, NULL);
}

// Two frames, one step of `velocity` apart.
static inline RfMeasureFrame judge_pair(const float *velocity, float *first, float *second, const uint8_t *mask)
{
    RfMeasureOptions options = rf_measure_defaults();
    options.patch_every = 0;
    RfImageView exemplar = grey(g_texture), a = grey(first), b = grey(second);
    RfMeasure *measure = make(&exemplar, options);
    RfMeasureFrame result;
    RfFlowView flow = flow_of(velocity, 0);
    assert_int_equal(rf_measure_step(measure, &flow, mask, &a, &result), RF_OK);
    assert_true(isnan(result.flow.error) && isnan(result.flicker.whole));
    flow.time = 1;
    assert_int_equal(rf_measure_step(measure, &flow, mask, &b, &result), RF_OK);
    rf_measure_destroy(measure);
    return result;
}
