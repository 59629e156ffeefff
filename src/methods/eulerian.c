// SPDX-License-Identifier: Apache-2.0
// Neyret. Advected textures. 2003, as Yu, Neyret, Bruneton, Holzschuch describe it too (2009, section 4.3).
//
// A layer is two or three sets of carried coordinates that start afresh in turn, every `latency` frames. A set's weight
// is 0 when it starts, so the jump is never seen:
//
//     w_p = sin(pi age_p / latency).
//
// The squares of a layer's weights add up to a constant, so that the contrast-preserving blend turns from one picture
// to the next at a steady pace (sin^2, which adds up to 1 itself, is twice as fast midway, and shows it).
//
// The layers' latencies double. A short one keeps the texture's look and shows motion badly, a long one follows the
// flow and stretches. Which one a place needs is measured, not assumed: from the Jacobians J of the coordinates comes
// the deformation they have accumulated, and from all sets together the rate at which it grows there,
//
//     rate = mean over the layers of  sum_p w_p ln delta(J_p) / sum_p w_p age_p,    delta = max(s_max, 1 / s_min),
//
// s the singular values. The mean age of what is seen of a layer is half its latency, so the latency at which the mean
// deformation is the limit is
//
//     ideal = 2 ln(max_distortion) / rate,
//
// held between the shortest and the longest there is, and the two layers whose latencies enclose it are mixed, linearly
// in its logarithm.
//
// The rate is taken on a lattice of every eighth pixel and smoothed: deformation lies in filaments as thin as the
// texture's features, and weights that vary as fast draw patterns of their own. Tried and dropped: to compare each
// layer's own deformation with the limit, pixel by pixel. It pulses with the layer's phases, and the mix with it.
//
// Deviations: the paper interpolates parameters of procedural noise to keep its contrast; pictures here are blended by
// the contrast-preserving form. Small-scale animation, its third part, is no matter of following a given flow.
#include "riffle/eulerian.h"

#include "core/memory.h"
#include "core/options.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/crossfade.h"

#include <stdlib.h>

enum
{
    MAX_LAYERS = 3,
    MAX_PHASES = 3,
    // Pixels from one node of the lattice to the next.
    LATTICE = 8
};

static_assert(MAX_LAYERS * MAX_PHASES <= RF_MAX_COORDINATE_SETS, "room for the sets");

// Of one set: beyond it nothing can be told from streaks.
#define MOST_DISTORTION 100.0f

struct RfEulerian
{
    RfEulerianOptions options;
    RfSampler sampler;
    RfCoordinates coordinates;
    /// Set p of layer l is number l * phases + p.
    RfTurn turns[MAX_LAYERS * MAX_PHASES];
    RfResolveQuad quads[RF_SAMPLE_QUADS];
    /// Growth of deformation, 1 / frame, at pixels (LATTICE i, LATTICE j): as measured, and smoothed.
    int columns, rows;
    float *measured, *rate;
};

#define FIELD(name) offsetof(RfEulerianOptions, name)

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, FIELD(seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where in the exemplar coordinates start is drawn from it."},
    {"latency", RF_OPTION_INT, FIELD(latency), "frames", 4, 100000, 24, NULL,
     "Frames that the first layer's coordinates live; each further layer's live twice as long."},
    {"layers", RF_OPTION_INT, FIELD(layers), "", 1, MAX_LAYERS, MAX_LAYERS, NULL,
     "Latencies to choose from at every pixel; with 1 the whole frame has one."},
    {"phases", RF_OPTION_INT, FIELD(phases), "", 2, MAX_PHASES, 2, NULL,
     "Sets of coordinates a layer, started in turn. 3 pulse less and blend more."},
    {"max-distortion", RF_OPTION_FLOAT, FIELD(max_distortion), "", 1.01, 100, 1.25, NULL,
     "Stretch or squash that a layer may have on average; where it has more, a shorter latency shows."},
    {"blend", RF_OPTION_CHOICE, FIELD(blend), "", 0, 1, RF_BLEND_CONTRAST, "plain|contrast",
     "Weighted mean, or the same with mean and variance kept."},
};

enum
{
    OPTION_COUNT = sizeof g_options / sizeof *g_options
};

const RfOption *rf_eulerian_option_table(int *count)
{
    if (count)
        *count = OPTION_COUNT;
    return g_options;
}

RfEulerianOptions rf_eulerian_defaults(void)
{
    return (RfEulerianOptions){.struct_size = sizeof(RfEulerianOptions),
                               .seed = 1,
                               .latency = 24,
                               .layers = MAX_LAYERS,
                               .phases = 2,
                               .max_distortion = 1.25f,
                               .blend = RF_BLEND_CONTRAST};
}

static void make_turns(RfEulerian *eulerian)
{
    int phases = eulerian->options.phases;
    eulerian->coordinates.sets = eulerian->options.layers * phases;
    for (int set = 0; set < eulerian->coordinates.sets; ++set)
    {
        int latency = eulerian->options.latency << (set / phases);
        eulerian->turns[set] = (RfTurn){latency, latency * (set % phases) / phases};
    }
}

