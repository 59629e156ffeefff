// SPDX-License-Identifier: Apache-2.0
// A steady river from left to right, between banks and round islands.
//
// Shallow water over a rough bed moves, to first order, as water through a porous layer: friction balances the
// pressure, a u = -grad p, with a friction a that grows towards the banks. With u = rot psi this is
//
//   div(a grad psi) = 0,   psi constant on each piece of land,
//
// so the flow is free of divergence and tangential at land, slow along banks and fast in the middle, and the constant
// of an island follows from the flow itself: no circulation of a u round it. psi lives on the corners of cells. All the
// corners of one piece of land are one unknown, so the velocity of a land cell is 0 exactly and no stiff coefficients
// are needed. At the left and right the flow is straight across (psi_x = 0); top and bottom are given.
//
// The system is solved by conjugate gradients, first on grids halved until the shorter side is under 32 cells, each
// giving the next its first guess. The preconditioner is one multigrid cycle over the same grids (Briggs, Henson,
// McCormick. A multigrid tutorial. 2000): damped Jacobi before and after, interpolation by corners and its transpose.
// Gaps that close on a coarse grid only make that cycle a worse preconditioner; 7 steps are enough at any size tried.
#include "core/memory.h"
#include "core/progress.h"
#include "core/random.h"
#include "core/result.h"
#include "fluids/scene.h"

#include <math.h>
#include <string.h>

enum
{
    ISLANDS = 7,
    MAX_ITERATIONS = 200,
    /// For telling how far it is; 7 are usual.
    USUAL_ITERATIONS = 8,
    ROWS_A_REPORT = 32
};

typedef struct Island
{
    /// In channel heights.
    float x, y, length, breadth, phase;
} Island;

typedef struct Channel
{
    /// Width over height of the domain.
    float aspect;
    bool stone;
    float phase[6];
    int island_count;
    Island islands[ISLANDS];
} Channel;

typedef struct Grid Grid;

/// One grid: corners (width + 1) x (height + 1).
struct Grid
{
    int width, height, columns, rows;
    /// Corner -> unknown; corners of one piece of land share one. Unknown 0 is the top bank, 1 the bottom bank.
    int *unknown;
    int unknown_count;
    /// Friction on the edge from a corner to the right and downwards.
    float *right, *down;
    /// By unknown: the solution; of the conjugate gradients; of a cycle; and how many corners it has.
    double *psi, *residual, *direction, *product, *diagonal, *source, *correction, *corners;
    /// NULL for the coarsest.
    Grid *coarse;
    /// What part of the whole work is done before this grid's, and with it.
    double from, to;
};

/// `part` of a grid's own work is done.
static RfResult report(const Grid *grid, double part)
{
    return rf_progress("finding the river's flow", grid->from + (grid->to - grid->from) * part);
}

static float bank_offset(const Channel *channel, float x, int side)
{
    const float *phase = channel->phase + 3 * side;
    return 0.13f + 0.06f * sinf(2.9f * x + phase[0]) + 0.03f * sinf(6.7f * x + phase[1]) +
           0.012f * sinf(15.0f * x + phase[2]);
}

/// Approximate distance to an island's shore, negative on it. x and y in channel heights.
static float island_distance(const Island *island, float x, float y)
{
    float dx = (x - island->x) / island->length, dy = (y - island->y) / island->breadth;
    float r = sqrtf(dx * dx + dy * dy), angle = atan2f(dy, dx);
    float wobble = 1 + 0.09f * sinf(2 * angle + island->phase) + 0.06f * sinf(3 * angle + 2 * island->phase);
    return (r - wobble) * fminf(island->length, island->breadth);
}

/// Distance to the nearest land, in channel heights, negative on land: -1 banks count as well.
static float land_distance(const Channel *channel, float x, float y)
{
    float distance = INFINITY;
    if (!channel->stone)
        distance = fminf(y - bank_offset(channel, x, 0), 1 - bank_offset(channel, x, 1) - y);
    for (int i = 0; i < channel->island_count; ++i)
        distance = fminf(distance, island_distance(&channel->islands[i], x, y));
    return distance;
}

/// True if the island keeps clear of the banks and the others.
static bool island_fits(const Channel *channel, const Island *island)
{
    float room = 0.07f;
    if (island->y - island->breadth < bank_offset(channel, island->x, 0) + room ||
        island->y + island->breadth > 1 - bank_offset(channel, island->x, 1) - room)
        return false;
    for (int i = 0; i < channel->island_count; ++i)
    {
        const Island *other = &channel->islands[i];
        float dx = (island->x - other->x) / (island->length + other->length + 2 * room);
        float dy = (island->y - other->y) / (island->breadth + other->breadth + room);
        if (dx * dx + dy * dy < 1)
            return false;
    }
    return true;
}

