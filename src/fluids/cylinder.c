// SPDX-License-Identifier: Apache-2.0
// Flow past a cylinder: a vortex street, from a lattice Boltzmann run (D2Q9) on a coarse grid, drawn at any size.
//
// Collisions are regularised (Latt, Chopard. Lattice Boltzmann method with regularized pre-collision distribution
// functions. 2006): of what is not equilibrium only the stress is kept. Plain and two-rate relaxation were tried first
// and blow up from a Reynolds number of 100 on a lattice this coarse. The lattice has a ring of ghost nodes: on the
// left the inflow's equilibrium, on the right a copy of the last column, above and below the mirror image (free slip).
// Nodes in the cylinder send back what comes (no slip).
//
// The street takes long to start from symmetry, so the first field is pushed sideways behind the cylinder; the run then
// goes on until it sheds steadily, and what stands there is moment 0. Between lattice nodes the velocity is cubic
// (Catmull-Rom). A moment shows the lattice's last whole step before it, at most a 500th of a period early. A step is
// too short (a fifth of a millisecond) to be worth waking other threads for.
#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"
#include "fluids/scene.h"

#include <math.h>
#include <string.h>

enum
{
    DIRECTIONS = 9,
    /// Nodes along the shorter side, and along the longer at most.
    SHORT_SIDE = 112,
    LONG_SIDE = 8 * SHORT_SIDE,
    /// Steps before moment 0 in units of diameter over speed.
    STARTUP = 22,
    /// A report costs as much as a hundredth of this many.
    STEPS_A_REPORT = 8
};

// 0; right, left; down, up; then diagonals, each followed by its opposite.
static const int step_x[DIRECTIONS] = {0, 1, -1, 0, 0, 1, -1, 1, -1};
static const int step_y[DIRECTIONS] = {0, 0, 0, 1, -1, 1, -1, -1, 1};
static const int opposite[DIRECTIONS] = {0, 2, 1, 4, 3, 6, 5, 8, 7};
static const int upside_down[DIRECTIONS] = {0, 1, 2, 4, 3, 7, 8, 5, 6};
static const float weight[DIRECTIONS] = {4.0f / 9,  1.0f / 9,  1.0f / 9,  1.0f / 9, 1.0f / 9,
                                         1.0f / 36, 1.0f / 36, 1.0f / 36, 1.0f / 36};

// Speed of the inflow in nodes a step: fast enough for a short start, slow enough to be nearly incompressible.
static const float inflow = 0.12f;

typedef struct Cylinder
{
    int width, height;
    /// Nodes of a row with its two ghosts.
    int stride;
    size_t plane;
    float centre_x, centre_y, radius;
    /// What a collision leaves of the stress: 1 - 1 / relaxation time.
    float keep;
    /// Lattice steps a frame, the frames gone and the steps made since moment 0.
    double steps_a_frame;
    int64_t frames, steps;
    /// [direction][row][node] now, after the step, and at moment 0.
    float *now, *next, *first;
    int *solid;
    int solid_count;
    /// [row][node][2]
    float *velocity;
} Cylinder;

static inline float equilibrium(int q, float density, float u, float v)
{
    float along = (float)step_x[q] * u + (float)step_y[q] * v;
    return weight[q] * density * (1 + 3 * along + 4.5f * along * along - 1.5f * (u * u + v * v));
}

