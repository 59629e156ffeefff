// SPDX-License-Identifier: Apache-2.0
// A thicket of sugar cane, lying along x: jointed stalks and long narrow leaves in layers, the nearer ones lit and
// casting shade on those behind. The strong direction is the point: x is along, y across.
//
// Every layer is asked in turn, from the front, whether it covers the point. Stalks run in lanes that close on the
// torus; leaves are single strokes, a curve y(x) with a width that tapers to both ends.
#include "core/memory.h"
#include "core/result.h"
#include "fluids/drawing.h"

enum
{
    STALK_LAYERS = 3,
    LEAF_LAYERS = 3,
    MAX_LEAVES = 4096
};

typedef struct Leaf
{
    float x, y, length, slope, bend, width, hue;
} Leaf;

typedef struct Canes
{
    RfTorus torus;
    /// The same torus, squeezed along x, so that noise on it is streaks.
    RfTorus streaks;
    int leaf_count[LEAF_LAYERS];
    Leaf *leaves[LEAF_LAYERS];
} Canes;

typedef struct StalkLayer
{
    /// Lanes a unit, share of lanes with a stalk, and brightness.
    float lanes, share, shade;
} StalkLayer;

static const StalkLayer stalk_layers[STALK_LAYERS] = {{24, 0.62f, 1}, {26, 0.85f, 0.66f}, {30, 1, 0.40f}};
static const float leaf_shades[LEAF_LAYERS] = {1.08f, 0.80f, 0.50f};
static const float squeeze = 0.06f;

static float streak(const Canes *canes, float x, float y, float cells, uint64_t stream)
{
    return rf_torus_noise(&canes->streaks, x * squeeze, y, cells, stream);
}

/// Place on a stroke: across it from -1 to 1, and along it from 0 to 1 (a leaf) or from joint to joint (a stalk).
typedef struct Place
{
    float across, along;
    uint64_t item;
} Place;

static bool on_stalk(const Canes *canes, int layer, float x, float y, Place *place)
{
    const StalkLayer *stalks = &stalk_layers[layer];
    int count = rf_max_int(3, (int)lroundf(stalks->lanes * canes->torus.span_y));
    float lane_width = canes->torus.span_y / (float)count;
    int middle = (int)floorf(y / lane_width);
    uint64_t best_order = 0;
    bool found = false;
    for (int k = middle - 1; k <= middle + 1; ++k)
    {
        uint64_t item = (uint64_t)rf_wrap_int(k, count), seed = canes->torus.seed, stream = 100 + (uint64_t)layer;
        if (rf_random_float(seed, stream, item, 0) > stalks->share)
            continue;
        float wander = 0.55f * rf_torus_noise(&canes->torus, x, 0, 2, stream + 16 * (item + 1)) +
                       0.5f * (rf_random_float(seed, stream, item, 1) - 0.5f);
        float radius = lane_width * (0.36f + 0.22f * rf_random_float(seed, stream, item, 2));
        // Joints: some six along a unit, at uneven distances, thicker there.
        float joints = floorf(4 + 3.5f * rf_random_float(seed, stream, item, 3));
        joints = fmaxf(1, roundf(joints * canes->torus.span_x));
        float along = x / canes->torus.span_x * joints + rf_random_float(seed, stream, item, 4);
        float to_joint = fabsf(along - floorf(along) - 0.5f);
        radius *= 1 + 0.13f * expf(-to_joint * to_joint * 900);
        float across = (y - ((float)k + 0.5f + wander) * lane_width) / radius;
        uint64_t order = rf_random_bits(seed, stream, item, 5) | 1;
        if (fabsf(across) < 1 && order > best_order)
        {
            *place = (Place){across, along - floorf(along), item};
            best_order = order;
            found = true;
        }
    }
    return found;
}

static RfVec3 stalk_colour(const Canes *canes, int layer, const Place *place, float x, float y)
{
    static const RfVec3 palette[] = {{0.56f, 0.57f, 0.22f}, {0.66f, 0.61f, 0.30f}, {0.44f, 0.52f, 0.20f},
                                     {0.70f, 0.58f, 0.34f}, {0.48f, 0.36f, 0.26f}, {0.38f, 0.47f, 0.22f}};
    uint64_t seed = canes->torus.seed, stream = 100 + (uint64_t)layer;
    RfVec3 a = palette[rf_random_below(6, seed, stream, place->item, 6)];
    RfVec3 b = palette[rf_random_below(6, seed, stream, place->item, 7)];
    // Each piece pales from one joint to the next; joints stand at one half.
    float piece = place->along < 0.5f ? place->along + 0.5f : place->along - 0.5f;
    RfVec3 colour = rf_mix3(a, b, 0.6f * piece);
    colour =
        rf_scale3(colour, 1 + 0.16f * streak(canes, x, y, 130, stream) + 0.12f * streak(canes, x, y, 50, stream + 5));
    // A joint: a dark ring with a pale, waxy band on one side.
    float from = place->along - 0.5f + 0.012f * place->across * place->across;
    float ring = expf(-from * from * 9000), wax = expf(-(from - 0.035f) * (from - 0.035f) * 1800);
    colour = rf_mix3(colour, (RfVec3){0.83f, 0.80f, 0.62f}, 0.55f * wax);
    return rf_scale3(colour, 1 - 0.65f * ring);
}

