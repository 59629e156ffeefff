// SPDX-License-Identifier: Apache-2.0
// The stepper over the measures: it keeps the previous frame, tells fluid from land and texture from holes, calls each
// measure, and sums up.
//
// Holes are counted by the coverage and by nothing else: they, and land, are filled smoothly from what is round them
// before anything looks at the grey picture, so that they are no edges, and pixels in them do not count. Spectra are
// taken from crops without any, or, where every crop has some, from the filled picture.
#include "riffle/measure.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "measure/judgement.h"
#include "measure/patches.h"
#include "measure/quantities.h"
#include "measure/spectrum.h"

#include <string.h>

enum
{
    MIN_SIDE = 16,
    MAPS = RF_MEASURE_MAP_HOLES + 1
};

// A frame as the measures see it.
typedef struct Frame
{
    float *grey;
    /// 1 where there is fluid with texture.
    uint8_t *known;
    bool all_known;
} Frame;

struct RfMeasure
{
    RfMeasureOptions options;
    /// Colour only: 1 or 3 channels, packed; no pixels without an exemplar.
    RfImageView exemplar;
    float *exemplar_grey;
    RfMeasureHoles holes;
    RfMeasureContrast contrast_floor;
    RfSpectrometer *spectrometer;
    RfPatchJudge *patches;
    int64_t use[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS];
    RfRadialSpectrum spectrum;

    int width, height, channels;
    /// The previous frame and the one being judged; they take turns.
    Frame frames[2];
    int current;
    /// 1 in the fluid, hole or not.
    uint8_t *fluid;
    bool all_fluid;
    float *displacement;
    float *maps[MAPS];
    bool has_map[MAPS];

    int64_t frames_seen, pairs_seen;
    bool timed;
    double time;
    RfMeasureTally tally;
    double power_sum[RF_MEASURE_MAX_BINS + 1];
    int64_t spectra_seen;
};

// ---- options -----------------------------------------------------------------------------------------------------

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, offsetof(RfMeasureOptions, seed), "", 0, 18446744073709551615.0, 7, NULL,
     "Places of random crops are drawn from it."},
    {"estimator", RF_OPTION_CHOICE, offsetof(RfMeasureOptions, estimator), "", 0, 1, RF_MEASURE_INVERSE_SEARCH,
     "inverse-search|lucas-kanade",
     "Who estimates the motion: as accurate as what published work measures with, or ten times finer."},
    {"flow-every", RF_OPTION_INT, offsetof(RfMeasureOptions, flow_every), "frames", 0, 1000000, 5, NULL,
     "The flow error is computed at every n-th frame; 0 never."},
    {"flicker-every", RF_OPTION_INT, offsetof(RfMeasureOptions, flicker_every), "frames", 0, 1000000, 1, NULL,
     "The flicker is computed at every n-th frame; 0 never."},
    {"patch-every", RF_OPTION_INT, offsetof(RfMeasureOptions, patch_every), "frames", 0, 1000000, 10, NULL,
     "The patch distance is computed at every n-th frame; 0 never."},
    {"patch-size", RF_OPTION_INT, offsetof(RfMeasureOptions, patch_size), "px", 3, 31, 9, NULL,
     "Side of the windows of the patch distance."},
    {"patch-stride", RF_OPTION_INT, offsetof(RfMeasureOptions, patch_stride), "px", 0, 1024, 0, NULL,
     "Windows at multiples of it are compared; 0 takes the least that gives at most 4096."},
    {"rotations", RF_OPTION_INT, offsetof(RfMeasureOptions, rotations), "", 1, 72, 1, NULL,
     "Exemplar windows turned by so many equal angles are candidates; 1 is unturned alone."},
    {"half-pixel", RF_OPTION_BOOL, offsetof(RfMeasureOptions, half_pixel), "", 0, 1, 0, NULL,
     "Exemplar windows shifted by half a pixel are candidates too: no penalty for resampling, four times the cost."},
    {"patch-colour", RF_OPTION_BOOL, offsetof(RfMeasureOptions, patch_colour), "", 0, 1, 1, NULL,
     "Windows are compared in colour, not in grey."},
    {"spectrum-crop", RF_OPTION_INT, offsetof(RfMeasureOptions, spectrum_crop), "px", 0, 512, 0, NULL,
     "Side of the crops that spectra are averaged over, even, 16 or more; 0 picks it by the exemplar."},
    {"spectrum-first", RF_OPTION_INT, offsetof(RfMeasureOptions, spectrum_first), "cycles", 1, 8, 1, NULL,
     "First radial bin that counts, in cycles a crop; 2 leaves slow gradients out."},
    {"holes", RF_OPTION_CHOICE, offsetof(RfMeasureOptions, holes), "", 0, 3, RF_MEASURE_HOLES_AUTO,
     "auto|alpha|zero|nan", "How a pixel with no texture is recognised."},
};