/// One row: each node takes what its neighbours sent and relaxes it.
static void relax_row(const Cylinder *c, int row)
{
    size_t start = (size_t)row * (size_t)c->stride;
    const float *from[DIRECTIONS];
    float *to[DIRECTIONS];
    for (int q = 0; q < DIRECTIONS; ++q)
    {
        from[q] = c->now + (size_t)q * c->plane + start - (ptrdiff_t)step_y[q] * c->stride - step_x[q];
        to[q] = c->next + (size_t)q * c->plane + start;
    }
    // By name, because the compiler widens no loop that reads pointers from a table.
    const float *from0 = from[0], *from1 = from[1], *from2 = from[2], *from3 = from[3], *from4 = from[4];
    const float *from5 = from[5], *from6 = from[6], *from7 = from[7], *from8 = from[8];
    float *to0 = to[0], *to1 = to[1], *to2 = to[2], *to3 = to[3], *to4 = to[4];
    float *to5 = to[5], *to6 = to[6], *to7 = to[7], *to8 = to[8];
    float keep = c->keep;
#pragma omp simd
    for (int x = 1; x <= c->width; ++x)
    {
        float f1 = from1[x], f2 = from2[x], f3 = from3[x], f4 = from4[x];
        float f5 = from5[x], f6 = from6[x], f7 = from7[x], f8 = from8[x];
        float diagonal = f5 + f6 + f7 + f8;
        float density = from0[x] + (f1 + f2) + (f3 + f4) + diagonal;
        float u = (f1 - f2 + f5 - f6 + f7 - f8) / density;
        float v = (f3 - f4 + f5 - f6 - f7 + f8) / density;
        // What is kept of the stress: second moments less those at equilibrium.
        float third = 1.0f / 3, xx = keep * (f1 + f2 + diagonal - density * (third + u * u));
        float yy = keep * (f3 + f4 + diagonal - density * (third + v * v));
        float xy = keep * (f5 + f6 - f7 - f8 - density * u * v);
        float square = 1 - 1.5f * (u * u + v * v);
        to0[x] = 4.0f / 9 * density * square - 2.0f / 3 * (xx + yy);
#define SEND_PAIR(there, back, w, a, stress)                                                                           \
    there[x] = (w)*density * (square + (a) * (4.5f * (a) + 3)) + (stress);                                             \
    back[x] = (w)*density * (square + (a) * (4.5f * (a)-3)) + (stress);
        SEND_PAIR(to1, to2, 1.0f / 9, u, third * xx - 0.5f * third * yy)
        SEND_PAIR(to3, to4, 1.0f / 9, v, third * yy - 0.5f * third * xx)
        SEND_PAIR(to5, to6, 1.0f / 36, u + v, 0.25f * third * (xx + yy) + 0.25f * xy)
        SEND_PAIR(to7, to8, 1.0f / 36, u - v, 0.25f * third * (xx + yy) - 0.25f * xy)
#undef SEND_PAIR
    }
}

/// Nodes of the cylinder turn round what they take instead of relaxing it.
static void bounce_back(Cylinder *c)
{
    for (int s = 0; s < c->solid_count; ++s)
        for (int q = 0; q < DIRECTIONS; ++q)
            c->next[(size_t)opposite[q] * c->plane + (size_t)c->solid[s]] =
                c->now[(size_t)q * c->plane + (size_t)(c->solid[s] - step_y[q] * c->stride - step_x[q])];
}

/// Ghosts above and below, then left and right, corners among them.
static void fill_ghosts(Cylinder *c)
{
    for (int q = 0; q < DIRECTIONS; ++q)
    {
        float *plane = c->now + (size_t)q * c->plane, *mirror = c->now + (size_t)upside_down[q] * c->plane;
        size_t row = (size_t)c->stride, last = row * (size_t)c->height;
        memcpy(plane, mirror + row, row * sizeof(float));
        memcpy(plane + last + row, mirror + last, row * sizeof(float));
    }
    for (int q = 0; q < DIRECTIONS; ++q)
        for (int j = 0; j < c->height + 2; ++j)
        {
            float *row = c->now + (size_t)q * c->plane + (size_t)j * (size_t)c->stride;
            row[0] = equilibrium(q, 1, inflow, 0);
            row[c->width + 1] = row[c->width];
        }
}

static void step(Cylinder *c)
{
    fill_ghosts(c);
    for (int row = 1; row <= c->height; ++row)
        relax_row(c, row);
    bounce_back(c);
    float *old = c->now;
    c->now = c->next;
    c->next = old;
}

static bool in_cylinder(const Cylinder *c, float x, float y)
{
    float dx = x - c->centre_x, dy = y - c->centre_y;
    return dx * dx + dy * dy < c->radius * c->radius;
}

