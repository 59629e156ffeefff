// SPDX-License-Identifier: Apache-2.0
// Beach pebbles: rounded cells of a power diagram in three layers, each layer smaller and deeper than the one above,
// so that gaps between stones show stones. A stone is a dome over its cell, with its own colour, grain and now and then
// a vein; light comes from the upper left, and gaps are dark because little of the sky is seen from them.
#include "core/result.h"
#include "fluids/cells.h"

enum
{
    LAYERS = 3
};

typedef struct Layer
{
    float large, small, gap, shade;
} Layer;

// Of the shorter side. The lowest layer has no gaps to fall through.
static const Layer layers[LAYERS] = {
    {0.105f, 0.040f, 0.006f, 1}, {0.045f, 0.020f, 0.0033f, 0.72f}, {0.025f, 0.014f, 0, 0.5f}};

typedef struct Pebbles
{
    RfTorus torus;
    RfCells *cells[LAYERS];
} Pebbles;

/// Dome of a stone: 0 at its rim, steep there, flat on top. Negative outside.
static float dome(const RfCellHit *hit, float gap)
{
    float inside = hit->round - gap;
    float reach = 0.62f * hit->radius;
    float t = rf_clamp(inside / reach, 0, 1);
    return inside < 0 ? inside : 0.52f * hit->radius * sqrtf(1 - (1 - t) * (1 - t));
}

static RfCellHit find(const Pebbles *pebbles, int layer, float x, float y)
{
    // Bent space makes straight walls into shores of stones.
    float bend = 0.010f, cells = 11;
    float bx = x + bend * rf_torus_noise(&pebbles->torus, x, y, cells, 40),
          by = y + bend * rf_torus_noise(&pebbles->torus, x, y, cells, 41);
    return rf_cells_at(pebbles->cells[layer], bx, by, 1);
}

/// Colour of the stone itself.
static RfVec3 stone_colour(const Pebbles *pebbles, const RfCellHit *hit, int layer, float x, float y)
{
    static const RfVec3 palette[] = {{0.55f, 0.53f, 0.50f}, {0.42f, 0.42f, 0.43f}, {0.66f, 0.60f, 0.52f},
                                     {0.36f, 0.38f, 0.42f}, {0.74f, 0.71f, 0.66f}, {0.52f, 0.43f, 0.36f},
                                     {0.58f, 0.49f, 0.43f}, {0.30f, 0.30f, 0.31f}, {0.83f, 0.81f, 0.77f},
                                     {0.48f, 0.50f, 0.47f}};
    uint64_t seed = pebbles->torus.seed, item = (uint64_t)hit->cell, stream = 10 + (uint64_t)layer;
    RfVec3 base = palette[rf_random_below(10, seed, stream, item, 0)];
    RfVec3 other = palette[rf_random_below(10, seed, stream, item, 1)];
    RfVec3 colour = rf_mix3(base, other, 0.35f * rf_random_float(seed, stream, item, 2));
    colour = rf_scale3(colour, 0.88f + 0.26f * rf_random_float(seed, stream, item, 3));
    // Grain and blotches, each stone from its own part of the noise.
    float shift = 7 * rf_random_float(seed, stream, item, 4);
    float blotch = rf_torus_octaves(&pebbles->torus, x + shift, y, 14, 3, 50);
    float grain = rf_torus_noise(&pebbles->torus, x, y + shift, 110, 55);
    float speckled = rf_random_float(seed, stream, item, 5);
    colour = rf_scale3(colour, 1 + 0.13f * blotch + (speckled > 0.6f ? 0.22f : 0.08f) * grain);
    if (rf_random_float(seed, stream, item, 6) < 0.22f)
    {
        float angle = RF_PI * rf_random_float(seed, stream, item, 7);
        float across = hit->dx * cosf(angle) + hit->dy * sinf(angle) + 0.012f * blotch +
                       hit->radius * (rf_random_float(seed, stream, item, 8) - 0.5f);
        float vein = expf(-across * across / (0.00002f * (1 + 2 * speckled)));
        colour = rf_mix3(colour, (RfVec3){0.86f, 0.84f, 0.80f}, 0.7f * vein);
    }
    return colour;
}

/// The dome's height with the stone's roughness.
static float height(const Pebbles *pebbles, int layer, float x, float y)
{
    RfCellHit hit = find(pebbles, layer, x, y);
    return dome(&hit, layers[layer].gap);
}

static void paint(const void *context, float x, float y, float *colour)
{
    const Pebbles *pebbles = context;
    const RfVec3 light = rf_unit3((RfVec3){-0.45f, -0.6f, 0.75f});
    float cover = 1;
    RfVec3 result = {0.05f, 0.045f, 0.04f};
    for (int layer = 0; layer < LAYERS; ++layer)
    {
        RfCellHit hit = find(pebbles, layer, x, y);
        float h = dome(&hit, layers[layer].gap);
        if (h <= 0)
        {
            // How deep in the gap: the sky is hidden by what stands above, most of all towards the light.
            float toward = height(pebbles, layer, x - 0.006f, y - 0.008f);
            float open = rf_smooth(0, 2.2f * layers[layer].gap + 0.001f, -h);
            cover *= (0.45f + 0.4f * open) * (toward > 0 ? 0.6f : 1);
            continue;
        }
        float step = 0.0012f;
        RfVec3 normal = rf_normal3((height(pebbles, layer, x + step, y) - h) / step,
                                   (height(pebbles, layer, x, y + step) - h) / step);
        float lambert = fmaxf(rf_dot3(normal, light), 0);
        float rim = rf_smooth(0, 0.30f * hit.radius, hit.round - layers[layer].gap);
        float lit = (0.30f + 0.12f * normal.z) * (0.35f + 0.65f * rim) + 0.80f * lambert;
        result = rf_scale3(stone_colour(pebbles, &hit, layer, x, y), lit);
        float glint = 0.10f * rf_glint(normal, light, 14);
        result = rf_add3(result, (RfVec3){glint, glint, glint});
        result = rf_scale3(result, layers[layer].shade);
        break;
    }
    colour[0] = cover * result.x;
    colour[1] = cover * result.y;
    colour[2] = cover * result.z;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    Pebbles pebbles = {.torus = rf_torus(parameters)};
    RfResult result = RF_OK;
    for (int i = 0; i < LAYERS && result == RF_OK; ++i)
        result =
            rf_cells_create(&pebbles.torus, layers[i].large, layers[i].small, 0.80f, (uint64_t)i, &pebbles.cells[i]);
    if (result == RF_OK)
        result = rf_paint(&pebbles.torus, image, paint, &pebbles);
    for (int i = 0; i < LAYERS; ++i)
        rf_cells_destroy(pebbles.cells[i]);
    return result;
}

const RfExemplarClass rf_exemplar_pebbles = {
    .name = "pebbles",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Rounded beach stones, each of its own colour, with smaller ones in the gaps.",
    .channels = 3,
    .draw = draw,
};