static void place_islands(Channel *channel, uint64_t seed)
{
    int wanted = rf_clamp_int((int)lroundf(3 * channel->aspect), 1, ISLANDS);
    for (uint64_t item = 0; item < 400 && channel->island_count < wanted; ++item)
    {
        float size = 0.035f + 0.05f * rf_random_float(seed, 1, item, 2);
        Island island = {.x = channel->aspect * (0.08f + 0.84f * rf_random_float(seed, 1, item, 0)),
                         .y = 0.15f + 0.7f * rf_random_float(seed, 1, item, 1),
                         .length = size * (1.2f + 1.4f * rf_random_float(seed, 1, item, 3)),
                         .breadth = size,
                         .phase = 2 * RF_PI * rf_random_float(seed, 1, item, 4)};
        if (island_fits(channel, &island))
            channel->islands[channel->island_count++] = island;
    }
}

static Channel make_channel(const RfParameters *parameters)
{
    uint64_t seed = (uint64_t)rf_parameter(parameters, "seed");
    Channel channel = {.aspect = (float)parameters->width / (float)parameters->height,
                       .stone = rf_parameter(parameters, "stone") != 0};
    for (int i = 0; i < 6; ++i)
        channel.phase[i] = 2 * RF_PI * rf_random_float(seed, 0, (uint64_t)i, 0);
    if (channel.stone)
    {
        float radius = 0.13f * fminf(1, channel.aspect);
        channel.islands[channel.island_count++] = (Island){0.4f * channel.aspect, 0.5f, radius, radius, 0};
    }
    else
        place_islands(&channel, seed);
    return channel;
}

/// The stone is round: no wobble.
static float distance_at(const Channel *channel, float x, float y)
{
    if (!channel->stone)
        return land_distance(channel, x, y);
    const Island *stone = &channel->islands[0];
    return hypotf(x - stone->x, y - stone->y) - stone->length;
}

static bool is_land(const Channel *channel, const Grid *grid, int i, int j)
{
    float scale = 1 / (float)grid->height;
    return distance_at(channel, ((float)i + 0.5f) * scale, ((float)j + 0.5f) * scale) < 0;
}

/// Everything but what a velocity is read from.
static void free_solver(Grid *grid)
{
    void *blocks[] = {grid->right,    grid->down,   grid->residual,   grid->direction, grid->product,
                      grid->diagonal, grid->source, grid->correction, grid->corners};
    for (size_t i = 0; i < sizeof blocks / sizeof blocks[0]; ++i)
        rf_release(blocks[i]);
    grid->right = grid->down = NULL;
    grid->residual = grid->direction = grid->product = grid->diagonal = NULL;
    grid->source = grid->correction = grid->corners = NULL;
}

static void free_grid(Grid *grid)
{
    while (grid)
    {
        Grid *coarse = grid->coarse;
        free_solver(grid);
        rf_release(grid->unknown);
        rf_release(grid->psi);
        rf_release(grid);
        grid = coarse;
    }
}

static RfResult allocate_arrays(Grid *grid)
{
    size_t corners = (size_t)grid->columns * (size_t)grid->rows, unknowns = corners + 2;
    grid->unknown = rf_allocate(corners, sizeof(int));
    grid->right = rf_allocate_zero(corners, sizeof(float));
    grid->down = rf_allocate_zero(corners, sizeof(float));
    double **vectors[] = {&grid->psi,      &grid->residual, &grid->direction,  &grid->product,
                          &grid->diagonal, &grid->source,   &grid->correction, &grid->corners};
    bool made = grid->unknown && grid->right && grid->down;
    for (size_t i = 0; i < sizeof vectors / sizeof vectors[0]; ++i)
    {
        *vectors[i] = rf_allocate_zero(unknowns, sizeof(double));
        made = made && *vectors[i];
    }
    return made ? RF_OK : RF_OUT_OF_MEMORY;
}

/// Joins the corners of each land cell; `parent` is a forest in which a root is its own parent.
static int find_root(int *parent, int k)
{
    while (parent[k] != k)
        k = parent[k] = parent[parent[k]];
    return k;
}

static void join(int *parent, int a, int b)
{
    int root_a = find_root(parent, a), root_b = find_root(parent, b);
    // The smaller number wins, so that a bank's root is its first corner.
    if (root_a < root_b)
        parent[root_b] = root_a;
    else
        parent[root_a] = root_b;
}

