// SPDX-License-Identifier: Apache-2.0
// The life of grids: advection, distortion, retirement, fading.
//
// Sorkine, Cohen-Or, Goldenthal, Lischinski. Bounded-distortion piecewise mesh parameterization. 2002 (delta of a
// triangle).
//
// Deviation: a vertex that loses its last triangle to the land or the border keeps the K_d it had. With the paper's 1 a
// worn grid flashes up along the bank from one frame to the next.
//
// Beyond the paper: grids relax. There a grid is bent until it is worn out, and in a strain of rate e that takes
// ln(delta) / e frames, whatever its size; the picture is then swapped piece by piece. Here vertices slip back, by the
// share 1 - exp(-relaxation e) of a frame, towards the rest shape at the place and turn that fit the grid's middle
// best. A steady strain is balanced at the stretch exp(1 / relaxation). In the middle nothing slips, at the distance r
// the texture lags by about e r a frame, so that the kernel shows little of it. Between relaxation 0 (the paper) and
// infinity (sprites) lies more of the spectrum for less of the flow than by any other option. The middle must be small:
// fitted to the whole grid, the place is the mean of a neighbourhood where the flow is not, and the error doubles.

#include "methods/lagrangian/lagrangian.h"

#include "core/maths.h"
#include "kernels/advection.h"
#include "kernels/extrapolation.h"
#include "kernels/poisson_disk.h"

#include <string.h>

// A grid is retired once its border comes nearer to its centre than this, in Poisson-disk radii. The paper has 1; K_g
// fades the border anyway, and fewer births flicker less.
#define COVER_RADIUS 0.9f

// A fade takes this share of the time that the local strain leaves it: less flickers, more smears and draws more
// layers.
#define FADE_SHARE 0.6f

// Where the rest shape is fitted: a Gaussian of this width, in Poisson-disk radii. Wider slips in the middle, too.
#define MIDDLE_WIDTH 0.2f

// A fade takes this long at least, in seconds, however fast the flow strains: 12 frames at 24 a second. Left to the
// strain alone fades of 5 frames swap a fifth of the picture from one frame to the next (bench_pops).
#define LEAST_FADE 0.5f

RfResult rf_lagrangian_grids_reserve(RfLagrangian *l, int capacity)
{
    if (capacity <= l->capacity)
        return RF_OK;
    int wanted = rf_max_int(capacity, l->capacity + l->capacity / 2 + 64);
    size_t vertices = (size_t)(l->options.grid_vertices * l->options.grid_vertices) * sizeof(float);
    void **blocks[] = {(void **)&l->grids, (void **)&l->x, (void **)&l->y, (void **)&l->quality};
    for (int i = 0; i < 4; ++i)
    {
        void *moved = rf_reallocate(*blocks[i], (size_t)l->count, (size_t)wanted, i == 0 ? sizeof(Grid) : vertices);
        if (!moved)
            return RF_OUT_OF_MEMORY;
        *blocks[i] = moved;
    }
    l->capacity = wanted;
    return RF_OK;
}

// delta = max(s_max, 1 / s_min) of the map from the rest triangle, legs of length `cell` along x and y, to one with
// these legs; infinite if turned over.
static float distortion(RfVec2 leg_x, RfVec2 leg_y, float cell)
{
    float a = leg_x.x / cell, b = leg_y.x / cell, c = leg_x.y / cell, d = leg_y.y / cell;
    if (!(a * d - b * c > 0))
        return INFINITY;
    float sum = sqrtf((a + d) * (a + d) + (c - b) * (c - b)), difference = sqrtf((a - d) * (a - d) + (b + c) * (b + c));
    float largest = 0.5f * (sum + difference), smallest = 0.5f * (sum - difference);
    return smallest > 0 ? fmaxf(largest, 1 / smallest) : INFINITY;
}

typedef struct Vertices
{
    const float *x, *y;
    int n;
} Vertices;

