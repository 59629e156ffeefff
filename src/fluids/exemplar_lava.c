// SPDX-License-Identifier: Apache-2.0
// Cooling lava from above: plates of dark crust (a power diagram in bent space), rough and lit from the upper left,
// with cracks between them where the melt glows. The glow is a temperature that falls away from a crack; its colour is
// the ramp of a black body from dark red to yellow-white.
#include "core/result.h"
#include "fluids/cells.h"

typedef struct Lava
{
    RfTorus torus;
    RfCells *plates, *shards;
} Lava;

/// Distances to the walls of plates and of the shards they break into.
typedef struct Cracks
{
    RfCellHit plate;
    float wide, fine, heat;
} Cracks;

/// Black body from cold (0) to white hot (1), sRGB-encoded.
static RfVec3 glow(float t)
{
    static const RfVec3 ramp[] = {{0, 0, 0},         {0.25f, 0.01f, 0.0f}, {0.60f, 0.07f, 0.01f}, {0.90f, 0.24f, 0.02f},
                                  {1, 0.52f, 0.06f}, {1, 0.80f, 0.28f},    {1, 0.96f, 0.72f}};
    float place = rf_clamp(t, 0, 1) * 6;
    int i = rf_min_int((int)place, 5);
    return rf_mix3(ramp[i], ramp[i + 1], place - (float)i);
}

static Cracks find(const Lava *lava, float x, float y)
{
    const RfTorus *torus = &lava->torus;
    float bx = x + 0.042f * rf_torus_octaves(torus, x, y, 5, 5, 10),
          by = y + 0.042f * rf_torus_octaves(torus, x, y, 5, 5, 20);
    Cracks cracks = {.plate = rf_cells_at(lava->plates, bx, by, 0.004f)};
    RfCellHit shard = rf_cells_at(lava->shards, bx + 0.3f * (bx - x), by + 0.3f * (by - y), 0.002f);
    // Some cracks gape, some are nearly closed.
    cracks.heat = rf_smooth(-0.42f, 0.55f, rf_torus_octaves(torus, x, y, 6, 2, 30));
    cracks.wide = cracks.plate.round - (0.0004f + 0.0105f * cracks.heat * cracks.heat);
    cracks.fine = shard.wall;
    return cracks;
}

/// Crust: plates bulge, shards tilt against each other, clinker on all of it.
static float height(const Lava *lava, float x, float y, const Cracks *cracks)
{
    float rise = 0.022f * (1 - expf(-fmaxf(cracks->wide, 0) / 0.020f));
    float seam = 0.0035f * (1 - expf(-cracks->fine / 0.003f));
    float rough = rf_torus_octaves(&lava->torus, x, y, 18, 5, 40);
    float grit = rf_torus_noise(&lava->torus, x, y, 120, 50);
    return rise + seam + 0.009f * rough + 0.0016f * grit;
}

static float height_at(const Lava *lava, float x, float y)
{
    Cracks cracks = find(lava, x, y);
    return height(lava, x, y, &cracks);
}

static void paint(const void *context, float x, float y, float *colour)
{
    const Lava *lava = context;
    Cracks cracks = find(lava, x, y);
    float h = height(lava, x, y, &cracks), step = 0.0015f;
    RfVec3 light = rf_unit3((RfVec3){-0.5f, -0.6f, 0.62f});
    RfVec3 normal = rf_normal3((height_at(lava, x + step, y) - h) / step, (height_at(lava, x, y + step) - h) / step);
    float lambert = fmaxf(rf_dot3(normal, light), 0);
    // Older plates are greyer.
    float age = rf_random_float(lava->torus.seed, 5, (uint64_t)cracks.plate.cell, 0);
    RfVec3 rock = rf_mix3((RfVec3){0.135f, 0.115f, 0.115f}, (RfVec3){0.27f, 0.25f, 0.25f}, age);
    RfVec3 result = rf_scale3(rock, 0.30f + 1.15f * lambert);
    float glint = 0.16f * rf_glint(normal, light, 18);
    result = rf_add3(result, (RfVec3){glint, glint, 1.05f * glint});
    // Heat: the melt itself, its glow on the walls of the crack, and the seams of the younger plates.
    float flicker = 0.14f * rf_torus_octaves(&lava->torus, x, y, 24, 3, 60);
    float melt =
        cracks.wide < 0 ? 0.42f + 0.26f * cracks.heat + 0.30f * rf_smooth(0, 0.009f, -cracks.wide) + flicker : 0;
    float wall = (0.30f + 0.28f * cracks.heat) * expf(-fmaxf(cracks.wide, 0) / (0.002f + 0.009f * cracks.heat));
    float seam = (0.20f + 0.30f * cracks.heat) * expf(-cracks.fine / 0.0020f) * rf_smooth(0.1f, 0.9f, cracks.heat);
    RfVec3 fire = glow(fmaxf(melt, fmaxf(wall, seam)));
    float melted = rf_smooth(0.0008f, -0.0008f, cracks.wide);
    result = rf_scale3(result, 1 - melted);
    result = rf_add3(result, fire);
    colour[0] = result.x;
    colour[1] = result.y;
    colour[2] = result.z;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    Lava lava = {.torus = rf_torus(parameters)};
    RfResult result = rf_cells_create(&lava.torus, 0.135f, 0.055f, 0.85f, 0, &lava.plates);
    if (result == RF_OK)
        result = rf_cells_create(&lava.torus, 0.050f, 0.025f, 0.80f, 1, &lava.shards);
    if (result == RF_OK)
        result = rf_paint(&lava.torus, image, paint, &lava);
    rf_cells_destroy(lava.plates);
    rf_cells_destroy(lava.shards);
    return result;
}

const RfExemplarClass rf_exemplar_lava = {
    .name = "lava",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Plates of dark crust with glowing cracks.",
    .channels = 3,
    .draw = draw,
};
