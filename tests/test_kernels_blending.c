// SPDX-License-Identifier: Apache-2.0
// The drawing of grids into a tile, against the same in plain double arithmetic, pixel by pixel and triangle by
// triangle.
#include "core/maths.h"
#include "core/random.h"
#include "core/simd.h"
#include "kernels/blending.h"
#include "kernels/resolving.h"
#include "riffle/base.h"
#include "support/files.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

enum
{
    VERTICES = 8,
    TEXTURE_SIDE = 48,
    QUADS = 2,
    PIXELS = RF_TILE_ROWS * RF_TILE_COLUMNS
};

typedef struct TestGrid
{
    float x[VERTICES * VERTICES], y[VERTICES * VERTICES], quality[VERTICES * VERTICES];
    RfDrawGrid draw;
} TestGrid;

static RfTexture make_texture(bool tiles)
{
    static float pixels[TEXTURE_SIDE * TEXTURE_SIDE * QUADS * 4];
    for (size_t k = 0; k < TEXTURE_SIDE * TEXTURE_SIDE * QUADS * 4; ++k)
        pixels[k] = rf_random_float(1, 0, k, 0) - 0.5f;
    RfTexture texture;
    assert_int_equal(rf_texture_create(pixels, TEXTURE_SIDE, TEXTURE_SIDE, QUADS, tiles, &texture), RF_OK);
    return texture;
}

static RfDrawJob make_job(const RfTexture *texture, float sharpness)
{
    return (RfDrawJob){
        .texture = texture, .sharpness = sharpness, .area = {{0, 0}, 1, 1, RF_TILE_COLUMNS, RF_TILE_ROWS}};
}

// Vertices move by up to `bend` cells.
static void make_grid(TestGrid *g, RfVec2 centre, float radius, float bend, uint64_t seed)
{
    float cell = 2.6f * radius / (VERTICES - 1);
    RfDrawGrid *d = &g->draw;
    *d = (RfDrawGrid){.x = g->x,
                      .y = g->y,
                      .quality = g->quality,
                      .n = VERTICES,
                      .u0 = 5.3f,
                      .v0 = 20.8f,
                      .cell = cell,
                      .stretch = {1, 0, 0, 1},
                      .centre = centre,
                      .radius = 1.1f * radius,
                      .fade = 0.7f,
                      .turn_cos = 1,
                      .id = (uint32_t)seed};
    for (int k = 0; k < VERTICES * VERTICES; ++k)
    {
        uint64_t item = (uint64_t)k;
        g->x[k] = centre.x + cell * ((float)(k % VERTICES) - 3.5f + bend * (2 * rf_random_float(seed, 1, item, 0) - 1));
        g->y[k] = centre.y + cell * ((float)(k / VERTICES) - 3.5f + bend * (2 * rf_random_float(seed, 1, item, 1) - 1));
        g->quality[k] = bend > 0 ? 0.3f + 0.7f * rf_random_float(seed, 1, item, 2) : 1;
    }
    d->x0 = centre.x - d->radius;
    d->x1 = centre.x + d->radius;
    d->y0 = centre.y - d->radius;
    d->y1 = centre.y + d->radius;
}

// ---- the slow, obvious form

