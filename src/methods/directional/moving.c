// SPDX-License-Identifier: Apache-2.0
// Moving the texture in pieces (Wang et al. 2005, sections 2.2.1 and 2.2.2).
//
// Cells of much the same velocity move by whole pixels, so that no pixel is ever resampled; what is left over is kept
// and added the next time. Where several cells land on a pixel, the one whose velocity is nearest to the flow's there
// stays. A pixel is then without texture where none landed, or where the texture lies off the flow.
#include "core/parallel.h"
#include "methods/directional/directional.h"

#include <string.h>

enum
{
    /// Rows of the frame that one thread fills at a time.
    BAND = 16,
    /// Pixels across a crack that the texture is continued over.
    CRACK = 2,
    /// Of 8 neighbours, so many must continue a pixel.
    HELD_BY = 3,
    /// Pixels from what is left out to what soon will be.
    SOON_REACH = 8
};

// Of the angle at which texture is left out: from here on it soon will be. With 1 (slivers) a frame of 256 x 256 pixels
// in a vortex has lost 5 % of its gradient after 100 frames, and half as many patches again are searched.
static const float SOON = 0.7f;

// Pieces that differ by less, in exemplar pixels, continue each other: they are not blended, only joined.
static const float CONTINUES = 1.6f;
// What is left over is at most this; what is more is forgotten.
static const float MOST_REST = 1;

static int came_from(const RfDirectional *d, const RfMove *m, int x, int y)
{
    return (y - m->dy) * d->width + x - m->dx;
}

// How ill a move suits the flow at a pixel.
static float misfit(const RfDirectional *d, int move, int pixel)
{
    return rf_vec2_length(rf_vec2_sub(d->moves[move].velocity, d->velocity[pixel]));
}

static void land(RfDirectional *d, int move, int pixel)
{
    float own = misfit(d, move, pixel);
    if (d->first[pixel] < 0 || own < misfit(d, d->first[pixel], pixel))
    {
        d->second[pixel] = d->first[pixel];
        d->first[pixel] = move;
    }
    else if (d->second[pixel] < 0 || own < misfit(d, d->second[pixel], pixel))
        d->second[pixel] = move;
}

static void land_band(void *context, int band, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    int top = band * BAND, bottom = rf_min_int(top + BAND, d->height);
    size_t start = (size_t)top * (size_t)d->width, count = (size_t)(bottom - top) * (size_t)d->width;
    memset(d->first + start, 0xff, count * sizeof *d->first);
    memset(d->second + start, 0xff, count * sizeof *d->second);
    for (int k = 0; k < d->cells.count; ++k)
    {
        const RfMove *m = &d->moves[k];
        int x0 = rf_max_int(m->cell.x + m->dx, 0), x1 = rf_min_int(m->cell.x + m->dx + m->cell.width, d->width);
        int y0 = rf_max_int(m->cell.y + m->dy, top), y1 = rf_min_int(m->cell.y + m->dy + m->cell.height, bottom);
        for (int y = y0; y < y1; ++y)
            for (int x = x0; x < x1; ++x)
                if (d->inside[y * d->width + x] && d->texels[came_from(d, m, x, y)].copy >= 0)
                    land(d, k, y * d->width + x);
    }
}

static bool lies_well(const RfDirectional *d, int copy, int pixel)
{
    float off = rf_angle_between(d->direction_at[pixel], rf_turned_copy_direction(&d->copies, copy));
    return isnan(off) || fabsf(off) <= rf_directional_step_angle(d);
}

// Pixels from here to where the moved cell ends.
static float depth(const RfMove *m, int x, int y)
{
    int i = x - m->dx - m->cell.x, j = y - m->dy - m->cell.y;
    return 1 + (float)rf_min_int(rf_min_int(i, m->cell.width - 1 - i), rf_min_int(j, m->cell.height - 1 - j));
}

static bool continues(const RfTexel *texel, int copy, RfVec2 source)
{
    return texel->copy == copy && rf_vec2_length(rf_vec2_sub(texel->source, source)) < CONTINUES;
}

// What was at a pixel, moved: its place in the exemplar changes by what the whole pixels it moves by are off the way.
static RfTexel moved(const RfDirectional *d, int from, const RfMove *m)
{
    RfTexel texel = d->texels[from];
    RfVec2 off = {(float)m->dx - m->velocity.x, (float)m->dy - m->velocity.y};
    texel.source = rf_vec2_add(texel.source, rf_jacobian_step(rf_turned_copy_jacobian(&d->copies, texel.copy), off));
    texel.rest = rf_vec2_sub(texel.rest, off);
    texel.rest = (RfVec2){rf_clamp(texel.rest.x, -MOST_REST, MOST_REST), rf_clamp(texel.rest.y, -MOST_REST, MOST_REST)};
    return texel;
}

