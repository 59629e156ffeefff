// SPDX-License-Identifier: Apache-2.0
// The moving form of texture optimisation, from inside.
#pragma once

#include "kernels/markers.h"
#include "kernels/neighbours.h"
#include "kernels/ring_cut.h"
#include "methods/optimize/optimize.h"

#include <math.h>

enum
{
    /// Pixels a side of the cells in which wear is judged.
    RF_WEAR_GRAIN = 2,
    /// In which texture that was replaced is seen less and less. 6 make no more of it than 3.
    RF_FADING_FRAMES = 3
};

/// A piece of the exemplar that is laid over worn texture.
typedef struct RfPatch
{
    /// Its middle in the frame and in the exemplar, and how it lies: see rf_bend_of.
    RfVec2 at, source, turn;
    /// [angle]: how far it reaches, in pixels.
    float radius[RF_RING_ANGLES];
} RfPatch;

enum
{
    RF_PATCH_SAMPLES = 1024
};

/// For one thread.
typedef struct RfPatchScratch
{
    int count;
    RfVec2 steps[RF_PATCH_SAMPLES];
    const float *seen[RF_PATCH_SAMPLES];
    RfRing ring;
} RfPatchScratch;

/// A place where texture is worn.
typedef struct RfWornPlace
{
    float wear;
    int cell;
} RfWornPlace;

struct RfOptimize
{
    RfOptimizeOptions options;
    const RfExemplar *exemplar;
    bool placed;
    double time;
    RfSynthesisMaterial material;
    /// The texture, and what of it was renewed a moment ago and fades.
    RfMarkers markers, fading;

    /// Wear is judged in cells of some pixels: how worn each is (over 1: to be renewed), and how the texture there is
    /// to lie when it is renewed.
    int columns, rows;
    float *wear;
    RfVec2 *turns, *smoothed;

    /// Greatest and least radius of patches, in pixels.
    int outer, inner;
    /// They are looked for on a coarse level of the exemplar, among all windows of it.
    int level, side;
    RfWindowDatabase *windows;
    /// [windows]: how much each varies, and what is added to its cost.
    float *variations, *penalties;
    /// The mean of all.
    double variation;
    float *prices;

    int max_patches;
    RfPatch *patches;
    RfWornPlace *worn;
    uint8_t *taken;
    float *queries;
    RfWindowMatch *matches;
    RfPatchScratch *scratch;

    /// Patches that the last step laid.
    int laid;
    /// The mean of the distances of those that were laid last, on the coarse level.
    double distance;
    double seconds[3];
};

/// Allocates all that depends on the frame's size and the exemplar. The material is there.
RfResult rf_optimize_make_room(RfOptimize *optimize, int width, int height);

/// The exemplar's x axis points downstream at a point of the frame; (1, 0) where the flow stands still.
RfVec2 rf_optimize_downstream(const RfFlowView *flow, int width, int height, RfVec2 at);

/// Sets wear and turns.
void rf_optimize_judge(RfOptimize *optimize, const RfFlowView *flow);

/// Renews the texture where it is worn. The markers are at the flow's time.
RfResult rf_optimize_renew(RfOptimize *optimize, const RfFlowView *flow);

/// The middle of a cell of wear, a pixel.
RfVec2 rf_optimize_cell_middle(const RfOptimize *optimize, int cell);

static inline bool rf_optimize_inside(const RfSynthesisExemplar *e, RfVec2 s)
{
    bool inside = s.x >= -0.5f && s.y >= -0.5f && s.x <= (float)e->width - 0.5f && s.y <= (float)e->height - 0.5f;
    return e->tiles ? isfinite(s.x) && isfinite(s.y) : inside;
}