static void join_row(const Channel *channel, const Grid *grid, int j, int *parent)
{
    for (int i = 0; i < grid->width; ++i)
        if (is_land(channel, grid, i, j))
        {
            int k = j * grid->columns + i;
            join(parent, k, k + 1);
            join(parent, k, k + grid->columns);
            join(parent, k, k + grid->columns + 1);
        }
}

static RfResult number_unknowns(const Channel *channel, Grid *grid)
{
    int corners = grid->columns * grid->rows, bottom = corners - grid->columns;
    int *parent = rf_allocate((size_t)corners, sizeof(int));
    if (!parent)
        return RF_OUT_OF_MEMORY;
    for (int k = 0; k < corners; ++k)
        parent[k] = k < grid->columns ? 0 : k >= bottom ? bottom : k;
    RfResult result = RF_OK;
    for (int j = 0; j < grid->height && result == RF_OK; ++j)
    {
        join_row(channel, grid, j, parent);
        if (j % ROWS_A_REPORT == 0)
            result = report(grid, 0.2 * j / grid->height);
    }
    int bottom_root = find_root(parent, bottom);
    grid->unknown_count = 2;
    for (int k = 0; k < corners; ++k)
    {
        int root = find_root(parent, k);
        // A root is the first corner of its tree but for the bottom's, which keeps its fixed number.
        grid->unknown[k] = root == 0             ? 0
                           : root == bottom_root ? 1
                           : root == k           ? grid->unknown_count++
                                                 : grid->unknown[root];
    }
    rf_release(parent);
    return result;
}

/// Friction 1 in the middle of the water and seven times that at land.
static float friction(const Channel *channel, float x, float y)
{
    float depth = rf_clamp(distance_at(channel, x, y) / 0.11f, 0, 1);
    return 1 / (0.14f + 0.86f * depth * (2 - depth));
}

static RfResult set_edges(const Channel *channel, Grid *grid)
{
    float scale = 1 / (float)grid->height;
    for (int j = 0; j < grid->rows; ++j)
    {
        if (j % ROWS_A_REPORT == 0)
            RF_TRY(report(grid, 0.2 + 0.3 * j / grid->rows));
        for (int i = 0; i < grid->columns; ++i)
        {
            size_t k = (size_t)j * (size_t)grid->columns + (size_t)i;
            // Edges along the left and right border have half a cell on their side.
            float half = i == 0 || i == grid->width ? 0.5f : 1;
            if (i < grid->width)
                grid->right[k] = friction(channel, ((float)i + 0.5f) * scale, (float)j * scale);
            if (j < grid->height)
                grid->down[k] = half * friction(channel, (float)i * scale, ((float)j + 0.5f) * scale);
        }
    }
    return RF_OK;
}

/// out = A x; rows of the two banks, whose psi is given, are 0. Edges within a piece of land add nothing.
static void apply(const Grid *grid, const double *x, double *out)
{
    memset(out, 0, (size_t)grid->unknown_count * sizeof *out);
    for (int j = 0; j < grid->rows; ++j)
        for (int i = 0; i < grid->columns; ++i)
        {
            int k = j * grid->columns + i, a = grid->unknown[k];
            if (i < grid->width)
            {
                int b = grid->unknown[k + 1];
                double flux = (double)grid->right[k] * (x[a] - x[b]);
                out[a] += flux;
                out[b] -= flux;
            }
            if (j < grid->height)
            {
                int b = grid->unknown[k + grid->columns];
                double flux = (double)grid->down[k] * (x[a] - x[b]);
                out[a] += flux;
                out[b] -= flux;
            }
        }
    out[0] = out[1] = 0;
}

static void find_diagonal(Grid *grid)
{
    for (int j = 0; j < grid->rows; ++j)
        for (int i = 0; i < grid->columns; ++i)
        {
            int k = j * grid->columns + i, a = grid->unknown[k];
            int right = i < grid->width ? grid->unknown[k + 1] : a;
            int down = j < grid->height ? grid->unknown[k + grid->columns] : a;
            double across = right != a ? (double)grid->right[k] : 0, along = down != a ? (double)grid->down[k] : 0;
            grid->diagonal[a] += across + along;
            grid->diagonal[right] += across;
            grid->diagonal[down] += along;
        }
}

/// The four unknowns of the coarse grid round a fine corner, and their weights.
typedef struct Stencil
{
    int unknown[4];
    double weight[4];
} Stencil;

