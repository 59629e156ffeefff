// SPDX-License-Identifier: Apache-2.0
// Lagrangian texture advection: what holds for its grids, its weights and its pictures in any flow.
#include "data/flow_field.h"
#include "measure/judgement.h"
#include "methods/lagrangian/lagrangian.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    MAX_SIDE = 256,
    MAX_PIXELS = MAX_SIDE * MAX_SIDE
};

static float g_frame[16 * MAX_PIXELS], g_before[16 * MAX_PIXELS], g_layers[16 * MAX_PIXELS];
static float g_grey[2][MAX_PIXELS], g_displacement[2 * MAX_PIXELS], g_work[2 * MAX_PIXELS];

static RfImageView view_of(float *pixels, int width, int height, int channels)
{
    return (RfImageView){pixels, width, height, channels, width * channels};
}

static RfLagrangianOptions options_of(float radius, RfBlend blend)
{
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.particle_radius = radius;
    options.blend = blend;
    return options;
}

static RfLagrangian *make(const RfExemplar *exemplar, RfLagrangianOptions options)
{
    RfLagrangian *lagrangian = NULL;
    assert_int_equal(rf_lagrangian_create(exemplar, &options, &lagrangian), RF_OK);
    return lagrangian;
}

// Steps through frames first to last of a scene on side x side cells and pixels; the last one stays in `out`.
static void run(RfLagrangian *lagrangian, SceneFlow *flow, int side, int channels, int first, int last, float *out)
{
    SceneMoments moments = scene_moments(flow, side, side);
    RfImageView frame = view_of(out, side, side, channels);
    for (int f = first; f <= last; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        assert_int_equal(rf_lagrangian_stats(lagrangian).holes, 0);
    }
    scene_moments_free(&moments);
}

static RfExemplar *exemplar_of(const RfMapView *maps, int count, RfTiling tiling)
{
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(maps, count, tiling, &exemplar), RF_OK);
    return exemplar;
}

// ---- what is drawn of a constant

static void a_constant_exemplar_gives_a_constant_frame_however_it_is_blended(void **state)
{
    (void)state;
    static float pixels[20 * 16 * 3];
    for (int k = 0; k < 20 * 16 * 3; ++k)
        pixels[k] = 0.2f + 0.3f * (float)(k % 3);
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, 20, 16, 3, 60}, 1};
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
        for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
        {
            RfExemplar *exemplar = exemplar_of(&map, 1, (RfTiling)tiling);
            RfLagrangian *lagrangian = make(exemplar, options_of(tiling == RF_TILING_YES ? 12 : 0, (RfBlend)blend));
            run(lagrangian, scene_two_vortices, 64, 3, 1, 12, g_frame);
            for (int k = 0; k < 64 * 64 * 3; ++k)
                assert_true(fabsf(g_frame[k] - pixels[k % 3]) < 1e-7f);
            rf_lagrangian_destroy(lagrangian);
            rf_exemplar_destroy(exemplar);
        }
}

// ---- the distribution

static float distance(RfVec2 a, RfVec2 b)
{
    return hypotf(a.x - b.x, a.y - b.y);
}

// No two live particles nearer than (1 - alpha) d; every fluid pixel within d of one, or with a mask within d and a
// cell of the lattice that gaps are looked for on.
static void assert_maximal(const RfLagrangian *l, const RfFlowView *flow)
{
    static RfVec2 centres[MAX_PIXELS];
    int count = 0;
    for (int i = 0; i < l->count; ++i)
        if (!l->grids[i].retired)
            centres[count++] = l->grids[i].centre;
    for (int a = 0; a < count; ++a)
        for (int b = a + 1; b < count; ++b)
            assert_true(distance(centres[a], centres[b]) >= (1 - ALPHA) * l->radius - 1e-3f);
    float reach = l->radius * 1.0001f + (flow->mask ? 1.42f * fmaxf(l->radius / 24, 0.5f) : 0);
    float sx = (float)l->width / (float)flow->width, sy = (float)l->height / (float)flow->height;
    for (int y = 0; y < l->height; ++y)
        for (int x = 0; x < l->width; ++x)
        {
            RfVec2 p = {(float)x + 0.5f, (float)y + 0.5f};
            if (!rf_flow_inside(flow, p.x / sx, p.y / sy))
                continue;
            bool near = false;
            for (int i = 0; i < count && !near; ++i)
                near = distance(p, centres[i]) <= reach;
            assert_true(near);
        }
}