static void take(const RfDirectional *d, int to, int from, const RfMove *m)
{
    size_t channels = (size_t)d->exemplar->channels;
    d->next_texels[to] = moved(d, from, m);
    memcpy(d->next_blended + (size_t)to * channels, d->blended + (size_t)from * channels, channels * sizeof(float));
    rf_directional_show(d, &d->next_texels[to], d->next_blended + (size_t)to * channels,
                        d->next_picture + (size_t)to * channels);
}

// Two pieces overlap: the one that stays fades into the other towards its border.
static void feather(RfDirectional *d, int pixel, int x, int y)
{
    const RfMove *a = &d->moves[d->first[pixel]], *b = &d->moves[d->second[pixel]];
    int there = came_from(d, b, x, y), channels = d->exemplar->channels;
    RfTexel *texel = &d->next_texels[pixel], other = moved(d, there, b);
    if (continues(texel, other.copy, other.source) || !lies_well(d, other.copy, pixel))
        return;
    float in_a = depth(a, x, y), in_b = depth(b, x, y), share = in_b / (in_a + in_b);
    float *picture = d->next_picture + (ptrdiff_t)pixel * channels, values[RF_SAMPLE_CHANNELS];
    rf_directional_show(d, &other, d->blended + (ptrdiff_t)there * channels, values);
    for (int c = 0; c < channels; ++c)
        picture[c] += share * (values[c] - picture[c]);
    float blends = texel->blends + 1;
    if (share > 0.5f)
    {
        blends = other.blends + 1;
        *texel = other;
    }
    texel->blends = blends;
    rf_directional_keep(d, texel, picture, d->next_blended + (ptrdiff_t)pixel * channels);
}

static void take_row(void *context, int y, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    for (int x = 0; x < d->width; ++x)
    {
        int pixel = y * d->width + x;
        d->next_texels[pixel] = (RfTexel){.copy = -1};
        if (d->first[pixel] < 0)
            continue;
        const RfMove *m = &d->moves[d->first[pixel]];
        int from = came_from(d, m, x, y);
        take(d, pixel, from, m);
        if (d->second[pixel] >= 0)
            feather(d, pixel, x, y);
    }
}

// ---- what lies off the flow

// How far off the flow a pixel's texture lies, in parts of what it may.
static float part_off(const RfDirectional *d, const RfTexel *texel, int pixel)
{
    float off = rf_angle_between(d->direction_at[pixel], rf_turned_copy_direction(&d->copies, texel->copy));
    return isnan(off) ? 0 : fabsf(off) / rf_directional_step_angle(d);
}

// What lies off the flow is left out, and next to it what soon will: a patch then replaces all of it at once. Sliver by
// sliver the texture would be made of slivers.
static void leave_out_misled(RfDirectional *d)
{
    int count = 0;
    for (int i = 0; i < d->width * d->height; ++i)
        if (d->next_texels[i].copy >= 0 && part_off(d, &d->next_texels[i], i) > 1)
        {
            d->next_texels[i].copy = -1;
            d->stack[count++] = i;
        }
    for (int start = 0, ring = 0; ring < SOON_REACH; ++ring)
        for (int end = count; start < end; ++start)
        {
            int x = d->stack[start] % d->width, y = d->stack[start] / d->width;
            for (int j = rf_max_int(y - 1, 0); j <= rf_min_int(y + 1, d->height - 1); ++j)
                for (int i = rf_max_int(x - 1, 0); i <= rf_min_int(x + 1, d->width - 1); ++i)
                {
                    int pixel = j * d->width + i;
                    if (d->next_texels[pixel].copy < 0 || part_off(d, &d->next_texels[pixel], pixel) <= SOON)
                        continue;
                    d->next_texels[pixel].copy = -1;
                    d->stack[count++] = pixel;
                }
        }
}

// ---- cracks

// The nearest texture along a line, within a crack's width: its pixel, or -1.
static int nearest_along(const RfDirectional *d, int x, int y, int dx, int dy, int *distance)
{
    for (*distance = 1; *distance <= CRACK; ++*distance)
    {
        int i = x + *distance * dx, j = y + *distance * dy;
        if (i < 0 || j < 0 || i >= d->width || j >= d->height)
            return -1;
        // Only what has moved here: `first` tells, since others may be continued at the same time.
        if (d->first[j * d->width + i] >= 0 && d->next_texels[j * d->width + i].copy >= 0)
            return j * d->width + i;
    }
    return -1;
}

