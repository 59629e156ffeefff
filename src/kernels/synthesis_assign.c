// SPDX-License-Identifier: Apache-2.0
// The assign step: every pixel becomes what the windows over it say.
//
// Each window over a pixel votes for a place of the exemplar, with a weight that falls off towards its border and with
// its cost. Votes for one place are counted together. The pixel becomes the place whose colour is nearest to the mean
// of all votes (Han et al. 2006), or that mean itself (Kwatra et al. 2005).
//
// Pixels are done cell by cell, since all of a cell are under nearly the same windows. Where these agree, which is most
// of the frame after a few iterations, there is nothing to vote about.
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/synthesis.h"

#include <string.h>

enum
{
    // Windows over a cell: those of 5 x 5 cells with a spacing of a quarter of a window, 7 x 7 with one of a pixel.
    MAX_VOTES = 81,
    FALL_STEPS = 16,
    MAX_FALL = (RF_FIXED_SIDE / 2 + 2) * FALL_STEPS
};

// Of the Gaussian fall-off, in windows' sides. From 0.2 to 1 residuals change by 8 %; below 0.4 they are worse.
static const float FALL_OFF = 0.4f;
// The exponent r of the energy where it is robust (Kwatra et al. 2005).
static const float ROBUST_EXPONENT = 0.8f;
// Keeps exact matches from weighing without end: in fixed point, where an exemplar's range is 1020, a 255th of it.
static const float LEAST_DIFFERENCE = 4;

typedef struct Vote
{
    RfVec2 at, source, turn;
    float weight;
    int group;
} Vote;

typedef struct Ballot
{
    int votes, groups;
    Vote vote[MAX_VOTES];
    /// Of each group at one pixel: its weight, that of its heaviest vote, and the place that this one is for.
    float weight[MAX_VOTES], heaviest[MAX_VOTES];
    RfVec2 place[MAX_VOTES];
    const int16_t *pixel[MAX_VOTES];
} Ballot;

typedef struct Assigning
{
    const RfSynthesisAssign *assign;
    int reach, channels;
    float half, smallest_cost;
    float fall[MAX_FALL];
    /// Of windows.
    float *weights;
    Ballot *ballots;
} Assigning;

static void make_fall(Assigning *a, int side)
{
    float sigma = FALL_OFF * (float)side;
    for (int i = 0; i < MAX_FALL; ++i)
    {
        float d = (float)i / FALL_STEPS;
        a->fall[i] = expf(-d * d / (2 * sigma * sigma));
    }
}

static void weigh_row(void *context, int row, int worker)
{
    (void)worker;
    const Assigning *a = context;
    const RfSynthesisFrame *f = a->assign->frame;
    for (int i = row * f->columns; i < (row + 1) * f->columns; ++i)
        a->weights[i] = a->assign->robust ? powf(f->windows[i].cost + a->smallest_cost, (ROBUST_EXPONENT - 2) / 2) : 1;
}

// A window with a place for the cell's middle joins the group of one that says the same; else it opens a group.
static void count_in(const Assigning *a, Ballot *b, const RfSynthesisWindow *window, RfVec2 shift, RfVec2 *middles,
                     RfVec2 middle)
{
    float together = a->assign->together;
    Vote *vote = &b->vote[b->votes++];
    float weight = a->weights[window - a->assign->frame->windows];
    *vote = (Vote){rf_vec2_add(window->at, shift), window->source, window->turn, weight, 0};
    RfVec2 place = rf_vec2_add(vote->source, rf_turn(vote->turn, rf_vec2_sub(middle, vote->at)));
    int g = 0;
    while (g < b->groups && !(fabsf(middles[g].x - place.x) <= together && fabsf(middles[g].y - place.y) <= together))
        ++g;
    if (g == b->groups)
        middles[b->groups++] = place;
    vote->group = g;
}

// All windows that may lie over the cell's pixels; positions are unrolled where the frame tiles.
static void hear(const Assigning *a, int column, int row, Ballot *b)
{
    const RfSynthesisFrame *f = a->assign->frame;
    RfVec2 middles[MAX_VOTES], middle = {(float)(column * f->spacing), (float)(row * f->spacing)};
    b->votes = b->groups = 0;
    for (int j = row - a->reach; j <= row + a->reach; ++j)
        for (int i = column - a->reach; i <= column + a->reach; ++i)
        {
            if (!f->tiles && (i < 0 || j < 0 || i >= f->columns || j >= f->rows))
                continue;
            int wi = rf_wrap_int(i, f->columns), wj = rf_wrap_int(j, f->rows);
            const RfSynthesisWindow *window = &f->windows[(ptrdiff_t)wj * f->columns + wi];
            RfVec2 shift = {(float)((i - wi) / f->columns * f->width), (float)((j - wj) / f->rows * f->height)};
            if (window->exists)
                count_in(a, b, window, shift, middles, middle);
        }
}

