// SPDX-License-Identifier: Apache-2.0
// Judging frames: does the texture follow the flow, is it still that texture, does it pop, is it washed out, are there
// holes. From frames alone, whoever made them.
//
// Frames go through one after the other; the previous one is kept, nothing else that grows. Every error has its *floor*
// beside it: the same measure, in the same run, where nothing is wrong. The ratio of the two compares across scenes and
// exemplars, the bare number does not. docs/measures.md says what each measure does and does not tell.
//
//     RfMeasureOptions options = rf_measure_defaults();
//     rf_measure_create(&exemplar, &options, &measure);
//     while (read(&flow, &frame))
//         rf_measure_step(measure, &flow, NULL, &frame, &result);     // flow.time is this frame's
//     rf_measure_summary(measure, &summary);
//
// Pixel values are sRGB-encoded, 0 to 1; grey levels are 255 of them, grey is Rec. 709 luma. Colour is the first three
// channels of three or more, or the first of fewer. A number that could not be computed is NaN.
#pragma once

#include "data.h"

/// Most bins of a radial spectrum.
#define RF_MEASURE_MAX_BINS 256
/// Cells along a side of the exemplar in which the places of matches are counted.
#define RF_MEASURE_USE_CELLS 16
/// Most entries of rf_measure_quantity_table.
#define RF_MEASURE_MAX_QUANTITIES 48

typedef enum RfMeasureEstimator
{
    /// Dense inverse search at half resolution (Kroeger et al. 2016): as accurate as what published work measures with
    /// (floors near 0.1 pixel), so that ratios compare with published ones.
    RF_MEASURE_INVERSE_SEARCH,
    /// Lucas and Kanade at every pixel, coarse to fine, to the last detail (floors near 0.01 pixel on smooth
    /// textures): the sharper instrument for telling two settings apart. Its ratios are far larger.
    RF_MEASURE_LUCAS_KANADE
} RfMeasureEstimator;

typedef enum RfMeasureHoles
{
    /// Alpha where the frames have it. Otherwise a pixel whose colour channels are all exactly 0, unless the exemplar
    /// has such a pixel too (then black is texture). A pixel that is not finite, or beyond +-1e6, always is a hole.
    RF_MEASURE_HOLES_AUTO,
    /// Alpha 0 and nothing else, except not finite.
    RF_MEASURE_HOLES_ALPHA,
    /// Exact 0 of all colour channels, whatever the exemplar has, except not finite.
    RF_MEASURE_HOLES_ZERO,
    /// Not finite alone.
    RF_MEASURE_HOLES_NAN
} RfMeasureHoles;

/// Start from rf_measure_defaults(). A struct that did not is refused.
typedef struct RfMeasureOptions
{
    /// Set by the defaults; tells a program built against another version.
    uint32_t struct_size;

    /// Places of random crops are drawn from it. Default 7. Same seed and input: same bytes, with any number of
    /// threads.
    uint64_t seed;

    /// Who estimates the motion. Default RF_MEASURE_INVERSE_SEARCH.
    RfMeasureEstimator estimator;

    /// The flow error is computed at every n-th frame that has a predecessor, the first one included; 0 never.
    /// Default 5. Three estimates each.
    int flow_every;

    /// The flicker is computed at every n-th frame that has a predecessor, the first one included; 0 never. Default 1.
    int flicker_every;

    /// The patch distance is computed at every n-th frame, the first one included; 0 never. Default 10. The
    /// costliest measure.
    int patch_every;

    /// Side of the windows of the patch distance in pixels, 3 to 31. Default 9.
    int patch_size;

    /// Windows of the frame are compared whose corner lies at multiples of this, in pixels; so are the exemplar's, the
    /// other way round. 0 (default) takes the least that gives at most 4096 windows. All windows are candidates.
    int patch_stride;

    /// Exemplar windows turned by 360 / rotations degrees, and its multiples, are candidates too. 1 (default) to 72.
    int rotations;

    /// Exemplar windows shifted by half a pixel (in x, in y, in both) are candidates too. Default no: a half-pixel
    /// shift alone then costs 10 to 22 grey levels on fine textures. Four times the cost.
    bool half_pixel;

    /// Windows are compared in colour (default) or in grey. In colour only if frame and exemplar both have it.
    bool patch_colour;

    /// Side of the crops that spectra are averaged over, in pixels, even, 16 to 512. 0 (default): half the exemplar's
    /// side, or the frame's if that is smaller, at most 128; less where the fluid is narrow.
    int spectrum_crop;

    /// The first radial bin that counts, in cycles a crop, 1 to 8. Default 1. 2 leaves out what a slow gradient of the
    /// exemplar adds.
    int spectrum_first;

    /// How a pixel with no texture is recognised. Default RF_MEASURE_HOLES_AUTO.
    RfMeasureHoles holes;

    /// The last channel of the frames is alpha (see rf_image_has_alpha). Default false.
    bool alpha;
} RfMeasureOptions;