const RfOption *rf_measure_option_table(int *count)
{
    if (count)
        *count = (int)(sizeof g_options / sizeof *g_options);
    return g_options;
}

RfMeasureOptions rf_measure_defaults(void)
{
    return (RfMeasureOptions){.struct_size = sizeof(RfMeasureOptions),
                              .seed = 7,
                              .estimator = RF_MEASURE_INVERSE_SEARCH,
                              .flow_every = 5,
                              .flicker_every = 1,
                              .patch_every = 10,
                              .patch_size = 9,
                              .rotations = 1,
                              .patch_colour = true,
                              .spectrum_first = 1,
                              .holes = RF_MEASURE_HOLES_AUTO};
}

// ---- the exemplar ------------------------------------------------------------------------------------------------

static bool is_colour_zero(const float *pixel, int channels)
{
    return pixel[0] == 0 && (channels < 3 || (pixel[1] == 0 && pixel[2] == 0));
}

// Copies the colour, and tells whether exact black is texture.
static RfResult copy_exemplar(RfMeasure *m, const RfImageView *from)
{
    int channels = from->channels < 3 ? 1 : 3;
    size_t count = (size_t)from->width * (size_t)from->height;
    bool black = false;
    m->exemplar = (RfImageView){rf_allocate(count, (size_t)channels * sizeof(float)), from->width, from->height,
                                channels, (ptrdiff_t)from->width * channels};
    m->exemplar_grey = rf_allocate(count, sizeof(float));
    if (!m->exemplar.pixels || !m->exemplar_grey)
        return RF_OUT_OF_MEMORY;
    for (int y = 0; y < from->height; ++y)
        for (int x = 0; x < from->width; ++x)
        {
            const float *p = from->pixels + (ptrdiff_t)y * from->row_stride + (ptrdiff_t)x * from->channels;
            float *out = m->exemplar.pixels + (ptrdiff_t)y * m->exemplar.row_stride + (ptrdiff_t)x * channels;
            black |= is_colour_zero(p, channels);
            for (int c = 0; c < channels; ++c)
                if (!(fabsf(out[c] = p[c]) < 1e6f))
                    return rf_fail(RF_BAD_INPUT, NULL, "exemplar", "pixel %d, %d, channel %d is %g: no colour", x, y, c,
                                   (double)p[c]);
        }
    rf_measure_grey(&m->exemplar, m->exemplar_grey);
    if (m->holes == RF_MEASURE_HOLES_AUTO && !m->options.alpha && black)
        m->holes = RF_MEASURE_HOLES_NAN;
    rf_measure_contrast_floor(&m->exemplar, m->options.seed, &m->contrast_floor);
    return RF_OK;
}

