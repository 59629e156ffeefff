// SPDX-License-Identifier: Apache-2.0
// Cabral, Leedom. Imaging vector fields using line integral convolution. 1993.
// Stalling, Hege. Fast and resolution independent line integral convolution. 1995.
//
// Each pixel averages white noise along its streamline, followed 0.8 pixel at a time both ways, under a Hann window.
// The average of n samples has 1/n of the noise's variance, so it is divided by the root of the sum of the squared
// weights: the contrast stays the same whatever the length, also where a line ends at land or border. Where the flow
// stands still the line has no length and the pixel keeps its own noise, made faint.
//
// Neighbours on a streamline share nearly all of their window. So a line is followed once, from the centre of the first
// pixel that has no good value yet to where it leaves its tile or comes to pixels that have theirs, and half a window
// beyond, and gives a value to every pixel it meets. The window is (1 + cos(pi i / H)) / 2, and with v[n], the noise at
// the n-th sample,
//
//   sum v[j + i] cos(pi i / H) = cos(pi j / H) sum v[n] cos(pi n / H) + sin(pi j / H) sum v[n] sin(pi n / H)
//
// so each sum is the difference of two running ones, and a sample costs the same for any window. Of the lines through a
// pixel the one nearest to its centre counts. A tile knows nothing of the others, so the picture does not depend on who
// draws them; where two meet, their lines are a quarter of a pixel apart, which cannot be seen. Against a line for
// every pixel that is 6 times as fast.
//
// Beyond the papers: a second pass over the sharpened first one joins the threads (Okada, Kao. Enhanced line integral
// convolution. 1997), and the wheel's colour tints the grey a little, so that direction can be read too.
#include "render/flow_picture.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"

#include <stdlib.h>

enum
{
    BAND = 4,
    MAX_HALF_STEPS = 200,
    TILE = 96,
    /// Most samples one way from a line's first pixel that get values; longer ones turn in circles.
    MAX_REACH = 512,
    MIDDLE = MAX_REACH + MAX_HALF_STEPS,
    LINE_SIZE = 2 * MIDDLE + 1
};

static const float STEP = 0.8f;
// Under this share of full speed the flow counts as still.
static const float STILL = 0.004f;
// Behind so many samples in a row in pixels that are content a line brings nothing new.
static const int IDLE = 4;
// A pixel is content with a line that passes its centre so near, in pixels. With 0.5 threads look torn.
static const float NEAR = 0.25f;

typedef struct Lic
{
    const RfFlowCanvas *canvas;
    /// Unit direction in pixels; 0 on land and where the flow stands still.
    RfVec2 *direction;
    /// What is convolved and what comes out, interleaved: x in, y out.
    RfVec2 *grey;
    /// Half the window's length in steps.
    int half_steps;
    /// Cosine and sine of pi i / half_steps over their period.
    float cosine[2 * MAX_HALF_STEPS], sine[2 * MAX_HALF_STEPS];
    /// Sum of the window's squares from 1 to i.
    float squares[MAX_HALF_STEPS];
    /// Of the first pass: sums of squares a row, and what brings them to unit variance.
    double *row_squares;
    float scale;
} Lic;

typedef struct Tile
{
    int x0, y0, x1, y1;
    /// Distance of the nearest line from the centre of each pixel, INFINITY before there is one.
    float nearest[TILE * TILE];
} Tile;

/// Samples along a streamline: [first, last] of them, of which [reach_first, reach_last] give values.
typedef struct Line
{
    int first, last, reach_first, reach_last;
    RfVec2 place[LINE_SIZE];
    float noise[LINE_SIZE];
    /// Running sums before each sample: of the noise, and of it times cosine and sine.
    double sum[LINE_SIZE + 1], sum_cosine[LINE_SIZE + 1], sum_sine[LINE_SIZE + 1];
} Line;

static size_t pixel_at(const Lic *lic, RfVec2 p)
{
    return (size_t)p.y * (size_t)lic->canvas->width + (size_t)p.x;
}