/// Inflow everywhere, swept sideways in a patch behind the cylinder.
static void start(Cylinder *c)
{
    for (int j = 0; j < c->height + 2; ++j)
        for (int i = 0; i < c->stride; ++i)
        {
            size_t k = (size_t)j * (size_t)c->stride + (size_t)i;
            float x = ((float)i - 0.5f - c->centre_x) / c->radius - 3, y = ((float)j - 0.5f - c->centre_y) / c->radius;
            float push = 0.6f * inflow * expf(-0.4f * (x * x + y * y));
            for (int q = 0; q < DIRECTIONS; ++q)
                c->now[(size_t)q * c->plane + k] = c->next[(size_t)q * c->plane + k] = equilibrium(q, 1, inflow, push);
            if (i > 0 && i <= c->width && j > 0 && j <= c->height && in_cylinder(c, (float)i - 0.5f, (float)j - 0.5f))
                c->solid[c->solid_count++] = (int)k;
        }
}

static void destroy(void *state)
{
    Cylinder *c = state;
    if (!c)
        return;
    void *blocks[] = {c->now, c->next, c->first, c->solid, c->velocity, c};
    for (size_t i = 0; i < sizeof blocks / sizeof blocks[0]; ++i)
        rf_release(blocks[i]);
}

static void choose_lattice(Cylinder *c, const RfParameters *parameters)
{
    double cells = (double)rf_min_int(parameters->width, parameters->height) / SHORT_SIDE;
    c->width = rf_clamp_int((int)lround(parameters->width / cells), SHORT_SIDE, LONG_SIDE);
    c->height = rf_clamp_int((int)lround(parameters->height / cells), SHORT_SIDE, LONG_SIDE);
    c->stride = c->width + 2;
    c->plane = (size_t)c->stride * (size_t)(c->height + 2);
    c->radius = SHORT_SIDE * 0.08f;
    c->centre_x = fmaxf(0.22f * (float)c->width, 3.2f * c->radius);
    c->centre_y = 0.5f * (float)c->height;
    double viscosity = 2 * (double)c->radius * (double)inflow / rf_parameter(parameters, "reynolds");
    c->keep = (float)(1 - 1 / (3 * viscosity + 0.5));
    c->steps_a_frame =
        rf_parameter(parameters, "speed") / (double)inflow * (double)c->width / (double)parameters->width;
}

/// Runs until the street sheds steadily, and keeps what stands there.
static RfResult settle(Cylinder *c)
{
    int steps = (int)(STARTUP * 2 * c->radius / inflow);
    for (int i = 0; i < steps; ++i)
    {
        if (i % STEPS_A_REPORT == 0)
            RF_TRY(rf_progress("starting the vortex street", (double)i / steps));
        step(c);
    }
    memcpy(c->first, c->now, DIRECTIONS * c->plane * sizeof(float));
    return RF_OK;
}

static RfResult create(const RfParameters *parameters, void **state)
{
    Cylinder *c = rf_allocate_zero(1, sizeof *c);
    if (!c)
        return RF_OUT_OF_MEMORY;
    choose_lattice(c, parameters);
    c->now = rf_allocate_zero(DIRECTIONS * c->plane, sizeof(float));
    c->next = rf_allocate_zero(DIRECTIONS * c->plane, sizeof(float));
    c->first = rf_allocate(DIRECTIONS * c->plane, sizeof(float));
    c->solid = rf_allocate(c->plane, sizeof(int));
    c->velocity = rf_allocate_zero(2 * (size_t)c->width * (size_t)c->height, sizeof(float));
    if (!c->now || !c->next || !c->first || !c->solid || !c->velocity)
    {
        destroy(c);
        return RF_OUT_OF_MEMORY;
    }
    start(c);
    RfResult result = settle(c);
    if (result == RF_OK)
        *state = c;
    else
        destroy(c);
    return result;
}

static void restart(void *state)
{
    Cylinder *c = state;
    memcpy(c->now, c->first, DIRECTIONS * c->plane * sizeof(float));
    c->frames = c->steps = 0;
}

