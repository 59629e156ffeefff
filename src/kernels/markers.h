// SPDX-License-Identifier: Apache-2.0
// Material points that carry a texture, about one a pixel. Each knows where it comes from in the exemplar and how the
// texture round it is bent, travels with the flow and is turned and strained by it.
//
// What is drawn from them is bent as the flow bends it and never interpolated twice: nothing blurs, however long it
// travels. Where points of different origin meet, the border between them is a line in the material, which moves by
// parts of a pixel as the rest does.
#pragma once

#include "core/maths.h"
#include "data/flow_field.h"

/// A step (x, y) in the frame is the step x * this.x + y * this.y in the exemplar.
typedef struct RfBend
{
    RfVec2 x, y;
} RfBend;

#define RF_CONTINUED_MOST 1e6f

typedef struct RfMarker
{
    /// Pixel indices: a pixel's centre is a whole number.
    RfVec2 at, source;
    RfBend bend;
    /// How much of it is seen, 0 to 1; 0: there is none.
    float share;
    /// How far the texture was continued to here from where it was laid, in pixels: where the flow enters the frame,
    /// the more the longer ago; RF_CONTINUED_MOST at most.
    float continued;
} RfMarker;

/// [height][width], in the pixel that they lie in: one at most in each.
typedef struct RfMarkers
{
    int width, height;
    /// The frame continues across its own borders.
    bool tiles;
    RfMarker *pixels, *next;
    /// Scratch: a pixel for each, and a number for each row.
    int32_t *index;
    int *reach;
} RfMarkers;

/// No markers.
RfResult rf_markers_create(int width, int height, bool tiles, RfMarkers *out);
void rf_markers_free(RfMarkers *markers);

/// Carries all markers from time `from` to flow->time.
void rf_markers_carry(RfMarkers *markers, const RfFlowView *flow, double from);
/// After markers were carried: pixels without one get one that continues the nearest. Where the flow swept all of them
/// out of the frame, the texture stays where it was.
void rf_markers_fill(RfMarkers *markers);

enum
{
    RF_MAX_VOICES = 9
};

/// Where a pixel comes from: one place, or where markers of different origin meet several. Shares sum to 1; no voice:
/// there is no marker near.
typedef struct RfVoices
{
    int count;
    RfVec2 places[RF_MAX_VOICES];
    float shares[RF_MAX_VOICES];
    /// One of the markers that say so.
    const RfMarker *markers[RF_MAX_VOICES];
} RfVoices;

void rf_markers_hear(const RfMarkers *markers, int x, int y, RfVoices *out);

/// The share of the pixel's marker; where it has none, but its left and right or its upper and lower neighbour have
/// one, their mean.
float rf_markers_share(const RfMarkers *markers, int x, int y);

/// Where a point of the frame comes from as the marker of its pixel says, which must be there.
RfVec2 rf_markers_source(const RfMarkers *markers, RfVec2 at);

static inline RfVec2 rf_bend(RfBend bend, RfVec2 step)
{
    return (RfVec2){bend.x.x * step.x + bend.y.x * step.y, bend.x.y * step.x + bend.y.y * step.y};
}

/// The bend that only turns: a step d in the frame is the step turn * d in the exemplar, both as complex numbers.
static inline RfBend rf_bend_of(RfVec2 turn)
{
    return (RfBend){{turn.x, turn.y}, {-turn.y, turn.x}};
}

/// The turn nearest to a bend, of unit length, and the bend's greatest and least stretch, the latter below 0 if it
/// mirrors.
typedef struct RfBendParts
{
    RfVec2 turn;
    float most, least;
} RfBendParts;

RfBendParts rf_bend_parts(RfBend bend);
