// SPDX-License-Identifier: Apache-2.0
// Melted chocolate stirred into folds, with the height it was drawn from as a fourth channel. The folds are the sine of
// a bent noise, so they run as closed ribbons of one width; dark and milk chocolate are not quite mixed. The gloss is
// in the colour: what a relief of the height adds is shape.
#include "core/result.h"
#include "fluids/drawing.h"

/// How far round the folds have turned, in half waves.
static float turns(const RfTorus *torus, float x, float y)
{
    float bx = x + 0.06f * rf_torus_octaves(torus, x, y, 3, 2, 10),
          by = y + 0.06f * rf_torus_octaves(torus, x, y, 3, 2, 20);
    return 4.6f * rf_torus_octaves(torus, bx, by, 5, 2, 30);
}

/// 0 to 1: folds with round backs and narrow valleys, and a slow swell.
static float height(const RfTorus *torus, float x, float y)
{
    float wave = 0.5f - 0.5f * cosf(RF_PI * turns(torus, x, y));
    float fold = wave * (1.9f - 0.9f * wave);
    float swell = 0.5f + 0.5f * rf_torus_octaves(torus, x, y, 4, 2, 40);
    float small = rf_torus_octaves(torus, x, y, 14, 2, 50);
    return rf_clamp(0.12f + 0.50f * fold + 0.26f * swell + 0.02f * small, 0, 1);
}

static void paint(const void *context, float x, float y, float *colour)
{
    const RfTorus *torus = context;
    float h = height(torus, x, y), step = 0.002f, relief = 0.05f;
    RfVec3 normal =
        rf_normal3(relief * (height(torus, x + step, y) - h) / step, relief * (height(torus, x, y + step) - h) / step);
    RfVec3 light = rf_unit3((RfVec3){-0.45f, -0.60f, 0.80f}), other = rf_unit3((RfVec3){0.7f, -0.1f, 0.6f});
    float milk =
        rf_smooth(-0.35f, 0.65f, rf_torus_octaves(torus, x, y, 5, 3, 60) + 0.25f * sinf(2.2f * turns(torus, x, y)));
    RfVec3 base = rf_mix3((RfVec3){0.235f, 0.115f, 0.060f}, (RfVec3){0.47f, 0.275f, 0.155f}, milk);
    float lit = 0.42f + 0.72f * fmaxf(rf_dot3(normal, light), 0);
    float valley = rf_smooth(0.10f, 0.55f, h);
    RfVec3 result = rf_scale3(base, lit * (0.62f + 0.42f * valley));
    float gloss =
        0.55f * rf_glint(normal, light, 40) + 0.16f * rf_glint(normal, light, 8) + 0.10f * rf_glint(normal, other, 16);
    result = rf_add3(result, (RfVec3){0.98f * gloss, 0.90f * gloss, 0.80f * gloss});
    colour[0] = result.x;
    colour[1] = result.y;
    colour[2] = result.z;
    colour[3] = h;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    RfTorus torus = rf_torus(parameters);
    return rf_paint(&torus, image, paint, &torus);
}

const RfExemplarClass rf_exemplar_chocolate = {
    .name = "chocolate",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Folds of melted chocolate, with its height as a fourth channel.",
    .channels = 4,
    .draw = draw,
};
