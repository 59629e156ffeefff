// SPDX-License-Identifier: Apache-2.0
#include "kernels/markers.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/nearest_known.h"
#include "kernels/tracing.h"

#include <stdlib.h>

// Markers farther from a pixel than this have no voice in it. Smaller ones flicker where borders pass, larger ones blur
// them: in a rotation 0.059, 0.044, 0.039, 0.035 over the floor with 0.8, 1.2, 1.5, 2.
static const float REACH = 1.5f;
// Places that differ by less, in exemplar pixels, are one.
static const float TOGETHER = 0.75f;

enum
{
    /// Rows sorted by one thread, at least.
    BAND = 16,
    NEAR = 2
};

RfResult rf_markers_create(int width, int height, bool tiles, RfMarkers *out)
{
    *out = (RfMarkers){.width = width, .height = height, .tiles = tiles};
    size_t pixels = (size_t)width * (size_t)height;
    out->pixels = rf_allocate_zero(pixels, sizeof *out->pixels);
    out->next = rf_allocate_zero(pixels, sizeof *out->next);
    out->index = rf_allocate(pixels, sizeof *out->index);
    out->reach = rf_allocate((size_t)height, sizeof *out->reach);
    if (out->pixels && out->next && out->index && out->reach)
        return RF_OK;
    rf_markers_free(out);
    return RF_OUT_OF_MEMORY;
}

void rf_markers_free(RfMarkers *markers)
{
    rf_release(markers->pixels);
    rf_release(markers->next);
    rf_release(markers->index);
    rf_release(markers->reach);
    *markers = (RfMarkers){0};
}

RfBendParts rf_bend_parts(RfBend b)
{
    // The sum of a similarity and a mirrored one; the lengths of the two make the singular values.
    RfVec2 same = {0.5f * (b.x.x + b.y.y), 0.5f * (b.x.y - b.y.x)};
    RfVec2 mirrored = {0.5f * (b.x.x - b.y.y), 0.5f * (b.x.y + b.y.x)};
    float p = rf_vec2_length(same), q = rf_vec2_length(mirrored);
    RfVec2 turn = p > 1e-6f ? (RfVec2){same.x / p, same.y / p} : (RfVec2){1, 0};
    return (RfBendParts){turn, p + q, p - q};
}

// ---- carry

typedef struct Carrying
{
    RfMarkers *markers;
    const RfFlowView *flow;
    double from;
    int steps;
} Carrying;

static RfVec2 velocity_of(const RfFlowView *flow, size_t cell, float blend)
{
    const float *a = flow->velocity + 2 * cell;
    if (!flow->next_velocity || blend == 0)
        return (RfVec2){a[0], a[1]};
    const float *b = flow->next_velocity + 2 * cell;
    return (RfVec2){a[0] + blend * (b[0] - a[0]), a[1] + blend * (b[1] - a[1])};
}

// The difference between the cells on both sides along x or y, over a step of one cell; land does not count.
static RfVec2 difference_at(const RfFlowView *flow, int x, int y, int dx, int dy, float blend)
{
    size_t own = (size_t)y * (size_t)flow->width + (size_t)x, cells[2] = {own, own};
    int steps = 0;
    for (int side = 0; side < 2; ++side)
    {
        int i = side ? x + dx : x - dx, j = side ? y + dy : y - dy;
        size_t cell = (size_t)j * (size_t)flow->width + (size_t)i;
        if (i < 0 || j < 0 || i >= flow->width || j >= flow->height || (flow->mask && !flow->mask[cell]))
            continue;
        cells[side] = cell;
        ++steps;
    }
    if (steps == 0 || (flow->mask && !flow->mask[own]))
        return (RfVec2){0, 0};
    RfVec2 d = rf_vec2_sub(velocity_of(flow, cells[1], blend), velocity_of(flow, cells[0], blend));
    return (RfVec2){d.x / (float)steps, d.y / (float)steps};
}

// The flow's gradient in the cell of a point: velocity's change by a step along x and along y.
static RfBend gradient_at(const RfFlowView *flow, RfVec2 p, float blend)
{
    int x = (int)rf_clamp(p.x, 0, (float)(flow->width - 1)), y = (int)rf_clamp(p.y, 0, (float)(flow->height - 1));
    return (RfBend){difference_at(flow, x, y, 1, 0, blend), difference_at(flow, x, y, 0, 1, blend)};
}

static RfBend product(RfBend a, RfBend b)
{
    return (RfBend){rf_bend(a, b.x), rf_bend(a, b.y)};
}