RF_API RfMeasureOptions rf_measure_defaults(void);
/// Every field of the options but struct_size and alpha.
RF_API const RfOption *rf_measure_option_table(int *count);

/// Does the texture follow the flow? Pixels. Needs a flow and a predecessor.
typedef struct RfMeasureFlow
{
    /// Mean end-point distance between the motion estimated from the last two frames and the flow's.
    double error;
    /// The same between the previous frame and that frame warped by the flow, and between a picture filled from the
    /// exemplar and that warped likewise.
    double floor, exemplar_floor;
    /// error / floor, error / exemplar_floor.
    double ratio, exemplar_ratio;
    /// Mean length of the flow's own displacement: what the error of a frozen texture would be.
    double motion;
    /// Pixels judged: fluid, 8 pixels or more from land, hole and border, at both ends of their path.
    double pixels;
} RfMeasureFlow;

/// Does it pop? Needs a flow and a predecessor. All over the frame's own rms contrast; of a frame without any, 0 where
/// it does not differ from the one carried, and NaN where it does.
typedef struct RfMeasureFlicker
{
    /// Rms difference between the frame and the previous one carried by the flow; floor: carrying there and back.
    double whole, floor, ratio;
    /// The largest of that in any 32 x 32 block of which half or more counts, the corner of that block, and the floor's
    /// largest.
    double block, block_floor, block_x, block_y;
} RfMeasureFlicker;

/// Is it still that texture, by its frequencies? Needs an exemplar.
typedef struct RfMeasureSpectrum
{
    /// Rms difference in dB of the radially averaged power spectra of frame and exemplar, each the mean over crops that
    /// overlap by half.
    double distance;
    /// The mean distance between 32 pairs of random crops of the exemplar, one crop each side; NaN where the exemplar
    /// is no larger than a crop.
    double floor, ratio;
    /// The mean distance between one crop of the frame and one of the exemplar, over the floor: 1 where they cannot be
    /// told apart. Blunter than `ratio`, which is under 1 for a frame as good as the exemplar.
    double pair_ratio;
} RfMeasureSpectrum;

/// Is its local structure from the exemplar, all of it? Grey levels. Needs an exemplar.
typedef struct RfMeasurePatch
{
    /// Rms residual of the frame's windows to their nearest exemplar windows. Low where it is pasted, and where it is
    /// blurred: read it with the spectrum.
    double residual;
    /// The other way round: rms residual of the exemplar's windows to their nearest frame windows. High where parts of
    /// the exemplar are missing.
    double missing;
    /// Effective fraction of the exemplar that the matches use: exp of the entropy of their places in 16 x 16 cells,
    /// over 256. Low where one place repeats.
    double share;
    /// The share of the exemplar's own windows' matches to its other, not overlapping ones.
    double share_floor;
    /// The exemplar's own windows to its other, not overlapping ones: what a fresh piece of the same texture would get.
    double floor, ratio, missing_ratio;
    /// Windows compared, frame to exemplar.
    double windows;
} RfMeasurePatch;