static RfVec2 vertex(const Vertices *v, int index)
{
    return (RfVec2){v->x[index], v->y[index]};
}

// Adds triangle p-q-r (legs p to q along x and p to r along y, signed by `sign`) to its vertices' sums; true if it
// folds.
static bool add_triangle(const Vertices *v, const bool *inside, const int corner[3], float sign, float cell,
                         float limit, float *sum, int *count)
{
    if (!inside[corner[0]] || !inside[corner[1]] || !inside[corner[2]])
        return false;
    RfVec2 p = vertex(v, corner[0]), leg_x = rf_vec2_sub(vertex(v, corner[1]), p),
           leg_y = rf_vec2_sub(vertex(v, corner[2]), p);
    float delta = distortion((RfVec2){sign * leg_x.x, sign * leg_x.y}, (RfVec2){sign * leg_y.x, sign * leg_y.y}, cell);
    // Q = max((delta_max - delta) / (delta_max - 1), 0)
    float quality = fmaxf((limit - delta) / (limit - 1), 0);
    for (int k = 0; k < 3; ++k)
    {
        sum[corner[k]] += quality;
        ++count[corner[k]];
    }
    return isinf(delta);
}

// K_d at every vertex: the mean quality of its triangles, what it was where it has none. True if a triangle folds.
static bool measure_quality(const RfLagrangian *l, const Vertices *v, const bool *inside, float *quality)
{
    int n = v->n, count[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES] = {0};
    bool folded = false;
    float sum[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES] = {0};
    for (int j = 0; j + 1 < n; ++j)
        for (int i = 0; i + 1 < n; ++i)
        {
            int a = j * n + i;
            const int upper[3] = {a, a + 1, a + n}, lower[3] = {a + n + 1, a + n, a + 1};
            folded |= add_triangle(v, inside, upper, 1, l->cell, l->options.max_distortion, sum, count);
            folded |= add_triangle(v, inside, lower, -1, l->cell, l->options.max_distortion, sum, count);
        }
    for (int k = 0; k < n * n; ++k)
        quality[k] = count[k] > 0 ? sum[k] / (float)count[k] : quality[k];
    return folded;
}

static float distance_to_segment(RfVec2 p, RfVec2 a, RfVec2 b)
{
    RfVec2 ab = rf_vec2_sub(b, a), ap = rf_vec2_sub(p, a);
    float length2 = ab.x * ab.x + ab.y * ab.y,
          t = length2 > 0 ? rf_clamp((ap.x * ab.x + ap.y * ab.y) / length2, 0, 1) : 0;
    return rf_vec2_length((RfVec2){ap.x - t * ab.x, ap.y - t * ab.y});
}

// True while every piece of the border that is in the fluid keeps the kernel's distance from the centre.
static bool covers_kernel(const Vertices *v, const bool *inside, RfVec2 centre, float radius)
{
    int n = v->n;
    for (int k = 0; k + 1 < n; ++k)
    {
        const int ends[4][2] = {{k, k + 1},
                                {n * (n - 1) + k, n * (n - 1) + k + 1},
                                {k * n, (k + 1) * n},
                                {k * n + n - 1, (k + 1) * n + n - 1}};
        for (int side = 0; side < 4; ++side)
        {
            int a = ends[side][0], b = ends[side][1];
            if ((inside[a] || inside[b]) && distance_to_segment(centre, vertex(v, a), vertex(v, b)) < radius)
                return false;
        }
    }
    return true;
}

