// SPDX-License-Identifier: Apache-2.0
// Yu, Neyret, Bruneton, Holzschuch. Scalable real-time animation of rivers. 2009.
//
// The particles, their distribution, fades, kernels and drawing are those of Lagrangian texture advection: this is a
// second front over the same state, with one switch. Where a grid's vertices move each by itself there, here the grid
// stays rigid: its centre moves as a particle, and it turns with the flow round it. What wears a grid out (folding,
// distortion, losing its kernel) then never happens, so sprites go only when they crowd or leave the fluid. Two
// sprites that overlap slide over each other wherever the flow strains; that is the fault to see.
//
// The particle is the middle of a lattice of 3 x 3 points one radius apart, all advected: a particle that has left the
// fluid goes on with what its surroundings tell, and the lattice's mean turn is the sprite's.
#include "riffle/sprites.h"

#include "core/maths.h"
#include "core/options.h"
#include "kernels/advection.h"
#include "methods/lagrangian/lagrangian.h"

struct RfSprites
{
    RfLagrangian *particles;
};

enum
{
    LATTICE = 3,
    MIDDLE = LATTICE * LATTICE / 2
};

#define FIELD(name) offsetof(RfSpritesOptions, name)

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, FIELD(seed), "", 0, 0x1p64, 1, NULL,
     "Another seed, another picture with the same look."},
    {"particle-radius", RF_OPTION_FLOAT, FIELD(particle_radius), "px", 0, 4096, 0, NULL,
     "Poisson-disk radius d; 0 picks 20, or less for a small exemplar. Smaller follows the flow closer and blends "
     "more."},
    {"turn", RF_OPTION_BOOL, FIELD(turn), "", 0, 1, 1, NULL,
     "Sprites turn as the flow does round them; otherwise they only move."},
    {"fade", RF_OPTION_FLOAT, FIELD(fade), "s", 0, 1000, 1, NULL, "Time a sprite takes to fade in or out."},
    {"sharpness", RF_OPTION_FLOAT, FIELD(sharpness), "", 0.25, 12, 1.5, NULL,
     "Power of the kernel weight. 1 mixes several pictures everywhere, larger keeps the shapes of one."},
    {"candidates", RF_OPTION_INT, FIELD(candidates), "", 1, 1000000, 12, NULL,
     "Places in the exemplar tried for a new sprite; the best fit to what is drawn there is taken. 1 takes any."},
    {"blend", RF_OPTION_CHOICE, FIELD(blend), "", 0, 2, RF_BLEND_CONTRAST, "plain|contrast|histogram",
     "Weighted mean; the same with mean and variance kept; or with the whole histogram kept."},
    {"fps", RF_OPTION_FLOAT, FIELD(fps), "1/s", 0.01, 10000, 24, NULL, "Frames a second: turns the fade into frames."},
};

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_sprites_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfSpritesOptions rf_sprites_defaults(void)
{
    return (RfSpritesOptions){.struct_size = sizeof(RfSpritesOptions),
                              .seed = 1,
                              .particle_radius = 0,
                              .turn = true,
                              .fade = 1,
                              .sharpness = 1.5f,
                              .candidates = 12,
                              .blend = RF_BLEND_CONTRAST,
                              .fps = 24};
}

// ---- moving ------------------------------------------------------------------------------------------------------

// Turns the unit vector (turn[0], turn[1]) by the rotation nearest to what became of the lattice (polar decomposition
// in the plane).
static void turn_with(const float *x, const float *y, float turn[2])
{
    float along = 0, across = 0;
    for (int k = 0; k < LATTICE * LATTICE; ++k)
    {
        float u = (float)(k % LATTICE - 1), v = (float)(k / LATTICE - 1);
        along += u * x[k] + v * y[k];
        across += u * y[k] - v * x[k];
    }
    float length = sqrtf(along * along + across * across), c = length > 0 ? along / length : 1,
          s = length > 0 ? across / length : 0;
    float old[2] = {turn[0], turn[1]};
    turn[0] = c * old[0] - s * old[1];
    turn[1] = s * old[0] + c * old[1];
}