static RfResult check_exemplar(const RfImageView *exemplar, const RfMeasureOptions *options)
{
    RF_REQUIRE(exemplar->pixels && exemplar->channels >= 1, "rf_measure_create: the exemplar has no pixels");
    RF_REQUIRE(exemplar->row_stride >= (ptrdiff_t)exemplar->width * exemplar->channels,
               "exemplar: row_stride is less than width * channels");
    if (exemplar->width < MIN_SIDE || exemplar->height < MIN_SIDE || exemplar->width > RF_MAX_SIZE ||
        exemplar->height > RF_MAX_SIZE)
        return rf_fail(RF_BAD_INPUT, NULL, "exemplar", "%d x %d pixels: each side must be %d to %d to be measured with",
                       exemplar->width, exemplar->height, MIN_SIDE, RF_MAX_SIZE);
    int least = rf_min_int(exemplar->width, exemplar->height);
    RF_REQUIRE(options->spectrum_crop <= least, "spectrum-crop %d: the exemplar has %d x %d pixels",
               options->spectrum_crop, exemplar->width, exemplar->height);
    RF_REQUIRE(options->patch_size <= least, "patch-size %d: the exemplar has %d x %d pixels", options->patch_size,
               exemplar->width, exemplar->height);
    if (options->patch_every == 0)
        return RF_OK;
    return rf_patches_check(exemplar->width, exemplar->height, options->patch_size, options->rotations,
                            options->half_pixel);
}

RfResult rf_measure_create(const RfImageView *exemplar, const RfMeasureOptions *options, RfMeasure **out)
{
    RF_REQUIRE(options && out, "rf_measure_create: options or out is NULL");
    *out = NULL;
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_measure_defaults", g_options,
                            (int)(sizeof g_options / sizeof *g_options)));
    RF_REQUIRE(options->spectrum_crop == 0 || (options->spectrum_crop >= MIN_SIDE && options->spectrum_crop % 2 == 0),
               "spectrum-crop %d: must be 0, or even and %d to 512", options->spectrum_crop, MIN_SIDE);
    if (exemplar)
        RF_TRY(check_exemplar(exemplar, options));
    RF_TRY(rf_progress("preparing the measures", 0));
    RfMeasure *m = rf_allocate_zero(1, sizeof *m);
    if (!m)
        return RF_OUT_OF_MEMORY;
    m->options = *options;
    m->holes = options->holes;
    RfResult result = exemplar ? copy_exemplar(m, exemplar) : RF_OK;
    if (result != RF_OK)
    {
        rf_measure_destroy(m);
        return result;
    }
    *out = m;
    return RF_OK;
}

// As before the first frame: what depends on its size goes, so that another one may be the first.
static void forget_frames(RfMeasure *m)
{
    for (int i = 0; i < MAPS; ++i)
    {
        rf_release(m->maps[i]);
        m->maps[i] = NULL;
    }
    for (int i = 0; i < 2; ++i)
    {
        rf_release(m->frames[i].grey);
        rf_release(m->frames[i].known);
        m->frames[i] = (Frame){0};
    }
    rf_release(m->fluid);
    rf_release(m->displacement);
    rf_spectrometer_destroy(m->spectrometer);
    rf_patches_destroy(m->patches);
    m->fluid = NULL;
    m->displacement = NULL;
    m->spectrometer = NULL;
    m->patches = NULL;
    m->width = m->height = m->channels = 0;
}

void rf_measure_destroy(RfMeasure *m)
{
    if (!m)
        return;
    forget_frames(m);
    rf_release(m->exemplar.pixels);
    rf_release(m->exemplar_grey);
    rf_release(m);
}

// ---- a frame arrives ---------------------------------------------------------------------------------------------

static int map_channels(RfMeasureMap map)
{
    return map == RF_MEASURE_MAP_MOTION || map == RF_MEASURE_MAP_SOURCE ? 2 : 1;
}

