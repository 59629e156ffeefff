// SPDX-License-Identifier: Apache-2.0
// Sprites: round pieces of the exemplar that particles carry along a flow without bending them.
//
// Yu, Neyret, Bruneton, Holzschuch. Scalable real-time animation of rivers. 2009.
#pragma once

#include "lagrangian.h"

typedef struct RfSpritesOptions
{
    /// Set by rf_sprites_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Same seed and same input: same bytes, with any number of threads. Default 1.
    uint64_t seed;
    /// Poisson-disk radius d, in output pixels, 2 to 4096; 0 picks 20, or less where the exemplar is small. Smaller
    /// follows the flow closer and blends more. An exemplar that does not tile must measure 3.9 d.
    float particle_radius;
    /// Sprites turn as the flow does round them. Default true. Otherwise they only move.
    bool turn;
    /// Time a sprite takes to fade in or out, in seconds, 0 to 1000. Default 1.
    float fade;
    /// Power of the kernel weight, 0.25 to 12. Default 1.5. Larger keeps shapes by drawing one sprite nearly
    /// everywhere.
    float sharpness;
    /// Places in the exemplar tried for a new sprite, 1 to 1000000. Default 12; 1 takes any.
    int candidates;
    /// How overlapping sprites are summed. Default RF_BLEND_CONTRAST.
    RfBlend blend;
    /// Frames a second: turns `fade` into frames. 0.01 to 10000. Default 24.
    float fps;
} RfSpritesOptions;

RF_API RfSpritesOptions rf_sprites_defaults(void);
RF_API const RfOption *rf_sprites_option_table(int *count);

typedef struct RfSprites RfSprites;

/// As the functions of the same names of RfLagrangian.
RF_API RF_MUST_USE RfResult rf_sprites_create(const RfExemplar *exemplar, const RfSpritesOptions *options,
                                              RfSprites **out);
RF_API RF_MUST_USE RfResult rf_sprites_step(RfSprites *sprites, const RfFlowView *flow, const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_sprites_advance(RfSprites *sprites, const RfFlowView *flow, int width, int height);
RF_API RfLagrangianStats rf_sprites_stats(const RfSprites *sprites);
RF_API RF_MUST_USE RfResult rf_sprites_save(const RfSprites *sprites, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_sprites_load(const RfExemplar *exemplar, const RfSpritesOptions *options,
                                            const void *block, size_t size, RfSprites **out);
RF_API void rf_sprites_destroy(RfSprites *sprites);