static void advance(void *state)
{
    Cylinder *c = state;
    ++c->frames;
    int64_t wanted = (int64_t)floor((double)c->frames * c->steps_a_frame);
    for (; c->steps < wanted; ++c->steps)
        step(c);
}

/// Velocity of every node over that of the inflow; 0 in the cylinder.
static void find_velocity(Cylinder *c)
{
    for (int j = 0; j < c->height; ++j)
        for (int i = 0; i < c->width; ++i)
        {
            size_t k = (size_t)(j + 1) * (size_t)c->stride + (size_t)i + 1;
            float density = 0, u = 0, v = 0;
            for (int q = 0; q < DIRECTIONS; ++q)
            {
                float f = c->now[(size_t)q * c->plane + k];
                density += f;
                u += (float)step_x[q] * f;
                v += (float)step_y[q] * f;
            }
            float scale = in_cylinder(c, (float)i + 0.5f, (float)j + 0.5f) ? 0 : 1 / (density * inflow);
            float *velocity = c->velocity + 2 * ((size_t)j * (size_t)c->width + (size_t)i);
            velocity[0] = scale * u;
            velocity[1] = scale * v;
        }
}

/// Catmull-Rom weights of the four samples round a point, t of the way from the second to the third.
static void cubic_weights(float t, float w[4])
{
    w[0] = 0.5f * t * (-1 + t * (2 - t));
    w[1] = 0.5f * (2 + t * t * (-5 + 3 * t));
    w[2] = 0.5f * t * (1 + t * (4 - 3 * t));
    w[3] = 0.5f * t * t * (t - 1);
}

static RfVec2 sample(const Cylinder *c, float x, float y)
{
    float fx = floorf(x - 0.5f), fy = floorf(y - 0.5f), wx[4], wy[4];
    cubic_weights(x - 0.5f - fx, wx);
    cubic_weights(y - 0.5f - fy, wy);
    RfVec2 sum = {0, 0};
    for (int b = 0; b < 4; ++b)
        for (int a = 0; a < 4; ++a)
        {
            int i = rf_clamp_int((int)fx + a - 1, 0, c->width - 1), j = (int)fy + b - 1;
            const float *velocity =
                c->velocity + 2 * ((size_t)rf_mirror_int(j, c->height) * (size_t)c->width + (size_t)i);
            float w = wx[a] * wy[b];
            // Free slip: the mirror image moves the other way across.
            sum.x += w * velocity[0];
            sum.y += j < 0 || j >= c->height ? -w * velocity[1] : w * velocity[1];
        }
    return sum;
}

static RfResult draw(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)moment;
    Cylinder *c = state;
    RF_TRY(rf_flow_field_add_mask(field));
    find_velocity(c);
    float speed = (float)rf_parameter(parameters, "speed");
    float scale_x = (float)c->width / (float)field->width, scale_y = (float)c->height / (float)field->height;
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
        {
            size_t k = (size_t)j * (size_t)field->width + (size_t)i;
            float x = ((float)i + 0.5f) * scale_x, y = ((float)j + 0.5f) * scale_y;
            field->mask[k] = !in_cylinder(c, x, y);
            RfVec2 v = field->mask[k] ? sample(c, x, y) : (RfVec2){0, 0};
            field->velocity[2 * k] = speed * v.x;
            field->velocity[2 * k + 1] = speed * v.y;
        }
    return RF_OK;
}

const RfSceneClass rf_scene_cylinder = {
    .name = "cylinder",
    .defaults = "size=512x256&speed=2&reynolds=150",
    .ranges = (const RfParameterRange[]){{"size", RF_PARAMETER_SIZE, 32, 4096},
                                         {"speed", RF_PARAMETER_NUMBER, 0.001, 100},
                                         {"reynolds", RF_PARAMETER_NUMBER, 60, 300},
                                         {0}},
    .sentence = "Flow from left to right past a cylinder that sheds a vortex street, without end; speed is the "
                "inflow's.",
    .most_aspect = 8,
    .moment_count = 0,
    .create = create,
    .restart = restart,
    .advance = advance,
    .draw = draw,
    .destroy = destroy,
};