// bend * exp(-j) by Cayley's (1 - j/2) (1 + j/2)^-1: exact turns, second order else. Where the flow strains by more
// than the form can say in one step, or by more than a million in all, the bend becomes 0: worn.
static RfBend strained(RfBend bend, RfBend j)
{
    float a = 1 + 0.5f * j.x.x, b = 0.5f * j.y.x, c = 0.5f * j.x.y, d = 1 + 0.5f * j.y.y, det = a * d - b * c;
    if (!(det > 0.1f && det < 10))
        return (RfBend){{0, 0}, {0, 0}};
    RfBend inverse = {{d / det, -c / det}, {-b / det, a / det}};
    RfBend minus = {{2 - a, -c}, {-b, 2 - d}};
    bend = product(bend, product(minus, inverse));
    // Of absurd flows parts may be NaN, which rf_max passes over.
    bool sound = fabsf(bend.x.x) < 1e6f && fabsf(bend.x.y) < 1e6f && fabsf(bend.y.x) < 1e6f && fabsf(bend.y.y) < 1e6f;
    return sound ? bend : (RfBend){{0, 0}, {0, 0}};
}

static void carry_marker(const Carrying *k, RfMarker *m)
{
    float sx = (float)k->flow->width / (float)k->markers->width;
    float sy = (float)k->flow->height / (float)k->markers->height;
    RfVec2 p = {(m->at.x + 0.5f) * sx, (m->at.y + 0.5f) * sy};
    double dt = (k->flow->time - k->from) / k->steps, time = k->from;
    float whole = (float)dt, half = 0.5f * whole;
    for (int i = 0; i < k->steps; ++i, time += dt)
    {
        RfVec2 v = rf_flow_sample(k->flow, p.x, p.y, rf_flow_blend(k->flow, time));
        RfVec2 middle = {p.x + half * v.x, p.y + half * v.y};
        float blend = rf_flow_blend(k->flow, time + 0.5 * dt);
        v = rf_flow_sample(k->flow, middle.x, middle.y, blend);
        RfBend j = gradient_at(k->flow, middle, blend);
        j = (RfBend){{whole * j.x.x, whole * j.x.y * sx / sy}, {whole * j.y.x * sy / sx, whole * j.y.y}};
        m->bend = strained(m->bend, j);
        p = (RfVec2){p.x + whole * v.x, p.y + whole * v.y};
    }
    m->at = (RfVec2){p.x / sx - 0.5f, p.y / sy - 0.5f};
}

// Into -0.5 to n - 0.5.
static float wrap(float at, int n)
{
    return at - floorf((at + 0.5f) / (float)n) * (float)n;
}

// The pixel of a point, -1 outside the frame. A point that is brought inside may round to the border itself.
static int pixel_of(const RfMarkers *m, RfVec2 *at)
{
    if (m->tiles)
        *at = (RfVec2){wrap(at->x, m->width), wrap(at->y, m->height)};
    float x = floorf(at->x + 0.5f), y = floorf(at->y + 0.5f);
    bool inside = x >= 0 && y >= 0 && x < (float)m->width && y < (float)m->height;
    return inside ? (int)y * m->width + (int)x : -1;
}

static int rows_apart(const RfMarkers *m, int a, int b)
{
    int rows = abs(a - b);
    return m->tiles ? rf_min_int(rows, m->height - rows) : rows;
}

static void carry_row(void *context, int row, int worker)
{
    (void)worker;
    const Carrying *k = context;
    RfMarkers *m = k->markers;
    size_t first = (size_t)row * (size_t)m->width;
    int reach = 0; // not in the array: rows of several threads lie side by side there
    for (size_t i = first; i < first + (size_t)m->width; ++i)
    {
        m->index[i] = -1;
        if (!(m->pixels[i].share > 0))
            continue;
        carry_marker(k, &m->pixels[i]);
        m->index[i] = pixel_of(m, &m->pixels[i].at);
        if (m->index[i] >= 0)
            reach = rf_max_int(reach, rows_apart(m, m->index[i] / m->width, row));
    }
    m->reach[row] = reach;
}

typedef struct Sorting
{
    RfMarkers *markers;
    /// Rows a band, and how far from its row the farthest marker has come.
    int band, reach;
} Sorting;