RfResult rf_eulerian_create(const RfExemplar *exemplar, const RfEulerianOptions *options, RfEulerian **out)
{
    RF_REQUIRE(exemplar && options && out, "rf_eulerian_create: exemplar, options or out is NULL");
    *out = NULL;
    RF_TRY(rf_options_check(options, options->struct_size, sizeof *options, "rf_eulerian_defaults", g_options,
                            OPTION_COUNT));
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RfEulerian *eulerian = rf_allocate_zero(1, sizeof *eulerian);
    if (!eulerian)
        return RF_OUT_OF_MEMORY;
    eulerian->options = *options;
    make_turns(eulerian);
    rf_crossfade_quads(exemplar, options->blend == RF_BLEND_CONTRAST, eulerian->quads);
    RfResult result = rf_sampler_create(exemplar, &eulerian->sampler);
    if (result != RF_OK)
    {
        rf_eulerian_destroy(eulerian);
        return result;
    }
    *out = eulerian;
    return RF_OK;
}

void rf_eulerian_destroy(RfEulerian *eulerian)
{
    if (!eulerian)
        return;
    rf_sampler_free(&eulerian->sampler);
    rf_coordinates_free(&eulerian->coordinates);
    rf_release(eulerian->measured);
    rf_release(eulerian->rate);
    rf_release(eulerian);
}

RfResult rf_eulerian_advance(RfEulerian *eulerian, const RfFlowView *flow, int width, int height)
{
    RF_REQUIRE(eulerian, "rf_eulerian_advance: eulerian is NULL");
    return rf_crossfade_move(&eulerian->coordinates, eulerian->turns, "carrying", flow, width, height);
}

// ln delta.
static float log_distortion(RfJacobian j)
{
    float sum = sqrtf((j.xx + j.yy) * (j.xx + j.yy) + (j.yx - j.xy) * (j.yx - j.xy));
    float difference = sqrtf((j.xx - j.yy) * (j.xx - j.yy) + (j.xy + j.yx) * (j.xy + j.yx));
    float largest = 0.5f * (sum + difference), smallest = 0.5f * (sum - difference);
    if (!(j.xx * j.yy - j.xy * j.yx > 0))
        return logf(MOST_DISTORTION);
    return logf(rf_min(rf_max(largest, 1 / rf_max(smallest, 1 / MOST_DISTORTION)), MOST_DISTORTION));
}

typedef struct Weighing
{
    const RfEulerian *eulerian;
    /// Of the sets, by age; and their ages in frames.
    float weights[MAX_LAYERS * MAX_PHASES], ages[MAX_LAYERS * MAX_PHASES];
} Weighing;

static Weighing weighing_of(const RfEulerian *eulerian)
{
    Weighing weighing = {.eulerian = eulerian};
    const RfCoordinates *c = &eulerian->coordinates;
    for (int set = 0; set < c->sets; ++set)
    {
        // Before its first turn a set is less deformed than its phase says, so the first frames show long latencies and
        // turn to shorter ones gradually.
        double age = rf_turn_age(eulerian->turns[set], c->time - c->start);
        weighing.weights[set] = (float)sin((double)RF_PI * age / eulerian->turns[set].period);
        weighing.ages[set] = (float)age;
    }
    return weighing;
}

static float rate_at(const Weighing *weighing, int x, int y)
{
    const RfEulerianOptions *options = &weighing->eulerian->options;
    float rate = 0;
    for (int layer = 0; layer < options->layers; ++layer)
    {
        float deformation = 0, age = 0;
        for (int set = layer * options->phases; set < (layer + 1) * options->phases; ++set)
            if (weighing->weights[set] > 0)
            {
                RfJacobian j = rf_coordinates_jacobian(&weighing->eulerian->coordinates, set, x, y);
                deformation += weighing->weights[set] * log_distortion(j);
                age += weighing->weights[set] * weighing->ages[set];
            }
        rate += age > 0 ? deformation / age : 0;
    }
    return rate / (float)options->layers;
}

static void measure_row(void *context, int row, int worker)
{
    (void)worker;
    const Weighing *weighing = context;
    const RfEulerian *eulerian = weighing->eulerian;
    int y = rf_min_int(LATTICE * row, eulerian->coordinates.height - 1);
    for (int i = 0; i < eulerian->columns; ++i)
    {
        int x = rf_min_int(LATTICE * i, eulerian->coordinates.width - 1);
        eulerian->measured[row * eulerian->columns + i] = rate_at(weighing, x, y);
    }
}