// On failure some are there and some are not: forget_frames.
static RfResult make_frames(RfMeasure *m, const RfImageView *frame)
{
    size_t count = (size_t)frame->width * (size_t)frame->height;
    bool complete = true;
    for (int i = 0; i < 2; ++i)
        complete &=
            (m->frames[i].grey = rf_allocate(count, sizeof(float))) && (m->frames[i].known = rf_allocate(count, 1));
    complete &= (m->fluid = rf_allocate(count, 1)) && (m->displacement = rf_allocate(count, 2 * sizeof(float)));
    for (int i = 0; i < MAPS; ++i)
        complete &= (m->maps[i] = rf_allocate(count, (size_t)map_channels((RfMeasureMap)i) * sizeof(float))) != NULL;
    m->width = frame->width;
    m->height = frame->height;
    m->channels = frame->channels;
    return complete ? RF_OK : RF_OUT_OF_MEMORY;
}

static RfResult check_frame(const RfMeasure *m, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(frame->width >= MIN_SIDE && frame->width <= RF_MAX_SIZE && frame->height >= MIN_SIDE &&
                   frame->height <= RF_MAX_SIZE,
               "frame: %d x %d: each side must be %d to %d", frame->width, frame->height, MIN_SIDE, RF_MAX_SIZE);
    RF_REQUIRE(frame->channels >= 1 && frame->row_stride >= (ptrdiff_t)frame->width * frame->channels,
               "frame: row_stride is less than width * channels");
    RF_REQUIRE(!m->width || (frame->width == m->width && frame->height == m->height && frame->channels == m->channels),
               "frame: %d x %d, %d channels, after frames of %d x %d, %d channels: they must stay", frame->width,
               frame->height, frame->channels, m->width, m->height, m->channels);
    RF_REQUIRE(!m->options.alpha || frame->channels == 2 || frame->channels >= 4,
               "frame: %d channels: alpha is the last of 2 or of 4", frame->channels);
    RF_REQUIRE(m->options.spectrum_crop <= rf_min_int(frame->width, frame->height),
               "spectrum-crop %d: the frame has %d x %d pixels", m->options.spectrum_crop, frame->width, frame->height);
    if (!flow)
        return RF_OK;
    RF_TRY(rf_flow_view_check(flow));
    RF_REQUIRE(!m->timed || flow->time > m->time, "flow: time %g after %g: times must increase", flow->time, m->time);
    return RF_OK;
}

static void find_fluid(RfMeasure *m, const RfFlowView *flow, const uint8_t *mask)
{
    bool by_flow = !mask && flow && flow->mask;
    m->all_fluid = true;
    for (int y = 0; y < m->height; ++y)
        for (int x = 0; x < m->width; ++x)
        {
            size_t k = (size_t)y * (size_t)m->width + (size_t)x;
            bool fluid = !mask || mask[k];
            if (by_flow)
                fluid = rf_flow_inside(flow, ((float)x + 0.5f) * (float)flow->width / (float)m->width,
                                       ((float)y + 0.5f) * (float)flow->height / (float)m->height);
            m->fluid[k] = fluid;
            m->all_fluid &= fluid;
        }
}

// The frame's grey, without holes and land.
static RfResult take_frame(RfMeasure *m, const RfImageView *frame, Frame *now, RfMeasureCoverage *coverage)
{
    rf_measure_coverage(frame, m->fluid, m->holes, m->options.alpha, now->known, coverage);
    now->all_known = m->all_fluid && coverage->holes == 0;
    rf_measure_grey(frame, now->grey);
    float *holes = m->maps[RF_MEASURE_MAP_HOLES];
    for (size_t k = 0; k < (size_t)m->width * (size_t)m->height; ++k)
        holes[k] = m->fluid[k] && !now->known[k] ? 1.0f : 0.0f;
    m->has_map[RF_MEASURE_MAP_HOLES] = true;
    return now->all_known ? RF_OK : rf_measure_fill(now->known, m->width, m->height, now->grey);
}

// ---- the measures ------------------------------------------------------------------------------------------------

static bool is_due(const RfMeasure *m, int every)
{
    return every > 0 && m->pairs_seen % every == 0;
}

