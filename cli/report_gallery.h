// SPDX-License-Identifier: Apache-2.0
// The pictures of a page: taken while the frames go by, since only the end tells which was the worst.
#pragma once

#include "riffle/riffle.h"

enum
{
    GALLERY_SHOTS = 3,
    GALLERY_WORST = 3
};

/// A frame that is kept; `image` is NULL where there is none.
typedef struct Shot
{
    int number;
    RfImage *image;
} Shot;

/// The frame that is worst in one quantity, and where in it.
typedef struct WorstShot
{
    /// Name of the quantity that decides, of the map's floor (may be NULL), and the map.
    const char *quantity, *floor;
    RfMeasureMap map;
    const char *title, *unit, *sentence;
    double value, floor_value;
    Shot shot;
    /// One channel, NaN where nothing is known.
    RfImage *error;
} WorstShot;

typedef struct Gallery
{
    bool wanted;
    RfImage *exemplar;
    /// First, middle and last frame.
    Shot shots[GALLERY_SHOTS];
    WorstShot worst[GALLERY_WORST];
    /// Of the frame whose spectrum is farthest off.
    RfMeasureSpectra spectra;
    double spectrum_distance;
    int spectrum_number;
    /// How often each cell of the exemplar was matched, over all frames that were compared.
    int64_t use[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS];
    bool used;
} Gallery;

void gallery_begin(Gallery *gallery);
void gallery_free(Gallery *gallery);
/// Beside frames of that size, in their scale.
RfResult gallery_take_exemplar(Gallery *gallery, const RfImage *exemplar, const RfImageView *frame);
/// The index-th of `count` frames has just been judged.
RfResult gallery_take(Gallery *gallery, const RfMeasure *measure, const RfMeasureFrame *values, int index, int count,
                      int number, const RfImage *frame);

/// Errors as colours from dark (0) to bright (`full` and more), clear where they are NaN.
RfResult gallery_paint(const RfImage *error, double full, RfImage **out);
/// The same scale, `part` from 0 to 1.
void gallery_colour(double part, float rgb[3]);
/// A round number that nearly all errors stay below.
double gallery_full_scale(const RfImage *error);
/// The exemplar in grey, coloured by how often each cell was used; *full is the share of the brightest cell over the
/// mean.
RfResult gallery_paint_use(const Gallery *gallery, double *full, RfImage **out);