/// Has blending washed it out? Needs an exemplar.
typedef struct RfMeasureContrast
{
    /// Standard deviation, frame over exemplar: grey, and each colour channel (the second and third NaN in grey).
    double luma, channel[3];
    /// Difference of the mean greys, frame minus exemplar, in grey levels.
    double brightness;
    /// Between the histograms of grey: half the L1 distance (0 to 1, 64 bins), and the earth mover's, in grey levels.
    double histogram_l1, histogram_mover;
    /// Of random crops of the exemplar, half its side, against the whole: mean |luma - 1|, |brightness|, histogram_l1
    /// and histogram_mover.
    double luma_floor, brightness_floor, l1_floor, mover_floor;
} RfMeasureContrast;

/// Holes. The floor is 0.
typedef struct RfMeasureCoverage
{
    /// Pixels in the fluid, those of them that are holes, and their share.
    double fluid, holes, share;
} RfMeasureCoverage;

/// The results of one frame.
typedef struct RfMeasureFrame
{
    /// Frames before this one.
    double index;
    RfMeasureFlow flow;
    RfMeasureFlicker flicker;
    RfMeasureSpectrum spectrum;
    RfMeasurePatch patch;
    RfMeasureContrast contrast;
    RfMeasureCoverage coverage;
    /// Of the flow that came with it: RfMeasureDivergence's `relative`. The floor is 0.
    double divergence;
} RfMeasureFrame;

/// What makes a quantity bad.
typedef enum RfMeasureSense
{
    /// Neither good nor bad: places, counts, floors.
    RF_MEASURE_NEUTRAL,
    RF_MEASURE_LOWER_IS_BETTER,
    RF_MEASURE_HIGHER_IS_BETTER,
    RF_MEASURE_ONE_IS_BEST,
    RF_MEASURE_ZERO_IS_BEST
} RfMeasureSense;

/// One double of RfMeasureFrame, so that reports and bindings need not repeat it.
typedef struct RfMeasureQuantity
{
    /// "flow-error", ...
    const char *name;
    /// "px", "dB", "levels", "" for plain numbers.
    const char *unit;
    /// Of the double in RfMeasureFrame, in bytes.
    size_t offset;
    RfMeasureSense sense;
    /// Name of the quantity that is this one's floor, or NULL.
    const char *floor;
    /// One sentence.
    const char *sentence;
} RfMeasureQuantity;

RF_API const RfMeasureQuantity *rf_measure_quantity_table(int *count);

/// Over the frames for which a quantity could be computed.
typedef struct RfMeasureStatistic
{
    /// Frames; with none, the others are NaN and worst_frame -1.
    int64_t count;
    /// Of a ratio to a floor: the ratio of the means.
    double mean;
    /// The frame's value that is worst by the quantity's sense (for a neutral one the largest), and its index.
    double worst;
    int64_t worst_frame;
} RfMeasureStatistic;

typedef struct RfMeasureSummary
{
    int64_t frames;
    /// As many and in the same order as rf_measure_quantity_table.
    RfMeasureStatistic quantities[RF_MEASURE_MAX_QUANTITIES];
} RfMeasureSummary;

typedef struct RfMeasure RfMeasure;

/// exemplar: may be NULL; copied. Either side 16 pixels or more, its alpha (2nd or 4th channel) is not looked at. From
/// an RfExemplar: rf_exemplar_map(exemplar, 0, NULL).image.
///
/// RF_UNSUPPORTED if the patch distance is asked for and the exemplar has more than 2^24 windows: about its pixels
/// times rotations, times 4 with half_pixel.
RF_API RF_MUST_USE RfResult rf_measure_create(const RfImageView *exemplar, const RfMeasureOptions *options,
                                              RfMeasure **out);

