// SPDX-License-Identifier: Apache-2.0
// Texture optimisation: windows of a frame look for their like in the exemplar, and the frame is made anew from what
// they found, in turn, until they agree.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005 (energy, search and assign).
// Han, Zhou, Wei, Gong, Bao, Zhang, Guo. Fast example-based surface texture synthesis via discrete optimization. 2006
// (k-coherent candidates; a pixel becomes one of the candidates, not their mean).
#pragma once

#include "core/maths.h"
#include "kernels/fixed_picture.h"
#include "kernels/neighbours.h"
#include "kernels/similar.h"
#include "kernels/usage.h"

enum
{
    /// Beyond an exemplar's borders, so that windows of one that tiles need no test.
    RF_SYNTHESIS_APRON = RF_FIXED_SIDE
};

/// One level of an exemplar: what windows are compared with.
typedef struct RfSynthesisExemplar
{
    int width, height, channels;
    bool tiles;
    /// [height][width][channels], in the unit of comparison: squared differences are summed as they are.
    float *pixels;
    /// The same times `scale`.
    RfFixedPicture fixed;
    float scale;
    RfSimilar similar;
} RfSynthesisExemplar;

/// A window of the frame and what it found. Positions are pixel indices: a pixel's centre is a whole number.
typedef struct RfSynthesisWindow
{
    /// Of its centre, in the frame and in the exemplar.
    RfVec2 at, source;
    /// How the exemplar lies in the frame: from `at`, a step d in the frame is the step turn * d in the exemplar, both
    /// as complex numbers. (1, 0): as it is.
    RfVec2 turn;
    /// Sum of squared differences when it was last compared, in fixed-point units.
    float cost;
    bool exists;
    /// Its match or its cost are others than before the last search.
    bool changed;
} RfSynthesisWindow;

/// A frame in the making. It is cut into cells of `spacing` pixels, each with one window at most.
typedef struct RfSynthesisFrame
{
    int width, height;
    bool tiles;
    int spacing, columns, rows;
    RfSynthesisWindow *windows;
    /// Of cells: a pixel became another in the last assignment.
    uint8_t *stirred;
    /// [height][width]: where each pixel comes from in the exemplar.
    RfVec2 *sources;
    /// What the pixels look like, in the unit of comparison and fixed point.
    RfFixedPicture picture;
} RfSynthesisFrame;

static inline RfVec2 rf_turn(RfVec2 turn, RfVec2 step)
{
    return (RfVec2){turn.x * step.x - turn.y * step.y, turn.x * step.y + turn.y * step.x};
}

/// The step back: rf_turn(turn, rf_turn_back(turn, step)) is step.
static inline RfVec2 rf_turn_back(RfVec2 turn, RfVec2 step)
{
    float square = turn.x * turn.x + turn.y * turn.y;
    return rf_turn((RfVec2){turn.x / square, -turn.y / square}, step);
}

/// The exemplar's pixel nearest to a place; beyond a border its last one, or round the other side where it tiles.
static inline const int16_t *rf_synthesis_pixel(const RfSynthesisExemplar *exemplar, RfVec2 place)
{
    return rf_fixed_at(&exemplar->fixed, rf_border_int(rf_nearest_int(place.x), exemplar->width, exemplar->tiles),
                       rf_border_int(rf_nearest_int(place.y), exemplar->height, exemplar->tiles));
}

/// Takes over `pixels`, also on failure. coarse: the level of half the size, or NULL. similar: places a list.
RfResult rf_synthesis_exemplar_create(float *pixels, int width, int height, int channels, bool tiles, float scale,
                                      int similar, const RfSynthesisExemplar *coarse, RfSynthesisExemplar *out);
void rf_synthesis_exemplar_free(RfSynthesisExemplar *exemplar);