// The grid's mean deformation, from its vertices' moments about the centre, and the rotation nearest to it (polar
// decomposition in the plane).
static void measure_deformation(const Vertices *v, float cell, Grid *grid)
{
    int n = v->n;
    float sum[4] = {0}, rest = 0, middle = 0.5f * (float)(n - 1);
    for (int k = 0; k < n * n; ++k)
    {
        float ru = ((float)(k % n) - middle) * cell, rv = ((float)(k / n) - middle) * cell,
              dx = v->x[k] - grid->centre.x, dy = v->y[k] - grid->centre.y;
        sum[0] += ru * dx;
        sum[1] += rv * dx;
        sum[2] += ru * dy;
        sum[3] += rv * dy;
        rest += ru * ru;
    }
    for (int i = 0; i < 4; ++i)
        grid->stretch[i] = sum[i] / rest;
    float along = sum[0] + sum[3], across = sum[2] - sum[1], length = sqrtf(along * along + across * across);
    grid->turn_cos = length > 0 ? along / length : 1;
    grid->turn_sin = length > 0 ? across / length : 0;
}

// Rate of strain from differences over one radius: the larger eigenvalue of the symmetric part of the velocity's
// gradient, its trace removed. Where nothing is known along an axis the grid's last value stands.
static float measure_strain(const RfLagrangian *l, const StepFlow *flow, const Grid *grid)
{
    RfVec2 centre = grid->centre;
    float h = 0.5f * l->radius, blend = rf_flow_blend(flow->view, flow->view->time);
    RfVec2 difference[2];
    for (int axis = 0; axis < 2; ++axis)
    {
        RfVec2 ends[2], known = {0, 0};
        bool inside[2];
        for (int k = 0; k < 2; ++k)
        {
            float s = k ? h : -h;
            RfVec2 p = {centre.x + (axis == 0 ? s : 0), centre.y + (axis == 1 ? s : 0)};
            inside[k] = rf_flow_velocity(flow->view, p, flow->scale_x, flow->scale_y, blend, &ends[k]);
        }
        if (!inside[0] && !inside[1])
            return grid->strain;
        if (!inside[0] || !inside[1])
        {
            // One side only: the difference to the centre, doubled.
            int in = inside[0] ? 0 : 1;
            if (!rf_flow_velocity(flow->view, centre, flow->scale_x, flow->scale_y, blend, &known))
                known = ends[in];
            ends[1 - in] = (RfVec2){2 * known.x - ends[in].x, 2 * known.y - ends[in].y};
        }
        difference[axis] = (RfVec2){(ends[1].x - ends[0].x) / (2 * h), (ends[1].y - ends[0].y) / (2 * h)};
    }
    float stretch = 0.5f * (difference[0].x - difference[1].y), shear = 0.5f * (difference[0].y + difference[1].x);
    return sqrtf(stretch * stretch + shear * shear);
}

static void measure_grid(RfLagrangian *l, const StepFlow *flow, int index, const bool *inside)
{
    int n = l->options.grid_vertices;
    size_t first = (size_t)index * (size_t)(n * n);
    Vertices v = {l->x + first, l->y + first, n};
    Grid *grid = &l->grids[index];
    float *quality = l->quality + first;
    RfVec2 sum = {0, 0};
    for (int k = 0; k < n * n; ++k)
        sum = rf_vec2_add(sum, vertex(&v, k));
    grid->centre = (RfVec2){sum.x / (float)(n * n), sum.y / (float)(n * n)};
    grid->folded = measure_quality(l, &v, inside, quality);
    grid->uncovering = !covers_kernel(&v, inside, grid->centre, COVER_RADIUS * l->radius);
    grid->least_quality = 1;
    grid->greatest_quality = 0;
    grid->worn = false;
    grid->inside_count = 0;
    for (int k = 0; k < n * n; ++k)
    {
        grid->inside_count += inside[k];
        grid->least_quality = fminf(grid->least_quality, quality[k]);
        grid->greatest_quality = fmaxf(grid->greatest_quality, quality[k]);
        if (inside[k] && quality[k] < 0.5f && rf_vec2_length(rf_vec2_sub(vertex(&v, k), grid->centre)) < l->radius)
            grid->worn = true;
    }
    measure_deformation(&v, l->cell, grid);
    grid->strain = measure_strain(l, flow, grid);
}

