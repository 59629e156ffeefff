// SPDX-License-Identifier: Apache-2.0
// What the flow does in a step, and the cells that it is cut into.
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/tracing.h"
#include "methods/directional/directional.h"

#include <string.h>

// Slower than this, in pixels a step, and the flow has no direction.
static const float STANDSTILL = 1e-4f;
// Nothing lands in the frame from farther away.
static const float FARTHEST = 2.0f * RF_MAX_SIZE;

// ---- the flow

typedef struct Reading
{
    RfDirectional *d;
    const RfFlowView *flow;
    double from;
    int steps;
} Reading;

static RfVec2 limited(const RfDirectional *d, RfVec2 v, float frames)
{
    // In double, where the square of no float overflows.
    double length = sqrt((double)v.x * (double)v.x + (double)v.y * (double)v.y);
    float least = d->options.speed_min * frames,
          most = d->options.speed_max > 0 ? d->options.speed_max * frames : FARTHEST;
    most = rf_min(most, FARTHEST);
    float wanted = rf_clamp((float)rf_min((float)length, FARTHEST), rf_min(least, most), most);
    if (length < (double)(STANDSTILL * frames))
        return (RfVec2){0, 0};
    return (RfVec2){(float)((double)v.x / length) * wanted, (float)((double)v.y / length) * wanted};
}

static void read_row(void *context, int y, int worker)
{
    (void)worker;
    const Reading *r = context;
    RfDirectional *d = r->d;
    const RfFlowView *flow = r->flow;
    float sx = (float)d->width / (float)flow->width, sy = (float)d->height / (float)flow->height;
    double time = flow->time;
    for (int x = 0; x < d->width; ++x)
    {
        size_t pixel = (size_t)y * (size_t)d->width + (size_t)x;
        RfVec2 point = {((float)x + 0.5f) / sx, ((float)y + 0.5f) / sy};
        d->inside[pixel] = !flow->mask || rf_pixel_inside(flow, d->width, d->height, x, y);
        RfVec2 now = rf_flow_sample(flow, point.x, point.y, rf_flow_blend(flow, time));
        now = (RfVec2){now.x * sx, now.y * sy};
        bool still = fabsf(now.x) < STANDSTILL && fabsf(now.y) < STANDSTILL;
        d->direction_at[pixel] = still ? NAN : atan2f(now.y, now.x);
        d->velocity[pixel] = now;
        if (r->steps == 0)
            continue;
        RfVec2 step = rf_vec2_sub(rf_trace(flow, point, r->from, time, r->steps), point);
        d->velocity[pixel] = limited(d, (RfVec2){step.x * sx, step.y * sy}, (float)(time - r->from));
    }
}

void rf_directional_read_flow(RfDirectional *d, const RfFlowView *flow, double from)
{
    d->frames = (float)(flow->time - from);
    Reading reading = {d, flow, from, flow->time > from ? rf_path_steps(flow, flow->time - from) : 0};
    rf_parallel_for(d->height, read_row, &reading);
}

// ---- cells

bool rf_directional_fluid(const RfDirectional *d, int pixel)
{
    return d->inside[pixel] != 0;
}

bool rf_directional_missing(const RfDirectional *d, int pixel)
{
    return d->inside[pixel] && d->texels[pixel].copy < 0;
}

float rf_directional_mean(const RfDirectional *d, RfCell cell, bool (*wanted)(const RfDirectional *, int))
{
    float x = 0, y = 0;
    for (int j = cell.y; j < cell.y + cell.height; ++j)
        for (int i = cell.x; i < cell.x + cell.width; ++i)
        {
            int pixel = j * d->width + i;
            if (!wanted(d, pixel) || isnan(d->direction_at[pixel]))
                continue;
            x += cosf(d->direction_at[pixel]);
            y += sinf(d->direction_at[pixel]);
        }
    return x != 0 || y != 0 ? atan2f(y, x) : NAN;
}

typedef struct Splitting
{
    RfDirectional *d;
    RfCellList *list;
    bool (*wanted)(const RfDirectional *, int pixel);
    bool (*agrees)(const RfDirectional *, RfCell, bool (*wanted)(const RfDirectional *, int));
} Splitting;

// The directions lie within 2 pi / n.
static bool directions_agree(const RfDirectional *d, RfCell cell, bool (*wanted)(const RfDirectional *, int))
{
    float some = NAN, least = 0, most = 0;
    for (int j = cell.y; j < cell.y + cell.height; ++j)
        for (int i = cell.x; i < cell.x + cell.width; ++i)
        {
            int pixel = j * d->width + i;
            if (!wanted(d, pixel) || isnan(d->direction_at[pixel]))
                continue;
            if (isnan(some))
                some = d->direction_at[pixel];
            float off = rf_angle_between(d->direction_at[pixel], some);
            least = rf_min(least, off);
            most = rf_max(most, off);
            if (most - least >= rf_directional_step_angle(d))
                return false;
        }
    return true;
}

static RfVec2 mean_velocity(const RfDirectional *d, RfCell cell)
{
    RfVec2 sum = {0, 0};
    int count = 0;
    for (int j = cell.y; j < cell.y + cell.height; ++j)
        for (int i = cell.x; i < cell.x + cell.width; ++i)
            if (d->inside[j * d->width + i])
            {
                sum = rf_vec2_add(sum, d->velocity[j * d->width + i]);
                ++count;
            }
    return count ? (RfVec2){sum.x / (float)count, sum.y / (float)count} : sum;
}

