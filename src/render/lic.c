// SPDX-License-Identifier: Apache-2.0
// Cabral, Leedom. Imaging vector fields using line integral convolution. 1993.
//
// Each pixel averages white noise along its streamline, followed 0.8 pixel at a time both ways,
// under a Hann window. The average of n samples has 1/n of the noise's variance, so it is divided by the root of the
// sum of the squared weights: the contrast stays the same whatever the length, also where a line ends at land or
// border. Where the flow stands still the line has no length and the pixel keeps its own noise, made faint.
//
// Beyond the paper: a second pass over the sharpened first one joins the threads (Okada, Kao. Enhanced line integral
// convolution. 1997), and the wheel's colour tints the grey a little, so that direction can be read too.
#include "render/flow_picture.h"

#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"

enum
{
    BAND = 4,
    MAX_HALF_STEPS = 200
};

static const float STEP = 0.8f;
// Under this share of full speed the flow counts as still.
static const float STILL = 0.004f;

typedef struct Lic
{
    const RfFlowCanvas *canvas;
    /// Unit direction in pixels; 0 on land and where the flow stands still.
    RfVec2 *direction;
    /// What is convolved and what comes out, interleaved: x in, y out.
    RfVec2 *grey;
    /// Half the window's length in steps, and its weights from the middle out.
    int half_steps;
    float window[MAX_HALF_STEPS];
} Lic;

static RfVec2 direction_at(const Lic *lic, float x, float y)
{
    int w = lic->canvas->width, h = lic->canvas->height;
    float u = rf_clamp(x - 0.5f, 0, (float)(w - 1)), v = rf_clamp(y - 0.5f, 0, (float)(h - 1));
    int i = (int)u, j = (int)v, right = i + 1 < w, down = j + 1 < h ? w : 0;
    float s = u - (float)i, t = v - (float)j;
    const RfVec2 *d = lic->direction + (size_t)j * (size_t)w + (size_t)i;
    RfVec2 sum = {(1 - t) * ((1 - s) * d[0].x + s * d[right].x) + t * ((1 - s) * d[down].x + s * d[down + right].x),
                  (1 - t) * ((1 - s) * d[0].y + s * d[right].y) + t * ((1 - s) * d[down].y + s * d[down + right].y)};
    float length = rf_vec2_length(sum);
    // Where neighbours cancel, a critical point is passed: stop.
    return length > 0.2f ? (RfVec2){sum.x / length, sum.y / length} : (RfVec2){0, 0};
}

typedef struct Sum
{
    float value, weight, squares;
} Sum;

static void add_sample(Sum *sum, float value, float weight)
{
    sum->value += weight * value;
    sum->weight += weight;
    sum->squares += weight * weight;
}

// Follows the streamline one way; false ends it. *d, the direction of the last step, finds the middle of this one: half
// the cost of the midpoint rule, and lines of this length cannot tell.
static bool follow(const Lic *lic, RfVec2 *p, RfVec2 *d, float step)
{
    *d = direction_at(lic, p->x + 0.5f * step * d->x, p->y + 0.5f * step * d->y);
    RfVec2 next = {p->x + step * d->x, p->y + step * d->y};
    if (d->x * d->x + d->y * d->y < 0.5f ||
        !(next.x >= 0 && next.y >= 0 && next.x < (float)lic->canvas->width && next.y < (float)lic->canvas->height))
        return false;
    *p = next;
    return lic->canvas->fluid[(size_t)next.y * (size_t)lic->canvas->width + (size_t)next.x] != 0;
}

static float convolve(const Lic *lic, int x, int y)
{
    int w = lic->canvas->width;
    Sum sum = {0, 0, 0};
    add_sample(&sum, lic->grey[(size_t)y * (size_t)w + (size_t)x].x, 1);
    for (int way = -1; way <= 1; way += 2)
    {
        RfVec2 p = {(float)x + 0.5f, (float)y + 0.5f}, d = lic->direction[(size_t)y * (size_t)w + (size_t)x];
        for (int i = 1; i < lic->half_steps && follow(lic, &p, &d, (float)way * STEP); ++i)
        {
            add_sample(&sum, lic->grey[(size_t)p.y * (size_t)w + (size_t)p.x].x, lic->window[i]);
        }
    }
    // Steps are shorter than a pixel, so neighbours on the line are partly the same noise.
    return sum.value / sqrtf(sum.squares * (sum.weight > 1 ? 1 / STEP : 1));
}

static void convolve_band(void *context, int item, int worker)
{
    (void)worker;
    const Lic *lic = context;
    int end = rf_min_int((item + 1) * BAND, lic->canvas->height);
    for (int y = item * BAND; y < end; ++y)
        for (int x = 0; x < lic->canvas->width; ++x)
        {
            size_t k = (size_t)y * (size_t)lic->canvas->width + (size_t)x;
            lic->grey[k].y = lic->canvas->fluid[k] ? convolve(lic, x, y) : 0;
        }
}

// The first pass minus the mean of its 3 x 3 neighbours, brought to unit variance: what the second pass convolves.
static void sharpen(const Lic *lic)
{
    int w = lic->canvas->width, h = lic->canvas->height;
    double squares = 0;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            float mean = 0;
            for (int i = 0; i < 9; ++i)
            {
                int row = rf_clamp_int(y + i / 3 - 1, 0, h - 1), column = rf_clamp_int(x + i % 3 - 1, 0, w - 1);
                mean += lic->grey[(size_t)row * (size_t)w + (size_t)column].y / 9;
            }
            RfVec2 *p = &lic->grey[(size_t)y * (size_t)w + (size_t)x];
            p->x = p->y - 0.8f * mean;
            squares += (double)(p->x * p->x);
        }
    float scale = squares > 0 ? sqrtf((float)((double)w * (double)h / squares)) : 0;
    for (size_t k = 0; k < (size_t)w * (size_t)h; ++k)
        lic->grey[k].x *= scale;
}

static void start(const Lic *lic)
{
    const RfFlowCanvas *canvas = lic->canvas;
    for (size_t k = 0; k < (size_t)canvas->width * (size_t)canvas->height; ++k)
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
            float luma = 0.2126f * hue.r + 0.7152f * hue.g + 0.0722f * hue.b;
            RfColour tinted = rf_colour_scale(hue, 0.35f + 0.65f / fmaxf(luma, 0.25f));
            RfColour colour = rf_colour_mix((RfColour){1, 1, 1}, tinted, 0.24f);
            rf_colour_put(canvas->frame, x, y, canvas->fluid[k] ? displayable(rf_colour_scale(colour, grey)) : RF_LAND);
        }
}

RfResult rf_draw_lic(const RfFlowCanvas *canvas, RfVec2 *scratch)
{
    Lic lic = {
        .canvas = canvas, .direction = scratch, .grey = scratch + (size_t)canvas->width * (size_t)canvas->height};
    lic.half_steps =
        rf_clamp_int((int)(0.03f * (float)rf_min_int(canvas->width, canvas->height) / STEP), 24, MAX_HALF_STEPS);
    for (int i = 0; i < lic.half_steps; ++i)
        lic.window[i] = 0.5f + 0.5f * cosf(RF_PI * (float)i / (float)lic.half_steps);
    int bands = (canvas->height + BAND - 1) / BAND;
    start(&lic);
    RF_TRY(rf_progress_for("drawing streamlines", 0, 0.5, bands, convolve_band, &lic));
    sharpen(&lic);
    RF_TRY(rf_progress_for("drawing streamlines", 0.5, 1, bands, convolve_band, &lic));
    rf_parallel_for(bands, colour_band, &lic);
    return RF_OK;
}
