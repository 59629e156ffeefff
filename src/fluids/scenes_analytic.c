// SPDX-License-Identifier: Apache-2.0
// Flows that are formulas. Every one is free of divergence, and every speed is in cells a frame with y down.
//
// The double gyre: Shadden, Lekien, Marsden. Definition and properties of Lagrangian coherent structures from
// finite-time Lyapunov exponents in two-dimensional aperiodic flows. Physica D 212, 2005 (section 6).
#include "fluids/scene.h"

#include <math.h>

#define SIZE_RANGE                                                                                                     \
    {                                                                                                                  \
        "size", RF_PARAMETER_SIZE, 4, RF_MAX_SIZE / 4                                                                  \
    }
#define SPEED_RANGE                                                                                                    \
    {                                                                                                                  \
        "speed", RF_PARAMETER_NUMBER, 0, 1000                                                                          \
    }

/// Position of the cell's centre against the middle of the field, in cells.
static RfVec2 from_middle(const RfFlowField *field, int i, int j)
{
    return (RfVec2){(float)i + 0.5f - 0.5f * (float)field->width, (float)j + 0.5f - 0.5f * (float)field->height};
}

static void put(RfFlowField *field, int i, int j, float u, float v)
{
    float *velocity = field->velocity + 2 * ((size_t)j * (size_t)field->width + (size_t)i);
    velocity[0] = u;
    velocity[1] = v;
}

// Angular speed w(r) = (S / a) exp((1 - r^2 / a^2) / 2): solid inside, decaying outside, fastest (S) at r = a.
static RfResult draw_vortex(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)state;
    (void)moment;
    float core = (float)rf_parameter(parameters, "core") * (float)rf_min_int(field->width, field->height);
    float spin = (float)rf_parameter(parameters, "speed") / core;
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
        {
            RfVec2 p = from_middle(field, i, j);
            float w = spin * expf(0.5f - 0.5f * (p.x * p.x + p.y * p.y) / (core * core));
            put(field, i, j, -w * p.y, w * p.x);
        }
    return RF_OK;
}

static RfResult draw_shear(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)state;
    (void)moment;
    double speed = rf_parameter(parameters, "speed"), layers = rf_parameter(parameters, "layers");
    for (int j = 0; j < field->height; ++j)
    {
        float u = (float)(speed * sin(M_PI * layers * (j + 0.5) / field->height));
        for (int i = 0; i < field->width; ++i)
            put(field, i, j, u, 0);
    }
    return RF_OK;
}

// On [0, 2] x [0, 1] with y up: psi = A sin(pi f) sin(pi y), f = a x^2 + (1 - 2 a) x, a = epsilon sin(2 pi t / period);
// u = -dpsi/dy, v = dpsi/dx. Taken in cells, A is such that the fastest point of the first moment moves at `speed`.
static RfResult draw_gyre(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)state;
    double a = rf_parameter(parameters, "epsilon") * sin(2 * M_PI * moment / rf_parameter(parameters, "period"));
    double cell_x = 2.0 / field->width, cell_y = 1.0 / field->height;
    double scale = rf_parameter(parameters, "speed") / fmax(cell_x, cell_y);
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
        {
            double x = (i + 0.5) * cell_x, y = 1 - (j + 0.5) * cell_y;
            double f = a * x * x + (1 - 2 * a) * x, slope = 2 * a * x + 1 - 2 * a;
            double u = -cell_y * sin(M_PI * f) * cos(M_PI * y);
            double v = cell_x * cos(M_PI * f) * sin(M_PI * y) * slope;
            put(field, i, j, (float)(scale * u), (float)(-scale * v));
        }
    return RF_OK;
}

static RfResult draw_uniform(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)state;
    (void)moment;
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
            put(field, i, j, (float)rf_parameter(parameters, "u"), (float)rf_parameter(parameters, "v"));
    return RF_OK;
}

static RfResult draw_rotation(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)state;
    (void)moment;
    float spin = (float)(rf_parameter(parameters, "turn") * M_PI / 180);
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
        {
            RfVec2 p = from_middle(field, i, j);
            put(field, i, j, -spin * p.y, spin * p.x);
        }
    return RF_OK;
}

const RfSceneClass rf_scene_vortex = {
    .name = "vortex",
    .defaults = "size=256x256&speed=2&core=0.2",
    .ranges = (const RfParameterRange[]){SIZE_RANGE, SPEED_RANGE, {"core", RF_PARAMETER_NUMBER, 0.01, 10}, {0}},
    .sentence = "One steady vortex, clockwise: speed is its greatest, in cells a frame, reached at core shorter sides "
                "from the middle.",
    .moment_count = 1,
    .draw = draw_vortex,
};

const RfSceneClass rf_scene_shear = {
    .name = "shear",
    .defaults = "size=256x256&speed=2&layers=2",
    .ranges = (const RfParameterRange[]){SIZE_RANGE, SPEED_RANGE, {"layers", RF_PARAMETER_INTEGER, 1, 1000}, {0}},
    .sentence = "Steady sine layers that slide along x, left and right in turn; speed is the greatest.",
    .moment_count = 1,
    .draw = draw_shear,
};

const RfSceneClass rf_scene_gyre = {
    .name = "gyre",
    .defaults = "size=512x256&speed=2&epsilon=0.25&period=400",
    .ranges = (const RfParameterRange[]){SIZE_RANGE,
                                         SPEED_RANGE,
                                         {"epsilon", RF_PARAMETER_NUMBER, 0, 0.5},
                                         {"period", RF_PARAMETER_NUMBER, 1, 1e6},
                                         {0}},
    .sentence = "The unsteady double gyre of Shadden et al. 2005: two vortices whose border swings by epsilon once a "
                "period (in frames); speed is the greatest of the first moment.",
    .moment_count = 0,
    .draw = draw_gyre,
};

const RfSceneClass rf_scene_uniform = {
    .name = "uniform",
    .defaults = "size=256x256&u=1&v=0",
    .ranges =
        (const RfParameterRange[]){
            SIZE_RANGE, {"u", RF_PARAMETER_NUMBER, -1000, 1000}, {"v", RF_PARAMETER_NUMBER, -1000, 1000}, {0}},
    .sentence = "The same velocity everywhere: u to the right, v down, in cells a frame.",
    .moment_count = 1,
    .draw = draw_uniform,
};

const RfSceneClass rf_scene_rotation = {
    .name = "rotation",
    .defaults = "size=256x256&turn=1",
    .ranges = (const RfParameterRange[]){SIZE_RANGE, {"turn", RF_PARAMETER_NUMBER, -360, 360}, {0}},
    .sentence = "Solid rotation about the middle by turn degrees a frame, clockwise on the screen.",
    .moment_count = 1,
    .draw = draw_rotation,
};
