// SPDX-License-Identifier: Apache-2.0
// Lower bounds of distances in 16-bit integers: see short_bounds.c.
#pragma once

#include "kernels/nearest.h"

#include <stdint.h>

enum
{
    /// From one window's kept numbers to the next one's: at least RF_MAX_WINDOW_COMPONENTS + 1.
    RF_KEPT_STRIDE = 80,
    /// Numbers of a second bound: components, what they leave out, and last what the first bound's leave out.
    RF_REST_NUMBERS = 32,
    /// The bits of INFINITY.
    RF_SHORT_INFINITE = 0x7f800000
};

/// Candidates in integers. Numbers are multiplied by `scale` and rounded.
typedef struct RfShortNumbers
{
    int kept, pairs;
    float scale;
    /// [tiles][pairs][32][2], negative, and [tiles * 32]: what a candidate's score starts from; INFINITY's bits past
    /// the last.
    int16_t *numbers;
    int32_t *starts;
    /// [candidates][RF_REST_NUMBERS], NULL where there is no second bound.
    int16_t *rests;
} RfShortNumbers;

/// A scale under which numbers of norms up to `norm` fit.
float rf_short_scale(double norm);

/// Stores a candidate's kept numbers and, where there is a second bound, the numbers of that.
void rf_shorten_candidate(const RfShortNumbers *shorts, int candidate, const float *kept, const float *rest);

/// How far |q - c| of as many numbers can be from what the integers say, in units of the numbers.
double rf_short_error(const RfShortNumbers *shorts, int numbers);

/// Whether penalties that differ by up to `spread` leave the scores in range.
bool rf_short_fits(const RfShortNumbers *shorts, double spread);

/// starts[i], plus a penalty >= 0.
int32_t rf_short_start(const RfShortNumbers *shorts, int candidate, double penalty);

/// out[count rounded up to 16] and the sum of its squares. Returns whether the numbers fit.
bool rf_shorten_query(const RfShortNumbers *shorts, const float *numbers, int count, int16_t *out, int32_t *square);

/// Scores of 12 queries and 32 candidates: out[q * stride + c], as bits that order as floats do, all of them positive.
void rf_short_products(const int16_t *queries, const int16_t *candidates, int pairs, const int32_t *starts, float *out,
                       ptrdiff_t stride);

/// A candidate whose score is above this (as a float of the same bits) has, to a query of that `square`, a distance
/// (plus penalty) above `distance` by the integers.
float rf_short_limit(const RfShortNumbers *shorts, double distance, int32_t square);

/// Keeps those of a list of candidates whose second score is at most `limit`, and returns how many there are. `scores`
/// are the first ones.
int rf_short_sieve(const RfShortNumbers *shorts, const int16_t *rest, const float *scores, int first, float limit,
                   int *list, int count);