static RfResult judge_motion(RfMeasure *m, const RfFlowView *flow, const Frame *before, const Frame *now,
                             RfMeasureFrame *out)
{
    bool flicker = is_due(m, m->options.flicker_every), error = is_due(m, m->options.flow_every);
    if (!flicker && !error)
        return RF_OK;
    RfFramePair pair = {m->width,
                        m->height,
                        before->grey,
                        now->grey,
                        before->all_known ? NULL : before->known,
                        now->all_known ? NULL : now->known};
    rf_measure_displacement(flow, m->timed ? m->time : flow->time - 1, m->width, m->height, m->displacement);
    if (flicker)
        RF_TRY(rf_measure_flicker(&pair, m->displacement, m->maps[RF_MEASURE_MAP_FLICKER],
                                  m->maps[RF_MEASURE_MAP_BLOCKS], &out->flicker));
    m->has_map[RF_MEASURE_MAP_FLICKER] = m->has_map[RF_MEASURE_MAP_BLOCKS] = flicker;
    if (!error)
        return RF_OK;
    RF_TRY(rf_progress("judging", 0.2));
    RfGrey exemplar = {m->exemplar_grey, m->exemplar.width, m->exemplar.height};
    RF_TRY(rf_measure_flow_error(m->options.estimator, &pair, m->displacement, m->exemplar_grey ? &exemplar : NULL,
                                 m->maps[RF_MEASURE_MAP_FLOW_ERROR], m->maps[RF_MEASURE_MAP_MOTION], &out->flow));
    m->has_map[RF_MEASURE_MAP_FLOW_ERROR] = m->has_map[RF_MEASURE_MAP_MOTION] = true;
    return RF_OK;
}

// Crops without holes, if there are any: a filled hole is smooth, and its rim is not, which shows in the frequencies
// that the texture does not have.
static RfResult judge_spectrum(RfMeasure *m, const Frame *now, RfRadialSpectrum *spectrum, RfMeasureFrame *out)
{
    RfGrey frame = {now->grey, m->width, m->height};
    RfGrey exemplar = {m->exemplar_grey, m->exemplar.width, m->exemplar.height};
    const uint8_t *mask = m->all_fluid ? NULL : m->fluid;
    if (!m->spectrometer)
        RF_TRY(rf_spectrometer_create(m->exemplar_grey ? &exemplar : NULL, &frame, mask, m->options.spectrum_crop,
                                      m->options.spectrum_first, m->options.seed, &m->spectrometer));
    RF_TRY(
        rf_spectrometer_measure(m->spectrometer, &frame, now->all_known ? NULL : now->known, spectrum, &out->spectrum));
    bool some = out->coverage.holes > 0 && out->coverage.holes < out->coverage.fluid;
    if (!some || !isnan(spectrum->power[1]))
        return RF_OK;
    return rf_spectrometer_measure(m->spectrometer, &frame, mask, spectrum, &out->spectrum);
}

// Colour alone, or grey, packed: what windows are compared in.
static void pack(const RfImageView *frame, const float *grey, const RfImageView *out)
{
    for (int y = 0; y < out->height; ++y)
        for (int x = 0; x < out->width; ++x)
        {
            const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            float *q = out->pixels + (ptrdiff_t)y * out->row_stride + (ptrdiff_t)x * out->channels;
            if (out->channels == 3)
                memcpy(q, p, 3 * sizeof *q);
            else
                *q = grey[(size_t)y * (size_t)out->width + (size_t)x] / 255;
        }
}

static RfResult pack_new(const RfImageView *picture, const float *grey, int channels, RfImageView *out)
{
    *out = *picture;
    out->channels = channels;
    out->row_stride = (ptrdiff_t)channels * out->width;
    out->pixels = rf_allocate((size_t)out->width * (size_t)out->height, (size_t)channels * sizeof(float));
    if (!out->pixels)
        return RF_OUT_OF_MEMORY;
    pack(picture, grey, out);
    return RF_OK;
}