// Follows the streamline one way; false ends it: at the border, on land, or where the flow stands still. The middle of
// the step has its direction from the pixel it lies in, and is found with the direction of the step before: lines of
// this length cannot tell.
static bool follow(const Lic *lic, RfVec2 *p, RfVec2 *d, float step)
{
    float w = (float)lic->canvas->width, h = (float)lic->canvas->height;
    RfVec2 middle = {p->x + 0.5f * step * d->x, p->y + 0.5f * step * d->y};
    if (!(middle.x >= 0 && middle.y >= 0 && middle.x < w && middle.y < h))
        return false;
    RfVec2 next = lic->direction[pixel_at(lic, middle)];
    // Against the step before, a critical point is passed.
    if (next.x * d->x + next.y * d->y <= 0)
        return false;
    *d = next;
    *p = (RfVec2){p->x + step * d->x, p->y + step * d->y};
    return p->x >= 0 && p->y >= 0 && p->x < w && p->y < h && lic->canvas->fluid[pixel_at(lic, *p)];
}

static bool inside(const Tile *tile, RfVec2 p)
{
    return p.x >= (float)tile->x0 && p.x < (float)tile->x1 && p.y >= (float)tile->y0 && p.y < (float)tile->y1;
}

static float *nearest_at(Tile *tile, RfVec2 p)
{
    return &tile->nearest[((int)p.y - tile->y0) * TILE + (int)p.x - tile->x0];
}

// One end of a line that grows.
typedef struct End
{
    RfVec2 p, d;
    int way, at, reach;
    /// Samples in a row that brought nothing new, and those behind the last one that gives a value.
    int idle, beyond;
    bool open;
} End;

static void grow(const Lic *lic, Tile *tile, Line *line, End *end)
{
    end->open = end->beyond < lic->half_steps - 1 && follow(lic, &end->p, &end->d, (float)end->way * STEP);
    if (!end->open)
        return;
    end->at += end->way;
    line->place[end->at] = end->p;
    line->noise[end->at] = lic->grey[pixel_at(lic, end->p)].x;
    bool reaches = end->beyond == 0 && inside(tile, end->p) && abs(end->at - MIDDLE) <= MAX_REACH;
    end->idle = reaches && *nearest_at(tile, end->p) <= NEAR ? end->idle + 1 : 0;
    if (reaches && end->idle <= IDLE)
        end->reach = end->at;
    else
        ++end->beyond;
}

// Both ends in turn: each waits for its last step only, so that the processor takes two steps at a time.
static void trace(const Lic *lic, Tile *tile, Line *line)
{
    RfVec2 p = line->place[MIDDLE], d = lic->direction[pixel_at(lic, p)];
    line->noise[MIDDLE] = lic->grey[pixel_at(lic, p)].x;
    End back = {.p = p, .d = d, .way = -1, .at = MIDDLE, .reach = MIDDLE, .open = true}, ahead = back;
    ahead.way = 1;
    while (back.open || ahead.open)
    {
        if (back.open)
            grow(lic, tile, line, &back);
        if (ahead.open)
            grow(lic, tile, line, &ahead);
    }
    line->first = back.at;
    line->reach_first = back.reach;
    line->last = ahead.at;
    line->reach_last = ahead.reach;
}

static void add_up(const Lic *lic, Line *line)
{
    int period = 2 * lic->half_steps, phase = line->first % period;
    double sum = 0, sum_cosine = 0, sum_sine = 0;
    for (int i = line->first; i <= line->last; ++i)
    {
        line->sum[i] = sum;
        line->sum_cosine[i] = sum_cosine;
        line->sum_sine[i] = sum_sine;
        sum += (double)line->noise[i];
        sum_cosine += (double)(line->noise[i] * lic->cosine[phase]);
        sum_sine += (double)(line->noise[i] * lic->sine[phase]);
        phase = phase + 1 < period ? phase + 1 : 0;
    }
    line->sum[line->last + 1] = sum;
    line->sum_cosine[line->last + 1] = sum_cosine;
    line->sum_sine[line->last + 1] = sum_sine;
}

// phase: at modulo the window's period.
static float convolved(const Lic *lic, const Line *line, int at, int phase)
{
    int reach = lic->half_steps - 1;
    int left = rf_min_int(reach, at - line->first), right = rf_min_int(reach, line->last - at);
    int from = at - left, to = at + right + 1;
    double value = line->sum[to] - line->sum[from] +
                   (double)lic->cosine[phase] * (line->sum_cosine[to] - line->sum_cosine[from]) +
                   (double)lic->sine[phase] * (line->sum_sine[to] - line->sum_sine[from]);
    float squares = 1 + lic->squares[left] + lic->squares[right];
    // Steps are shorter than a pixel, so neighbours on the line are partly the same noise.
    return 0.5f * (float)value / sqrtf(squares * (left + right > 0 ? 1 / STEP : 1));
}

