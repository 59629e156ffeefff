// SPDX-License-Identifier: Apache-2.0
// Soap bubbles from above: cells of a power diagram over a wide range of sizes. Each is a dome of clear film over dark
// water: its rim mirrors the bright sky (Fresnel), the lamp gives a sharp window near the top and a faint, inverted one
// from the back wall below, and the film's thickness tints it. Where walls meet, wet borders shine white.
#include "core/result.h"
#include "fluids/cells.h"

typedef struct Bubbles
{
    RfTorus torus;
    /// The bubbles on top, and smaller ones seen through them.
    RfCells *cells, *below;
} Bubbles;

/// A soft-edged square of a window with its cross, in the coordinates of a dome; 1 in the panes.
static float window(float x, float y)
{
    float pane = rf_smooth(0.15f, 0.11f, fabsf(x)) * rf_smooth(0.17f, 0.13f, fabsf(y));
    float bars = rf_smooth(0.010f, 0.024f, fabsf(x)) * rf_smooth(0.010f, 0.024f, fabsf(y + 0.02f));
    return pane * bars;
}

/// Interference colours along the film's thickness, 0 to 1 and on.
static RfVec3 film_tint(float thickness)
{
    return (RfVec3){0.5f + 0.5f * cosf(2 * RF_PI * thickness),
                    0.5f + 0.5f * cosf(2 * RF_PI * (thickness * 1.18f + 0.15f)),
                    0.5f + 0.5f * cosf(2 * RF_PI * (thickness * 1.42f + 0.28f))};
}

/// What is seen through a bubble: smaller ones in deep water, out of focus.
static RfVec3 depth_colour(const Bubbles *bubbles, float x, float y)
{
    RfCellHit hit = rf_cells_at(bubbles->below, x, y, 0.004f);
    float rim = expf(-hit.round / (0.16f * hit.radius));
    float side = rf_clamp((-0.6f * hit.dx - 0.8f * hit.dy) / hit.radius, -1, 1);
    RfVec3 deep = {0.13f, 0.27f, 0.36f}, bright = {0.50f, 0.69f, 0.76f};
    return rf_mix3(deep, bright, rf_clamp(0.45f * rim - 0.16f * side + 0.14f, 0, 1));
}

/// Light on the dome at (ux, uy), `reach` from its middle: sky, crescent, and two images of the window.
static RfVec3 reflect(RfVec3 colour, float ux, float uy, float reach, float thickness)
{
    float fresnel = 1 - sqrtf(fmaxf(1 - reach * reach, 0));
    fresnel = fresnel * fresnel;
    float side = -0.6f * ux - 0.8f * uy;
    RfVec3 sky = rf_mix3((RfVec3){0.86f, 0.92f, 0.96f}, film_tint(thickness), 0.28f);
    colour = rf_mix3(colour, sky, rf_clamp(0.06f + fresnel * (0.72f + 0.22f * side), 0, 1));
    float ring = expf(-45 * (reach - 0.76f) * (reach - 0.76f));
    float crescent = ring * rf_smooth(0.2f, 0.9f, -side / fmaxf(reach, 0.01f));
    colour = rf_mix3(colour, rf_mix3(sky, film_tint(thickness + 0.3f), 0.35f), 0.55f * crescent);
    float bright = window(ux + 0.36f + 0.25f * (uy + 0.42f), uy + 0.42f - 0.2f * (ux + 0.36f));
    float second = window(1.7f * (ux - 0.40f), 1.7f * (uy - 0.48f));
    return rf_mix3(colour, (RfVec3){1, 1, 1}, rf_clamp(0.95f * bright + 0.4f * second, 0, 1));
}

static RfVec3 bubble(const Bubbles *bubbles, const RfCellHit *hit, float x, float y)
{
    uint64_t seed = bubbles->torus.seed, item = (uint64_t)hit->cell;
    // Where on the dome: 0 in the middle, 1 at the wall, whatever the cell's shape.
    float size = sqrtf(hit->dx * hit->dx + hit->dy * hit->dy);
    float reach = rf_clamp(size / fmaxf(size + fmaxf(hit->round, 0), 1e-6f), 0, 1);
    float ux = size > 0 ? hit->dx / size * reach : 0, uy = size > 0 ? hit->dy / size * reach : 0;
    float bend = 0.5f * reach * reach;
    RfVec3 colour = depth_colour(bubbles, x + bend * hit->dx, y + bend * hit->dy);
    colour = rf_scale3(colour, 0.90f + 0.35f * rf_random_float(seed, 3, item, 0) + 0.22f * (0.6f * ux + 0.8f * uy));
    float thickness = 1.1f * rf_random_float(seed, 3, item, 1) + 0.9f * reach + 0.25f * uy +
                      0.2f * rf_torus_noise(&bubbles->torus, x, y, 16, 20);
    return reflect(colour, ux, uy, reach, thickness);
}

static void paint(const void *context, float x, float y, float *colour)
{
    const Bubbles *bubbles = context;
    float bend = 0.006f, bx = x + bend * rf_torus_noise(&bubbles->torus, x, y, 9, 30),
          by = y + bend * rf_torus_noise(&bubbles->torus, x, y, 9, 31);
    RfCellHit hit = rf_cells_at(bubbles->cells, bx, by, 0.0035f);
    RfVec3 result = bubble(bubbles, &hit, x, y);
    // Wet borders: a bright line in the middle, dark ones beside it.
    float width = 0.0020f + 0.014f * hit.radius;
    float beside = rf_smooth(2.6f * width, 1.2f * width, hit.round), border = rf_smooth(width, 0.2f * width, hit.round);
    result = rf_scale3(result, 1 - 0.36f * beside * (1 - border));
    result = rf_mix3(result, (RfVec3){0.80f, 0.88f, 0.91f}, 0.85f * border);
    colour[0] = result.x;
    colour[1] = result.y;
    colour[2] = result.z;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    Bubbles bubbles = {.torus = rf_torus(parameters)};
    RF_TRY(rf_cells_create(&bubbles.torus, 0.105f, 0.019f, 0.86f, 0, &bubbles.cells));
    RfResult result = rf_cells_create(&bubbles.torus, 0.040f, 0.018f, 0.86f, 1, &bubbles.below);
    if (result == RF_OK)
        result = rf_paint(&bubbles.torus, image, paint, &bubbles);
    rf_cells_destroy(bubbles.cells);
    rf_cells_destroy(bubbles.below);
    return result;
}

const RfExemplarClass rf_exemplar_bubbles = {
    .name = "bubbles",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Soap bubbles of many sizes seen from above, with bright rims and the image of a window.",
    .channels = 3,
    .draw = draw,
};