static RfResult make_patches(RfMeasure *m, int channels)
{
    RfImageView exemplar;
    RF_TRY(pack_new(&m->exemplar, m->exemplar_grey, channels, &exemplar));
    RfResult result = rf_patches_create(&exemplar, m->options.patch_size, m->options.patch_stride, m->options.rotations,
                                        m->options.half_pixel, &m->patches);
    rf_release(exemplar.pixels);
    return result;
}

static RfResult judge_patches(RfMeasure *m, const RfImageView *frame, const Frame *now, RfMeasureFrame *out)
{
    int size = m->options.patch_size;
    if (!m->exemplar_grey || m->options.patch_every == 0 || m->frames_seen % m->options.patch_every != 0 ||
        m->width < size || m->height < size)
        return RF_OK;
    int channels = m->options.patch_colour && m->exemplar.channels == 3 && m->channels >= 3 ? 3 : 1;
    if (!m->patches)
        RF_TRY(make_patches(m, channels));
    RfImageView packed;
    int64_t use[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS];
    RF_TRY(pack_new(frame, now->grey, channels, &packed));
    RfResult result =
        rf_patches_measure(m->patches, &packed, now->all_known ? NULL : now->known, m->maps[RF_MEASURE_MAP_PATCH],
                           m->maps[RF_MEASURE_MAP_SOURCE], use, &out->patch);
    if (result == RF_OK)
        memcpy(m->use, use, sizeof use);
    m->has_map[RF_MEASURE_MAP_PATCH] = m->has_map[RF_MEASURE_MAP_SOURCE] = result == RF_OK;
    rf_release(packed.pixels);
    return result;
}

static void judge_contrast(const RfMeasure *m, const RfImageView *frame, const Frame *now, RfMeasureFrame *out)
{
    if (!m->exemplar_grey)
        return;
    rf_measure_contrast(frame, now->all_known ? NULL : now->known, &m->exemplar, &out->contrast);
    out->contrast.luma_floor = m->contrast_floor.luma_floor;
    out->contrast.brightness_floor = m->contrast_floor.brightness_floor;
    out->contrast.l1_floor = m->contrast_floor.l1_floor;
    out->contrast.mover_floor = m->contrast_floor.mover_floor;
}

static RfResult judge_flow(const RfFlowView *flow, RfMeasureFrame *out)
{
    RfMeasureDivergence divergence;
    RF_TRY(rf_measure_divergence(flow, &divergence));
    out->divergence = divergence.relative;
    return RF_OK;
}

// Everything that may fail. The patches come last and go on with the fractions of "judging".
static RfResult judge(RfMeasure *m, const RfFlowView *flow, const uint8_t *mask, const RfImageView *frame,
                      RfRadialSpectrum *spectrum, RfMeasureFrame *out)
{
    Frame *now = &m->frames[m->current];
    rf_measure_clear(out);
    memset(m->has_map, 0, sizeof m->has_map);
    RF_TRY(rf_progress("judging", 0));
    find_fluid(m, flow, mask);
    RF_TRY(take_frame(m, frame, now, &out->coverage));
    if (flow)
        RF_TRY(judge_flow(flow, out));
    if (flow && m->frames_seen > 0)
        RF_TRY(judge_motion(m, flow, &m->frames[1 - m->current], now, out));
    RF_TRY(rf_progress("judging", 0.5));
    RF_TRY(judge_spectrum(m, now, spectrum, out));
    RF_TRY(rf_progress("judging", 0.6));
    RF_TRY(judge_patches(m, frame, now, out));
    judge_contrast(m, frame, now, out);
    return RF_OK;
}

static void add_spectrum(RfMeasure *m)
{
    if (isnan(m->spectrum.power[1]))
        return;
    for (int k = 1; k <= rf_spectrometer_crop(m->spectrometer) / 2; ++k)
        m->power_sum[k] += m->spectrum.power[k];
    ++m->spectra_seen;
}