static bool source_inside(const RfSynthesisExemplar *e, RfVec2 s)
{
    return e->tiles || (s.x >= -0.5f && s.y >= -0.5f && s.x < (float)e->width - 0.5f && s.y < (float)e->height - 0.5f);
}

static float weigh(const Assigning *a, const Vote *vote, float x, float y)
{
    float dx = fabsf(x - vote->at.x), dy = fabsf(y - vote->at.y);
    if (dx > a->half || dy > a->half)
        return 0;
    return vote->weight * a->fall[(int)(dx * FALL_STEPS + 0.5f)] * a->fall[(int)(dy * FALL_STEPS + 0.5f)];
}

// Sums up the votes at a pixel. Returns the sum of the weights.
static float count_votes(const Assigning *a, Ballot *b, int x, int y)
{
    float total = 0;
    for (int g = 0; g < b->groups; ++g)
    {
        b->weight[g] = 0;
        b->heaviest[g] = 0;
    }
    for (int i = 0; i < b->votes; ++i)
    {
        const Vote *vote = &b->vote[i];
        float weight = weigh(a, vote, (float)x, (float)y);
        RfVec2 step = {(float)x - vote->at.x, (float)y - vote->at.y};
        RfVec2 place = rf_vec2_add(vote->source, rf_turn(vote->turn, step));
        if (weight == 0 || !source_inside(a->assign->exemplar, place))
            continue;
        // Not the mean of the places: between two pieces that differ by part of a pixel it would lead from one to the
        // other little by little, and make both of them unlike the exemplar.
        if (weight > b->heaviest[vote->group])
        {
            b->heaviest[vote->group] = weight;
            b->place[vote->group] = place;
        }
        b->weight[vote->group] += weight;
        total += weight;
    }
    return total;
}

// The mean of all votes, and of what the pixel is held to.
static void mean_of_votes(const Assigning *a, Ballot *b, int x, int y, float total, float *mean)
{
    const RfSynthesisAssign *assign = a->assign;
    for (int c = 0; c < a->channels; ++c)
        mean[c] = 0;
    for (int g = 0; g < b->groups; ++g)
        if (b->weight[g] > 0)
        {
            b->pixel[g] = rf_synthesis_pixel(assign->exemplar, b->place[g]);
            for (int c = 0; c < a->channels; ++c)
                mean[c] += b->weight[g] / total * b->pixel[g][c];
        }
    for (int c = 0; c < a->channels && assign->held.hold; ++c)
        mean[c] = rf_synthesis_hold(&assign->held, assign->frame->width, x, y, c, mean[c]);
}

static int nearest_group(const Assigning *a, const Ballot *b, const float *mean)
{
    float least = INFINITY;
    int best = -1;
    for (int g = 0; g < b->groups; ++g)
    {
        if (!(b->weight[g] > 0))
            continue;
        float distance = 0;
        for (int c = 0; c < a->channels; ++c)
            distance += ((float)b->pixel[g][c] - mean[c]) * ((float)b->pixel[g][c] - mean[c]);
        if (distance < least)
        {
            least = distance;
            best = g;
        }
    }
    return best;
}

static bool set_source(RfVec2 *source, RfVec2 place)
{
    // Turned windows of one piece say the same but for rounding.
    bool other = fabsf(source->x - place.x) > 1e-3f || fabsf(source->y - place.y) > 1e-3f;
    *source = place;
    return other;
}

// Returns true if the pixel became another.
static bool assign_pixel(const Assigning *a, Ballot *b, int x, int y)
{
    const RfSynthesisAssign *assign = a->assign;
    float total = count_votes(a, b, x, y);
    if (!(total > 0))
        return false;
    float mean[RF_MAX_EXEMPLAR_CHANNELS];
    mean_of_votes(a, b, x, y, total, mean);
    int16_t *pixel = rf_fixed_at(&assign->frame->picture, x, y);
    int best = nearest_group(a, b, mean);
    bool other = set_source(&assign->frame->sources[(ptrdiff_t)y * assign->frame->width + x], b->place[best]);
    if (!assign->mean && !assign->held.hold)
    {
        memcpy(pixel, b->pixel[best], (size_t)a->channels * sizeof *pixel);
        return other;
    }
    for (int c = 0; c < a->channels; ++c)
    {
        float value =
            assign->mean ? mean[c] : rf_synthesis_hold(&assign->held, assign->frame->width, x, y, c, b->pixel[best][c]);
        int16_t now = (int16_t)lrintf(value);
        other |= now != pixel[c];
        pixel[c] = now;
    }
    return other;
}

