// SPDX-License-Identifier: Apache-2.0
// Directional moving texture, from inside.
#pragma once

#include "core/maths.h"
#include "data/flow_field.h"
#include "kernels/comparison.h"
#include "kernels/patch_search.h"
#include "kernels/ring_cut.h"
#include "kernels/sampler.h"
#include "kernels/turned_copies.h"
#include "riffle/directional.h"

#include <math.h>

/// Of a pixel: where its texture comes from.
typedef struct RfTexel
{
    /// Exemplar coordinates, a pixel's centre at i + 0.5.
    RfVec2 source;
    /// How far the flow has gone beyond whole pixels, in pixels.
    RfVec2 rest;
    /// How often it was blended.
    float blends;
    /// The turned copy; -1: nothing is here.
    int32_t copy;
} RfTexel;

/// A rectangle of the frame, in pixels.
typedef struct RfCell
{
    int x, y, width, height;
} RfCell;

enum
{
    /// Side of the regions in which it is counted what is shown.
    RF_DIRECTIONAL_REGION = 128
};

/// A cell of the frame before, and how it moves.
typedef struct RfMove
{
    RfCell cell;
    /// The mean of its pixels; and by how many whole pixels it moves.
    RfVec2 velocity;
    int dx, dy;
} RfMove;

typedef struct RfCellList
{
    RfCell *cells;
    int count, room;
} RfCellList;

/// What one thread needs to look for a patch and lay it. A patch's box is the cell grown by the mask's width.
typedef struct RfPatchScratch
{
    float pixels[RF_PATCH_BOX * RF_PATCH_BOX * RF_MAX_EXEMPLAR_CHANNELS];
    float weights[RF_PATCH_BOX * RF_PATCH_BOX];
    /// Of the patch, 0 to 1, at each pixel of the box.
    float alpha[RF_PATCH_BOX * RF_PATCH_BOX];
    /// Pixels from the hole, squared.
    int distance[RF_PATCH_BOX * RF_PATCH_BOX];
    RfPatchTerms terms;
    float prices[RF_LOOKS];
    RfRing ring;
} RfPatchScratch;

struct RfDirectional
{
    RfDirectionalOptions options;
    const RfExemplar *exemplar;
    RfComparison comparison;
    RfSampler sampler;
    RfTurnedCopies copies;
    /// Of the exemplar, degrees.
    float direction, directionality;
    /// The largest side of a cell whose patch has room in the exemplar however it is turned; at most options.cell_max.
    int cell_max;

    /// All below depends on the first frame.
    bool placed;
    int width, height;
    double time;
    /// [height][width] and [height][width][channels]: the texture, what it is blended with and what both look like;
    /// and room for those of the next frame.
    RfTexel *texels, *next_texels;
    float *blended, *next_blended, *picture, *next_picture;
    /// [height][width]: how far the flow goes in this step, in pixels; its direction, radians, NAN where it stands
    /// still; 1 inside the fluid.
    RfVec2 *velocity;
    float *direction_at;
    uint8_t *inside;
    /// [height][width]: the moves that land on a pixel, the better one first; -1: none.
    int32_t *first, *second;
    int32_t *stack;
    uint8_t *loose;
    RfCellList cells, holes;
    RfMove *moves;
    int move_room;
    /// One a thread, as many as there ever were.
    RfPatchScratch *scratch;
    int scratch_count;
    /// Frames that this step goes.
    float frames;
    /// Of each look in each region of the frame: what a patch of it costs, in parts of the exemplar's variance for each
    /// pixel that the patch is compared at.
    float (*prices)[RF_LOOKS];
    int region_columns, region_rows;
    /// Pixels counted in the last step.
    int64_t fluid, filled, continued, renewed;
    /// Patches laid since the first frame, for drawing at random where nothing is known.
    uint64_t laid;
    /// Since the first frame: cells lie differently in each.
    uint64_t steps;
    double seconds[3];
};