/// No windows, and no sources: all (0, 0).
RfResult rf_synthesis_frame_create(int width, int height, int channels, bool tiles, RfSynthesisFrame *out);
void rf_synthesis_frame_free(RfSynthesisFrame *frame);
/// Cuts the frame into cells of `spacing`, without windows.
RfResult rf_synthesis_cut(RfSynthesisFrame *frame, int spacing);
/// The pixel in the middle of a cell.
static inline RfVec2 rf_synthesis_cell_middle(const RfSynthesisFrame *frame, int column, int row)
{
    int x = column * frame->spacing + frame->spacing / 2, y = row * frame->spacing + frame->spacing / 2;
    return (RfVec2){(float)(x < frame->width ? x : frame->width - 1),
                    (float)(y < frame->height ? y : frame->height - 1)};
}
/// A window in the middle of every cell; it lies as `turns` ([height][width], NULL: all (1, 0)) say there, and
/// continues the frame's sources.
void rf_synthesis_place(RfSynthesisFrame *frame, const RfVec2 *turns);
/// Every window starts at a random place of the exemplar.
void rf_synthesis_scatter(RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int side, uint64_t seed);
/// Doubles the sources of a coarser frame. turns: of the finer one's pixels, as above.
void rf_synthesis_refine(const RfSynthesisFrame *coarse, const RfVec2 *turns, RfSynthesisFrame *fine);
/// What pixels are held to and how strongly, against a weight of 1 of what the exemplar says.
typedef struct RfSynthesisHeld
{
    /// Channels without the guides.
    const RfFixedPicture *to;
    /// [height][width]; NULL: nothing is held.
    const float *hold;
} RfSynthesisHeld;

/// A channel's value where the exemplar says `value`.
static inline float rf_synthesis_hold(const RfSynthesisHeld *held, int width, int x, int y, int channel, float value)
{
    float hold = held->hold[(ptrdiff_t)y * width + x];
    return (value + hold * rf_fixed_at(held->to, x, y)[channel]) / (1 + hold);
}

/// Sets the picture from the sources and what they are held to, but for its last `guides` channels.
void rf_synthesis_show(RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int guides, RfSynthesisHeld held);

/// Moves the prices by where the frame's windows, of this side, come from.
void rf_synthesis_settle_prices(const RfSynthesisFrame *frame, const RfSynthesisExemplar *exemplar, int side,
                                RfUsage *usage);
/// Prices for RfSynthesisSearch: those of the exemplar's cells times `scale`.
void rf_synthesis_prices(const RfSynthesisExemplar *exemplar, int side, const RfUsage *usage, float scale,
                         float *prices);

/// Penalties of an exact search: the prices (as below, or NULL) times `unit`, less `part` of the windows' variations
/// (rf_windows_vary, or NULL). What is smooth is least unlike to anything: for windows that have nothing to do with
/// each other the sum of squared differences is, in the mean, the sum of both variations. Where nothing fits well yet,
/// smooth windows would win, and a texture would lose its contrast.
void rf_synthesis_penalties(const RfSynthesisExemplar *exemplar, const RfWindowDatabase *windows, int side,
                            const float *prices, float unit, const float *variations, float part, float *penalties);

typedef struct RfSynthesisSearch
{
    const RfSynthesisExemplar *exemplar;
    RfSynthesisFrame *frame;
    /// Of the windows, odd.
    int side;
    /// All windows of the exemplar, for the exact search; NULL: k-coherent candidates.
    const RfWindowDatabase *windows;
    /// [height][width] of the exemplar, for a window's centre, added to its cost; NULL: none.
    const float *prices;
    /// rf_windows_vary of `windows`: costs are lowered by 3/4 of them, see rf_synthesis_penalties. NULL: they are not.
    const float *variations;
    /// As in RfSynthesisAssign.
    int guides;
    RfSynthesisHeld held;
    /// Whole pixels only, and nothing turned: the fast path.
    bool plain;
    /// Windows where nothing has changed too.
    bool all;
    uint64_t seed, round;
} RfSynthesisSearch;

/// Mean costs, in fixed-point units.
typedef struct RfSynthesisEnergy
{
    /// Of all windows, and of those that were compared.
    double mean, compared;
} RfSynthesisEnergy;

/// Gives every window its match.
RfResult rf_synthesis_search(const RfSynthesisSearch *search, RfSynthesisEnergy *energy);

typedef struct RfSynthesisAssign
{
    const RfSynthesisExemplar *exemplar;
    RfSynthesisFrame *frame;
    int side;
    /// A pixel becomes the mean of what its windows say, not one of them.
    bool mean;
    /// Windows that fit badly count less (energy with r = 0.8; else r = 2).
    bool robust;
    /// Places that differ by up to this, in exemplar pixels, count as one: that of the heaviest window. 0 where nothing
    /// is turned or scaled.
    float together;
    /// Cells where nothing has changed too.
    bool all;
    /// Channels at the end of the picture that are given, not made.
    int guides;
    /// Against a weight of 1 of all windows over a pixel together.
    RfSynthesisHeld held;
} RfSynthesisAssign;

/// Makes sources and picture from the windows.
RfResult rf_synthesis_assign(const RfSynthesisAssign *assign);
