// SPDX-License-Identifier: Apache-2.0
// Sea foam from above: a white lace whose holes are the rounded cells of a power diagram in bent space, a finer lace in
// the thick patches, and tiny bubbles in all of it, over blue-green water. Thin foam lets the water shine through; the
// lace is a little raised, lit from the upper left, and its shadow lies on the water.
#include "core/result.h"
#include "fluids/cells.h"

typedef struct Foam
{
    RfTorus torus;
    RfCells *holes, *small_holes;
} Foam;

/// White in a band along the walls of cells, fading over its last third.
static float lace(const RfCellHit *hit, float width)
{
    return rf_smooth(1.15f * width, 0.55f * width, hit->round);
}

/// How much foam lies at a point, 0 to 1, without its tiny bubbles.
static float thickness(const Foam *foam, float x, float y)
{
    const RfTorus *torus = &foam->torus;
    float bx = x + 0.045f * rf_torus_octaves(torus, x, y, 4, 4, 10),
          by = y + 0.045f * rf_torus_octaves(torus, x, y, 4, 4, 20);
    RfCellHit hole = rf_cells_at(foam->holes, bx, by, 0.012f);
    RfCellHit small = rf_cells_at(foam->small_holes, bx, by, 0.004f);
    float patch = rf_torus_octaves(torus, x, y, 5, 3, 30);
    float ragged = rf_torus_octaves(torus, x, y, 30, 2, 40);
    float width = 0.0019f + 0.0120f * rf_smooth(-0.25f, 0.85f, patch) + 0.0024f * ragged;
    float coarse = lace(&hole, width);
    // The fine lace grows out of the coarse one and thins out into the holes.
    float reach =
        rf_smooth(0.040f, 0.002f, hole.round - 0.9f * width) * rf_smooth(-0.35f, 0.55f, patch + 0.3f * ragged);
    float fine = lace(&small, 0.0010f + 0.0036f * reach) * rf_smooth(0.02f, 0.55f, reach);
    float veil = 0.20f * reach;
    return rf_clamp(fmaxf(fmaxf(coarse, 0.85f * fine), veil), 0, 1);
}

static RfVec3 water(const Foam *foam, float x, float y)
{
    float swell = rf_torus_octaves(&foam->torus, x, y, 4, 3, 50),
          ripple = rf_torus_octaves(&foam->torus, x, y, 20, 2, 60);
    RfVec3 deep = {0.035f, 0.27f, 0.36f}, shallow = {0.17f, 0.56f, 0.60f};
    RfVec3 colour = rf_mix3(deep, shallow, rf_clamp(0.45f + 0.55f * swell + 0.10f * ripple, 0, 1));
    // Light gathered by the ripples into bright lines.
    float line = 1 - fabsf(rf_torus_noise(&foam->torus, x + 0.02f * swell, y + 0.02f * ripple, 11, 70));
    return rf_mix3(colour, (RfVec3){0.55f, 0.85f, 0.85f}, 0.13f * rf_smooth(0.75f, 1, line));
}

static void paint(const void *context, float x, float y, float *colour)
{
    const Foam *foam = context;
    float thick = thickness(foam, x, y);
    float toward = thick > 0.02f ? thickness(foam, x - 0.0035f, y - 0.0045f) : 0;
    float shadow = thick < 0.98f ? thickness(foam, x - 0.009f, y - 0.012f) : 0;
    RfVec3 result = rf_scale3(water(foam, x, y), 1 - 0.42f * shadow * (1 - thick));
    // Tiny bubbles: dark dots, fewer where the foam is thick and dry.
    float dots = rf_torus_noise(&foam->torus, x, y, 95, 90) + 0.5f * rf_torus_noise(&foam->torus, x, y, 60, 91);
    float film = thick * (1 - 0.38f * rf_smooth(0.15f, 0.75f, dots) * (1.25f - thick));
    float light = 0.90f + 0.45f * (thick - toward);
    float grey = 0.05f * rf_torus_octaves(&foam->torus, x, y, 24, 3, 80);
    RfVec3 white = rf_scale3((RfVec3){0.95f, 0.985f, 0.99f}, rf_clamp(light + grey, 0.55f, 1.03f));
    result = rf_mix3(result, white, film);
    colour[0] = result.x;
    colour[1] = result.y;
    colour[2] = result.z;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    Foam foam = {.torus = rf_torus(parameters)};
    RfResult result = rf_cells_create(&foam.torus, 0.122f, 0.024f, 0.84f, 0, &foam.holes);
    if (result == RF_OK)
        result = rf_cells_create(&foam.torus, 0.030f, 0.010f, 0.84f, 1, &foam.small_holes);
    if (result == RF_OK)
        result = rf_paint(&foam.torus, image, paint, &foam);
    rf_cells_destroy(foam.holes);
    rf_cells_destroy(foam.small_holes);
    return result;
}

const RfExemplarClass rf_exemplar_foam = {
    .name = "foam",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "White sea foam like lace over blue-green water.",
    .channels = 3,
    .draw = draw,
};
