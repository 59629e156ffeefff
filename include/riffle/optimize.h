// SPDX-License-Identifier: Apache-2.0
// Texture optimisation: a still texture of any size, or a moving one that keeps the exemplar's structure: it is carried
// and bent by the flow, and renewed by pieces of the exemplar where it is worn.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005. Han, Zhou, Wei, Gong, Bao,
// Zhang, Guo. Fast example-based surface texture synthesis via discrete optimization. 2006.
#pragma once

#include "data.h"

typedef enum RfOptimizeForm
{
    /// A pixel becomes one of the exemplar's: sharp; best for colour.
    RF_FORM_DISCRETE,
    /// A pixel becomes the mean of what its windows say: smooth.
    RF_FORM_MEAN
} RfOptimizeForm;

typedef enum RfOptimizeOrient
{
    /// The exemplar lies as it is, and is turned as the flow turns it.
    RF_ORIENT_FREE,
    /// The exemplar lies everywhere as it is.
    RF_ORIENT_NONE,
    /// The exemplar's x axis points downstream.
    RF_ORIENT_FLOW
} RfOptimizeOrient;

typedef enum RfOptimizeSearch
{
    /// All windows of the exemplar on every level.
    RF_SEARCH_EXACT,
    /// All on the coarsest level, k-coherent candidates on the others: constant cost a pixel.
    RF_SEARCH_COHERENCE
} RfOptimizeSearch;

enum
{
    RF_MAX_OPTIMIZE_WINDOWS = 4
};

typedef struct RfOptimizeOptions
{
    /// Set by rf_optimize_defaults(); tells a program built against another version.
    uint32_t struct_size;
    /// Same seed and same input: same bytes, with any number of threads. Default 1.
    uint64_t seed;
    /// Of the pyramid, 1 to 10; 0 picks them by the exemplar's size: as many as leave fewer than 18 pixels on the
    /// coarsest one's shorter side, 3 at least. Default 0. More keep larger structures together.
    int levels;
    /// Sides of the windows, odd, 5 to 33 pixels, used one after the other on every level; 0 ends them. Default 17, 9.
    /// Larger ones keep larger structures, smaller ones mend details.
    int windows[RF_MAX_OPTIMIZE_WINDOWS];
    /// Search and assign steps with each window on the coarsest level, 1 to 100; half as many on each finer one.
    /// Default 6. More lower the energy, little after 6.
    int iterations;
    /// Of stills; moving textures show the exemplar's pixels. Default RF_FORM_DISCRETE.
    RfOptimizeForm form;
    /// Price of using one place of the exemplar more than others, against the mean cost of a window, 0 to 10.
    /// Default 2. 0 lets the result collapse to the places that fit themselves best; above 4 what fits badly is taken
    /// for being new.
    float spread;
    /// Of moving textures; stills have RfOptimizeConstraints.orientation. Default RF_ORIENT_FREE.
    RfOptimizeOrient orient;
    /// Of stills, and of the first frame of moving textures. Default RF_SEARCH_COHERENCE.
    RfOptimizeSearch search;
    /// Similar places listed for every pixel of the exemplar, 1 to 8, as candidates of the k-coherent search.
    /// Default 2.
    int similar;
    /// The result continues across its own borders. Default false.
    bool tile;
} RfOptimizeOptions;

RF_API RfOptimizeOptions rf_optimize_defaults(void);
RF_API const RfOption *rf_optimize_option_table(int *count);

/// What a still texture is bound to. Views with pixels NULL are not used; all others have the size of the result.
typedef struct RfOptimizeConstraints
{
    /// The exemplar's made channels, and one more: 1 where the pixel is given and stays, 0 where it is to be made.
    RfImageView fixed;
    /// What the result should look like: the exemplar's made channels...
    RfImageView target;
    /// ... and how much so, 1 channel, >= 0; 1 counts as much as the exemplar. Not given: 1 everywhere.
    RfImageView target_weight;
    /// Compared with the exemplar's map named "guide", which has as many channels and is not made.
    RfImageView guide;
    /// 1 channel: degrees, clockwise, by which the exemplar is turned.
    RfImageView orientation;
    /// 1 channel, 1/16 to 16: how many times larger the exemplar appears.
    RfImageView scale;
} RfOptimizeConstraints;

/// Channels of the exemplar that are made: all but those of the map named "guide".
RF_API int rf_optimize_channels(const RfExemplar *exemplar);

/// Fills `image` (rf_optimize_channels channels, any size from 8 x 8) with the exemplar's texture. constraints may be
/// NULL. Progress is reported by level and iteration, with the energy: the rms difference of windows, in parts of the
/// exemplar's range. On failure `image` holds its old pixels.
RF_API RF_MUST_USE RfResult rf_optimize_still(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                                              const RfOptimizeConstraints *constraints, const RfImageView *image);

typedef struct RfOptimize RfOptimize;

/// As the functions of the same names of RfLagrangian; an exemplar with a map named "guide" is RF_BAD_INPUT, and the
/// first step may be cancelled, which leaves the stepper as it was. The first step makes a still texture; later ones
/// carry and bend it, and lay pieces of the exemplar, of radius windows[0] pixels at most, over what is worn.
RF_API RF_MUST_USE RfResult rf_optimize_create(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                                               RfOptimize **out);
RF_API RF_MUST_USE RfResult rf_optimize_step(RfOptimize *optimize, const RfFlowView *flow, const RfImageView *frame);
RF_API RF_MUST_USE RfResult rf_optimize_advance(RfOptimize *optimize, const RfFlowView *flow, int width, int height);

/// What the last step did. Times are seconds of this step.
typedef struct RfOptimizeStats
{
    /// Pieces of the exemplar laid over worn texture.
    int patches;
    /// The rms difference of these to what they were laid on, on the coarse level of the search, in parts of the
    /// exemplar's range; of the last ones laid.
    double energy;
    double carry_seconds, search_seconds, draw_seconds;
} RfOptimizeStats;

RF_API RfOptimizeStats rf_optimize_stats(const RfOptimize *optimize);
RF_API RF_MUST_USE RfResult rf_optimize_save(const RfOptimize *optimize, void **block, size_t *size);
RF_API RF_MUST_USE RfResult rf_optimize_load(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                                             const void *block, size_t size, RfOptimize **out);
RF_API void rf_optimize_destroy(RfOptimize *optimize);