// u, v and K_g K_d at a point of the frame; false outside the grid.
static bool find_point(const RfDrawGrid *g, double px, double py, double value[3])
{
    int n = g->n;
    for (int t = 0; t < 2 * (n - 1) * (n - 1); ++t)
    {
        int i = t / 2 % (n - 1), j = t / 2 / (n - 1), a = j * n + i;
        const int corner[3] = {t % 2 ? a + n + 1 : a, t % 2 ? a + n : a + 1, t % 2 ? a + 1 : a + n};
        double x[3], y[3];
        for (int k = 0; k < 3; ++k)
        {
            x[k] = (double)g->x[corner[k]] - px;
            y[k] = (double)g->y[corner[k]] - py;
        }
        double w[3] = {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
        double sum = w[0] + w[1] + w[2];
        if (sum == 0 || w[0] / sum < 0 || w[1] / sum < 0 || w[2] / sum < 0)
            continue;
        value[0] = value[1] = value[2] = 0;
        for (int k = 0; k < 3; ++k)
        {
            int ci = corner[k] % n, cj = corner[k] / n;
            bool border = ci == 0 || cj == 0 || ci == n - 1 || cj == n - 1;
            value[0] += w[k] / sum * ((double)g->u0 + ci * (double)g->cell);
            value[1] += w[k] / sum * ((double)g->v0 + cj * (double)g->cell);
            value[2] += w[k] / sum * (border ? 0 : (double)g->quality[corner[k]]);
        }
        return true;
    }
    return false;
}

static double sample(const RfTexture *texture, int n, double u, double v, int lane)
{
    const RfTextureLevel *level = &texture->levels[n];
    const float *plane = level->texels + (size_t)(lane / 4) * rf_texture_plane(level) + lane % 4;
    double s = (u - 0.5) * (double)level->scale_x, t = (v - 0.5) * (double)level->scale_y, sum = 0;
    int i = (int)floor(s), j = (int)floor(t);
    for (int k = 0; k < 4; ++k)
    {
        int x = i + k % 2, y = j + k / 2;
        x = texture->tiles ? rf_wrap_int(x, level->width) : rf_clamp_int(x, 0, level->width - 1);
        y = texture->tiles ? rf_wrap_int(y, level->height) : rf_clamp_int(y, 0, level->height - 1);
        sum += (k % 2 ? s - i : 1 - s + i) * (k / 2 ? t - j : 1 - t + j) *
               (double)plane[((size_t)y * (size_t)level->stride + (size_t)x) * 4];
    }
    return sum;
}

typedef struct SlowSums
{
    double weight[PIXELS], weight2[PIXELS], colour[4 * QUADS][PIXELS], u[PIXELS], v[PIXELS];
} SlowSums;

static SlowSums g_slow;

static void draw_slowly(const RfDrawJob *job, const RfDrawGrid *g, int level)
{
    for (int p = 0; p < PIXELS; ++p)
    {
        int i = p % RF_TILE_COLUMNS, j = p / RF_TILE_COLUMNS;
        double x = (double)job->area.origin.x + (i + 0.5) * (double)job->area.spacing,
               y = (double)job->area.origin.y + (j + 0.5) * (double)job->area.spacing, value[3];
        double kernel = 1 - hypot(x - (double)g->centre.x, y - (double)g->centre.y) / (double)g->radius;
        if (i >= job->area.width || j >= job->area.height || kernel <= 0 || !find_point(g, x, y, value))
            continue;
        double w = pow(kernel, (double)job->sharpness) * value[2] * (double)g->fade;
        g_slow.weight[p] += w;
        g_slow.weight2[p] += w * w;
        g_slow.u[p] = value[0];
        g_slow.v[p] = value[1];
        for (int lane = 0; lane < 4 * QUADS; ++lane)
            g_slow.colour[lane][p] += w * sample(job->texture, level, value[0], value[1], lane);
    }
}

static void assert_sums_equal(const RfTileSums *sums, double tolerance)
{
    double total = 0;
    for (int p = 0; p < PIXELS; ++p)
    {
        assert_true(fabs((double)sums->weight[p] - g_slow.weight[p]) < tolerance);
        assert_true(fabs((double)sums->weight2[p] - g_slow.weight2[p]) < tolerance);
        for (int lane = 0; lane < 4 * QUADS; ++lane)
            assert_true(fabs((double)sums->colour[((size_t)(lane / 4) * PIXELS + (size_t)p) * 4 + (size_t)(lane % 4)] -
                             g_slow.colour[lane][p]) < tolerance);
        total += g_slow.weight[p];
    }
    assert_true(total > 10);
}

// ---- tests

static void check_drawing(float bend, float sharpness, bool tiles, float spacing, int bias, double tolerance)
{
    RfArena arena = {0};
    RfTileSums sums;
    RfTexture texture = make_texture(tiles);
    RfDrawJob job = make_job(&texture, sharpness);
    job.area.spacing = job.area.row_spacing = spacing;
    job.level_bias = bias;
    job.area.origin = (RfVec2){-3, 10};
    job.area.width = RF_TILE_COLUMNS - 5;
    job.area.height = RF_TILE_ROWS - 9;
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    memset(&g_slow, 0, sizeof g_slow);
    // One in the middle, one across two borders of the tile, one in a corner, one out of sight.
    static const RfVec2 centres[] = {{61.3f, 40.7f}, {120, 66}, {-4, 13}, {1e6f, 40}};
    int64_t samples = 0;
    static TestGrid grids[4];
    for (int i = 0; i < 4; ++i)
    {
        make_grid(&grids[i], centres[i], 22, bend, 7 + (uint64_t)i);
        rf_tile_draw(&job, &grids[i].draw, &sums, NULL, &samples);
        draw_slowly(&job, &grids[i].draw, bias);
    }
    assert_sums_equal(&sums, tolerance);
    int64_t drawn = 0;
    for (int p = 0; p < PIXELS; ++p)
        drawn += g_slow.weight[p] > 0;
    assert_true(samples >= drawn && samples < 2 * drawn);
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

static void undeformed_grids_are_drawn_as_the_slow_form_draws_them(void **state)
{
    (void)state;
    check_drawing(0, 1, true, 1, 0, 2e-4);
    check_drawing(0, 2, true, 1, 0, 2e-4);
    check_drawing(0, 2, false, 1, 0, 2e-4);
}

static void any_sharpness_is_within_a_thousandth(void **state)
{
    (void)state;
    check_drawing(0, 0.25f, true, 1, 0, 1e-3);
    check_drawing(0, 3.7f, true, 1, 0, 1e-3);
    check_drawing(0, 12, true, 1, 0, 1e-3);
}

static void triangles_that_share_edges_leave_no_hole_and_draw_no_pixel_twice(void **state)
{
    (void)state;
    // A hole would lack a pixel's whole weight, a pixel drawn twice would have it twice; both are up to 0.7 here.
    check_drawing(0.2f, 1, true, 1, 0, 5e-4);
    check_drawing(0.2f, 2, false, 1, 0, 5e-4);
}

static void grids_of_large_cells_are_drawn_so_from_every_fourth_row(void **state)
{
    (void)state;
    static RfRasterPlanes planes;
    static RfTileLayer layers[PIXELS];
    static TestGrid g;
    RfTexture texture = make_texture(true);
    RfDrawJob job = make_job(&texture, 1);
    // How much each corner moves by, and what that may do to coordinates, in exemplar pixels: rows of an undeformed
    // grid lie exactly between others.
    static const struct
    {
        float bend;
        double greatest, mean;
    } cases[] = {{0, 1e-3, 1e-4}, {0.1f, 0.6, 0.06}};
    for (int c = 0; c < 2; ++c)
    {
        make_grid(&g, (RfVec2){61.3f, 30.7f}, 40, cases[c].bend, 11);
        memset(&g_slow, 0, sizeof g_slow);
        memset(layers, 0, sizeof layers);
        draw_slowly(&job, &g.draw, 0);
        rf_tile_layers(&job, &g.draw, &planes, layers);
        double greatest = 0, sum = 0, weights = 0, greatest_weight = 0;
        int count = 0;
        for (int p = 0; p < PIXELS; ++p)
        {
            double weight = fabs((double)layers[p].total - g_slow.weight[p]);
            greatest_weight = weight > greatest_weight ? weight : greatest_weight;
            weights += weight;
            if (!(g_slow.weight[p] > 0.02))
                continue;
            double error = hypot((double)layers[p].u[0] - g_slow.u[p], (double)layers[p].v[0] - g_slow.v[p]);
            greatest = error > greatest ? error : greatest;
            sum += error;
            ++count;
        }
        print_message(
            "corners moved by %.1f cells: coordinates off by at most %.4f px, %.4f in the mean; weights by at "
            "most %.4f, %.5f\n",
            (double)cases[c].bend, greatest, sum / count, greatest_weight, weights / PIXELS);
        assert_true(count > 3000 && greatest < cases[c].greatest && sum / count < cases[c].mean);
        assert_true(greatest_weight < 0.05 && weights / PIXELS < 2e-3);
    }
    rf_texture_free(&texture);
}

static void vertices_on_pixel_centres_leave_no_hole(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfTileSums sums;
    RfTexture texture = make_texture(true);
    RfDrawJob job = make_job(&texture, 1);
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    TestGrid g;
    make_grid(&g, (RfVec2){60, 32}, 22, 0, 1);
    // Every edge runs through pixel centres.
    for (int k = 0; k < VERTICES * VERTICES; ++k)
    {
        g.x[k] = 32.5f + 8 * (float)(k % VERTICES);
        g.y[k] = 4.5f + 8 * (float)(k / VERTICES);
    }
    g.draw.cell = 8;
    int64_t samples = 0;
    memset(&g_slow, 0, sizeof g_slow);
    rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
    draw_slowly(&job, &g.draw, 0);
    assert_sums_equal(&sums, 2e-4);
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

static void a_coarser_spacing_draws_the_coarser_level(void **state)
{
    (void)state;
    check_drawing(0, 2, true, 2, 1, 2e-4);
    check_drawing(0.2f, 1, false, 2, 1, 5e-4);
    check_drawing(0, 1, true, 4, 2, 2e-4);
}

static void layers_are_the_strongest_grids_with_their_coordinates(void **state)
{
    (void)state;
    RfTexture texture = make_texture(true);
    RfDrawJob job = make_job(&texture, 2);
    static RfRasterPlanes planes;
    static RfTileLayer layers[PIXELS];
    static SlowSums single[6];
    static TestGrid grids[6];
    memset(layers, 0, sizeof layers);
    for (int i = 0; i < 6; ++i)
    {
        make_grid(&grids[i], (RfVec2){50 + 4 * (float)i, 30 + 3 * (float)(i % 3)}, 20, 0.1f, 100 + (uint64_t)i);
        rf_tile_layers(&job, &grids[i].draw, &planes, layers);
        memset(&g_slow, 0, sizeof g_slow);
        draw_slowly(&job, &grids[i].draw, 0);
        memcpy(&single[i], &g_slow, sizeof g_slow);
    }
    int full = 0;
    for (int p = 0; p < PIXELS; ++p)
    {
        double total = 0;
        int present = 0;
        for (int i = 0; i < 6; ++i)
        {
            total += single[i].weight[p];
            present += single[i].weight[p] > 1e-3;
        }
        assert_true(fabs((double)layers[p].total - total) < 1e-3);
        for (int k = 0; k < 4; ++k)
        {
            float weight = layers[p].weight[k];
            assert_true(k == 0 || weight <= layers[p].weight[k - 1]);
            int stronger = 0;
            for (int i = 0; i < 6; ++i)
                stronger += single[i].weight[p] > (double)weight + 1e-3;
            assert_true(stronger <= k);
            if (weight < 1e-3f)
                continue;
            const SlowSums *own = &single[layers[p].id[k] - 100];
            assert_true(fabs(own->weight[p] - (double)weight) < 1e-3);
            assert_true(fabs(own->u[p] - (double)layers[p].u[k]) < 1e-3);
            assert_true(fabs(own->v[p] - (double)layers[p].v[k]) < 1e-3);
        }
        full += present > 4;
    }
    assert_true(full > 100);
    rf_texture_free(&texture);
}

static void the_lattice_holds_this_grids_weights_and_zero_elsewhere(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfTileSums sums;
    RfTexture texture = make_texture(true);
    RfDrawJob job = make_job(&texture, 1);
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    TestGrid g[2];
    float lattice[RF_LATTICE_POINTS];
    int64_t samples = 0;
    make_grid(&g[0], (RfVec2){60, 32}, 22, 0.1f, 1);
    make_grid(&g[1], (RfVec2){70, 30}, 15, 0.1f, 2);
    rf_tile_draw(&job, &g[0].draw, &sums, NULL, &samples);
    memset(lattice, 0xff, sizeof lattice);
    rf_tile_draw(&job, &g[1].draw, &sums, lattice, &samples);
    memset(&g_slow, 0, sizeof g_slow);
    draw_slowly(&job, &g[1].draw, 0);
    for (int k = 0; k < RF_LATTICE_POINTS; ++k)
    {
        int x = k % RF_LATTICE_COLUMNS * RF_LATTICE_STEP, y = k / RF_LATTICE_COLUMNS * RF_LATTICE_STEP;
        assert_true(fabs((double)lattice[k] - g_slow.weight[y * RF_TILE_COLUMNS + x]) < 5e-4);
    }
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

static void direction_maps_turn_with_the_grid(void **state)
{
    (void)state;
    static float pixels[TEXTURE_SIDE * TEXTURE_SIDE * QUADS * 4];
    for (int k = 0; k < TEXTURE_SIDE * TEXTURE_SIDE * QUADS * 4; ++k)
        pixels[k] = k % 4 == 0 ? 0.6f : k % 4 == 2 ? 0.8f : 0;
    RfTexture texture;
    assert_int_equal(rf_texture_create(pixels, TEXTURE_SIDE, TEXTURE_SIDE, QUADS, true, &texture), RF_OK);
    RfDrawJob job = make_job(&texture, 1);
    job.turned[0] = 1;
    job.turned[1] = 2;
    RfArena arena = {0};
    RfTileSums sums;
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    TestGrid g;
    make_grid(&g, (RfVec2){60, 32}, 22, 0, 1);
    // 30 degrees clockwise on the screen.
    g.draw.turn_cos = 0.8660254f;
    g.draw.turn_sin = 0.5f;
    int64_t samples = 0;
    rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
    size_t p = 30 * RF_TILE_COLUMNS + 58;
    const float *normal = sums.colour + 4 * p, *vector = sums.colour + 4 * (PIXELS + p);
    float w = sums.weight[p];
    assert_true(w > 0.5f);
    // x right, y up: it points down. x right, y down: down too.
    assert_true(fabsf(normal[0] / w - 0.5196f) < 1e-4f && fabsf(normal[1] / w + 0.3f) < 1e-4f);
    assert_true(fabsf(vector[0] / w - 0.5196f) < 1e-4f && fabsf(vector[1] / w - 0.3f) < 1e-4f);
    assert_true(fabsf(normal[2] / w - 0.8f) < 1e-4f);
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

// Draws what is wrong, then something sound: sums stay finite, and nothing is left over for the next grid.
static void folded_and_degenerate_grids_give_finite_sums_and_leave_nothing_behind(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfTileSums sums, sound;
    RfTexture texture = make_texture(true);
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sound), RF_OK);
    enum
    {
        CASES = 10
    };
    for (int c = 0; c < CASES; ++c)
    {
        RfDrawJob job = make_job(&texture, c % 2 ? 2.0f : 1.5f);
        TestGrid g;
        int64_t samples = 0;
        make_grid(&g, (RfVec2){60, 32}, 22, c == 0 ? 3.0f : 0, 1);
        for (int k = 0; k < VERTICES * VERTICES; ++k)
        {
            if (c == 1) // turned over
                g.x[k] = 120 - g.x[k];
            if (c == 2) // folded in the middle
                g.x[k] = 60 - fabsf(g.x[k] - 60);
            if (c == 3) // a line
                g.y[k] = g.x[k];
            if (c == 4) // a point
                g.x[k] = g.y[k] = 30;
            if (c == 5 && k % 9 == 0)
                g.x[k] = k % 2 ? 1e30f : -1e30f;
            if (c == 6 && k % 7 == 0)
                g.x[k] = g.y[k] = NAN;
            if (c == 7 && k % 7 == 0)
                g.y[k] = INFINITY;
            if (c == 8)
                g.y[k] += 1e-7f * g.x[k];
        }
        if (c == 9)
            g.draw.radius = 1e-3f;
        if (c == 4)
            memset(g.draw.stretch, 0, sizeof g.draw.stretch);
        if (c == 3)
            g.draw.stretch[0] = g.draw.stretch[3] = 1e-12f;
        rf_tile_clear(&sums, QUADS, RF_TILE_ROWS);
        rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
        for (int p = 0; p < PIXELS; ++p)
        {
            assert_true(isfinite(sums.weight[p]) && isfinite(sums.weight2[p]) && sums.weight[p] >= 0);
            for (int lane = 0; lane < 4 * QUADS; ++lane)
                assert_true(
                    isfinite(sums.colour[(size_t)p * 4 + (size_t)(lane % 4) + (size_t)(lane / 4) * PIXELS * 4]));
            assert_true(sums.weight[p] <= 1);
        }
        rf_tile_clear(&sums, QUADS, RF_TILE_ROWS);
        rf_tile_clear(&sound, QUADS, RF_TILE_ROWS);
        make_grid(&g, (RfVec2){64, 30}, 20, 0.1f, 2);
        rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
        rf_tile_draw(&job, &g.draw, &sound, NULL, &samples);
        assert_memory_equal(sums.weight, sound.weight, PIXELS * sizeof(float));
        assert_memory_equal(sums.colour, sound.colour, PIXELS * 4 * QUADS * sizeof(float));
    }
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

static void a_squeezed_grid_is_averaged_not_aliased(void **state)
{
    (void)state;
    RfArena arena = {0};
    RfTileSums sums;
    RfTexture texture = make_texture(true);
    RfDrawJob job = make_job(&texture, 1);
    assert_int_equal(rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums), RF_OK);
    // White noise; the picture of n by n pixels a pixel has a deviation of 1 / n; of n along one axis, 1 / sqrt(n).
    static const float squeeze[][2] = {{4, 1}, {1, 3}, {4, 4}};
    static const double greatest[] = {0.68, 0.75, 0.4};
    for (int c = 0; c < 3; ++c)
    {
        TestGrid g;
        int64_t samples = 0;
        make_grid(&g, (RfVec2){64, 32}, 25, 0, 1);
        g.draw.cell *= 4;
        for (int k = 0; k < VERTICES * VERTICES; ++k)
        {
            g.x[k] = 64 + (g.x[k] - 64) * 4 / squeeze[c][0];
            g.y[k] = 32 + (g.y[k] - 32) * 4 / squeeze[c][1];
        }
        g.draw.stretch[0] = 1 / squeeze[c][0];
        g.draw.stretch[3] = 1 / squeeze[c][1];
        rf_tile_clear(&sums, QUADS, RF_TILE_ROWS);
        rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
        double squares = 0, n = 0;
        for (int p = 0; p < PIXELS; ++p)
            for (int lane = 0; lane < 4 && sums.weight[p] > 0.2f; ++lane, n += 1)
                squares += pow((double)(sums.colour[4 * p + lane] / sums.weight[p]), 2);
        double deviation = sqrt(squares / n) / sqrt(1.0 / 12);
        print_message("squeezed %g x %g: deviation x %.2f\n", (double)squeeze[c][0], (double)squeeze[c][1], deviation);
        assert_true(n > 1000 && deviation < greatest[c]);
        assert_true(deviation > 0.7 / sqrt((double)(squeeze[c][0] * squeeze[c][1])));
    }
    rf_texture_free(&texture);
    rf_arena_free(&arena);
}

// ---- instruction sets

// Sums of some deformed grids, and what they resolve to, as numbers in a file.
static int dump(const char *path)
{
    RfArena arena = {0};
    RfTileSums sums;
    RfTexture texture = make_texture(true);
    FILE *file = fopen(path, "wb");
    if (!file || rf_tile_create(QUADS, RF_TILE_ROWS, &arena, &sums) != RF_OK)
        return 1;
    for (int turn = 0; turn < 3; ++turn)
    {
        RfDrawJob job = make_job(&texture, turn == 0 ? 1.0f : turn == 1 ? 2.0f : 3.3f);
        job.turned[1] = turn;
        int64_t samples = 0;
        rf_tile_clear(&sums, QUADS, RF_TILE_ROWS);
        for (uint64_t i = 0; i < 12; ++i)
        {
            TestGrid g;
            make_grid(&g, (RfVec2){15 * (float)i, 60 * rf_random_float(5, 0, i, 0)}, 20, i < 10 ? 0.2f : 1.5f, i);
            g.draw.turn_cos = 0.6f;
            g.draw.turn_sin = 0.8f;
            if (i % 4 == 3)
                g.draw.stretch[0] = 0.35f;
            rf_tile_draw(&job, &g.draw, &sums, NULL, &samples);
        }
        fwrite(sums.weight, sizeof(float), PIXELS, file);
        fwrite(sums.weight2, sizeof(float), PIXELS, file);
        fwrite(sums.colour, sizeof(float), PIXELS * 4 * QUADS, file);
    }
    rf_texture_free(&texture);
    rf_arena_free(&arena);
    return fclose(file);
}

static void run_child(const char *simd, const char *path)
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0)
    {
        setenv("RF_SIMD", simd, 1);
        execl("/proc/self/exe", "test_kernels_blending", "--dump", path, (char *)NULL);
        _exit(127);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

static void every_instruction_set_draws_the_same_within_1e_5(void **state)
{
    (void)state;
    if (rf_simd_level() == RF_SIMD_PLAIN)
    {
        print_message("skipped: this machine has the plain instruction set only\n");
        skip();
    }
    TestFolder folder = test_folder_make();
    static const char *const sets[] = {"plain", "avx2", "avx512"};
    float *numbers[3];
    size_t size = 0;
    for (int i = 0; i < 3; ++i)
    {
        const char *path = test_folder_file(&folder, sets[i]);
        run_child(sets[i], path);
        numbers[i] = (float *)test_file_read(path, &size);
        assert_int_equal(size, 3 * (2 + 4 * QUADS) * PIXELS * sizeof(float));
    }
    double greatest = 0;
    for (int i = 1; i < 3; ++i)
        for (size_t k = 0; k < size / sizeof(float); ++k)
            greatest = fmax(greatest, fabs((double)(numbers[i][k] - numbers[0][k])));
    print_message("%s against plain: at most %.1e apart\n", rf_simd_name(), greatest);
    assert_true(greatest < 1e-5);
    for (int i = 0; i < 3; ++i)
        free(numbers[i]);
    test_folder_remove(&folder);
}

// ---- resolving

static void resolved_weights_sum_to_one_their_squares_to_one_and_anything_between(void **state)
{
    (void)state;
    enum
    {
        COUNT = 37
    };
    float weight[COUNT], weight2[COUNT], rho[COUNT], sum[COUNT], norm[COUNT];
    for (int k = 0; k < COUNT; ++k)
    {
        float a = rf_random_float(1, 0, (uint64_t)k, 0), b = rf_random_float(1, 0, (uint64_t)k, 1) * (float)(k % 3);
        weight[k] = k == 5 ? 0 : a + b;
        weight2[k] = k == 5 ? 0 : a * a + b * b;
        rho[k] = k % 2 ? 0 : k % 4 ? 1.0f : 0.4f;
    }
    rf_resolve_scales(weight, weight2, rho, COUNT, sum, norm);
    for (int k = 0; k < COUNT; ++k)
    {
        if (k == 5)
        {
            assert_true(sum[k] == 0 && norm[k] == 0);
            continue;
        }
        float pairs = weight[k] * weight[k] - weight2[k];
        assert_true(fabsf(weight[k] * sum[k] - 1) < 1e-5f);
        assert_true(fabsf((weight2[k] + rho[k] * pairs) * norm[k] * norm[k] - 1) < 1e-4f);
        // Independent pictures: squares sum to one. Equal ones: the plain mean.
        if (rho[k] == 1)
            assert_true(fabsf(norm[k] - sum[k]) < 1e-3f * sum[k]);
    }
    RfResolveQuad quad = {{0.5f, 0.5f, 0.5f, 0.5f}, {0, 0, 0.4f, 0}, {1, 1, 1, 0.6f}, {0, 1, 0, 1}, false};
    float colour[4 * COUNT], values[4 * COUNT];
    for (int k = 0; k < 4 * COUNT; ++k)
        colour[k] = 2 * rf_random_float(2, 0, (uint64_t)k, 0) - 1;
    rf_resolve_row(colour, sum, norm, &quad, COUNT, values);
    for (int k = 0; k < 4 * COUNT; ++k)
    {
        int c = k % 4;
        float expected = quad.mean[c] + colour[k] * (quad.plain[c] > 0 ? sum[k / 4] : norm[k / 4]);
        expected = rf_clamp(expected, quad.low[c], quad.high[c]);
        assert_true(fabsf(values[k] - expected) < 1e-5f);
    }
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "--dump") == 0)
        return dump(argv[2]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(undeformed_grids_are_drawn_as_the_slow_form_draws_them),
        cmocka_unit_test(any_sharpness_is_within_a_thousandth),
        cmocka_unit_test(triangles_that_share_edges_leave_no_hole_and_draw_no_pixel_twice),
        cmocka_unit_test(grids_of_large_cells_are_drawn_so_from_every_fourth_row),
        cmocka_unit_test(vertices_on_pixel_centres_leave_no_hole),
        cmocka_unit_test(a_coarser_spacing_draws_the_coarser_level),
        cmocka_unit_test(layers_are_the_strongest_grids_with_their_coordinates),
        cmocka_unit_test(the_lattice_holds_this_grids_weights_and_zero_elsewhere),
        cmocka_unit_test(direction_maps_turn_with_the_grid),
        cmocka_unit_test(folded_and_degenerate_grids_give_finite_sums_and_leave_nothing_behind),
        cmocka_unit_test(a_squeezed_grid_is_averaged_not_aliased),
        cmocka_unit_test(every_instruction_set_draws_the_same_within_1e_5),
        cmocka_unit_test(resolved_weights_sum_to_one_their_squares_to_one_and_anything_between),
    };
    return cmocka_run_group_tests_name("blending", tests, NULL, NULL);
}