// Puts the markers that now lie in a band of rows into their pixels. Of two that meet in one the first stays.
static void sort_band(void *context, int item, int worker)
{
    (void)worker;
    const Sorting *k = context;
    RfMarkers *m = k->markers;
    size_t width = (size_t)m->width, top = (size_t)(item * k->band);
    size_t bottom = (size_t)rf_min_int((item + 1) * k->band, m->height);
    for (size_t i = top * width; i < bottom * width; ++i)
        m->next[i].share = 0;
    int from = (int)top - k->reach, to = (int)bottom + k->reach;
    if (!m->tiles)
        from = rf_max_int(from, 0), to = rf_min_int(to, m->height);
    to = rf_min_int(to, from + m->height);
    for (int row = from; row < to; ++row)
    {
        size_t first = (size_t)rf_wrap_int(row, m->height) * width;
        for (size_t i = first; i < first + width; ++i)
        {
            int32_t pixel = m->index[i];
            if (pixel >= (int32_t)(top * width) && pixel < (int32_t)(bottom * width) && !(m->next[pixel].share > 0))
                m->next[pixel] = m->pixels[i];
        }
    }
}

void rf_markers_carry(RfMarkers *m, const RfFlowView *flow, double from)
{
    Carrying carrying = {m, flow, from, rf_path_steps(flow, flow->time - from)};
    rf_parallel_for(m->height, carry_row, &carrying);
    Sorting sorting = {m, 1, 0};
    for (int j = 0; j < m->height; ++j)
        sorting.reach = rf_max_int(sorting.reach, m->reach[j]);
    // Bands that look at few rows besides their own.
    sorting.band = rf_max_int(BAND, 4 * sorting.reach);
    rf_parallel_for((m->height + sorting.band - 1) / sorting.band, sort_band, &sorting);
    RfMarker *swap = m->pixels;
    m->pixels = m->next;
    m->next = swap;
}

// ---- fill

// The nearest pixel with a marker, where it is no farther than NEAR: most are.
static int32_t look_round(const RfMarkers *m, int x, int y)
{
    int32_t found = -1;
    int least = 2 * NEAR * NEAR + 1;
    for (int j = y - NEAR; j <= y + NEAR; ++j)
        for (int i = x - NEAR; i <= x + NEAR; ++i)
        {
            int square = (i - x) * (i - x) + (j - y) * (j - y);
            bool outside = i < 0 || j < 0 || i >= m->width || j >= m->height;
            if (square >= least || (outside && !m->tiles))
                continue;
            int32_t pixel = rf_wrap_int(j, m->height) * m->width + rf_wrap_int(i, m->width);
            if (m->pixels[pixel].share > 0)
            {
                least = square;
                found = pixel;
            }
        }
    return found;
}

static void look_row(void *context, int y, int worker)
{
    (void)worker;
    RfMarkers *m = context;
    int missing = 0;
    for (int x = 0; x < m->width; ++x)
    {
        int32_t own = y * m->width + x;
        m->index[own] = m->pixels[own].share > 0 ? own : look_round(m, x, y);
        missing += m->index[own] < 0;
    }
    m->reach[y] = missing;
}

// The way round a border, where it is shorter.
static float shortest(float step, int n)
{
    return step - floorf(step / (float)n + 0.5f) * (float)n;
}

// Whether a pixel without a marker is a gap between markers: one lies near it on the side away from the nearest. Gaps
// come one by one and in pairs wherever a flow turns. Into a frame that tiles nothing flows.
static bool is_between(const RfMarkers *m, int x, int y, int32_t nearest)
{
    int dx = nearest % m->width - x, dy = nearest / m->width - y;
    for (int j = rf_max_int(y - NEAR, 0); j <= rf_min_int(y + NEAR, m->height - 1) && !m->tiles; ++j)
        for (int i = rf_max_int(x - NEAR, 0); i <= rf_min_int(x + NEAR, m->width - 1); ++i)
        {
            bool away = (i - x) * dx + (j - y) * dy < 0;
            if (away && m->index[j * m->width + i] == j * m->width + i)
                return true;
        }
    return m->tiles;
}

static void fill_row(void *context, int y, int worker)
{
    (void)worker;
    RfMarkers *m = context;
    for (int x = 0; x < m->width; ++x)
    {
        int32_t own = y * m->width + x, nearest = m->index[own];
        if (nearest == own)
            continue;
        // Before they were sorted into pixels, markers lay in the order of those they came from.
        RfMarker from = nearest < 0 ? m->next[own] : m->pixels[nearest];
        RfVec2 at = {(float)x, (float)y}, step = rf_vec2_sub(at, from.at);
        if (m->tiles)
            step = (RfVec2){shortest(step.x, m->width), shortest(step.y, m->height)};
        if (nearest >= 0)
            from.source = rf_vec2_add(from.source, rf_bend(from.bend, step));
        if (nearest >= 0 && !is_between(m, x, y, nearest))
            from.continued = rf_min(from.continued + rf_vec2_length(step), RF_CONTINUED_MOST);
        from.at = at;
        m->pixels[own] = from;
    }
}

