// SPDX-License-Identifier: Apache-2.0
// Directional moving texture: pieces of the exemplar, turned downstream, that the flow carries without bending them.
//
// Wang, Wang, Yong, Sun. Synthesizing 2D directional moving texture. 2005.
#pragma once

#include "data.h"

typedef enum RfDirectionalSeam
{
    /// Overlapping pieces fade into each other.
    RF_SEAM_FEATHER,
    /// They are cut along the line where they differ least.
    RF_SEAM_CUT
} RfDirectionalSeam;

typedef enum RfDirectionalCells
{
    /// A moving cell's velocities differ from their mean by `velocity_spread` at most.
    RF_CELLS_NEAR,
    /// By its least speed at most, so that no two differ by twice the least (the paper's rule). Opposite directions may
    /// then share a cell.
    RF_CELLS_LEAST
} RfDirectionalCells;

typedef struct RfDirectionalOptions
{
    /// Set by rf_directional_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Same seed and same input: same bytes, with any number of threads. Default 1.
    uint64_t seed;
    /// Turned copies of the exemplar, n, 4 to 180. Default 24. Texture is replaced where the flow's direction differs
    /// from its own by more than 360 / n degrees: with more it lies closer along the flow, and is replaced sooner.
    int rotations;
    /// The exemplar's main direction, which is to point downstream: degrees, 0 along its x axis, clockwise, up to 360;
    /// below 0 it is found (Tamura et al. 1978). Default -1.
    float direction;
    /// Sides of cells and patches in pixels, 2 to 48. Defaults 4 and 32.
    int cell_min, cell_max;
    /// How a moving cell's velocities may differ. Default RF_CELLS_NEAR.
    RfDirectionalCells cells;
    /// Of RF_CELLS_NEAR, in pixels a frame, 0.05 to 100. Default 0.5.
    float velocity_spread;
    /// Pixels round a hole that a patch is matched with and fades into, D, 1 to 8. Default 4.
    int mask_width;
    /// A cell is replaced when its pixels were blended more often than this in the mean, 0 to 1000; 0: never.
    /// Default 2.
    float renew_after;
    /// Speeds are limited to these, in pixels a frame, 0 to 1000; 0: not. Slow texture is carried by whole pixels as
    /// soon as it has gone as far, so that `speed_min` is needed only where a standstill is unwanted. Default 0.
    float speed_min, speed_max;
    /// How dear a patch is whose look (brightness and contrast of what is in its middle) is already shown more often
    /// than the exemplar has it, 0 to 20; 0: patches are chosen by fit alone, as in the paper, and the plain ones crowd
    /// out all others where much is replaced. Default 1.
    float spread;
    /// How patches meet in the first frame. Default RF_SEAM_FEATHER.
    RfDirectionalSeam seam;
} RfDirectionalOptions;

RF_API RfDirectionalOptions rf_directional_defaults(void);
RF_API const RfOption *rf_directional_option_table(int *count);

typedef struct RfDirectional RfDirectional;

/// As the functions of the same names of RfLagrangian.
RF_API RF_MUST_USE RfResult rf_directional_create(const RfExemplar *exemplar, const RfDirectionalOptions *options,
                                                  RfDirectional **out);
RF_API RF_MUST_USE RfResult rf_directional_step(RfDirectional *directional, const RfFlowView *flow,
                                                const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_directional_advance(RfDirectional *directional, const RfFlowView *flow, int width,
                                                   int height);

/// The exemplar's main direction, and what the last step did. Times are seconds of this step.
typedef struct RfDirectionalStats
{
    /// Degrees, as options.direction; and how much of a main direction the exemplar has, 0 to 1.
    float direction, directionality;
    /// Directionality is so low that the texture will not show the flow's direction, and no direction was given.
    bool isotropic;
    /// Parts of the fluid's pixels: in holes that were filled, continued across cracks, in cells that were replaced.
    float filled, continued, renewed;
    double move_seconds, fill_seconds, renew_seconds;
} RfDirectionalStats;

RF_API RfDirectionalStats rf_directional_stats(const RfDirectional *directional);
RF_API RF_MUST_USE RfResult rf_directional_save(const RfDirectional *directional, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_directional_load(const RfExemplar *exemplar, const RfDirectionalOptions *options,
                                                const void *block, size_t size, RfDirectional **out);
RF_API void rf_directional_destroy(RfDirectional *directional);