static Stencil stencil_at(const Grid *grid, int i, int j)
{
    const Grid *coarse = grid->coarse;
    double x = (double)i * coarse->width / grid->width, y = (double)j * coarse->height / grid->height;
    int a = rf_min_int((int)x, coarse->width - 1), b = rf_min_int((int)y, coarse->height - 1);
    double s = x - a, t = y - b;
    const int *corner = coarse->unknown + b * coarse->columns + a;
    return (Stencil){{corner[0], corner[1], corner[coarse->columns], corner[coarse->columns + 1]},
                     {(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t}};
}

/// fine += P coarse: an unknown gets the mean of what is interpolated to its corners.
static void prolong(const Grid *grid, const double *coarse, double *fine)
{
    for (int j = 0; j < grid->rows; ++j)
        for (int i = 0; i < grid->columns; ++i)
        {
            int u = grid->unknown[j * grid->columns + i];
            Stencil stencil = stencil_at(grid, i, j);
            double sum = 0;
            for (int k = 0; k < 4; ++k)
                sum += stencil.weight[k] * coarse[stencil.unknown[k]];
            fine[u] += sum / grid->corners[u];
        }
}

/// coarse = transpose of P, times fine; the given banks stay 0.
static void restrict_to_coarse(const Grid *grid, const double *fine, double *coarse)
{
    memset(coarse, 0, (size_t)grid->coarse->unknown_count * sizeof *coarse);
    for (int j = 0; j < grid->rows; ++j)
        for (int i = 0; i < grid->columns; ++i)
        {
            int u = grid->unknown[j * grid->columns + i];
            double share = fine[u] / grid->corners[u];
            Stencil stencil = stencil_at(grid, i, j);
            for (int k = 0; k < 4; ++k)
                coarse[stencil.unknown[k]] += stencil.weight[k] * share;
        }
    coarse[0] = coarse[1] = 0;
}

/// Damped Jacobi sweeps on A correction = source.
static void smooth(Grid *grid, int sweeps)
{
    for (; sweeps > 0; --sweeps)
    {
        apply(grid, grid->correction, grid->product);
        for (int u = 2; u < grid->unknown_count; ++u)
            grid->correction[u] += 0.8 / grid->diagonal[u] * (grid->source[u] - grid->product[u]);
    }
}

/// correction = about the inverse of A times source: symmetric, so that it may precondition. Uses `product`.
static void cycle(Grid *grid)
{
    memset(grid->correction, 0, (size_t)grid->unknown_count * sizeof *grid->correction);
    if (!grid->coarse)
    {
        smooth(grid, 60);
        return;
    }
    smooth(grid, 2);
    apply(grid, grid->correction, grid->product);
    for (int u = 2; u < grid->unknown_count; ++u)
        grid->product[u] = grid->source[u] - grid->product[u];
    grid->product[0] = grid->product[1] = 0;
    restrict_to_coarse(grid, grid->product, grid->coarse->source);
    cycle(grid->coarse);
    prolong(grid, grid->coarse->correction, grid->correction);
    grid->correction[0] = grid->correction[1] = 0;
    smooth(grid, 2);
}

static double dot(const Grid *grid, const double *a, const double *b)
{
    double sum = 0;
    for (int u = 2; u < grid->unknown_count; ++u)
        sum += a[u] * b[u];
    return sum;
}

/// source = residual, then a cycle; returns residual . correction.
static double precondition(Grid *grid)
{
    memcpy(grid->source, grid->residual, (size_t)grid->unknown_count * sizeof *grid->source);
    cycle(grid);
    return dot(grid, grid->residual, grid->correction);
}

/// Conjugate gradients from the psi that is there, until its error is about a millionth of the flow.
static RfResult solve(Grid *grid)
{
    size_t bytes = (size_t)grid->unknown_count * sizeof(double);
    apply(grid, grid->psi, grid->residual);
    for (int u = 0; u < grid->unknown_count; ++u)
        grid->residual[u] = -grid->residual[u];
    double weight = precondition(grid), enough = 1e-12 * grid->width / (double)grid->height;
    memcpy(grid->direction, grid->correction, bytes);
    for (int iteration = 0; iteration < MAX_ITERATIONS && weight > enough; ++iteration)
    {
        RF_TRY(report(grid, 0.5 + 0.5 * rf_min_int(iteration, USUAL_ITERATIONS) / USUAL_ITERATIONS));
        apply(grid, grid->direction, grid->product);
        double step = weight / dot(grid, grid->direction, grid->product);
        for (int u = 2; u < grid->unknown_count; ++u)
        {
            grid->psi[u] += step * grid->direction[u];
            grid->residual[u] -= step * grid->product[u];
        }
        double next = precondition(grid);
        for (int u = 2; u < grid->unknown_count; ++u)
            grid->direction[u] = grid->correction[u] + next / weight * grid->direction[u];
        weight = next;
    }
    return RF_OK;
}

/// First guess from the coarser grid, or, without one, a straight flow.
static void guess(Grid *grid)
{
    for (int k = 0; k < grid->columns * grid->rows; ++k)
        grid->corners[grid->unknown[k]] += 1;
    if (grid->coarse)
        prolong(grid, grid->coarse->psi, grid->psi);
    else
        for (int k = 0; k < grid->columns * grid->rows; ++k)
            grid->psi[grid->unknown[k]] = (double)(k / grid->columns) / grid->height;
    grid->psi[0] = 0;
    grid->psi[1] = 1;
}

/// Solves on a grid of this size, coarser ones first.
static RfResult solve_grid(const Channel *channel, int width, int height, double to, Grid **out)
{
    Grid *grid = rf_allocate_zero(1, sizeof *grid);
    if (!grid)
        return RF_OUT_OF_MEMORY;
    *grid = (Grid){.width = width, .height = height, .columns = width + 1, .rows = height + 1, .to = to};
    RfResult result = RF_OK;
    if (rf_min_int(width, height) >= 32)
    {
        // A quarter of the cells.
        grid->from = 0.25 * to;
        result = solve_grid(channel, width / 2, height / 2, grid->from, &grid->coarse);
    }
    if (result == RF_OK)
        result = allocate_arrays(grid);
    if (result == RF_OK)
        result = number_unknowns(channel, grid);
    if (result == RF_OK)
        result = set_edges(channel, grid);
    if (result == RF_OK)
    {
        find_diagonal(grid);
        guess(grid);
        result = solve(grid);
    }
    if (result == RF_OK)
        *out = grid;
    else
        free_grid(grid);
    return result;
}

/// Velocity of a cell's middle from the psi of its corners: u = -psi_y, v = psi_x with psi falling downwards.
static RfVec2 cell_velocity(const Grid *grid, int i, int j)
{
    const int *corner = grid->unknown + j * grid->columns + i;
    double a = grid->psi[corner[0]], b = grid->psi[corner[1]];
    double c = grid->psi[corner[grid->columns]], d = grid->psi[corner[grid->columns + 1]];
    return (RfVec2){(float)(0.5 * (c + d - a - b)), (float)(0.5 * (a + c - b - d))};
}

static RfResult draw(const RfParameters *parameters, void *state, int moment, RfFlowField *field)
{
    (void)moment;
    const Grid *grid = state;
    RF_TRY(rf_flow_field_add_mask(field));
    Channel channel = make_channel(parameters);
    float greatest = 0;
    for (int j = 0; j < grid->height; ++j)
        for (int i = 0; i < grid->width; ++i)
        {
            size_t k = (size_t)j * (size_t)grid->width + (size_t)i;
            RfVec2 v = cell_velocity(grid, i, j);
            field->mask[k] = !is_land(&channel, grid, i, j);
            field->velocity[2 * k] = v.x;
            field->velocity[2 * k + 1] = v.y;
            greatest = fmaxf(greatest, rf_vec2_length(v));
        }
    float scale = greatest > 0 ? (float)rf_parameter(parameters, "speed") / greatest : 0;
    for (size_t k = 0; k < 2 * (size_t)grid->width * (size_t)grid->height; ++k)
        field->velocity[k] *= scale;
    return RF_OK;
}

static RfResult create(const RfParameters *parameters, void **state)
{
    Channel channel = make_channel(parameters);
    Grid *grid;
    RF_TRY(solve_grid(&channel, parameters->width, parameters->height, 1, &grid));
    free_grid(grid->coarse);
    grid->coarse = NULL;
    free_solver(grid);
    *state = grid;
    return RF_OK;
}

static void destroy(void *state)
{
    free_grid(state);
}

const RfSceneClass rf_scene_river = {
    .name = "river",
    .defaults = "size=512x256&speed=2&seed=1&stone=0",
    .ranges = (const RfParameterRange[]){{"size", RF_PARAMETER_SIZE, 16, 2048},
                                         {"speed", RF_PARAMETER_NUMBER, 0, 1000},
                                         {"seed", RF_PARAMETER_INTEGER, 0, 4294967295.0},
                                         {"stone", RF_PARAMETER_INTEGER, 0, 1},
                                         {0}},
    .sentence =
        "A steady river from left to right between wavy banks and round islands, slower at the shores; stone=1: "
        "one round stone and no banks.",
    .most_aspect = 16,
    .moment_count = 1,
    .create = create,
    .draw = draw,
    .destroy = destroy,
};
