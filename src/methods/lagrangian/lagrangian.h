// SPDX-License-Identifier: Apache-2.0
// The state of Lagrangian texture advection, and the verbs a step is made of.
#pragma once

#include "riffle/lagrangian.h"

#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "data/exemplar.h"
#include "data/flow_field.h"
#include "kernels/blending.h"
#include "kernels/histogram.h"

enum
{
    MAX_LANES = 4 * RF_TEXTURE_QUADS,
    /// Older grids that a grid remembers its resemblance to: the strongest, should there be more.
    MAX_RESEMBLANCES = 12
};

/// Kernel radius and grid side in Poisson-disk radii. The paper has 1 and 2.6; see methods/lagrangian/refill.c for
/// the 1.1.
#define KERNEL_RADIUS 1.1f
#define GRID_SIDE 2.6f
#define ALPHA 0.25f

/// How the channels of a frame lie in the texture, and how the sums become channels again.
typedef struct Material
{
    RfTexture texture;
    int lane_count;
    int lane_of_channel[RF_MAX_EXEMPLAR_CHANNELS];
    /// A lane's mean (removed in the texture), range and weight in comparisons; whether it is blended plainly whatever
    /// the method.
    float mean[MAX_LANES], low[MAX_LANES], high[MAX_LANES], match_weight[MAX_LANES];
    bool plain[MAX_LANES];
    /// Of every lane at every texture level.
    float variance[RF_TEXTURE_LEVELS][MAX_LANES];
    int turned[RF_TEXTURE_QUADS];
    /// By map; channels is 0 where the map is not made Gaussian.
    RfHistogram histograms[RF_MAX_MAPS];
    RfBlend blend;
} Material;

typedef struct Resemblance
{
    uint32_t id;
    float correlation;
} Resemblance;

typedef struct Grid
{
    uint32_t id;
    bool retired;
    /// In frames; fade lengths of 0 mean at once.
    double birth, retirement;
    float fade_in, fade_out;
    /// The others' weight at the centre when the grid was born, at most 1.
    float others;
    RfVec2 centre;
    /// Exemplar coordinates of vertex (0, 0).
    float u0, v0;
    float turn_cos, turn_sin;
    /// Mean deformation, d(x, y) / d(u, v).
    float stretch[4];
    float least_quality, greatest_quality;
    /// Rate of strain at the centre, 1 / frame.
    float strain;
    int inside_count, resemblance_count;
    /// What befell the grid in this step.
    bool folded, worn, uncovering;
    Resemblance resemblances[MAX_RESEMBLANCES];
} Grid;

struct RfLagrangian
{
    const RfExemplar *exemplar;
    RfLagrangianOptions options;
    /// Sprites: grids do not bend; whether they turn with the flow.
    bool rigid, turning;
    Material material;
    /// Halvings of the exemplar at which new grids are matched first.
    int match_halvings;
    float radius, cell;
    int width, height;
    bool started;
    double time;
    uint64_t step;
    uint32_t next_id;
    /// Grids in order of birth, so ids ascend. Vertices of grid g: x, y, quality + g * n * n.
    int count, capacity;
    Grid *grids;
    float *x, *y, *quality;
    RfArena arena, workers[RF_MAX_THREADS];
    RfLagrangianStats stats;
};

RfResult rf_lagrangian_material_create(const RfExemplar *exemplar, RfBlend blend, Material *out);
void rf_lagrangian_material_free(Material *material);

/// What a step needs to know of the flow.
typedef struct StepFlow
{
    const RfFlowView *view;
    double from;
    float scale_x, scale_y;
} StepFlow;

/// grids.c
RfResult rf_lagrangian_grids_reserve(RfLagrangian *l, int capacity);
void rf_lagrangian_grids_advect(RfLagrangian *l, const StepFlow *flow);
void rf_lagrangian_grids_measure_new(RfLagrangian *l, const StepFlow *flow, int index);
RfResult rf_lagrangian_grids_retire(RfLagrangian *l, const StepFlow *flow);
void rf_lagrangian_grids_drop(RfLagrangian *l);
float rf_lagrangian_grid_fade(const Grid *grid, double time);
/// Frames that a fade takes where the flow strains at this rate. The fainter the others that a grid takes over from (0
/// to 1), the sooner they will be gone, and the shorter.
float rf_lagrangian_fade_length(const RfLagrangian *l, float strain, float others);

/// sprites.c: as rf_advect_grid for the vertices of a rigid grid.
void rf_lagrangian_sprite_advect(const RfLagrangian *l, const StepFlow *flow, RfVec2 centre, float *x, float *y,
                                 bool *inside);

/// state.c: brings a saved state into a stepper that was just made.
RfResult rf_lagrangian_restore(RfLagrangian *l, const void *block, size_t size);

/// refill.c
int rf_lagrangian_coarsest_halvings(const RfLagrangian *l);
RfResult rf_lagrangian_grids_refill(RfLagrangian *l, const StepFlow *flow);

/// draw.c
RfDrawGrid rf_lagrangian_draw_grid_of(const RfLagrangian *l, int index, double time);
RfResult rf_lagrangian_frame_draw(RfLagrangian *l, const StepFlow *flow, const RfImageView *frame);