/// The topmost leaf of a layer over the point.
static bool on_leaf(const Canes *canes, int layer, float x, float y, Place *place)
{
    for (int k = canes->leaf_count[layer] - 1; k >= 0; --k)
    {
        const Leaf *leaf = &canes->leaves[layer][k];
        float dx = x - leaf->x;
        dx -= canes->torus.span_x * floorf(dx / canes->torus.span_x);
        if (dx > leaf->length)
            continue;
        float along = dx / leaf->length;
        float dy = y - leaf->y - leaf->slope * dx - leaf->bend * dx * dx;
        dy -= canes->torus.span_y * floorf(dy / canes->torus.span_y + 0.5f);
        float width = leaf->width * 4 * along * (1 - along) * (1.25f - 0.5f * along);
        if (fabsf(dy) < width)
        {
            *place = (Place){dy / width, along, (uint64_t)k};
            return true;
        }
    }
    return false;
}

static RfVec3 leaf_colour(const Canes *canes, int layer, const Place *place, float x, float y)
{
    const Leaf *leaf = &canes->leaves[layer][place->item];
    RfVec3 green = rf_mix3((RfVec3){0.25f, 0.40f, 0.10f}, (RfVec3){0.50f, 0.58f, 0.22f}, leaf->hue);
    RfVec3 colour =
        rf_mix3(green, (RfVec3){0.72f, 0.62f, 0.34f}, rf_smooth(0.75f, 1, leaf->hue + 0.25f * place->along));
    colour = rf_scale3(colour, 1 + 0.22f * streak(canes, x, y, 160, 300 + (uint64_t)layer));
    // Folded along a pale midrib: one half faces the light, the other does not.
    float fold = place->across < 0 ? 1.12f : 0.78f, rib = expf(-place->across * place->across * 60);
    colour = rf_scale3(colour, fold + 0.15f * fabsf(place->across) - 0.25f * place->across * place->across);
    return rf_mix3(colour, (RfVec3){0.78f, 0.80f, 0.52f}, 0.45f * rib);
}

/// A cylinder lit from above (small y), with a soft gleam along it.
static RfVec3 round_off(RfVec3 colour, float across)
{
    float up = sqrtf(fmaxf(1 - across * across, 0));
    float lit = 0.22f + 0.92f * fmaxf(-0.55f * across + 0.835f * up, 0);
    float gleam = expf(-(across + 0.42f) * (across + 0.42f) * 26);
    return rf_add3(rf_scale3(colour, lit), (RfVec3){0.13f * gleam, 0.13f * gleam, 0.10f * gleam});
}

static void paint(const void *context, float x, float y, float *colour)
{
    const Canes *canes = context;
    RfVec3 result = {0.035f, 0.045f, 0.02f};
    float shade = 1;
    Place place, above;
    for (int layer = 0; layer < STALK_LAYERS; ++layer)
    {
        if (on_leaf(canes, layer, x, y, &place))
        {
            result = rf_scale3(leaf_colour(canes, layer, &place, x, y), shade * leaf_shades[layer]);
            break;
        }
        // Shade of what lies above towards the light.
        if (on_leaf(canes, layer, x - 0.004f, y - 0.011f, &above))
            shade *= 0.62f;
        if (on_stalk(canes, layer, x, y, &place))
        {
            RfVec3 stalk = stalk_colour(canes, layer, &place, x, y);
            result = rf_scale3(round_off(stalk, place.across), shade * stalk_layers[layer].shade);
            break;
        }
        if (on_stalk(canes, layer, x, y - 0.010f, &above))
            shade *= 0.60f;
    }
    colour[0] = result.x;
    colour[1] = result.y;
    colour[2] = result.z;
}

static RfResult grow_leaves(Canes *canes, int layer)
{
    const RfTorus *torus = &canes->torus;
    int count = rf_min_int(MAX_LEAVES, 1 + (int)(34 * torus->span_x * torus->span_y));
    canes->leaf_count[layer] = count;
    canes->leaves[layer] = rf_allocate((size_t)count, sizeof(Leaf));
    if (!canes->leaves[layer])
        return RF_OUT_OF_MEMORY;
    uint64_t seed = torus->seed, stream = 200 + (uint64_t)layer;
    for (int k = 0; k < count; ++k)
    {
        uint64_t item = (uint64_t)k;
        float length = fminf(0.95f * torus->span_x, 0.30f + 0.50f * rf_random_float(seed, stream, item, 2));
        canes->leaves[layer][k] = (Leaf){.x = torus->span_x * rf_random_float(seed, stream, item, 0),
                                         .y = torus->span_y * rf_random_float(seed, stream, item, 1),
                                         .length = length,
                                         .slope = 0.16f * (rf_random_float(seed, stream, item, 3) - 0.5f),
                                         .bend = 0.20f * (rf_random_float(seed, stream, item, 4) - 0.5f),
                                         .width = 0.006f + 0.007f * rf_random_float(seed, stream, item, 5),
                                         .hue = rf_random_float(seed, stream, item, 6)};
    }
    return RF_OK;
}

static RfResult draw(const RfParameters *parameters, const RfImageView *image)
{
    Canes canes = {.torus = rf_torus(parameters)};
    canes.streaks = canes.torus;
    canes.streaks.span_x *= squeeze;
    RfResult result = RF_OK;
    for (int layer = 0; layer < LEAF_LAYERS && result == RF_OK; ++layer)
        result = grow_leaves(&canes, layer);
    if (result == RF_OK)
        result = rf_paint(&canes.torus, image, paint, &canes);
    for (int layer = 0; layer < LEAF_LAYERS; ++layer)
        rf_release(canes.leaves[layer]);
    return result;
}

const RfExemplarClass rf_exemplar_canes = {
    .name = "canes",
    .defaults = "size=256&seed=1&scale=1",
    .ranges = rf_drawing_ranges,
    .sentence = "Dense sugar cane with narrow leaves, all lying along x: an exemplar with a direction.",
    .channels = 3,
    .draw = draw,
};