// Means of 3 x 3 nodes, weighted 1 2 1 along each axis.
static void smooth_row(void *context, int row, int worker)
{
    (void)worker;
    const RfEulerian *eulerian = ((const Weighing *)context)->eulerian;
    for (int i = 0; i < eulerian->columns; ++i)
    {
        float sum = 0;
        for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
            {
                int x = rf_clamp_int(i + dx, 0, eulerian->columns - 1),
                    y = rf_clamp_int(row + dy, 0, eulerian->rows - 1);
                sum += (float)((2 - abs(dx)) * (2 - abs(dy))) * eulerian->measured[y * eulerian->columns + x];
            }
        eulerian->rate[row * eulerian->columns + i] = sum / 16;
    }
}

static RfResult make_lattice(RfEulerian *eulerian, int width, int height)
{
    if (eulerian->rate)
        return RF_OK;
    eulerian->columns = (width + LATTICE - 1) / LATTICE + 1;
    eulerian->rows = (height + LATTICE - 1) / LATTICE + 1;
    size_t nodes = (size_t)eulerian->columns * (size_t)eulerian->rows;
    if (!eulerian->measured)
        eulerian->measured = rf_allocate(nodes, sizeof(float));
    if (eulerian->measured)
        eulerian->rate = rf_allocate(nodes, sizeof(float));
    return eulerian->rate ? RF_OK : RF_OUT_OF_MEMORY;
}

// The smoothed rate at a pixel of the lattice's row of cells `upper`, t of the way down it.
static float interpolate_rate(const RfEulerian *eulerian, const float *upper, float t, int x)
{
    const float *left = upper + x / LATTICE, *lower = left + eulerian->columns;
    float s = (float)(x % LATTICE) / LATTICE;
    return rf_lerp(rf_lerp(left[0], left[1], s), rf_lerp(lower[0], lower[1], s), t);
}

static void weigh(const void *context, int x, int y, int count, float (*weights)[RF_CROSSFADE_PIXELS])
{
    const Weighing *weighing = context;
    const RfEulerian *eulerian = weighing->eulerian;
    int layers = eulerian->options.layers, phases = eulerian->options.phases;
    // Of a rate under it, the ideal latency is the longest.
    float limit = 2 * logf(eulerian->options.max_distortion) / (float)eulerian->options.latency,
          least = limit / (float)(1 << (layers - 1));
    const float *upper = eulerian->rate + (size_t)(y / LATTICE) * (size_t)eulerian->columns;
    for (int i = 0; i < count; ++i)
    {
        float rate = interpolate_rate(eulerian, upper, (float)(y % LATTICE) / LATTICE, x + i);
        float place = rate > least ? rf_max(log2f(limit / rate), 0) : (float)(layers - 1);
        for (int layer = 0; layer < layers; ++layer)
            for (int phase = 0; phase < phases; ++phase)
                weights[layer * phases + phase][i] =
                    rf_max(1 - fabsf(place - (float)layer), 0) * weighing->weights[layer * phases + phase];
    }
}

RfResult rf_eulerian_step(RfEulerian *eulerian, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(eulerian && frame && frame->pixels, "rf_eulerian_step: eulerian or frame is NULL");
    RF_TRY(rf_crossfade_check(&eulerian->sampler, frame));
    RF_TRY(rf_eulerian_advance(eulerian, flow, frame->width, frame->height));
    RF_TRY(make_lattice(eulerian, frame->width, frame->height));
    Weighing weighing = weighing_of(eulerian);
    rf_parallel_for(eulerian->rows, measure_row, &weighing);
    rf_parallel_for(eulerian->rows, smooth_row, &weighing);
    RfCrossfade crossfade = {.sampler = &eulerian->sampler,
                             .coordinates = &eulerian->coordinates,
                             .weigh = weigh,
                             .context = &weighing,
                             .quads = eulerian->quads};
    rf_crossfade_origins(&crossfade, eulerian->options.seed, eulerian->turns);
    rf_crossfade_draw(&crossfade, flow, frame);
    return RF_OK;
}

static uint64_t inputs_hash(const RfExemplar *exemplar, const RfEulerianOptions *options)
{
    return rf_options_hash(options, g_options, OPTION_COUNT, exemplar->hash);
}

RfResult rf_eulerian_save(const RfEulerian *eulerian, void **block, size_t *size)
{
    RF_REQUIRE(eulerian && block && size, "rf_eulerian_save: eulerian, block or size is NULL");
    return rf_coordinates_save(&eulerian->coordinates, "eulerian",
                               inputs_hash(eulerian->sampler.exemplar, &eulerian->options), block, size);
}

RfResult rf_eulerian_load(const RfExemplar *exemplar, const RfEulerianOptions *options, const void *block, size_t size,
                          RfEulerian **out)
{
    RF_REQUIRE(block, "rf_eulerian_load: block is NULL");
    RF_TRY(rf_eulerian_create(exemplar, options, out));
    RfResult result =
        rf_coordinates_load(&(*out)->coordinates, "eulerian", inputs_hash(exemplar, options), block, size);
    if (result != RF_OK)
    {
        rf_eulerian_destroy(*out);
        *out = NULL;
    }
    return result;
}