// The line through the centre of a pixel, and a value for every pixel it meets in the tile.
static void draw_line(const Lic *lic, Tile *tile, Line *line, int x, int y)
{
    line->place[MIDDLE] = (RfVec2){(float)x + 0.5f, (float)y + 0.5f};
    trace(lic, tile, line);
    add_up(lic, line);
    int period = 2 * lic->half_steps, phase = line->reach_first % period;
    for (int i = line->reach_first; i <= line->reach_last; ++i, phase = phase + 1 < period ? phase + 1 : 0)
    {
        RfVec2 p = line->place[i];
        int column = (int)p.x, row = (int)p.y;
        size_t k = (size_t)row * (size_t)lic->canvas->width + (size_t)column;
        float dx = p.x - (float)column - 0.5f, dy = p.y - (float)row - 0.5f;
        float *nearest = &tile->nearest[(row - tile->y0) * TILE + column - tile->x0];
        RfVec2 d = lic->direction[k];
        // Across the line: along it, samples of one pixel differ little. What stands still takes no part in lines.
        float distance = fabsf(dx * d.y - dy * d.x);
        if (distance >= *nearest || (d.x == 0 && d.y == 0 && i != MIDDLE))
            continue;
        *nearest = distance;
        lic->grey[k].y = convolved(lic, line, i, phase);
    }
}

static void convolve_tile(void *context, int item, int worker)
{
    (void)worker;
    const Lic *lic = context;
    int w = lic->canvas->width, h = lic->canvas->height, columns = (w + TILE - 1) / TILE;
    Tile tile = {.x0 = item % columns * TILE, .y0 = item / columns * TILE};
    Line line;
    tile.x1 = rf_min_int(tile.x0 + TILE, w);
    tile.y1 = rf_min_int(tile.y0 + TILE, h);
    for (int i = 0; i < TILE * TILE; ++i)
        tile.nearest[i] = INFINITY;
    for (int y = tile.y0; y < tile.y1; ++y)
        for (int x = tile.x0; x < tile.x1; ++x)
        {
            size_t k = (size_t)y * (size_t)w + (size_t)x;
            if (!lic->canvas->fluid[k])
                lic->grey[k].y = 0;
            else if (tile.nearest[(y - tile.y0) * TILE + x - tile.x0] > NEAR)
                draw_line(lic, &tile, &line, x, y);
        }
}

// The first pass minus the mean of its 3 x 3 neighbours, brought to unit variance: what the second pass convolves.
static void sharpen_row(void *context, int y, int worker)
{
    (void)worker;
    const Lic *lic = context;
    int w = lic->canvas->width, h = lic->canvas->height;
    const RfVec2 *rows[3];
    double squares = 0;
    for (int i = 0; i < 3; ++i)
        rows[i] = lic->grey + (size_t)rf_clamp_int(y + i - 1, 0, h - 1) * (size_t)w;
    for (int x = 0; x < w; ++x)
    {
        int left = rf_max_int(x - 1, 0), right = rf_min_int(x + 1, w - 1);
        float sum = 0;
        for (int i = 0; i < 3; ++i)
            sum += rows[i][left].y + rows[i][x].y + rows[i][right].y;
        RfVec2 *p = &lic->grey[(size_t)y * (size_t)w + (size_t)x];
        p->x = p->y - 0.8f / 9 * sum;
        squares += (double)(p->x * p->x);
    }
    lic->row_squares[y] = squares;
}

static void scale_row(void *context, int y, int worker)
{
    (void)worker;
    const Lic *lic = context;
    RfVec2 *row = lic->grey + (size_t)y * (size_t)lic->canvas->width;
    for (int x = 0; x < lic->canvas->width; ++x)
        row[x].x *= lic->scale;
}

static void sharpen(Lic *lic)
{
    int h = lic->canvas->height;
    double squares = 0, pixels = (double)lic->canvas->width * (double)h;
    rf_parallel_for(h, sharpen_row, lic);
    for (int y = 0; y < h; ++y)
        squares += lic->row_squares[y];
    lic->scale = squares > 0 ? sqrtf((float)(pixels / squares)) : 0;
    rf_parallel_for(h, scale_row, lic);
}

