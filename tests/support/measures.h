// SPDX-License-Identifier: Apache-2.0
// Measures of quality for tests and benchmarks: does the texture follow the flow, is it still that texture, does it
// pop, is it washed out.
//
// Grey is Rec. 709 luma of sRGB-encoded values, 0 to 255, [h][w]. A displacement is [h][w][2] in pixels: what stands at
// pixel (x, y) of frame n moves by it until frame n + 1. Masks are [h][w], 0 outside the fluid; NULL: fluid everywhere.
// Every error has its *floor* beside it: the same measure where nothing is wrong. Ratios of the two compare across
// scenes and exemplars; the bare numbers do not.
#pragma once

#include "riffle/data.h"

/// Luma of 3 or more channels, or the only one (the first of two).
void measure_grey(const RfImageView *frame, float *grey);

/// Integrates a flow from view->time - 1 to view->time along the paths (Runge-Kutta, fourth order, two half steps), at
/// w x h pixels.
void measure_displacement(const RfFlowView *view, int w, int h, float *displacement);

/// The displacement seen from frame n + 1: backward(y) = -forward(y + backward(y)). Found by fixed-point iteration.
void measure_invert(const float *forward, int w, int h, float *backward);

/// out(y) = in(y + offset(y)) by cubic splines, the border's value outside.
void measure_warp(const float *in, const float *offset, int w, int h, float *out);

/// Dense optical flow from a to b, coarse to fine: a(x) = b(x + flow(x)). Motions up to about 8 pixels.
void measure_optical_flow(const float *a, const float *b, int w, int h, float *flow);

/// The same by dense inverse search (Kroeger and others 2016) at half resolution: an estimator of the accuracy that
/// published work measures with, an order of magnitude coarser than the one above. At least 16 x 16 pixels.
void measure_inverse_search(const float *a, const float *b, int w, int h, float *flow);

typedef struct MeasureFlowError
{
    /// Mean end-point error in pixels between the flow estimated from two frames and the true one.
    double error;
    /// The same between frame n and frame n warped by the true displacement, and between a picture filled from the
    /// exemplar and that warped likewise (0 without an exemplar).
    double floor, exemplar_floor;
    /// error / floor, error / exemplar_floor.
    double ratio, exemplar_ratio;
    /// Pixels judged: fluid, at least 8 pixels from land and border, at both ends of their path.
    int64_t pixels;
} MeasureFlowError;

/// exemplar: grey, may be NULL; repeated by mirroring to fill the frame.
MeasureFlowError measure_flow_error(const float *a, const float *b, int w, int h, const float *displacement,
                                    const uint8_t *mask, const float *exemplar, int exemplar_w, int exemplar_h);

/// The same with measure_inverse_search, for the error and for both floors.
///
/// Why two: on smooth noise the estimator above is off by 0.01 pixel where nothing is wrong, which only a noise-free
/// warp reaches, so that a method whose motion is right to 0.1 pixel is judged ten times too bad. Published work on
/// flowing textures measures with estimators of this one's class, whose floor is near 0.1 pixel: ratios to that floor
/// compare with its, and say whether such an estimator can tell the texture from one that truly moves. The fine one
/// remains the sharper instrument for comparing two settings.
MeasureFlowError measure_inverse_search_error(const float *a, const float *b, int w, int h, const float *displacement,
                                              const uint8_t *mask, const float *exemplar, int exemplar_w,
                                              int exemplar_h);

typedef struct MeasureSpectrum
{
    /// Rms difference in dB of the radially averaged power spectra of frame and exemplar, each the mean over crops that
    /// overlap by half; 0 for the exemplar itself.
    double distance;
    /// The mean distance between 32 pairs of random crops of the exemplar, one crop each side. A frame as good as the
    /// exemplar has ratio < 1, since its mean spectrum is steadier than one crop's.
    double floor, ratio;
    /// The mean distance between a crop of the frame and one of the exemplar, over the floor: 1 where they cannot be
    /// told apart. Blunter than `ratio`.
    double pair_ratio;
    /// Side of the crops in pixels: half the exemplar's (or the frame's, if that is smaller), even, 16 to 128. Crops
    /// are Hann-windowed, their mean removed; radial bins of one cycle a crop from 1 to crop / 2; a noise of a quarter
    /// grey level is added to both, so that empty frequencies do not count.
    int crop;
} MeasureSpectrum;

MeasureSpectrum measure_spectrum(const float *frame, int w, int h, const float *exemplar, int exemplar_w,
                                 int exemplar_h);

typedef struct MeasureContrast
{
    /// Standard deviation, frame over exemplar: luma, and up to the first four channels. 1 where both are flat.
    double luma, channel[4];
    int channels;
    /// Difference of the mean lumas, frame minus exemplar, in grey levels.
    double brightness;
    /// Between the histograms of luma: half the L1 distance (0 to 1, 64 bins) and the earth mover's, in grey levels.
    double histogram_l1, histogram_mover;
} MeasureContrast;

/// Only fluid pixels of the frame count. Frame and exemplar have as many channels.
MeasureContrast measure_contrast(const RfImageView *frame, const uint8_t *mask, const RfImageView *exemplar);

typedef struct MeasureFlicker
{
    /// Rms difference between frame n + 1 and frame n carried by the flow, over the frame's own rms contrast; and the
    /// floor: carrying there and back.
    double whole, floor;
    /// The largest of that in any 32 x 32 block at least half of which counts (over the contrast of the whole frame),
    /// and the block's corner: where it pops. `block_floor` is the floor's largest.
    double pop, block_floor;
    int pop_x, pop_y;
} MeasureFlicker;

MeasureFlicker measure_flicker(const float *a, const float *b, int w, int h, const float *displacement,
                               const uint8_t *mask);

/// Rms difference between b and a carried by the flow in each block of `block` x `block` pixels, in grey levels: [h /
/// block][w / block], row by row; -1 where less than half of a block counts. What pops stands out from the rest.
void measure_block_changes(const float *a, const float *b, int w, int h, const float *displacement, const uint8_t *mask,
                           int block, float *changes);