// The window that says most about a point.
static const Vote *heaviest_vote(const Assigning *a, const Ballot *b, RfVec2 point)
{
    const Vote *heaviest = b->vote;
    float most = 0;
    bool equal = a->assign->together == 0; // nothing is turned: votes of one group are for exactly one place
    for (int i = 0; i < b->votes && !equal; ++i)
    {
        float weight = weigh(a, &b->vote[i], point.x, point.y);
        if (weight > most)
        {
            most = weight;
            heaviest = &b->vote[i];
        }
    }
    return heaviest;
}

// All windows say the same, and nothing else is asked for: the cell is a piece of the exemplar.
static bool copy_cell(const Assigning *a, const Ballot *b, int x0, int y0, int x1, int y1)
{
    const RfSynthesisAssign *assign = a->assign;
    bool other = false;
    const Vote *vote = heaviest_vote(a, b, (RfVec2){0.5f * (float)(x0 + x1 - 1), 0.5f * (float)(y0 + y1 - 1)});
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
        {
            RfVec2 step = {(float)x - vote->at.x, (float)y - vote->at.y};
            RfVec2 place = rf_vec2_add(vote->source, rf_turn(vote->turn, step));
            if (!source_inside(assign->exemplar, place))
                continue;
            other |= set_source(&assign->frame->sources[(ptrdiff_t)y * assign->frame->width + x], place);
            memcpy(rf_fixed_at(&assign->frame->picture, x, y), rf_synthesis_pixel(assign->exemplar, place),
                   (size_t)a->channels * sizeof(int16_t));
        }
    return other;
}

static bool has_changed(const Assigning *a, int column, int row)
{
    const RfSynthesisFrame *f = a->assign->frame;
    for (int j = row - a->reach; j <= row + a->reach; ++j)
        for (int i = column - a->reach; i <= column + a->reach; ++i)
            if (f->tiles || (i >= 0 && j >= 0 && i < f->columns && j < f->rows))
                if (f->windows[rf_wrap_int(j, f->rows) * f->columns + rf_wrap_int(i, f->columns)].changed)
                    return true;
    return false;
}

static void assign_row(void *context, int row, int worker)
{
    const Assigning *a = context;
    const RfSynthesisAssign *assign = a->assign;
    RfSynthesisFrame *f = assign->frame;
    Ballot *b = &a->ballots[worker];
    int y0 = row * f->spacing, y1 = rf_min_int(y0 + f->spacing, f->height);
    for (int i = 0; i < f->columns; ++i)
    {
        int x0 = i * f->spacing, x1 = rf_min_int(x0 + f->spacing, f->width);
        bool other = false;
        if (assign->all || has_changed(a, i, row))
        {
            hear(a, i, row, b);
            if (b->groups == 1 && !assign->held.hold && !assign->mean)
                other = copy_cell(a, b, x0, y0, x1, y1);
            else
                for (int y = y0; y < y1; ++y)
                    for (int x = x0; x < x1; ++x)
                        other |= assign_pixel(a, b, x, y);
        }
        f->stirred[(ptrdiff_t)row * f->columns + i] = other;
    }
}

RfResult rf_synthesis_assign(const RfSynthesisAssign *assign)
{
    RfSynthesisFrame *f = assign->frame;
    int half = assign->side / 2, numbers = assign->side * assign->side * assign->exemplar->channels;
    Assigning *a = rf_allocate_zero(1, sizeof *a);
    Ballot *ballots = rf_allocate((size_t)rf_threads(), sizeof *ballots);
    float *weights = rf_allocate((size_t)f->columns * (size_t)f->rows, sizeof *weights);
    RfResult result = a && ballots && weights ? RF_OK : RF_OUT_OF_MEMORY;
    if (result == RF_OK)
    {
        a->assign = assign;
        a->ballots = ballots;
        a->weights = weights;
        a->reach = (half + f->spacing - 1) / f->spacing;
        a->half = (float)half + 0.5f;
        a->channels = assign->exemplar->channels - assign->guides;
        a->smallest_cost = (float)numbers * LEAST_DIFFERENCE * LEAST_DIFFERENCE;
        assert((2 * a->reach + 1) * (2 * a->reach + 1) <= MAX_VOTES);
        make_fall(a, assign->side);
        rf_parallel_for(f->rows, weigh_row, a);
        rf_parallel_for(f->rows, assign_row, a);
        rf_fixed_extend(&f->picture, f->tiles);
    }
    rf_release(a);
    rf_release(ballots);
    rf_release(weights);
    return result;
}
