// SPDX-License-Identifier: Apache-2.0
// Exact nearest windows: for every query window, which w x w window of the exemplar is most like it?
//
// A *database* holds all windows of one or several pictures (the exemplar, and turned or shifted copies of it). A
// search compares windows of w * w * channels numbers by their weighted sum of squared differences
//
//     distance(q, c) = sum over pixels p, channels k:  query weight_p * channel weight_k * (q_pk - c_pk)^2
//
// and finds the true least of it, always; of equals the lower candidate wins. The result does not depend on the
// instruction set or on the number of threads.
#pragma once

#include "riffle/data.h"

enum
{
    RF_MAX_WINDOW_SIDE = 65,
    RF_MAX_WINDOW_CHANNELS = RF_MAX_EXEMPLAR_CHANNELS,
    RF_MAX_WINDOW_COPIES = 4096,
    RF_MAX_WINDOW_CANDIDATES = 1 << 24,
    RF_MAX_WINDOW_COMPONENTS = 64
};

/// One picture that windows are taken from. Its pixels are copied by the database.
typedef struct RfWindowSource
{
    RfImageView image;
    /// [height][width], 0: not valid. NULL: all are. A pixel with a number that is not finite, or beyond +-1e12, is
    /// never valid. Only windows that lie wholly in valid pixels count.
    const uint8_t *valid;
    /// 6 floats a, b, c, d, e, f: pixel (x, y) here shows what lies at (a x + b y + c, d x + e y + f) in the exemplar.
    /// NULL: the same place. Used by exclusion only, so that windows of a turned copy are known for what they show.
    const float *to_exemplar;
} RfWindowSource;

typedef struct RfWindowOptions
{
    /// w >= 1, odd or even.
    int side;
    /// Windows wrap round the borders of every copy. Else they lie inside.
    bool tiles;
    /// One a channel, 0 to 1e4; NULL: all 1.
    const float *channel_weights;
    /// Principal components kept, up to RF_MAX_WINDOW_COMPONENTS; 0: as many as are fastest. Changes the speed, never
    /// the result.
    int components;
} RfWindowOptions;

/// A window by its first (top left) pixel.
typedef struct RfWindowPlace
{
    int copy, x, y;
} RfWindowPlace;

typedef struct RfWindowDatabase RfWindowDatabase;

/// All sources have the same number of channels. Candidates are numbered copy by copy, row by row. A database without
/// any candidate (a picture smaller than a window, nothing valid) is RF_BAD_INPUT.
RfResult rf_windows_create(const RfWindowSource *sources, int count, const RfWindowOptions *options,
                           RfWindowDatabase **out);
void rf_windows_destroy(RfWindowDatabase *database);
/// Number of candidates, >= 1.
int rf_windows_count(const RfWindowDatabase *database);
/// Numbers in a window: side * side * channels.
int rf_windows_numbers(const RfWindowDatabase *database);
/// Principal components in use, and the part of the windows' variance they hold.
int rf_windows_components(const RfWindowDatabase *database, float *variance_kept);
RfWindowPlace rf_windows_place(const RfWindowDatabase *database, int candidate);
/// The candidate at a place; -1 if there is none (outside, or not valid).
int rf_windows_at(const RfWindowDatabase *database, RfWindowPlace place);
/// Copies a candidate's pixels: [side][side][channels].
void rf_windows_read(const RfWindowDatabase *database, int candidate, float *window);
/// Fills variations[candidates]: the sum of squared differences of a candidate's pixels from their mean, in its first
/// `channels` channels.
void rf_windows_vary(const RfWindowDatabase *database, int channels, float *variations);

typedef struct RfWindowQueries
{
    int count;
    /// [count][side][side][channels].
    const float *windows;
    /// [count][side][side], 0 to 1e4, or NULL for all 1: how much a pixel counts; 0: not known, its numbers are not
    /// looked at. About (components + 1) : (numbers + side^2) slower than without, and twice that where the machine
    /// has VNNI.
    const float *weights;
    /// [candidates] or NULL: added to the distance when the least is looked for, not to the distance that is told. Any
    /// finite numbers within +-1e30; to spread use evenly over the exemplar.
    const float *penalties;
    /// [count] or NULL: for query i only candidates with |dx| >= side or |dy| >= side from this window, both measured
    /// between centres in the exemplar (see to_exemplar; round the borders of the first copy where windows wrap).
    /// copy < 0: nothing is excluded. For judging an exemplar against itself without overlap.
    const RfWindowPlace *excluded;
} RfWindowQueries;

typedef struct RfWindowMatch
{
    /// -1 if there is none: everything is excluded, or the query has numbers that are not finite or beyond +-1e12.
    int candidate;
    RfWindowPlace place;
    /// Without the penalty; INFINITY where there is no candidate.
    float distance;
} RfWindowMatch;

/// Fills matches[queries->count]. Uses all threads. The database is not changed: several threads may search it at once.
RfResult rf_windows_search(const RfWindowDatabase *database, const RfWindowQueries *queries, RfWindowMatch *matches);

/// Gathers windows from a picture: windows[count][side][side][channels], window i's first pixel on corners[i] = {x, y}.
/// weights: NULL, or [count][side][side]: 1 where a pixel is inside and valid, else 0 (its numbers are then 0 too).
/// Without weights every window must lie inside the picture, or it must tile; validity is then not looked at.
RfResult rf_windows_gather(const RfWindowSource *source, int side, bool tiles, const int (*corners)[2], int count,
                           float *windows, float *weights);
