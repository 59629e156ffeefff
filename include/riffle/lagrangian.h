// SPDX-License-Identifier: Apache-2.0
// Lagrangian texture advection: small textured grids that the flow carries and deforms, faded in and out and blended.
//
// Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. INRIA RR-6810, 2009.
// Blending: Heitz, Neyret. High-performance by-example noise using a histogram-preserving blending operator. 2018.
#pragma once

#include "data.h"

/// Start from rf_lagrangian_defaults() or rf_lagrangian_paper(). A struct that did not is refused.
typedef struct RfLagrangianOptions
{
    /// Set by the defaults; tells a program built against another version.
    uint32_t struct_size;

    /// Same seed and same input: same bytes, with any number of threads. Default 1.
    uint64_t seed;

    /// Poisson-disk radius d, in output pixels, 2 to 4096; 0 picks 64, or less where the exemplar's shorter side is
    /// under 3.9 d, or 2.6 d if it tiles. Smaller follows the flow closer and blends more; cost grows as 1 / d^2. An
    /// exemplar that does not tile must measure 3.9 d; a larger d is refused with the one that fits.
    float particle_radius;

    /// Vertices along a side of a grid, 4 to 32. Default 8. More follow fine motion; cost grows as its square.
    int grid_vertices;

    /// Largest stretch or squash of a triangle before its weight is 0 (delta_max), 1.05 to 100. Default 1.95. Smaller
    /// keeps the spectrum, larger follows longer.
    float max_distortion;

    /// How fast a grid slips back to its rest shape, in units of the rate of strain round it, 0 to 1000. Default 1.5;
    /// 0 never, as in the paper. In a steady strain a grid then settles at a stretch of exp(1 / relaxation) and lives
    /// on. Larger keeps the spectrum and draws fewer layers, smaller follows the flow closer at the rim of a grid.
    float relaxation;

    /// Longest time a grid takes to fade in or out (tau), in seconds, 0 to 1000. Default 5. Where the flow strains
    /// fast, fades are shorter.
    float fade;

    /// How far fades follow the local strain, 0 to 1. Default 1. 0 fades everything over `fade`, 1 ends a fade before
    /// the distortion reaches its limit. Whatever it is, a grid born where next to nothing else shows comes in over
    /// half a second (or `fade`, if that is less).
    float adapt;

    /// Power of the kernel weight K_p, 0.25 to 12. Default 1.5. 1 is the paper's; larger keeps shapes by drawing one
    /// picture nearly everywhere.
    float sharpness;

    /// Places in the exemplar tried for a new grid, 1 to 1000000. Default 12; the one that fits best what is drawn
    /// there now is taken. 1 takes any.
    int candidates;

    /// How overlapping grids are summed. Default RF_BLEND_CONTRAST, which here allows for grids that resemble each
    /// other.
    RfBlend blend;

    /// Frames a second: turns `fade` into frames. 0.01 to 10000. Default 24.
    float fps;
} RfLagrangianOptions;

/// The best we found; docs/lagrangian.md shows how it was chosen.
RF_API RfLagrangianOptions rf_lagrangian_defaults(void);
/// The constants of the paper: delta_max 5, tau 5 s everywhere (but half a second for grids born where next to nothing
/// else shows), linear kernel, random areas, no relaxation.
RF_API RfLagrangianOptions rf_lagrangian_paper(void);
/// Every field of the options but struct_size.
RF_API const RfOption *rf_lagrangian_option_table(int *count);

/// What a step did. Times are seconds of this step.
typedef struct RfLagrangianStats
{
    /// Grids that live, that fade out, that were born and that were retired in this step.
    int live, fading, born, retired;
    /// Fluid pixels that no grid covers: always 0 unless something is wrong.
    int64_t holes;
    /// Layers drawn, in frames' worth of pixels.
    float layers;
    double advect_seconds, distribute_seconds, draw_seconds;
} RfLagrangianStats;

typedef struct RfLagrangian RfLagrangian;

/// The exemplar is borrowed and must outlive `*out`.
RF_API RF_MUST_USE RfResult rf_lagrangian_create(const RfExemplar *exemplar, const RfLagrangianOptions *options,
                                                 RfLagrangian **out);

/// Moves to `flow->time` and draws the frame, which must have the exemplar's channels and, after the first step, its
/// old size. The first step only places grids. Times must not decrease. Pixels outside the fluid become 0. On failure
/// `frame` holds its old pixels; after RF_OUT_OF_MEMORY the stepper is good for destroying only.
RF_API RF_MUST_USE RfResult rf_lagrangian_step(RfLagrangian *lagrangian, const RfFlowView *flow,
                                               const RfImageView *frame);

/// The same without drawing: for frames that are passed over.
RF_API RF_MUST_USE RfResult rf_lagrangian_advance(RfLagrangian *lagrangian, const RfFlowView *flow, int width,
                                                  int height);

/// What the last step was made of, for renderers and compositors that shade themselves: for each pixel the four
/// strongest grids, strongest first, as u v weight id. `layers` has 16 channels and the frame's size; u, v in exemplar
/// pixels (not wrapped); weights are normalised to sum to 1 over all grids; missing grids are 0 0 0 -1. Land is not
/// left out.
RF_API RF_MUST_USE RfResult rf_lagrangian_layers(const RfLagrangian *lagrangian, const RfImageView *layers);

RF_API RfLagrangianStats rf_lagrangian_stats(const RfLagrangian *lagrangian);

/// The Poisson-disk radius in use: particle_radius, or the one picked for 0.
RF_API float rf_lagrangian_radius(const RfLagrangian *lagrangian);

/// One relocatable block (version, hash, sizes) from which rf_lagrangian_load goes on with the same bytes. Free it with
/// rf_free.
RF_API RF_MUST_USE RfResult rf_lagrangian_save(const RfLagrangian *lagrangian, void **block, size_t *size);
/// Refuses a block of another version, exemplar, options or instruction set, and a damaged one, with RF_BAD_INPUT.
RF_API RF_MUST_USE RfResult rf_lagrangian_load(const RfExemplar *exemplar, const RfLagrangianOptions *options,
                                               const void *block, size_t size, RfLagrangian **out);

RF_API void rf_lagrangian_destroy(RfLagrangian *lagrangian);