static void check_scene(RfFlow *flow, SceneMoments *scene, const RfExemplar *exemplar, int width, int height,
                        float radius)
{
    RfLagrangian *lagrangian = make(exemplar, options_of(radius, RF_BLEND_CONTRAST));
    RfImageView frame = view_of(g_frame, width, height, 3);
    int born = 0, retired = 0;
    int frames = TEST_SANITIZED ? 40 : 300;
    for (int f = 1; f <= frames; ++f)
    {
        RfFlowView view = {0};
        if (flow)
            assert_int_equal(rf_flow_at(flow, f, &view), RF_OK);
        else
            view = scene_step(scene, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        RfLagrangianStats stats = rf_lagrangian_stats(lagrangian);
        assert_int_equal(stats.holes, 0);
        assert_true(stats.live > 0 && stats.live + stats.fading == lagrangian->count);
        assert_maximal(lagrangian, &view);
        born += f > 1 ? stats.born : 0;
        retired += stats.retired;
    }
    assert_true(born > 20 && retired > 10);
    rf_lagrangian_destroy(lagrangian);
}

static void three_hundred_frames_have_no_hole_and_stay_maximal_without_crowds(void **state)
{
    (void)state;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    static const char *const flows[] = {"builtin:gyre?size=128x64", "builtin:cylinder?size=160x80",
                                        "builtin:river?size=160x80"};
    for (int i = 0; i < 3; ++i)
    {
        RfFlow *flow = NULL;
        assert_int_equal(rf_flow_open(flows[i], NULL, &flow), RF_OK);
        // Cells of 1.2 pixels: the shore is drawn between them.
        RfFlowInfo info = rf_flow_info(flow);
        check_scene(flow, NULL, exemplar, info.width * 6 / 5, info.height * 6 / 5, 16);
        rf_flow_close(flow);
    }
    SceneMoments scene = scene_moments(scene_two_vortices, 128, 128);
    check_scene(NULL, &scene, exemplar, 128, 128, 20);
    scene_moments_free(&scene);
    rf_exemplar_destroy(exemplar);
}

static void pixels_on_land_are_zero(void **state)
{
    (void)state;
    enum
    {
        N = 96
    };
    static uint8_t mask[N * N];
    for (int k = 0; k < N * N; ++k)
        mask[k] = hypot(k % N - 47.5, (double)(k / N) - 47.5) > 17;
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangian *lagrangian = make(exemplar, options_of(12, RF_BLEND_HISTOGRAM));
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfImageView frame = view_of(g_frame, N, N, 3);
    for (int f = 1; f <= 10; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        view.mask = mask;
        for (int k = 0; k < 3 * N * N; ++k)
            g_frame[k] = 77;
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        for (int k = 0; k < N * N; ++k)
            for (int c = 0; c < 3; ++c)
                assert_true(mask[k] ? g_frame[3 * k + c] > 0.02f && g_frame[3 * k + c] < 1 : g_frame[3 * k + c] == 0);
    }
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

static void a_step_of_no_length_in_which_the_mask_grows_leaves_no_hole(void **state)
{
    (void)state;
    enum
    {
        N = 96
    };
    static uint8_t mask[N * N];
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    RfImageView frame = view_of(g_frame, N, N, 3);
    for (int edge = 10; edge < 40; edge += 3)
    {
        RfLagrangian *lagrangian = make(exemplar, options_of(12, RF_BLEND_CONTRAST));
        RfFlowView view = scene_step(&moments, 1);
        view.mask = mask;
        for (int grown = 0; grown < 3; ++grown)
        {
            for (int k = 0; k < N * N; ++k)
                mask[k] = k % N < edge + 20 * grown;
            assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
            assert_int_equal(rf_lagrangian_stats(lagrangian).holes, 0);
            assert_true(rf_lagrangian_stats(lagrangian).born > 0);
            for (int k = 0; k < N * N; ++k)
                assert_true(mask[k] ? g_frame[3 * k] > 0.02f : g_frame[3 * k] == 0);
        }
        rf_lagrangian_destroy(lagrangian);
    }
    scene_moments_free(&moments);
    rf_exemplar_destroy(exemplar);
}

// ---- weights

// A smooth picture known everywhere: mean 0, one cycle in 64 pixels.
static float wave(float u, float v)
{
    return cosf(2 * RF_PI * u / 64) * sinf(2 * RF_PI * v / 64 + 0.4f);
}

static RfExemplar *wave_exemplar(void)
{
    static float data[64 * 64], alpha[64 * 64];
    for (int k = 0; k < 64 * 64; ++k)
    {
        data[k] = wave((float)(k % 64) + 0.5f, (float)(k / 64) + 0.5f);
        alpha[k] = 0.5f + 0.4f * data[k];
    }
    RfMapView maps[] = {{"height", RF_MAP_DATA, {data, 64, 64, 1, 64}, 1},
                        {"alpha", RF_MAP_ALPHA, {alpha, 64, 64, 1, 64}, 0}};
    return exemplar_of(maps, 2, RF_TILING_YES);
}

// Holds the frame against what its layers say, where they say all.
static void check_layers(RfBlend blend, double *squares_apart)
{
    enum
    {
        N = 128
    };
    RfExemplar *exemplar = wave_exemplar();
    RfLagrangianOptions options = options_of(24, blend);
    options.candidates = 1;
    RfLagrangian *lagrangian = make(exemplar, options);
    run(lagrangian, scene_two_vortices, N, 2, 1, 40, g_frame);
    RfImageView layers = view_of(g_layers, N, N, 16);
    assert_int_equal(rf_lagrangian_layers(lagrangian, &layers), RF_OK);
    int judged = 0, mixed = 0;
    *squares_apart = 0;
    for (int k = 0; k < N * N; ++k)
    {
        const float *layer = g_layers + 16 * k;
        double sum = 0, squares = 0, value = 0;
        for (int i = 0; i < 4; ++i)
        {
            double w = (double)layer[4 * i + 2];
            assert_true(w >= 0 && (i == 0 || w <= (double)layer[4 * i - 2]));
            assert_true((w > 0) == (layer[4 * i + 3] >= 0));
            sum += w;
            squares += w * w;
            value += w * (double)wave(layer[4 * i], layer[4 * i + 1]);
        }
        assert_true(sum < 1 + 1e-4);
        assert_true(layer[15] >= 0 || sum > 1 - 1e-4);
        // There may be more than four grids.
        if (sum < 1 - 1e-4)
            continue;
        double expected = blend == RF_BLEND_PLAIN ? value : value / sqrt(squares);
        expected = fmin(fmax(expected, -1), 1);
        assert_true(fabs((double)g_frame[2 * k] - expected) < 0.03);
        // Alpha is blended plainly whatever the blend.
        assert_true(fabs((double)g_frame[2 * k + 1] - 0.5 - 0.4 * value) < 0.012);
        *squares_apart = fmax(*squares_apart, fabs(value / sqrt(squares) - value));
        mixed += squares < 0.7;
        ++judged;
    }
    print_message("%d pixels of at most four grids, %d of them mixed\n", judged, mixed);
    assert_true(judged > N * N / 8 && mixed > N * N / 20);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

static void weights_sum_to_one_or_their_squares_do_and_the_frame_is_what_its_layers_say(void **state)
{
    (void)state;
    double apart;
    check_layers(RF_BLEND_PLAIN, &apart);
    check_layers(RF_BLEND_CONTRAST, &apart);
    // The two forms are far from each other, so that one cannot pass for the other.
    assert_true(apart > 0.2);
}

// ---- motion

// Round and round in a box: nothing flows in.
static void box(int w, int h, double frame, float *velocity)
{
    (void)frame;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            double u = M_PI * (x + 0.5) / w, v = M_PI * (y + 0.5) / h;
            velocity[2 * (y * w + x)] = (float)(0.6 * sin(u) * cos(v));
            velocity[2 * (y * w + x) + 1] = (float)(-0.6 * cos(u) * sin(v));
        }
}

enum
{
    BLOCK = 16,
    MAX_BLOCKS = MAX_PIXELS / (BLOCK * BLOCK)
};

// Changes of all judged blocks of a run, in grey levels, sorted; and the mean over its steps with births, and over
// those without, of a step's largest.
typedef struct Changes
{
    float *all;
    size_t count;
    double with, without;
    int births, calm;
} Changes;

static int ascending(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

// What changes from frame to frame of a run when the motion is taken out, from frame 20 on.
static Changes find_changes(RfLagrangian *lagrangian, RfFlow *flow, SceneMoments *scene, int width, int height,
                            int frames)
{
    Changes changes = {.all = malloc((size_t)(frames * MAX_BLOCKS) * sizeof(float))};
    assert_non_null(changes.all);
    RfImageView frame = view_of(g_frame, width, height, 3);
    for (int f = 1; f <= frames; ++f)
    {
        RfFlowView view = {0};
        if (flow)
            assert_int_equal(rf_flow_at(flow, f, &view), RF_OK);
        else
            view = scene_step(scene, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        rf_measure_grey(&frame, g_grey[f % 2]);
        if (f < 20)
            continue;
        float blocks[MAX_BLOCKS];
        rf_measure_displacement(&view, view.time - 1, width, height, g_displacement);
        RfFramePair pair = {width, height, g_grey[(f + 1) % 2], g_grey[f % 2], NULL, NULL};
        assert_int_equal(rf_measure_block_changes(&pair, g_displacement, BLOCK, blocks), RF_OK);
        bool birth = rf_lagrangian_stats(lagrangian).born > 0;
        ++*(birth ? &changes.births : &changes.calm);
        double largest = 0;
        for (int k = 0; k < width / BLOCK * (height / BLOCK); ++k)
            if (blocks[k] >= 0)
            {
                largest = fmax(largest, (double)blocks[k]);
                changes.all[changes.count++] = blocks[k];
            }
        *(birth ? &changes.with : &changes.without) += largest;
    }
    changes.with /= changes.births;
    changes.without /= changes.calm;
    qsort(changes.all, changes.count, sizeof *changes.all, ascending);
    return changes;
}

static void a_birth_is_not_seen(void **state)
{
    (void)state;
    enum
    {
        N = 128,
        FRAMES = 200
    };
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    RfLagrangian *lagrangian = make(exemplar, options_of(20, RF_BLEND_CONTRAST));
    SceneMoments moments = scene_moments(box, N, N);
    Changes changes = find_changes(lagrangian, NULL, &moments, N, N, FRAMES);
    double most = (double)changes.all[changes.count - 1];
    print_message(
        "largest change of a block, mean of %d steps with births: %.2f grey levels, of %d without: %.2f; of all: "
        "%.2f\n",
        changes.births, changes.with, changes.calm, changes.without, most);
    assert_true(changes.births >= 10 && changes.calm >= 10);
    assert_true(changes.with <= 1.3 * changes.without);
    // Fades as short as the strain leaves them come to 8 here.
    assert_true(most <= 6);
    free(changes.all);
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

static void in_strong_strain_no_part_of_the_picture_is_swapped_at_once(void **state)
{
    (void)state;
    RfImage *image = NULL;
    RfFlow *flow = NULL;
    assert_int_equal(rf_image_read("builtin:pebbles", &image), RF_OK);
    assert_int_equal(rf_flow_open("builtin:gyre?size=256x128&speed=1", NULL, &flow), RF_OK);
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_AUTO);
    RfLagrangian *lagrangian = make(exemplar, options_of(32, RF_BLEND_CONTRAST));
    Changes changes = find_changes(lagrangian, flow, NULL, 256, 128, 150);
    double median = (double)changes.all[changes.count / 2], most = (double)changes.all[changes.count - 1],
           rare = (double)changes.all[changes.count * 999 / 1000];
    print_message("median change of a block %.2f grey levels, of one in a thousand x%.2f, of the worst x%.2f\n", median,
                  rare / median, most / median);
    // Fades as short as the strain leaves them give 5.7 in a thousand.
    assert_true(rare <= 5 * median && most <= 10 * median);
    free(changes.all);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
    rf_flow_close(flow);
    rf_image_destroy(image);
}

static void in_a_uniform_flow_frames_shift_by_it_to_a_twentieth_of_a_pixel(void **state)
{
    (void)state;
    enum
    {
        N = 160,
        MARGIN = 40
    };
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
    {
        RfLagrangian *lagrangian = make(exemplar, options_of(20, (RfBlend)blend));
        for (int f = 30; f <= 31; ++f)
        {
            run(lagrangian, scene_translation, N, 3, f == 30 ? 1 : f, f, g_frame);
            RfImageView frame = view_of(g_frame, N, N, 3);
            rf_measure_grey(&frame, g_grey[f - 30]);
        }
        RfFramePair pair = {N, N, g_grey[0], g_grey[1], NULL, NULL};
        assert_int_equal(rf_measure_lucas_kanade(&pair, g_work), RF_OK);
        double sum[2] = {0}, error = 0, n = 0;
        // 2 d from inflow, which is at the left and at the bottom.
        for (int y = 10; y < N - MARGIN; ++y)
            for (int x = MARGIN; x < N - 10; ++x, n += 1)
            {
                const float *v = g_work + 2 * (y * N + x);
                sum[0] += (double)v[0];
                sum[1] += (double)v[1];
                error += hypot((double)v[0] - 2.25, (double)v[1] + 1.5);
            }
        print_message("shift %.4f %.4f, mean end-point error %.4f px\n", sum[0] / n, sum[1] / n, error / n);
        assert_true(hypot(sum[0] / n - 2.25, sum[1] / n + 1.5) < 0.05);
        assert_true(error / n < 0.05);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_exemplar_destroy(exemplar);
}

static void a_solid_rotation_turns_the_picture(void **state)
{
    (void)state;
    enum
    {
        N = 160
    };
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
    {
        RfLagrangian *lagrangian = make(exemplar, options_of(16, (RfBlend)blend));
        run(lagrangian, scene_rotation, N, 3, 0, 0, g_before);
        run(lagrangian, scene_rotation, N, 3, 1, 30, g_frame);
        double turned = 0, still = 0;
        // A quarter turn, clockwise: what was at (x, y) is at (N - 1 - y, x).
        for (int y = 0; y < N; ++y)
            for (int x = 0; x < N; ++x)
                for (int c = 0; c < 3 && hypot(x + 0.5 - N / 2, y + 0.5 - N / 2) < N / 2 - 2.2 * 16; ++c)
                {
                    double p = (double)g_before[3 * (y * N + x) + c];
                    turned += pow(p - (double)g_frame[3 * (x * N + N - 1 - y) + c], 2);
                    still += pow(p - (double)g_frame[3 * (y * N + x) + c], 2);
                }
        // Two unlike pictures differ by 1.
        print_message("after a quarter turn: %.3f of what two unlike pictures differ by\n", sqrt(turned / still));
        assert_true(sqrt(turned / still) < 0.06);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_exemplar_destroy(exemplar);
}

static void directions_turn_with_the_grid_and_normals_keep_their_length(void **state)
{
    (void)state;
    enum
    {
        N = 96
    };
    static float vectors[64 * 2], normals[64 * 3];
    for (int k = 0; k < 64; ++k)
    {
        vectors[2 * k] = 3;
        normals[3 * k] = 0.5f + 0.5f * 0.6f;
        normals[3 * k + 1] = 0.5f;
        normals[3 * k + 2] = 0.5f + 0.5f * 0.8f;
    }
    RfMapView maps[] = {{"motion", RF_MAP_VECTOR, {vectors, 8, 8, 2, 16}, 1},
                        {"normal", RF_MAP_NORMAL, {normals, 8, 8, 3, 24}, 1}};
    RfExemplar *exemplar = exemplar_of(maps, 2, RF_TILING_YES);
    RfLagrangian *lagrangian = make(exemplar, options_of(12, RF_BLEND_PLAIN));
    run(lagrangian, scene_rotation, N, 5, 0, 30, g_frame);
    for (int k = 0; k < N * N; ++k)
        if (hypot(k % N + 0.5 - N / 2, (double)(k / N) + 0.5 - N / 2) < N / 2 - 2.2 * 12)
        {
            // What pointed right points down; a normal map's y is up.
            const float *p = g_frame + 5 * k;
            assert_true(fabsf(p[0]) < 0.02f && fabsf(p[1] - 3) < 0.02f);
            assert_true(fabsf(p[2] - 0.5f) < 5e-3f && fabsf(p[3] - 0.2f) < 5e-3f && fabsf(p[4] - 0.9f) < 5e-3f);
        }
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

// ---- exemplars

static float bumps(int x, int y, int channel)
{
    return 0.5f + 0.4f * sinf(0.37f * (float)(x + 3 * channel)) * cosf(0.23f * (float)y + (float)channel);
}

static void normals_of_a_bumpy_map_have_unit_length_in_every_blend(void **state)
{
    (void)state;
    enum
    {
        N = 96
    };
    static float normals[40 * 36 * 3];
    for (int k = 0; k < 40 * 36; ++k)
    {
        float x = 2 * bumps(k % 40, k / 40, 0) - 1, y = 2 * bumps(k % 40, k / 40, 1) - 1, z = 0.7f;
        float scale = 0.5f / sqrtf(x * x + y * y + z * z);
        normals[3 * k] = 0.5f + x * scale;
        normals[3 * k + 1] = 0.5f + y * scale;
        normals[3 * k + 2] = 0.5f + z * scale;
    }
    RfMapView map = {"normal", RF_MAP_NORMAL, {normals, 40, 36, 3, 120}, 1};
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
    for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
    {
        RfLagrangian *lagrangian = make(exemplar, options_of(0, (RfBlend)blend));
        run(lagrangian, scene_two_vortices, N, 3, 1, 12, g_frame);
        double flat = 0;
        for (int k = 0; k < N * N; ++k)
        {
            float x = 2 * g_frame[3 * k] - 1, y = 2 * g_frame[3 * k + 1] - 1, z = 2 * g_frame[3 * k + 2] - 1;
            assert_true(fabsf(x * x + y * y + z * z - 1) < 1e-4f);
            flat += z > 0.98f;
        }
        assert_true(flat < 0.5 * N * N);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_exemplar_destroy(exemplar);
}

static void sixteen_channels_with_alpha_are_drawn_each_from_its_own(void **state)
{
    (void)state;
    enum
    {
        N = 64,
        W = 40,
        H = 44
    };
    static const int widths[] = {3, 1, 3, 2, 3, 4};
    static const RfMapKind kinds[] = {RF_MAP_COLOUR, RF_MAP_ALPHA, RF_MAP_NORMAL,
                                      RF_MAP_VECTOR, RF_MAP_DATA,  RF_MAP_DATA};
    static const char *const names[] = {"colour", "alpha", "normal", "motion", "ambient", "more"};
    static float pixels[6][W * H * 4];
    RfMapView maps[6];
    int first = 0;
    for (int m = 0; m < 6; ++m)
    {
        // Every channel has a range of its own, apart from the others' by more than it is wide.
        for (int k = 0; k < W * H; ++k)
            for (int c = 0; c < widths[m]; ++c)
                pixels[m][k * widths[m] + c] = kinds[m] == RF_MAP_DATA
                                                   ? (float)(first + c) + 0.5f * bumps(k % W, k / W, c)
                                                   : bumps(k % W, k / W, c);
        maps[m] = (RfMapView){names[m], kinds[m], {pixels[m], W, H, widths[m], W * widths[m]}, 1};
        first += widths[m];
    }
    assert_int_equal(first, 16);
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
        for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
        {
            RfExemplar *exemplar = exemplar_of(maps, 6, (RfTiling)tiling);
            RfLagrangian *lagrangian = make(exemplar, options_of(10, (RfBlend)blend));
            run(lagrangian, scene_two_vortices, N, 16, 1, 6, g_frame);
            for (int k = 0; k < N * N * 16; ++k)
            {
                int c = k % 16;
                float low = c >= 9 ? (float)c : 0, high = c >= 9 ? (float)c + 0.5f : 1;
                if (c < 7 || c >= 9)
                    assert_true(g_frame[k] >= low && g_frame[k] <= high);
                assert_true(isfinite(g_frame[k]));
            }
            rf_lagrangian_destroy(lagrangian);
            rf_exemplar_destroy(exemplar);
        }
}

static void the_smallest_exemplar_and_frames_of_one_pixel_work(void **state)
{
    (void)state;
    static float pixels[64 * 3];
    for (int k = 0; k < 64 * 3; ++k)
        pixels[k] = (float)((k * 37) % 64) / 64;
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, 8, 8, 3, 24}, 1};
    static const int sides[] = {1, 3, 50};
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
        for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
            for (int i = 0; i < 3; ++i)
            {
                RfExemplar *exemplar = exemplar_of(&map, 1, (RfTiling)tiling);
                RfLagrangian *lagrangian = make(exemplar, options_of(0, (RfBlend)blend));
                assert_true(rf_lagrangian_radius(lagrangian) >= 2 && rf_lagrangian_radius(lagrangian) < 4);
                run(lagrangian, scene_two_vortices, sides[i], 3, 1, 5, g_frame);
                for (int k = 0; k < 3 * sides[i] * sides[i]; ++k)
                    assert_true(g_frame[k] >= 0 && g_frame[k] <= 1);
                rf_lagrangian_destroy(lagrangian);
                rf_exemplar_destroy(exemplar);
            }
}

// A picture whose left half is dark and whose right half is bright: where it does not tile, no grid may show both ends.
static void grids_stay_inside_an_exemplar_that_does_not_tile(void **state)
{
    (void)state;
    enum
    {
        N = 96
    };
    RfExemplar *smooth = scene_noise_exemplar(64, 1);
    RfMapView map = rf_exemplar_map(smooth, 0, NULL);
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
    RfLagrangian *lagrangian = make(exemplar, options_of(0, RF_BLEND_CONTRAST));
    assert_true(fabsf(rf_lagrangian_radius(lagrangian) - 64 / 3.9f) < 0.01f);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    for (int f = 1; f <= 60; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_advance(lagrangian, &view, N, N), RF_OK);
        float side = GRID_SIDE * lagrangian->radius;
        for (int i = 0; i < lagrangian->count; ++i)
        {
            const Grid *grid = &lagrangian->grids[i];
            assert_true(grid->u0 >= -0.51f && grid->v0 >= -0.51f);
            assert_true(grid->u0 + side <= 64.51f && grid->v0 + side <= 64.51f);
        }
    }
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
    rf_exemplar_destroy(smooth);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_constant_exemplar_gives_a_constant_frame_however_it_is_blended),
        cmocka_unit_test(three_hundred_frames_have_no_hole_and_stay_maximal_without_crowds),
        cmocka_unit_test(pixels_on_land_are_zero),
        cmocka_unit_test(a_step_of_no_length_in_which_the_mask_grows_leaves_no_hole),
        cmocka_unit_test(weights_sum_to_one_or_their_squares_do_and_the_frame_is_what_its_layers_say),
        cmocka_unit_test(a_birth_is_not_seen),
        cmocka_unit_test(in_strong_strain_no_part_of_the_picture_is_swapped_at_once),
        cmocka_unit_test(in_a_uniform_flow_frames_shift_by_it_to_a_twentieth_of_a_pixel),
        cmocka_unit_test(a_solid_rotation_turns_the_picture),
        cmocka_unit_test(directions_turn_with_the_grid_and_normals_keep_their_length),
        cmocka_unit_test(normals_of_a_bumpy_map_have_unit_length_in_every_blend),
        cmocka_unit_test(sixteen_channels_with_alpha_are_drawn_each_from_its_own),
        cmocka_unit_test(the_smallest_exemplar_and_frames_of_one_pixel_work),
        cmocka_unit_test(grids_stay_inside_an_exemplar_that_does_not_tile),
    };
    // The frames are small, and no different with more.
    rf_set_threads(1);
    return cmocka_run_group_tests_name("lagrangian", tests, NULL, NULL);
}