// The rest shape's place, and its turn times the length of a cell, that fit the grid's middle best.
typedef struct Pose
{
    RfVec2 centre, axis;
} Pose;

static Pose fit_pose(const RfLagrangian *l, const Vertices *v)
{
    int n = v->n;
    float width = MIDDLE_WIDTH * l->radius / l->cell, middle = 0.5f * (float)(n - 1), total = 0;
    float weight[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    RfVec2 centre = {0, 0}, axis = {0, 0};
    for (int k = 0; k < n * n; ++k)
    {
        float i = (float)(k % n) - middle, j = (float)(k / n) - middle;
        weight[k] = expf(-(i * i + j * j) / (width * width));
        total += weight[k];
        centre = rf_vec2_add(centre, (RfVec2){weight[k] * v->x[k], weight[k] * v->y[k]});
    }
    centre = (RfVec2){centre.x / total, centre.y / total};
    for (int k = 0; k < n * n; ++k)
    {
        float i = (float)(k % n) - middle, j = (float)(k / n) - middle;
        RfVec2 p = rf_vec2_sub(vertex(v, k), centre);
        axis = rf_vec2_add(axis, (RfVec2){weight[k] * (i * p.x + j * p.y), weight[k] * (i * p.y - j * p.x)});
    }
    float length = rf_vec2_length(axis), scale = length > 0 ? l->cell / length : 0;
    return (Pose){centre, {axis.x * scale, axis.y * scale}};
}

static void relax(const RfLagrangian *l, const Grid *grid, double frames, float *x, float *y)
{
    int n = l->options.grid_vertices;
    float share = 1 - expf(-l->options.relaxation * grid->strain * (float)frames), middle = 0.5f * (float)(n - 1);
    Pose pose = fit_pose(l, &(Vertices){x, y, n});
    if (!(share > 0) || (pose.axis.x == 0 && pose.axis.y == 0))
        return;
    for (int k = 0; k < n * n; ++k)
    {
        float i = (float)(k % n) - middle, j = (float)(k / n) - middle;
        x[k] += share * (pose.centre.x + pose.axis.x * i - pose.axis.y * j - x[k]);
        y[k] += share * (pose.centre.y + pose.axis.y * i + pose.axis.x * j - y[k]);
    }
}

typedef struct AdvectJob
{
    RfLagrangian *l;
    const StepFlow *flow;
} AdvectJob;

static void advect_one(void *context, int index, int worker)
{
    (void)worker;
    const AdvectJob *job = context;
    RfLagrangian *l = job->l;
    int n = l->options.grid_vertices;
    size_t first = (size_t)index * (size_t)(n * n);
    bool inside[RF_MAX_GRID_VERTICES * RF_MAX_GRID_VERTICES];
    if (l->rigid)
        rf_lagrangian_sprite_advect(l, job->flow, l->grids[index].centre, l->x + first, l->y + first, inside);
    else
    {
        rf_advect_grid(l->x + first, l->y + first, inside, n, job->flow->view, job->flow->from, l->width, l->height);
        relax(l, &l->grids[index], job->flow->view->time - job->flow->from, l->x + first, l->y + first);
    }
    measure_grid(l, job->flow, index, inside);
}

void rf_lagrangian_grids_advect(RfLagrangian *l, const StepFlow *flow)
{
    AdvectJob job = {l, flow};
    rf_parallel_for(l->count, advect_one, &job);
}

void rf_lagrangian_grids_measure_new(RfLagrangian *l, const StepFlow *flow, int index)
{
    StepFlow still = *flow;
    still.from = flow->view->time;
    AdvectJob job = {l, &still};
    advect_one(&job, index, 0);
}

float rf_lagrangian_fade_length(const RfLagrangian *l, float strain, float others)
{
    float longest = l->options.fade * l->options.fps, least = fminf(LEAST_FADE * l->options.fps, longest);
    float limit = l->options.max_distortion;
    // A grid is retired at delta = (1 + delta_max) / 2 and has no weight left at delta_max. Pure strain e takes
    // ln(delta_max / delta) / e from one to the other.
    float left = strain > 0 ? FADE_SHARE * logf(2 * limit / (1 + limit)) / strain : longest;
    left = rf_lerp(least, rf_clamp(left, least, longest), others);
    return others > 0 ? rf_lerp(longest, left, l->options.adapt) : least;
}

static void retire(RfLagrangian *l, int index, double time)
{
    Grid *grid = &l->grids[index];
    grid->retired = true;
    grid->retirement = time;
    grid->fade_out = rf_lagrangian_fade_length(l, grid->strain, 1);
    ++l->stats.retired;
}

float rf_lagrangian_grid_fade(const Grid *grid, double time)
{
    float in = grid->fade_in > 0 ? rf_clamp((float)((time - grid->birth) / (double)grid->fade_in), 0, 1) : 1;
    // The sums are normalised: beside faint others a straight line would show the newcomer at half its weight at once.
    // There it starts as a parabola.
    in *= grid->others + (1 - grid->others) * in;
    if (!grid->retired)
        return in;
    float out =
        grid->fade_out > 0 ? rf_clamp(1 - (float)((time - grid->retirement) / (double)grid->fade_out), 0, 1) : 0;
    return in * out;
}

// Of two that are too close the more worn one goes; on ties the older.
static RfResult retire_close_pairs(RfLagrangian *l, double time)
{
    RfVec2 *points = rf_arena_push(&l->arena, (size_t)l->count, sizeof *points);
    int *index = rf_arena_push(&l->arena, (size_t)l->count, sizeof *index), live = 0;
    if (!points || !index)
        return RF_OUT_OF_MEMORY;
    for (int i = 0; i < l->count; ++i)
        if (!l->grids[i].retired)
        {
            points[live] = l->grids[i].centre;
            index[live++] = i;
        }
    RfPair *pairs;
    int count = rf_close_pairs(points, live, (1 - ALPHA) * l->radius, &l->arena, &pairs);
    if (count < 0)
        return RF_OUT_OF_MEMORY;
    for (int i = 0; i < count; ++i)
    {
        int a = index[pairs[i].a], b = index[pairs[i].b];
        if (l->grids[a].retired || l->grids[b].retired)
            continue;
        retire(l, l->grids[b].least_quality < l->grids[a].least_quality ? b : a, time);
    }
    return RF_OK;
}

RfResult rf_lagrangian_grids_retire(RfLagrangian *l, const StepFlow *flow)
{
    double time = flow->view->time;
    rf_lagrangian_grids_drop(l);
    for (int i = 0; i < l->count; ++i)
        if (!l->grids[i].retired && (l->grids[i].worn || l->grids[i].folded || l->grids[i].uncovering))
            retire(l, i, time);
    return retire_close_pairs(l, time);
}

// Out of sight for good: faded out, worn out altogether, or out of the fluid.
static bool is_gone(const Grid *grid, double time)
{
    return grid->inside_count == 0 ||
           (grid->retired && (grid->greatest_quality == 0 || rf_lagrangian_grid_fade(grid, time) == 0));
}

void rf_lagrangian_grids_drop(RfLagrangian *l)
{
    size_t vertices = (size_t)(l->options.grid_vertices * l->options.grid_vertices);
    int kept = 0;
    for (int i = 0; i < l->count; ++i)
    {
        if (is_gone(&l->grids[i], l->time))
            continue;
        if (kept != i)
        {
            float *arrays[] = {l->x, l->y, l->quality};
            for (int a = 0; a < 3; ++a)
                memcpy(arrays[a] + (size_t)kept * vertices, arrays[a] + (size_t)i * vertices, vertices * sizeof(float));
            l->grids[kept] = l->grids[i];
        }
        ++kept;
    }
    l->count = kept;
}