/// Judges one frame, 16 x 16 pixels or more, of the first one's size and channels.
///
/// flow: may be NULL. The frame's moment is flow->time, which must be later than at the step before; the motion from
/// the step before to this one is integrated along the paths. A step without a flow has no motion to judge, and the
/// step after it takes itself to be one frame later. mask: [height][width] of the frame, 0 outside the fluid; NULL: the
/// flow's mask, or fluid everywhere. On failure `out` holds its old content and the frame is not counted: the next step
/// goes on from the one before it. Between the measures it asks the thread's RfProgress whether to go on.
RF_API RF_MUST_USE RfResult rf_measure_step(RfMeasure *measure, const RfFlowView *flow, const uint8_t *mask,
                                            const RfImageView *frame, RfMeasureFrame *out);

/// Of all frames so far.
RF_API void rf_measure_summary(const RfMeasure *measure, RfMeasureSummary *out);

/// Radial power spectra in dB (of grey levels squared a unit of frequency), bin k at k / crop cycles a pixel.
typedef struct RfMeasureSpectra
{
    /// Bins from first to last, both included; crop / 2 is the Nyquist frequency. crop 0: nothing computed yet.
    int crop, first, last;
    double frame[RF_MEASURE_MAX_BINS + 1], exemplar[RF_MEASURE_MAX_BINS + 1];
    /// Lowest and highest of 64 single crops of the exemplar.
    double low[RF_MEASURE_MAX_BINS + 1], high[RF_MEASURE_MAX_BINS + 1];
    /// Of all frames so far: the mean power, in dB.
    double all_frames[RF_MEASURE_MAX_BINS + 1];
} RfMeasureSpectra;

/// Of the last frame. Without an exemplar, only `frame` and `all_frames`; the rest is NaN.
RF_API void rf_measure_spectra(const RfMeasure *measure, RfMeasureSpectra *out);

/// How often each cell of the exemplar was matched when the patch distance was last computed, row by row.
RF_API void rf_measure_use(const RfMeasure *measure, int64_t counts[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS]);

typedef enum RfMeasureMap
{
    /// End-point distance, in pixels.
    RF_MEASURE_MAP_FLOW_ERROR,
    /// The motion that was estimated: 2 channels, x and y, in pixels.
    RF_MEASURE_MAP_MOTION,
    /// Difference from the previous frame carried by the flow, over the rms contrast; signed.
    RF_MEASURE_MAP_FLICKER,
    /// The rms of that in blocks of 32 x 32 that overlap by half: each pixel holds the largest of its blocks.
    RF_MEASURE_MAP_BLOCKS,
    /// Residual of the compared window nearest to the pixel, in grey levels.
    RF_MEASURE_MAP_PATCH,
    /// Centre of the exemplar window that it matched: 2 channels, x and y, in exemplar pixels.
    RF_MEASURE_MAP_SOURCE,
    /// 1 where the fluid has no texture, 0 elsewhere.
    RF_MEASURE_MAP_HOLES
} RfMeasureMap;

/// True if the last step computed it.
RF_API bool rf_measure_has_map(const RfMeasure *measure, RfMeasureMap map);
/// Draws it into a view of the frame's size, one channel unless said otherwise above. NaN where it is not defined.
RF_API RF_MUST_USE RfResult rf_measure_map(const RfMeasure *measure, RfMeasureMap map, const RfImageView *out);

RF_API void rf_measure_destroy(RfMeasure *measure);

/// Is it a fluid? At flow->time, over fluid cells whose four neighbours are fluid too.
typedef struct RfMeasureDivergence
{
    /// Rms divergence times cell size over rms speed: the fraction of its speed that a cell gains or loses. NaN where
    /// nothing moves.
    double relative;
    /// Cells a frame a cell; cells a frame.
    double rms_divergence, rms_speed;
    int64_t cells;
} RfMeasureDivergence;

/// Velocities to be judged alone, such as detail that was synthesised.
RF_API RF_MUST_USE RfResult rf_measure_divergence(const RfFlowView *flow, RfMeasureDivergence *out);