RfResult rf_measure_step(RfMeasure *m, const RfFlowView *flow, const uint8_t *mask, const RfImageView *frame,
                         RfMeasureFrame *out)
{
    RF_REQUIRE(m && frame && frame->pixels && out, "rf_measure_step: measure, frame or out is NULL");
    RF_TRY(check_frame(m, flow, frame));
    RfMeasureFrame judged;
    RfRadialSpectrum spectrum;
    RfResult result = m->width ? RF_OK : make_frames(m, frame);
    if (result == RF_OK)
        result = judge(m, flow, mask, frame, &spectrum, &judged);
    if (result != RF_OK)
    {
        memset(m->has_map, 0, sizeof m->has_map);
        if (m->frames_seen == 0)
            forget_frames(m);
        return result;
    }
    judged.index = (double)m->frames_seen;
    m->pairs_seen += flow && m->frames_seen > 0;
    ++m->frames_seen;
    m->timed = flow != NULL;
    m->time = flow ? flow->time : 0;
    m->current = 1 - m->current;
    m->spectrum = spectrum;
    add_spectrum(m);
    rf_measure_tally(&m->tally, &judged);
    *out = judged;
    return RF_OK;
}

// ---- what a report wants -----------------------------------------------------------------------------------------

void rf_measure_summary(const RfMeasure *m, RfMeasureSummary *out)
{
    rf_measure_tally_summary(&m->tally, out);
    out->frames = m->frames_seen;
}

static void to_decibels(const double *power, double scale, double *out)
{
    for (int k = 0; k <= RF_MEASURE_MAX_BINS; ++k)
        out[k] = power[k] * scale > 0 ? 10 * log10(power[k] * scale) : (double)NAN;
}

void rf_measure_spectra(const RfMeasure *m, RfMeasureSpectra *out)
{
    RfRadialSpectrum mean, low, high;
    *out = (RfMeasureSpectra){0};
    if (!m->spectrometer)
        return;
    rf_spectrometer_exemplar(m->spectrometer, &mean, &low, &high);
    out->crop = rf_spectrometer_crop(m->spectrometer);
    out->first = m->options.spectrum_first;
    out->last = out->crop / 2;
    to_decibels(m->spectrum.power, 1, out->frame);
    to_decibels(mean.power, 1, out->exemplar);
    to_decibels(low.power, 1, out->low);
    to_decibels(high.power, 1, out->high);
    to_decibels(m->power_sum, m->spectra_seen ? 1 / (double)m->spectra_seen : (double)NAN, out->all_frames);
}

void rf_measure_use(const RfMeasure *m, int64_t counts[RF_MEASURE_USE_CELLS * RF_MEASURE_USE_CELLS])
{
    memcpy(counts, m->use, sizeof m->use);
}

bool rf_measure_has_map(const RfMeasure *m, RfMeasureMap map)
{
    return (unsigned)map < MAPS && m->has_map[map];
}

RfResult rf_measure_map(const RfMeasure *m, RfMeasureMap map, const RfImageView *out)
{
    RF_REQUIRE(m && out && out->pixels, "rf_measure_map: measure or out is NULL");
    RF_REQUIRE(rf_measure_has_map(m, map), "rf_measure_map: the last step did not compute it (rf_measure_has_map)");
    int channels = map_channels(map);
    RF_REQUIRE(out->width == m->width && out->height == m->height && out->channels == channels &&
                   out->row_stride >= (ptrdiff_t)out->width * channels,
               "map: %d x %d, %d channels: must be %d x %d, %d", out->width, out->height, out->channels, m->width,
               m->height, channels);
    size_t row = (size_t)m->width * (size_t)channels;
    for (int y = 0; y < m->height; ++y)
        memcpy(out->pixels + (ptrdiff_t)y * out->row_stride, m->maps[map] + (size_t)y * row, row * sizeof(float));
    return RF_OK;
}
