// SPDX-License-Identifier: Apache-2.0
// Neyret. Advected textures. 2003, as Yu, Neyret, Bruneton, Holzschuch describe it too (2009, section 4.3).
//
// A layer is two or three sets of carried coordinates that start afresh in turn, every `latency` frames. A set's weight
// is 0 when it starts, so the jump is never seen:
//
//     w_p = sin^2(pi age_p / latency).
//
// The layers' latencies double. A short one keeps the texture's look and shows motion badly, a long one follows the
// flow and stretches. Which one a place needs is measured, not assumed: the deformation that a layer's coordinates have
// accumulated there is
//
//     e_l = sum_p w_p ln delta(J_p) / sum_p w_p,    delta = max(s_max, 1 / s_min),
//
// s the singular values of the coordinates' Jacobian. The ideal latency is the one at which e is the limit E = ln
// max_distortion. Deformation grows about as the age, so layer l + 1, where e_(l + 1) = 2 e_l, is shown in full while
// e_(l + 1) <= E and not at all from 2 E on, which is where layer l just meets the limit: of what is left over by the
// shorter ones each layer takes
//
//     share_l = clamp(2 - e_l / E, 0, 1).
//
// In between the pictures of two latencies are mixed, and the effective latency is between theirs. All of it is
// continuous in space and time, as the coordinates are.
//
// Deviations: the paper interpolates parameters of procedural noise to keep its contrast; pictures here are blended by
// the contrast-preserving form. Small-scale animation, its third part, is no matter of following a given flow.
#include "riffle/eulerian.h"

#include "core/memory.h"
#include "core/options.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/crossfade.h"

enum
{
    MAX_LAYERS = 3,
    MAX_PHASES = 3
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
};

#define FIELD(name) offsetof(RfEulerianOptions, name)

static const RfOption g_options[] = {
    {"seed", RF_OPTION_UINT64, FIELD(seed), "", 0, 18446744073709551615.0, 1, NULL,
     "Where in the exemplar coordinates start is drawn from it."},
    {"latency", RF_OPTION_INT, FIELD(latency), "frames", 4, 100000, 12, NULL,
     "Frames that the first layer's coordinates live; each further layer's live twice as long."},
    {"layers", RF_OPTION_INT, FIELD(layers), "", 1, MAX_LAYERS, MAX_LAYERS, NULL,
     "Latencies to choose from at every pixel; with 1 the whole frame has one."},
    {"phases", RF_OPTION_INT, FIELD(phases), "", 2, MAX_PHASES, 2, NULL,
     "Sets of coordinates a layer, started in turn. 3 pulse less and blend more."},
    {"max-distortion", RF_OPTION_FLOAT, FIELD(max_distortion), "", 1.01, 100, 1.5, NULL,
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
                               .latency = 12,
                               .layers = MAX_LAYERS,
                               .phases = 2,
                               .max_distortion = 1.5f,
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
    /// Of the sets, by age.
    float weights[MAX_LAYERS * MAX_PHASES];
} Weighing;

static Weighing weighing_of(const RfEulerian *eulerian)
{
    Weighing weighing = {.eulerian = eulerian};
    const RfCoordinates *c = &eulerian->coordinates;
    for (int set = 0; set < c->sets; ++set)
    {
        RfTurn turn = eulerian->turns[set];
        double wave = sin((double)RF_PI * rf_turn_age(turn, c->time - c->start) / turn.period);
        weighing.weights[set] = (float)(wave * wave);
    }
    return weighing;
}

// e_l at a pixel.
static float layer_deformation(const Weighing *weighing, int layer, int x, int y)
{
    int phases = weighing->eulerian->options.phases;
    float sum = 0, total = 0;
    for (int set = layer * phases; set < (layer + 1) * phases; ++set)
        if (weighing->weights[set] > 0)
        {
            RfJacobian j = rf_coordinates_jacobian(&weighing->eulerian->coordinates, set, x, y);
            sum += weighing->weights[set] * log_distortion(j);
            total += weighing->weights[set];
        }
    return total > 0 ? sum / total : 0;
}

static void weigh(const void *context, int x, int y, int count, float (*weights)[RF_CROSSFADE_PIXELS])
{
    const Weighing *weighing = context;
    const RfEulerianOptions *options = &weighing->eulerian->options;
    float limit = logf(options->max_distortion);
    for (int i = 0; i < count; ++i)
    {
        float left = 1;
        for (int layer = 0; layer < options->layers; ++layer)
        {
            // What the next layer takes over from this one.
            float taken = layer + 1 < options->layers
                              ? rf_clamp(2 - layer_deformation(weighing, layer + 1, x + i, y) / limit, 0, 1)
                              : 0;
            for (int set = layer * options->phases; set < (layer + 1) * options->phases; ++set)
                weights[set][i] = left * (1 - taken) * weighing->weights[set];
            left *= taken;
        }
    }
}

RfResult rf_eulerian_step(RfEulerian *eulerian, const RfFlowView *flow, const RfImageView *frame)
{
    RF_REQUIRE(eulerian && frame && frame->pixels, "rf_eulerian_step: eulerian or frame is NULL");
    RF_TRY(rf_crossfade_check(&eulerian->sampler, frame));
    RF_TRY(rf_eulerian_advance(eulerian, flow, frame->width, frame->height));
    Weighing weighing = weighing_of(eulerian);
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
    return rf_coordinates_save(&eulerian->coordinates, "rf-eule",
                               inputs_hash(eulerian->sampler.exemplar, &eulerian->options), block, size);
}

RfResult rf_eulerian_load(const RfExemplar *exemplar, const RfEulerianOptions *options, const void *block, size_t size,
                          RfEulerian **out)
{
    RF_REQUIRE(block, "rf_eulerian_load: block is NULL");
    RF_TRY(rf_eulerian_create(exemplar, options, out));
    RfResult result = rf_coordinates_load(&(*out)->coordinates, "rf-eule", inputs_hash(exemplar, options), block, size);
    if (result != RF_OK)
    {
        rf_eulerian_destroy(*out);
        *out = NULL;
    }
    return result;
}
