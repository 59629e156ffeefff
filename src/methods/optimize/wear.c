// SPDX-License-Identifier: Apache-2.0
// How worn the texture is: by how much it is stretched, and turned away from how it is to lie; and, where the flow
// enters the frame, by how far what was laid there was continued. What pieces meet at the border do so in a line along
// the flow for as long as they are continued, and where their turns differ they run into each other.
//
// The texture is to lie as the options say: unturned, downstream, or as the flow has turned it. In the latter case
// neighbours in a vortex are turned ever more unlike each other, which no texture can follow: renewed texture lies as
// its surroundings do in the mean.
#include "core/parallel.h"
#include "core/random.h"
#include "methods/optimize/moving.h"

enum
{
    GRAIN = RF_WEAR_GRAIN,
    /// Of the mean of turns, in cells on each side.
    SMOOTH = 4
};

// Texture is renewed when it is stretched by this, as a natural logarithm (half as long again, or a third shorter), or
// turned off by so much, about in radians. In turbulence 0.3 flickers 5 % more and 0.5 8 % less, at the same distance
// from the exemplar; with more, structures are seen to be stretched.
static const float WORN_STRETCH = 0.4f;
static const float WORN_ANGLE = 0.5f;
// And when it was continued by so much of a patch's reach.
static const float CONTINUED = 0.5f;
// The limits differ by up to this part from block to block of the exemplar, so that what was made together does not
// wear out together.
static const float LIMITS_DIFFER = 0.4f;
static const float BLOCK = 24;

typedef struct Judging
{
    RfOptimize *o;
    const RfFlowView *flow;
} Judging;

static int cell_pixel(const RfOptimize *o, int cell)
{
    int x = rf_min_int(cell % o->columns * GRAIN + GRAIN / 2, o->markers.width - 1);
    int y = rf_min_int(cell / o->columns * GRAIN + GRAIN / 2, o->markers.height - 1);
    return y * o->markers.width + x;
}

RfVec2 rf_optimize_cell_middle(const RfOptimize *o, int cell)
{
    int pixel = cell_pixel(o, cell);
    return (RfVec2){(float)(pixel % o->markers.width), (float)(pixel / o->markers.width)};
}

static RfVec2 turn_of(const Judging *k, int cell)
{
    const RfOptimize *o = k->o;
    switch (o->options.orient)
    {
    case RF_ORIENT_NONE:
        return (RfVec2){1, 0};
    case RF_ORIENT_FLOW:
        return rf_optimize_downstream(k->flow, o->markers.width, o->markers.height, rf_optimize_cell_middle(o, cell));
    default:
        return rf_bend_parts(o->markers.pixels[cell_pixel(o, cell)].bend).turn;
    }
}

static void turn_row(void *context, int row, int worker)
{
    (void)worker;
    const Judging *k = context;
    for (int i = 0; i < k->o->columns; ++i)
        k->o->turns[row * k->o->columns + i] = turn_of(k, row * k->o->columns + i);
}

// The sum over 2 SMOOTH + 1 cells in a row of them, those beyond the end left out or, where the frame tiles, taken from
// the other end.
static RfVec2 sum_of(const RfVec2 *turns, int i, int n, int stride, bool tiles)
{
    RfVec2 sum = {0, 0};
    for (int d = i - SMOOTH; d <= i + SMOOTH; ++d)
        if (tiles || (d >= 0 && d < n))
            sum = rf_vec2_add(sum, turns[(ptrdiff_t)rf_wrap_int(d, n) * stride]);
    return sum;
}

static void smooth_row(void *context, int row, int worker)
{
    (void)worker;
    RfOptimize *o = context;
    for (int i = 0; i < o->columns; ++i)
        o->smoothed[row * o->columns + i] =
            sum_of(o->turns + (ptrdiff_t)row * o->columns, i, o->columns, 1, o->markers.tiles);
}

static void smooth_column(void *context, int column, int worker)
{
    (void)worker;
    RfOptimize *o = context;
    for (int j = 0; j < o->rows; ++j)
    {
        RfVec2 sum = sum_of(o->smoothed + column, j, o->rows, o->columns, o->markers.tiles);
        float length = rf_vec2_length(sum);
        if (length > 1e-3f)
            o->turns[j * o->columns + column] = (RfVec2){sum.x / length, sum.y / length};
    }
}

static float limit_of(const RfOptimize *o, RfVec2 s)
{
    // Places on an exemplar that tiles may lie anywhere: casts stay defined.
    int64_t column = (int64_t)floorf(rf_clamp(s.x, -1e9f, 1e9f) / BLOCK);
    int64_t row = (int64_t)floorf(rf_clamp(s.y, -1e9f, 1e9f) / BLOCK);
    uint64_t block = (uint64_t)row << 32 ^ (uint64_t)column;
    float random = (float)rf_random_below(1024, o->options.seed, 0, block, 0) / 512 - 1;
    return 1 + LIMITS_DIFFER * random;
}

static float wear_of(const Judging *k, int cell)
{
    const RfOptimize *o = k->o;
    int pixel = cell_pixel(o, cell), width = o->markers.width;
    if (k->flow->mask && !rf_pixel_inside(k->flow, width, o->markers.height, pixel % width, pixel / width))
        return 0;
    const RfMarker *m = &o->markers.pixels[pixel];
    RfBendParts parts = rf_bend_parts(m->bend);
    if (!rf_optimize_inside(&o->material.levels[0], m->source) || !(parts.least > 0 && parts.most < 1e6f))
        return INFINITY;
    RfVec2 turn = o->turns[cell];
    // Nearly the angle between the two: twice the sine of its half.
    float off = rf_vec2_length(rf_vec2_sub(parts.turn, turn));
    float stretch = logf(rf_max(parts.most, 1 / parts.least));
    float bent = rf_max(stretch / WORN_STRETCH, off / WORN_ANGLE);
    return rf_max(bent, m->continued / (CONTINUED * (float)o->outer)) / limit_of(o, m->source);
}

static void judge_row(void *context, int row, int worker)
{
    (void)worker;
    const Judging *k = context;
    for (int i = 0; i < k->o->columns; ++i)
        k->o->wear[row * k->o->columns + i] = wear_of(k, row * k->o->columns + i);
}

void rf_optimize_judge(RfOptimize *o, const RfFlowView *flow)
{
    Judging judging = {o, flow};
    rf_parallel_for(o->rows, turn_row, &judging);
    if (o->options.orient == RF_ORIENT_FREE)
    {
        rf_parallel_for(o->rows, smooth_row, o);
        rf_parallel_for(o->columns, smooth_column, o);
    }
    rf_parallel_for(o->rows, judge_row, &judging);
}
