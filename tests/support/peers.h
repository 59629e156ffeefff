// SPDX-License-Identifier: Apache-2.0
// Results of four other tools on eight exemplars (data/reference/peers), and Riffle's own beside them: judged alike,
// and compared as tests and benchmarks compare them.
#pragma once

#include "riffle/riffle.h"

enum
{
    PEER_MEASURES = 3,
    PEER_MAX_ROWS = 128
};

/// "residual" (lower is better), "share" (higher), "spectrum" (lower).
extern const char *const peer_measures[PEER_MEASURES];

/// What one tool made of one exemplar.
typedef struct PeerRow
{
    char name[32], tool[32];
    double values[PEER_MEASURES];
    /// NAN where nobody told.
    double seconds;
} PeerRow;

typedef struct PeerTable
{
    char folder[1024];
    int count;
    PeerRow rows[PEER_MAX_ROWS];
} PeerTable;

/// Reads the published figures from $RIFFLE_DATA, or where that is not set from `data`. False if there are none.
bool peers_read(const char *data, PeerTable *out);

/// "exemplar", or a tool's name. The message of a failure is in rf_last_error().
RF_MUST_USE RfResult peers_image(const PeerTable *table, const char *name, const char *file, RfImage **out);

/// As the figures of others were taken: 9 x 9 windows in colour at multiples of 8; spectra of crops as large as the
/// exemplar, from ring 2 on.
RF_MUST_USE RfResult peers_judge(const RfImageView *exemplar, const RfImageView *picture, RfMeasureFrame *out);

/// The part of a picture's 64 x 64 windows, one every 16 pixels, that are a window of the exemplar to 2 grey levels
/// rms.
double peers_verbatim(const RfImageView *exemplar, const RfImageView *picture);

/// What Riffle made, the part of it that is verbatim, and the picture.
typedef struct PeerOwn
{
    PeerRow row;
    double verbatim;
    RfImage *picture;
} PeerOwn;

/// Riffle's own 512 x 512 pixels from the named exemplar. The time is the median of `runs`. The caller destroys the
/// picture; on failure there is none.
RF_MUST_USE RfResult peers_synthesise(const PeerTable *table, const char *name, const RfOptimizeOptions *options,
                                      int runs, PeerOwn *out);

/// Appends; there must be room.
void peers_add(PeerTable *table, const PeerRow *row);
/// NULL if there is none.
const PeerRow *peers_find(const PeerTable *table, const char *name, const char *tool);

/// -1, 0 or 1: whether value `a` is smaller than, equal to or larger than `b`. Equal are those within 3 %, and spectra
/// that are both under 1 dB: one crop of the exemplar alone is off by that much.
int peers_order(int measure, double a, double b);
/// -1: the first is better; 0: equal; 1: worse.
int peers_compare(int measure, const PeerRow *a, const PeerRow *b);

/// In how many measures `a` is better than `b`.
int peers_wins(const PeerRow *a, const PeerRow *b);

/// The mean over exemplars and measures of the tool's rank, 1 being best; equal ones share the mean of their ranks.
double peers_mean_rank(const PeerTable *table, const char *tool);