// The pixel to be continued at one that lies in a crack; -1 if it does not.
static int across_crack(const RfDirectional *d, int x, int y)
{
    static const int lines[4][2] = {{1, 0}, {0, 1}, {1, 1}, {1, -1}};
    int best = -1, least = CRACK + 1;
    for (int k = 0; k < 4; ++k)
    {
        int to, back, dx = lines[k][0], dy = lines[k][1];
        int a = nearest_along(d, x, y, dx, dy, &to), b = nearest_along(d, x, y, -dx, -dy, &back);
        if (a < 0 || b < 0 || to + back - 1 > CRACK)
            continue;
        if (rf_min_int(to, back) < least)
        {
            least = rf_min_int(to, back);
            best = to <= back ? a : b;
        }
    }
    return best;
}

static void continue_row(void *context, int y, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    const RfExemplar *e = d->exemplar;
    for (int x = 0; x < d->width; ++x)
    {
        int pixel = y * d->width + x, from = -1;
        if (d->inside[pixel] && d->first[pixel] < 0)
            from = across_crack(d, x, y);
        if (from < 0 || !lies_well(d, d->next_texels[from].copy, pixel))
            continue;
        RfTexel texel = d->next_texels[from];
        RfJacobian j = rf_turned_copy_jacobian(&d->copies, texel.copy);
        RfVec2 step = {(float)(x - from % d->width), (float)(y - from / d->width)};
        texel.source = rf_vec2_add(texel.source, rf_jacobian_step(j, step));
        if (!e->tiles && !(texel.source.x >= 0 && texel.source.y >= 0 && texel.source.x <= (float)e->width &&
                           texel.source.y <= (float)e->height))
            continue;
        texel.blends = 0;
        d->next_texels[pixel] = texel;
        memset(d->next_blended + (ptrdiff_t)pixel * e->channels, 0, (size_t)e->channels * sizeof(float));
        rf_directional_show(d, &texel, d->next_blended + (ptrdiff_t)pixel * e->channels,
                            d->next_picture + (ptrdiff_t)pixel * e->channels);
    }
}

// ---- what hangs loose

static bool together(const RfDirectional *d, int a, int b)
{
    return a == b || (d->moves[a].dx == d->moves[b].dx && d->moves[a].dy == d->moves[b].dy);
}

typedef struct Around
{
    int pixels[8], dx[8], dy[8], count;
} Around;

static Around around(const RfDirectional *d, int x, int y)
{
    Around a = {.count = 0};
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx)
        {
            if ((dx == 0 && dy == 0) || x + dx < 0 || y + dy < 0 || x + dx >= d->width || y + dy >= d->height)
                continue;
            a.pixels[a.count] = (y + dy) * d->width + x + dx;
            a.dx[a.count] = dx;
            a.dy[a.count++] = dy;
        }
    return a;
}

// A piece that many cells have carried frays: where neighbours part, pixels that few of them continue are taken for
// cracks.
static bool is_loose(const RfDirectional *d, int pixel, int x, int y)
{
    const RfTexel *texel = &d->next_texels[pixel];
    if (texel->copy < 0)
        return false;
    Around a = around(d, x, y);
    bool parting = false;
    for (int i = 0; i < a.count && !parting; ++i)
        parting = d->next_texels[a.pixels[i]].copy >= 0 && !together(d, d->first[pixel], d->first[a.pixels[i]]);
    if (!parting)
        return false;
    int held = 0;
    for (int i = 0; i < a.count; ++i)
    {
        RfVec2 step = {(float)a.dx[i], (float)a.dy[i]};
        RfVec2 source = rf_jacobian_step(rf_turned_copy_jacobian(&d->copies, texel->copy), step);
        held += continues(&d->next_texels[a.pixels[i]], texel->copy, rf_vec2_add(texel->source, source));
    }
    return 8 * held < HELD_BY * a.count;
}

static void find_loose_row(void *context, int y, int worker)
{
    (void)worker;
    RfDirectional *d = context;
    for (int x = 0; x < d->width; ++x)
        d->loose[y * d->width + x] = is_loose(d, y * d->width + x, x, y);
}

static void leave_out_loose(RfDirectional *d)
{
    rf_parallel_for(d->height, find_loose_row, d);
    for (int i = 0; i < d->width * d->height; ++i)
        if (d->loose[i])
        {
            d->next_texels[i].copy = -1;
            d->first[i] = -1;
        }
}

void rf_directional_move(RfDirectional *d)
{
    rf_parallel_for((d->height + BAND - 1) / BAND, land_band, d);
    rf_parallel_for(d->height, take_row, d);
    leave_out_misled(d);
    leave_out_loose(d);
    rf_parallel_for(d->height, continue_row, d);
    for (int i = 0; i < d->width * d->height; ++i)
        d->continued += d->first[i] < 0 && d->next_texels[i].copy >= 0;
    RfTexel *texels = d->texels;
    d->texels = d->next_texels;
    d->next_texels = texels;
    float *picture = d->picture;
    d->picture = d->next_picture;
    d->next_picture = picture;
    float *blended = d->blended;
    d->blended = d->next_blended;
    d->next_blended = blended;
}