void rf_lagrangian_sprite_advect(const RfLagrangian *l, const StepFlow *flow, RfVec2 centre, float *x, float *y,
                                 bool *inside)
{
    int n = l->options.grid_vertices;
    float px[LATTICE * LATTICE], py[LATTICE * LATTICE];
    bool in[LATTICE * LATTICE];
    for (int k = 0; k < LATTICE * LATTICE; ++k)
    {
        px[k] = centre.x + (float)(k % LATTICE - 1) * l->radius;
        py[k] = centre.y + (float)(k / LATTICE - 1) * l->radius;
    }
    rf_advect_grid(px, py, in, LATTICE, flow->view, flow->from, l->width, l->height);
    // The sprite's own x axis, as it lies in the frame.
    float turn[2] = {x[n - 1] - x[0], y[n - 1] - y[0]}, length = sqrtf(turn[0] * turn[0] + turn[1] * turn[1]);
    turn[0] /= length;
    turn[1] /= length;
    if (l->turning)
        turn_with(px, py, turn);
    for (int k = 0; k < n * n; ++k)
    {
        float u = ((float)(k % n) - 0.5f * (float)(n - 1)) * l->cell,
              v = ((float)(k / n) - 0.5f * (float)(n - 1)) * l->cell;
        x[k] = px[MIDDLE] + turn[0] * u - turn[1] * v;
        y[k] = py[MIDDLE] + turn[1] * u + turn[0] * v;
        inside[k] = rf_flow_inside(flow->view, x[k] / flow->scale_x, y[k] / flow->scale_y);
    }
}

// Smaller than a grid's: what a sprite cannot bend to, it must be too small to show.
#define DEFAULT_RADIUS 20.0f
#define LEAST_RADIUS 2.0f

// As for grids, an exemplar that does not tile must measure one and a half of a sprite's grid, one that tiles one.
static float default_radius(const RfExemplar *exemplar)
{
    float side = (float)rf_min_int(exemplar->width, exemplar->height) / GRID_SIDE;
    return rf_clamp(exemplar->tiles ? side : side / 1.5f, LEAST_RADIUS, DEFAULT_RADIUS);
}

// ---- the front ---------------------------------------------------------------------------------------------------

static RfResult make(const RfExemplar *exemplar, const RfSpritesOptions *options, RfSprites **out)
{
    RfLagrangianOptions particles = rf_lagrangian_defaults();
    particles.seed = options->seed;
    particles.particle_radius = options->particle_radius > 0 ? options->particle_radius : default_radius(exemplar);
    particles.fade = options->fade;
    particles.sharpness = options->sharpness;
    particles.candidates = options->candidates;
    particles.blend = options->blend;
    particles.fps = options->fps;
    // Rigid grids have distortion 1 but for rounding, and nothing wears them out in some time that a fade could follow.
    particles.max_distortion = 100;
    particles.adapt = 0;
    RfSprites *sprites = rf_allocate_zero(1, sizeof *sprites);
    if (!sprites)
        return RF_OUT_OF_MEMORY;
    RfResult result = rf_lagrangian_create(exemplar, &particles, &sprites->particles);
    if (result != RF_OK)
    {
        rf_sprites_destroy(sprites);
        return result;
    }
    sprites->particles->rigid = true;
    sprites->particles->turning = options->turn;
    *out = sprites;
    return RF_OK;
}

RfResult rf_sprites_create(const RfExemplar *exemplar, const RfSpritesOptions *options, RfSprites **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_sprites_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_sprites_defaults", g_options,
                            OPTION_COUNT));
    return make(exemplar, options, out);
}

void rf_sprites_destroy(RfSprites *sprites)
{
    if (!sprites)
        return;
    rf_lagrangian_destroy(sprites->particles);
    rf_release(sprites);
}

RfResult rf_sprites_advance(RfSprites *sprites, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(sprites, "rf_sprites_advance: sprites is NULL");
    return rf_lagrangian_advance(sprites->particles, flow, width, height);
}

RfResult rf_sprites_step(RfSprites *sprites, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(sprites, "rf_sprites_step: sprites is NULL");
    return rf_lagrangian_step(sprites->particles, flow, frame);
}

RfLagrangianStats rf_sprites_stats(const RfSprites *sprites)
{
    return rf_lagrangian_stats(sprites->particles);
}

RfResult rf_sprites_save(const RfSprites *sprites, void **block, size_t *size)
{
    RF_REQUIRE(sprites, "rf_sprites_save: sprites is NULL");
    return rf_lagrangian_save(sprites->particles, block, size);
}

RfResult rf_sprites_load(const RfExemplar *exemplar, const RfSpritesOptions *options, const void *block, size_t size,
                         RfSprites **out)
{
    RF_REQUIRE(block, "rf_sprites_load: block is NULL");
    RF_TRY(rf_sprites_create(exemplar, options, out));
    RfResult result = rf_lagrangian_restore((*out)->particles, block, size);
    if (result != RF_OK)
    {
        rf_sprites_destroy(*out);
        *out = NULL;
    }
    return result;
}