void rf_markers_fill(RfMarkers *m)
{
    int missing = 0;
    rf_parallel_for(m->height, look_row, m);
    for (int y = 0; y < m->height; ++y)
        missing += m->reach[y];
    if (missing > 0)
        rf_spread_nearest(m->index, m->width, m->height);
    rf_parallel_for(m->height, fill_row, m);
}

// ---- draw

RfVec2 rf_markers_source(const RfMarkers *m, RfVec2 at)
{
    int x = rf_nearest_int(at.x), y = rf_nearest_int(at.y);
    int px = rf_border_int(x, m->width, m->tiles), py = rf_border_int(y, m->height, m->tiles);
    const RfMarker *k = &m->pixels[(ptrdiff_t)py * m->width + px];
    RfVec2 step = {at.x - k->at.x, at.y - k->at.y};
    if (m->tiles)
        step = (RfVec2){step.x - (float)(x - px), step.y - (float)(y - py)};
    return rf_vec2_add(k->source, rf_bend(k->bend, step));
}

// 0 outside the frame.
static float share_at(const RfMarkers *m, int x, int y)
{
    if (!m->tiles && (x < 0 || y < 0 || x >= m->width || y >= m->height))
        return 0;
    return m->pixels[(ptrdiff_t)rf_wrap_int(y, m->height) * m->width + rf_wrap_int(x, m->width)].share;
}

float rf_markers_share(const RfMarkers *m, int x, int y)
{
    float own = m->pixels[(ptrdiff_t)y * m->width + x].share;
    if (own > 0)
        return own;
    float left = share_at(m, x - 1, y), right = share_at(m, x + 1, y);
    if (left > 0 && right > 0)
        return 0.5f * (left + right);
    float above = share_at(m, x, y - 1), below = share_at(m, x, y + 1);
    return above > 0 && below > 0 ? 0.5f * (above + below) : 0;
}

// Adds a place to the voice that says the same, or as a new one. `out` holds weights, and sums of places times weights
// in `sums`.
static void add_voice(RfVoices *out, RfVec2 *sums, const RfMarker *marker, RfVec2 place, float weight)
{
    int g = 0;
    while (g < out->count &&
           !(fabsf(out->places[g].x - place.x) <= TOGETHER && fabsf(out->places[g].y - place.y) <= TOGETHER))
        ++g;
    if (g == out->count)
    {
        out->places[g] = place;
        out->markers[g] = marker;
        out->shares[g] = 0;
        sums[g] = (RfVec2){0, 0};
        ++out->count;
    }
    sums[g] = (RfVec2){sums[g].x + weight * place.x, sums[g].y + weight * place.y};
    out->shares[g] += weight;
}

// To 1/256 of a pixel: means of equal places are equal to them only but for rounding.
static float snap(float at)
{
    return floorf(at * 256 + 0.5f) * (1.0f / 256);
}

void rf_markers_hear(const RfMarkers *m, int x, int y, RfVoices *out)
{
    RfVec2 sums[RF_MAX_VOICES];
    float total = 0;
    out->count = 0;
    for (int j = y - 1; j <= y + 1; ++j)
        for (int i = x - 1; i <= x + 1; ++i)
        {
            if (!m->tiles && (i < 0 || j < 0 || i >= m->width || j >= m->height))
                continue;
            int pi = rf_border_int(i, m->width, m->tiles), pj = rf_border_int(j, m->height, m->tiles);
            const RfMarker *k = &m->pixels[(ptrdiff_t)pj * m->width + pi];
            if (!(k->share > 0))
                continue;
            RfVec2 step = {(float)(x - i + pi) - k->at.x, (float)(y - j + pj) - k->at.y};
            float weight = 1 - (step.x * step.x + step.y * step.y) * (1 / (REACH * REACH));
            if (weight <= 0)
                continue;
            weight *= weight;
            add_voice(out, sums, k, rf_vec2_add(k->source, rf_bend(k->bend, step)), weight);
            total += weight;
        }
    for (int g = 0; g < out->count; ++g)
    {
        out->places[g] = (RfVec2){snap(sums[g].x / out->shares[g]), snap(sums[g].y / out->shares[g])};
        out->shares[g] /= total;
    }
}