static void start_row(void *context, int y, int worker)
{
    (void)worker;
    const Lic *lic = context;
    const RfFlowCanvas *canvas = lic->canvas;
    size_t first = (size_t)y * (size_t)canvas->width;
    for (size_t k = first; k < first + (size_t)canvas->width; ++k)
    {
        RfVec2 v = canvas->velocity[k], p = {v.x * canvas->scale_x, v.y * canvas->scale_y};
        float speed = rf_vec2_length(v), length = rf_vec2_length(p);
        bool moves = canvas->fluid[k] && length > 0 && speed > STILL * canvas->full_speed;
        lic->direction[k] = moves ? (RfVec2){p.x / length, p.y / length} : (RfVec2){0, 0};
        // Uniform noise of unit variance.
        lic->grey[k].x = 3.4641016f * (rf_random_float(canvas->seed, 0, k, 0) - 0.5f);
    }
}

static RfColour displayable(RfColour c)
{
    return (RfColour){rf_clamp(c.r, 0, 1), rf_clamp(c.g, 0, 1), rf_clamp(c.b, 0, 1)};
}

static void colour_band(void *context, int item, int worker)
{
    (void)worker;
    const Lic *lic = context;
    const RfFlowCanvas *canvas = lic->canvas;
    int end = rf_min_int((item + 1) * BAND, canvas->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < canvas->width; ++x)
        {
            size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
            RfVec2 v = canvas->velocity[k];
            float share = canvas->full_speed > 0 ? fminf(rf_vec2_length(v) / canvas->full_speed, 1) : 0;
            float strength = 0.22f + 0.78f * rf_smoothstep(0, 0.15f, share);
            // A soft limiter keeps threads from burning out.
            float thread = tanhf(0.62f * lic->grey[k].y * strength);
            float grey = 0.50f + 0.34f * thread + 0.06f * sqrtf(share);
            // The wheel at equal luma: only its hue is wanted here.
            RfColour hue = rf_flow_colour(v, canvas->full_speed);
            float luma = rf_luma(hue.r, hue.g, hue.b);
            RfColour tinted = rf_colour_scale(hue, 0.35f + 0.65f / fmaxf(luma, 0.25f));
            RfColour colour = rf_colour_mix((RfColour){1, 1, 1}, tinted, 0.24f);
            rf_colour_put(canvas->frame, x, y, canvas->fluid[k] ? displayable(rf_colour_scale(colour, grey)) : RF_LAND);
        }
}

static void make_window(Lic *lic)
{
    lic->half_steps = rf_clamp_int((int)(0.03f * (float)rf_min_int(lic->canvas->width, lic->canvas->height) / STEP), 24,
                                   MAX_HALF_STEPS);
    for (int i = 0; i < 2 * lic->half_steps; ++i)
    {
        lic->cosine[i] = cosf(RF_PI * (float)i / (float)lic->half_steps);
        lic->sine[i] = sinf(RF_PI * (float)i / (float)lic->half_steps);
    }
    for (int i = 1; i < lic->half_steps; ++i)
    {
        float weight = 0.5f + 0.5f * lic->cosine[i];
        lic->squares[i] = lic->squares[i - 1] + weight * weight;
    }
}

static RfResult draw(Lic *lic)
{
    const RfFlowCanvas *canvas = lic->canvas;
    int tiles = ((canvas->width + TILE - 1) / TILE) * ((canvas->height + TILE - 1) / TILE);
    rf_parallel_for(canvas->height, start_row, lic);
    RF_TRY(rf_progress_for("drawing streamlines", 0, 0.5, tiles, convolve_tile, lic));
    sharpen(lic);
    RF_TRY(rf_progress_for("drawing streamlines", 0.5, 1, tiles, convolve_tile, lic));
    rf_parallel_for((canvas->height + BAND - 1) / BAND, colour_band, lic);
    return RF_OK;
}

RfResult rf_draw_lic(const RfFlowCanvas *canvas, RfVec2 *scratch)
{
    Lic lic = {.canvas = canvas,
               .direction = scratch,
               .grey = scratch + (size_t)canvas->width * (size_t)canvas->height,
               .row_squares = rf_allocate((size_t)canvas->height, sizeof(double))};
    if (!lic.row_squares)
        return RF_OUT_OF_MEMORY;
    make_window(&lic);
    RfResult result = draw(&lic);
    rf_release(lic.row_squares);
    return result;
}
