// SPDX-License-Identifier: Apache-2.0
// Arrows on a grid over the dimmed wheel: each stays inside its own square, so squares are drawn in any order.
//
// An arrow is the union of a shaft (a segment with round ends) and a head (a triangle); a pixel's coverage comes from
// the signed distance to it. A dark rim keeps white arrows visible on light colours.
#include "render/flow_picture.h"

#include "core/parallel.h"

// Under this share of full speed a dot stands for an arrow.
static const float STILL = 0.02f;

typedef struct Arrow
{
    /// Tail and tip, half width of the shaft; the head's length and half width. Pixels.
    RfVec2 tail, tip, along;
    float shaft, head_length, head_width;
} Arrow;

static float segment_distance(RfVec2 p, RfVec2 a, RfVec2 b)
{
    RfVec2 ab = rf_vec2_sub(b, a), ap = rf_vec2_sub(p, a);
    float square = ab.x * ab.x + ab.y * ab.y;
    float t = square > 0 ? rf_clamp((ap.x * ab.x + ap.y * ab.y) / square, 0, 1) : 0;
    return rf_vec2_length((RfVec2){ap.x - t * ab.x, ap.y - t * ab.y});
}

// Distance to an isosceles triangle with its tip at p = 0, its base at `length` behind; p in the arrow's frame, x
// forward. Outside it is exact near the sides, which is all that a rim needs.
static float head_distance(RfVec2 p, float length, float half_width)
{
    float side = sqrtf(length * length + half_width * half_width);
    float slanted = (p.x * half_width + fabsf(p.y) * length) / side, base = -p.x - length;
    return fmaxf(slanted, base);
}

static float arrow_distance(const Arrow *arrow, RfVec2 p)
{
    RfVec2 q = rf_vec2_sub(p, arrow->tip);
    RfVec2 local = {q.x * arrow->along.x + q.y * arrow->along.y, q.y * arrow->along.x - q.x * arrow->along.y};
    RfVec2 neck = {arrow->tip.x - arrow->head_length * arrow->along.x,
                   arrow->tip.y - arrow->head_length * arrow->along.y};
    float shaft = segment_distance(p, arrow->tail, neck) - arrow->shaft;
    return arrow->head_length > 0 ? fminf(shaft, head_distance(local, arrow->head_length, arrow->head_width)) : shaft;
}

static Arrow make_arrow(RfVec2 centre, RfVec2 velocity, const RfFlowCanvas *canvas, float spacing)
{
    float speed = rf_vec2_length(velocity);
    float share = canvas->full_speed > 0 ? fminf(speed / canvas->full_speed, 1) : 0, shaft = 0.034f * spacing + 0.3f;
    if (share < STILL)
        return (Arrow){centre, centre, {1, 0}, shaft, 0, 0};
    // The direction as it is seen, where the frame's pixels are not square cells.
    RfVec2 along = {velocity.x * canvas->scale_x, velocity.y * canvas->scale_y};
    float length = rf_vec2_length(along), reach = spacing * (0.18f + 0.26f * share);
    along = (RfVec2){along.x / length, along.y / length};
    float head = spacing * (0.18f + 0.12f * share);
    return (Arrow){{centre.x - reach * along.x, centre.y - reach * along.y},
                   {centre.x + reach * along.x, centre.y + reach * along.y},
                   along,
                   shaft,
                   head,
                   0.52f * head};
}

static void lay_over(const RfImageView *frame, int x, int y, RfColour colour, float share)
{
    const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + 3 * (ptrdiff_t)x;
    rf_colour_put(frame, x, y, rf_colour_mix((RfColour){p[0], p[1], p[2]}, colour, share));
}

static bool all_fluid(const RfFlowCanvas *canvas, int x0, int y0, int x1, int y1)
{
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
            if (!canvas->fluid[(size_t)y * (size_t)canvas->width + (size_t)x])
                return false;
    return true;
}

typedef struct Grid
{
    const RfFlowCanvas *canvas;
    int columns, rows;
    float spacing;
} Grid;

static void draw_square(const Grid *grid, int column, int row)
{
    const RfFlowCanvas *canvas = grid->canvas;
    int x0 = (int)((int64_t)column * canvas->width / grid->columns);
    int x1 = (int)((int64_t)(column + 1) * canvas->width / grid->columns);
    int y0 = (int)((int64_t)row * canvas->height / grid->rows);
    int y1 = (int)((int64_t)(row + 1) * canvas->height / grid->rows);
    RfVec2 centre = {((float)column + 0.5f) * (float)canvas->width / (float)grid->columns,
                     ((float)row + 0.5f) * (float)canvas->height / (float)grid->rows};
    size_t middle = (size_t)((y0 + y1) / 2) * (size_t)canvas->width + (size_t)((x0 + x1) / 2);
    bool fluid = all_fluid(canvas, x0, y0, x1, y1);
    Arrow arrow = make_arrow(centre, canvas->velocity[middle], canvas, grid->spacing);
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
        {
            if (!canvas->fluid[(size_t)y * (size_t)canvas->width + (size_t)x])
                continue;
            lay_over(canvas->frame, x, y, (RfColour){0.10f, 0.11f, 0.13f}, 0.50f);
            if (!fluid)
                continue;
            float d = arrow_distance(&arrow, (RfVec2){(float)x + 0.5f, (float)y + 0.5f});
            lay_over(canvas->frame, x, y, (RfColour){0.05f, 0.05f, 0.07f}, 0.55f * rf_clamp(1 - 0.6f * d, 0, 1));
            lay_over(canvas->frame, x, y, (RfColour){0.98f, 0.98f, 0.96f}, rf_clamp(0.5f - d, 0, 1));
        }
}

static void draw_row_of_squares(void *context, int item, int worker)
{
    (void)worker;
    const Grid *grid = context;
    for (int column = 0; column < grid->columns; ++column)
        draw_square(grid, column, item);
}

void rf_draw_arrows(const RfFlowCanvas *canvas)
{
    int shorter = rf_min_int(canvas->width, canvas->height);
    float spacing = fmaxf((float)shorter / 19, 14);
    Grid grid = {.canvas = canvas,
                 .columns = rf_max_int((int)((float)canvas->width / spacing + 0.5f), 1),
                 .rows = rf_max_int((int)((float)canvas->height / spacing + 0.5f), 1)};
    // Squares are a little narrower or wider than asked for; an arrow fits the narrower side.
    grid.spacing = fminf((float)canvas->width / (float)grid.columns, (float)canvas->height / (float)grid.rows);
    rf_parallel_for(grid.rows, draw_row_of_squares, &grid);
}