static bool velocities_agree(const RfDirectional *d, RfCell cell, bool (*wanted)(const RfDirectional *, int))
{
    RfVec2 mean = mean_velocity(d, cell);
    float farthest = 0, slowest = INFINITY;
    for (int j = cell.y; j < cell.y + cell.height; ++j)
        for (int i = cell.x; i < cell.x + cell.width; ++i)
        {
            int pixel = j * d->width + i;
            if (!wanted(d, pixel))
                continue;
            farthest = rf_max(farthest, rf_vec2_length(rf_vec2_sub(d->velocity[pixel], mean)));
            slowest = rf_min(slowest, rf_vec2_length(d->velocity[pixel]));
        }
    return farthest <= (d->options.cells == RF_CELLS_NEAR ? d->options.velocity_spread * d->frames : slowest);
}

static RfResult append(RfCellList *list, RfCell cell)
{
    if (list->count == list->room)
    {
        int room = rf_max_int(2 * list->room, 1024);
        RfCell *cells = rf_reallocate(list->cells, (size_t)list->room, (size_t)room, sizeof *cells);
        if (!cells)
            return RF_OUT_OF_MEMORY;
        list->cells = cells;
        list->room = room;
    }
    list->cells[list->count++] = cell;
    return RF_OK;
}

// Shrinks the cell to what is wanted of it. False: nothing.
static bool shrink(const Splitting *s, RfCell *cell)
{
    int left = cell->x + cell->width, top = -1, right = cell->x, bottom = cell->y;
    for (int j = cell->y; j < cell->y + cell->height; ++j)
        for (int i = cell->x; i < cell->x + cell->width; ++i)
            if (s->wanted(s->d, j * s->d->width + i))
            {
                top = top < 0 ? j : top;
                bottom = j + 1;
                left = rf_min_int(left, i);
                right = rf_max_int(right, i + 1);
            }
    if (top < 0)
        return false;
    *cell = (RfCell){left, top, right - left, bottom - top};
    return true;
}

static RfResult split(const Splitting *s, RfCell cell)
{
    if (!shrink(s, &cell))
        return RF_OK;
    int least = rf_min_int(s->d->options.cell_min, s->d->cell_max), most = s->d->cell_max;
    bool large = cell.width > most || cell.height > most;
    bool wide = cell.width >= 2 * least || cell.width > most, high = cell.height >= 2 * least || cell.height > most;
    if (!large && ((!wide && !high) || s->agrees(s->d, cell, s->wanted)))
        return append(s->list, cell);
    int width = wide ? cell.width / 2 : cell.width, height = high ? cell.height / 2 : cell.height;
    RF_TRY(split(s, (RfCell){cell.x, cell.y, width, height}));
    if (wide)
        RF_TRY(split(s, (RfCell){cell.x + width, cell.y, cell.width - width, height}));
    if (high)
        RF_TRY(split(s, (RfCell){cell.x, cell.y + height, width, cell.height - height}));
    if (wide && high)
        RF_TRY(split(s, (RfCell){cell.x + width, cell.y + height, cell.width - width, cell.height - height}));
    return RF_OK;
}

// The cells' borders lie elsewhere in each frame: where they stayed, the texture would tear again and again.
static RfResult split_all(const Splitting *s)
{
    const RfDirectional *d = s->d;
    int side = d->cell_max;
    int left = -(int)(d->steps * 19 % (uint64_t)side), top = -(int)(d->steps * 11 % (uint64_t)side);
    for (int y = top; y < d->height; y += side)
        for (int x = left; x < d->width; x += side)
        {
            int x0 = rf_max_int(x, 0), x1 = rf_min_int(x + side, d->width);
            int y0 = rf_max_int(y, 0), y1 = rf_min_int(y + side, d->height);
            RF_TRY(split(s, (RfCell){x0, y0, x1 - x0, y1 - y0}));
        }
    return RF_OK;
}

RfResult rf_directional_split_frame(RfDirectional *d, RfCellList *list)
{
    Splitting splitting = {d, list, rf_directional_fluid, directions_agree};
    list->count = 0;
    return split_all(&splitting);
}

RfResult rf_directional_split_hole(RfDirectional *d, RfCell cell, RfCellList *list)
{
    Splitting splitting = {d, list, rf_directional_missing, directions_agree};
    return split(&splitting, cell);
}

static RfVec2 mean_rest(const RfDirectional *d, RfCell cell)
{
    RfVec2 sum = {0, 0};
    int count = 0;
    for (int j = cell.y; j < cell.y + cell.height; ++j)
        for (int i = cell.x; i < cell.x + cell.width; ++i)
            if (d->texels[j * d->width + i].copy >= 0)
            {
                sum = rf_vec2_add(sum, d->texels[j * d->width + i].rest);
                ++count;
            }
    return count ? (RfVec2){sum.x / (float)count, sum.y / (float)count} : sum;
}

static void set_move(void *context, int item, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    RfCell cell = d->cells.cells[item];
    RfVec2 velocity = mean_velocity(d, cell), way = rf_vec2_add(velocity, mean_rest(d, cell));
    d->moves[item] = (RfMove){cell, velocity, rf_nearest_int(way.x), rf_nearest_int(way.y)};
}

RfResult rf_directional_split_moves(RfDirectional *d)
{
    Splitting splitting = {d, &d->cells, rf_directional_fluid, velocities_agree};
    d->cells.count = 0;
    RF_TRY(split_all(&splitting));
    if (d->cells.count > d->move_room)
    {
        RfMove *moves = rf_reallocate(d->moves, (size_t)d->move_room, (size_t)d->cells.room, sizeof *moves);
        if (!moves)
            return RF_OUT_OF_MEMORY;
        d->moves = moves;
        d->move_room = d->cells.room;
    }
    rf_parallel_for(d->cells.count, set_move, d);
    return RF_OK;
}