RfResult rf_directional_check(const RfDirectionalOptions *options);
/// The sampler and the turned copies; and room for frames of this size.
RfResult rf_directional_make_room(RfDirectional *directional, int width, int height);

/// The farthest that two directions of a cell may lie apart, and a pixel's from its texture's: 2 pi / n.
static inline float rf_directional_step_angle(const RfDirectional *d)
{
    return 2 * RF_PI / (float)d->options.rotations;
}

static inline float rf_angle_between(float a, float b)
{
    float turns = (a - b) / (2 * RF_PI);
    return (turns - floorf(turns + 0.5f)) * (2 * RF_PI);
}

/// What a pixel looks like: what its place in the exemplar shows, and what it is blended with.
static inline void rf_directional_show(const RfDirectional *d, const RfTexel *texel, const float *blended,
                                       float *values)
{
    float own[RF_SAMPLE_CHANNELS];
    rf_sampler_at(&d->sampler, texel->source, rf_turned_copy_jacobian(&d->copies, texel->copy), own);
    for (int c = 0; c < d->exemplar->channels; ++c)
        values[c] = own[c] + blended[c];
}

/// The other way round: sets what it is blended with, so that it looks like `values`, up to rounding: they are set to
/// what rf_directional_show() will say.
static inline void rf_directional_keep(const RfDirectional *d, const RfTexel *texel, float *values, float *blended)
{
    float own[RF_SAMPLE_CHANNELS];
    rf_sampler_at(&d->sampler, texel->source, rf_turned_copy_jacobian(&d->copies, texel->copy), own);
    for (int c = 0; c < d->exemplar->channels; ++c)
    {
        blended[c] = values[c] - own[c];
        values[c] = own[c] + blended[c];
    }
}

// ---- cells.c

/// Sets velocity, direction and inside for a step from one time to the next.
void rf_directional_read_flow(RfDirectional *directional, const RfFlowView *flow, double from);
/// The mean direction of a cell's pixels that are wanted; NAN if none has one. wanted: [height][width].
float rf_directional_mean(const RfDirectional *directional, RfCell cell,
                          bool (*wanted)(const RfDirectional *, int pixel));
bool rf_directional_fluid(const RfDirectional *directional, int pixel);
bool rf_directional_missing(const RfDirectional *directional, int pixel);
/// Splits the frame, or one cell, into cells in which the directions of wanted pixels differ little. Cells without such
/// a pixel are left out.
RfResult rf_directional_split_frame(RfDirectional *directional, RfCellList *list);
RfResult rf_directional_split_hole(RfDirectional *directional, RfCell cell, RfCellList *list);
/// Sets `moves` and their number in `cells`.
RfResult rf_directional_split_moves(RfDirectional *directional);

// ---- moving.c

/// Moves the texture, leaves out what is not valid, and continues it across cracks.
void rf_directional_move(RfDirectional *directional);

// ---- masks.c

/// Sets weights and alpha of a box: for a cell with a hole, whose box is larger; for a cell that is replaced.
void rf_directional_mask_hole(const RfDirectional *directional, RfCell cell, RfCell box, RfPatchScratch *scratch);
void rf_directional_mask_cell(const RfDirectional *directional, RfCell cell, RfPatchScratch *scratch);
/// Cuts the patch whose first pixel shows `source` along the closed line round the cell where it differs least from the
/// frame: alpha becomes 1 within it and 0 beyond.
void rf_directional_cut(const RfDirectional *directional, RfCell cell, RfCell box, int copy, RfVec2 source,
                        RfPatchScratch *scratch);

// ---- filling.c

/// Makes the first frame.
RfResult rf_directional_start(RfDirectional *directional);
/// Fills all pixels of the fluid without texture.
RfResult rf_directional_fill(RfDirectional *directional);
/// Replaces cells that were blended too often.
RfResult rf_directional_renew(RfDirectional *directional);
