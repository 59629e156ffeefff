// SPDX-License-Identifier: Apache-2.0
// Directional moving texture.
#include "core/maths.h"
#include "core/saved_state.h"
#include "methods/directional/directional.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scarce.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    SIDE = 128,
    PIXELS = SIDE * SIDE,
    LAST = TEST_SANITIZED ? 10 : 30
};

static float g_velocity[2 * PIXELS], g_first[3 * PIXELS], g_last[3 * PIXELS];

static RfExemplar *builtin(const char *spec)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(spec, &image), RF_OK);
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_YES, &exemplar), RF_OK);
    rf_image_destroy(image);
    return exemplar;
}

static RfDirectional *make(const RfExemplar *exemplar, const RfDirectionalOptions *options)
{
    RfDirectionalOptions defaults = rf_directional_defaults();
    RfDirectional *d = NULL;
    assert_int_equal(rf_directional_create(exemplar, options ? options : &defaults, &d), RF_OK);
    return d;
}

static void step(RfDirectional *d, const uint8_t *mask, double time, float *pixels)
{
    RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = g_velocity, .mask = mask, .time = time};
    RfImageView frame = {pixels, SIDE, SIDE, 3, (ptrdiff_t)SIDE * 3};
    assert_int_equal(rf_directional_step(d, &flow, &frame), RF_OK);
}

// Round the middle, all as fast: the direction turns, most of all near the middle.
static void circles(float speed)
{
    for (int y = 0; y < SIDE; ++y)
        for (int x = 0; x < SIDE; ++x)
        {
            float dx = (float)x + 0.5f - 0.5f * SIDE, dy = (float)y + 0.5f - 0.5f * SIDE, r = hypotf(dx, dy);
            g_velocity[2 * (y * SIDE + x)] = -speed * dy / r;
            g_velocity[2 * (y * SIDE + x) + 1] = speed * dx / r;
        }
}

// ---- the exemplar's direction

static void exemplars_have_a_direction_or_are_said_to_have_none(void **state)
{
    (void)state;
    static const struct
    {
        const char *spec;
        bool isotropic;
    } cases[] = {
        {"builtin:canes?size=128", false}, {"builtin:bubbles?size=128", true}, {"builtin:foam?size=128", true}};
    for (int i = 0; i < 3; ++i)
    {
        RfExemplar *exemplar = builtin(cases[i].spec);
        RfDirectional *d = make(exemplar, NULL);
        RfDirectionalStats stats = rf_directional_stats(d);
        assert_int_equal(stats.isotropic, cases[i].isotropic);
        if (!cases[i].isotropic)
            assert_true(stats.direction < 2 || stats.direction > 358);
        rf_directional_destroy(d);
        RfDirectionalOptions options = rf_directional_defaults();
        options.direction = 33;
        d = make(exemplar, &options);
        assert_true(rf_directional_stats(d).direction == 33);
        rf_directional_destroy(d);
        rf_exemplar_destroy(exemplar);
    }
}

// ---- along the flow

// The angle between a frame's stripes and the flow, in degrees, in the median; by the structure tensor of windows of
// 9 x 9 pixels.
static int by_size(const void *a, const void *b)
{
    float p = *(const float *)a, q = *(const float *)b;
    return (p > q) - (p < q);
}

static float grey(const float *pixels, int x, int y)
{
    const float *p = pixels + 3 * (y * SIDE + x);
    return p[0] + p[1] + p[2];
}

static float median_angle(const float *pixels)
{
    static float angles[PIXELS];
    int count = 0;
    for (int y = 8; y < SIDE - 8; ++y)
        for (int x = 8; x < SIDE - 8; ++x)
        {
            float xx = 0, xy = 0, yy = 0;
            for (int j = y - 4; j <= y + 4; ++j)
                for (int i = x - 4; i <= x + 4; ++i)
                {
                    float gx = grey(pixels, i + 1, j) - grey(pixels, i - 1, j);
                    float gy = grey(pixels, i, j + 1) - grey(pixels, i, j - 1);
                    xx += gx * gx, xy += gx * gy, yy += gy * gy;
                }
            // Gradients lie across the stripes.
            float stripes = 0.5f * atan2f(2 * xy, xx - yy) + RF_PI / 2;
            const float *v = g_velocity + 2 * (y * SIDE + x);
            float off = fabsf(rf_angle_between(2 * stripes, 2 * atan2f(v[1], v[0]))) / 2;
            angles[count++] = off * 180 / RF_PI;
        }
    qsort(angles, (size_t)count, sizeof *angles, by_size);
    return angles[count / 2];
}

static void canes_lie_along_the_flow(void **state)
{
    (void)state;
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    for (int n = 24; n <= 48; n += 24)
    {
        RfDirectionalOptions options = rf_directional_defaults();
        options.rotations = n;
        RfDirectional *d = make(exemplar, &options);
        for (int t = 0; t <= LAST; ++t)
            step(d, NULL, t, g_last);
        float angle = median_angle(g_last);
        if (angle > (n == 24 ? 10.0f : 6.0f))
            fail_msg("%g degrees off the flow with %d copies", (double)angle, n);
        rf_directional_destroy(d);
    }
    // What lies across it is told from what lies along it.
    RfDirectionalOptions options = rf_directional_defaults();
    options.direction = 90;
    RfDirectional *d = make(exemplar, &options);
    step(d, NULL, 0, g_last);
    assert_true(median_angle(g_last) > 75);
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

static void turn_all(double time)
{
    for (int i = 0; i < PIXELS; ++i)
    {
        g_velocity[2 * i] = 2 * cosf(0.1f * (float)time);
        g_velocity[2 * i + 1] = 2 * sinf(0.1f * (float)time);
    }
}

static void texture_follows_where_the_flow_itself_turns(void **state)
{
    (void)state;
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    RfDirectional *d = make(exemplar, NULL);
    float sum = 0;
    for (int t = 0; t <= 16; ++t)
    {
        turn_all(t);
        step(d, NULL, t, g_last);
        float angle = median_angle(g_last);
        sum += angle;
        assert_true(angle < 24);
        for (int i = 0; i < PIXELS; ++i)
        {
            float off = rf_angle_between(d->direction_at[i], rf_turned_copy_direction(&d->copies, d->texels[i].copy));
            assert_true(fabsf(off) <= rf_directional_step_angle(d) * 1.001f);
        }
    }
    assert_true(sum / 17 < 10);
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

// ---- with the flow

static void uniform(float u, float v)
{
    for (int i = 0; i < PIXELS; ++i)
    {
        g_velocity[2 * i] = u;
        g_velocity[2 * i + 1] = v;
    }
}

static void what_stands_still_stays_as_it_is(void **state)
{
    (void)state;
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    RfDirectional *d = make(exemplar, NULL);
    uniform(0, 0);
    step(d, NULL, 0, g_first);
    for (int t = 1; t <= 3; ++t)
    {
        step(d, NULL, t, g_last);
        assert_memory_equal(g_first, g_last, sizeof g_last);
    }
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

// The root mean square of what moved by (x, y) pixels differs, of the first frame's contrast.
static double moved_by(int x, int y)
{
    double error = 0, sum = 0, squares = 0;
    int count = 0;
    for (int j = 40; j < SIDE - 40; ++j)
        for (int i = 40; i < SIDE - 40; ++i, ++count)
        {
            double a = (double)grey(g_first, i - x, j - y), b = (double)grey(g_last, i, j);
            error += (a - b) * (a - b);
            sum += a;
            squares += a * a;
        }
    return sqrt(error / (squares - sum * sum / count));
}

static void a_parallel_flow_carries_the_texture(void **state)
{
    (void)state;
    static const struct
    {
        float u, v;
        int steps, x, y;
    } cases[] = {{2, 1, 12, 24, 12}, {-0.3f, 0.2f, 20, -6, 4}, {0.05f, 0, 40, 2, 0}, {0, -1.5f, 6, 0, -9}};
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    for (int i = 0; i < 4; ++i)
    {
        uniform(cases[i].u, cases[i].v);
        RfDirectional *d = make(exemplar, NULL);
        step(d, NULL, 0, g_first);
        for (int t = 1; t <= cases[i].steps; ++t)
            step(d, NULL, t, g_last);
        assert_true(moved_by(cases[i].x, cases[i].y) < 0.05);
        assert_true(moved_by(0, 0) > 0.2);
        rf_directional_destroy(d);
    }
    rf_exemplar_destroy(exemplar);
}

static void speeds_are_limited(void **state)
{
    (void)state;
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    RfDirectionalOptions options = rf_directional_defaults();
    options.speed_min = 1;
    options.speed_max = 3;
    for (int fast = 0; fast <= 1; ++fast)
    {
        uniform(fast ? 20 : 0.01f, 0);
        RfDirectional *d = make(exemplar, &options);
        step(d, NULL, 0, g_first);
        for (int t = 1; t <= 6; ++t)
            step(d, NULL, t, g_last);
        assert_true(moved_by(fast ? 18 : 6, 0) < 0.05);
        rf_directional_destroy(d);
    }
    rf_exemplar_destroy(exemplar);
}

// ---- holes, seams, renewal

static void no_pixel_of_the_fluid_is_without_texture(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    for (int i = 0; i < PIXELS; ++i)
        mask[i] = hypot(i % SIDE - 30.0, i / SIDE - 70.0) > 14;
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    RfDirectional *d = make(exemplar, NULL);
    for (int t = 0; t <= LAST; ++t)
    {
        step(d, mask, t, g_last);
        for (int i = 0; i < PIXELS; ++i)
            assert_true(!mask[i] || d->texels[i].copy >= 0);
        RfDirectionalStats stats = rf_directional_stats(d);
        assert_true((t == 0) == (stats.filled == 0) && stats.filled < 0.3f && stats.renewed < 0.3f);
    }
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

static float mean_blends(const RfDirectional *d)
{
    double sum = 0;
    for (int i = 0; i < PIXELS; ++i)
        sum += (double)d->texels[i].blends;
    return (float)(sum / PIXELS);
}

static float mean_gradient(const float *pixels)
{
    double sum = 0;
    for (int y = 8; y < SIDE - 8; ++y)
        for (int x = 8; x < SIDE - 8; ++x)
            sum += hypot((double)(grey(pixels, x + 1, y) - grey(pixels, x, y)),
                         (double)(grey(pixels, x, y + 1) - grey(pixels, x, y)));
    return (float)sum;
}

// The paper's figure 7; but here the gradient stays without renewal, too.
static void renewal_keeps_blends_few_and_the_texture_sharp(void **state)
{
    (void)state;
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    float gradients[2], blends[2], first = 0;
    for (int renewing = 0; renewing <= 1; ++renewing)
    {
        RfDirectionalOptions options = rf_directional_defaults();
        options.renew_after = renewing ? options.renew_after : 0;
        RfDirectional *d = make(exemplar, &options);
        for (int t = 0; t <= 40; ++t)
        {
            step(d, NULL, t, g_last);
            first = t == 0 ? mean_gradient(g_last) : first;
            assert_true(renewing || rf_directional_stats(d).renewed == 0);
        }
        gradients[renewing] = mean_gradient(g_last);
        blends[renewing] = mean_blends(d);
        rf_directional_destroy(d);
    }
    if (!(gradients[1] > 0.95f * first && gradients[1] < 1.05f * first && blends[1] < 2 && blends[0] > 2))
        fail_msg("gradient %g, after 40 frames %g, without renewal %g; blends %g, %g", (double)first,
                 (double)gradients[1], (double)gradients[0], (double)blends[1], (double)blends[0]);
    rf_exemplar_destroy(exemplar);
}

static void a_cut_first_frame_is_not_blended(void **state)
{
    (void)state;
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=128");
    float gradients[2];
    for (int cut = 0; cut <= 1; ++cut)
    {
        RfDirectionalOptions options = rf_directional_defaults();
        options.seam = cut ? RF_SEAM_CUT : RF_SEAM_FEATHER;
        RfDirectional *d = make(exemplar, &options);
        step(d, NULL, 0, g_last);
        gradients[cut] = mean_gradient(g_last);
        assert_true((mean_blends(d) == 0) == (cut == 1));
        for (int i = 0; i < 3 * PIXELS && cut; ++i)
            assert_true(d->blended[i] == 0);
        rf_directional_destroy(d);
    }
    assert_true(gradients[1] > gradients[0]);
    rf_exemplar_destroy(exemplar);
}

static void what_comes_into_view_is_filled_whenever_it_does(void **state)
{
    (void)state;
    static uint8_t mask[PIXELS];
    RfExemplar *exemplar = builtin("builtin:canes?size=64");
    RfDirectional *d = make(exemplar, NULL);
    circles(2);
    memset(mask, 0, sizeof mask);
    step(d, mask, 0, g_last); // no fluid at all
    memset(mask, 1, sizeof mask / 2);
    step(d, mask, 1, g_last);
    memset(mask, 1, sizeof mask);
    step(d, mask, 1, g_last); // the same moment once more
    for (int i = 0; i < PIXELS; ++i)
        assert_true(d->texels[i].copy >= 0);
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

static void threads_may_change_from_step_to_step(void **state)
{
    (void)state;
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=64");
    for (int changing = 0; changing <= 1; ++changing)
    {
        RfDirectional *d = make(exemplar, NULL);
        for (int t = 0; t <= 5; ++t)
        {
            rf_set_threads(changing ? 1 + 3 * t : 2);
            step(d, NULL, t, changing ? g_last : g_first);
        }
        rf_directional_destroy(d);
    }
    rf_set_threads(0);
    assert_memory_equal(g_first, g_last, sizeof g_last);
    rf_exemplar_destroy(exemplar);
}

// A map of vectors along the exemplar's direction, also of one that is searched on a coarse level.
static void vectors_point_along_the_flow(void **state)
{
    (void)state;
    static float vectors[2 * 300 * 300], frame[2 * PIXELS];
    for (int i = 0; i < 300 * 300; ++i)
    {
        vectors[2 * i] = 3;
        vectors[2 * i + 1] = 0.2f * (float)(i % 7 == 0);
    }
    RfDirectionalOptions options = rf_directional_defaults();
    options.direction = 0;
    float angle = 2 * RF_PI / 24 * 5;
    uniform(cosf(angle), sinf(angle));
    for (int side = 80; side <= 300; side += 220)
    {
        RfMapView map = {"motion", RF_MAP_VECTOR, {vectors, side, side, 2, 2 * side}, 1};
        RfExemplar *exemplar = NULL;
        assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_NO, &exemplar), RF_OK);
        RfDirectional *d = make(exemplar, &options);
        for (int t = 0; t < 3; ++t)
        {
            RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = g_velocity, .time = t};
            RfImageView view = {frame, SIDE, SIDE, 2, (ptrdiff_t)SIDE * 2};
            assert_int_equal(rf_directional_step(d, &flow, &view), RF_OK);
        }
        assert_true((d->copies.size > 1) == (side > 256));
        for (int i = 0; i < PIXELS; ++i)
        {
            float along = frame[2 * i] * cosf(angle) + frame[2 * i + 1] * sinf(angle);
            float across = frame[2 * i + 1] * cosf(angle) - frame[2 * i] * sinf(angle);
            assert_true(fabsf(along - 3) < 0.02f && across > -0.1f && across < 0.3f);
        }
        rf_directional_destroy(d);
        rf_exemplar_destroy(exemplar);
    }
}

// ---- what is refused, memory

static void what_makes_no_sense_is_refused(void **state)
{
    (void)state;
    static float pixels[80 * 80 * 3];
    RfMapView maps[] = {{"colour", RF_MAP_COLOUR, {pixels, 16, 80, 3, 48}, 1},
                        {"guide", RF_MAP_DATA, {pixels, 16, 80, 3, 48}, 1}};
    RfExemplar *exemplar = NULL;
    RfDirectional *d = NULL;
    RfDirectionalOptions options = rf_directional_defaults();
    assert_int_equal(rf_exemplar_create(maps, 2, RF_TILING_YES, &exemplar), RF_OK);
    assert_int_equal(rf_directional_create(exemplar, &options, &d), RF_BAD_INPUT);
    rf_exemplar_destroy(exemplar);
    // Too narrow for a patch that lies askew, unless it goes on beyond its borders.
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
    {
        maps[0].image.width = 15;
        assert_int_equal(rf_exemplar_create(maps, 1, (RfTiling)tiling, &exemplar), RF_OK);
        assert_int_equal(rf_directional_create(exemplar, &options, &d), tiling == RF_TILING_NO ? RF_BAD_INPUT : RF_OK);
        rf_directional_destroy(d);
        d = NULL;
        rf_exemplar_destroy(exemplar);
    }
#ifndef RF_STOP_ON_MISUSE
    assert_int_equal(rf_exemplar_create(maps, 1, RF_TILING_YES, &exemplar), RF_OK);
    options.cell_min = 33;
    assert_int_equal(rf_directional_create(exemplar, &options, &d), RF_INVALID_ARGUMENT);
    options = rf_directional_defaults();
    options.speed_min = 3;
    options.speed_max = 2;
    assert_int_equal(rf_directional_create(exemplar, &options, &d), RF_INVALID_ARGUMENT);
    assert_null(d);
    rf_exemplar_destroy(exemplar);
#endif
}

// With a true hash: only what the numbers say can be refused.
static RfResult load_changed(const RfExemplar *exemplar, const uint8_t *block, size_t size, size_t offset,
                             const void *value, size_t bytes)
{
    RfDirectionalOptions options = rf_directional_defaults();
    uint8_t *copy = malloc(size);
    RfStateHead head;
    RfDirectional *loaded = NULL;
    assert_non_null(copy);
    memcpy(copy, block, size);
    memcpy(copy + offset, value, bytes);
    memcpy(&head, copy, sizeof head);
    rf_state_seal(copy, size, "directional", head.version, head.inputs);
    RfResult result = rf_directional_load(exemplar, &options, copy, size, &loaded);
    rf_directional_destroy(loaded);
    free(copy);
    return result;
}

static void a_state_with_a_true_hash_and_absurd_numbers_is_refused(void **state)
{
    (void)state;
    enum
    {
        HEADER = sizeof(RfStateHead) + 40,
        SIZE = sizeof(RfStateHead),
        TIME = sizeof(RfStateHead) + 16,
        TEXEL = HEADER + 100 * sizeof(RfTexel),
        BLENDED = HEADER + PIXELS * sizeof(RfTexel)
    };
    circles(2);
    RfExemplar *exemplar = builtin("builtin:canes?size=64");
    RfDirectional *d = make(exemplar, NULL);
    for (int t = 0; t < 3; ++t)
        step(d, NULL, t, g_last);
    void *block = NULL;
    size_t size = 0;
    assert_int_equal(rf_directional_save(d, &block, &size), RF_OK);
    assert_int_equal(size, BLENDED + sizeof g_last);
    static const float numbers[] = {NAN, INFINITY, -INFINITY};
    static const int copies[] = {-2, 24, 1 << 30};
    assert_int_equal(load_changed(exemplar, block, size, TEXEL + offsetof(RfTexel, copy), &(int){23}, 4), RF_OK);
    for (int i = 0; i < 3; ++i)
    {
        const size_t fields[] = {TEXEL + offsetof(RfTexel, source), TEXEL + offsetof(RfTexel, rest),
                                 TEXEL + offsetof(RfTexel, blends), BLENDED + 400};
        for (int k = 0; k < 4; ++k)
            assert_int_equal(load_changed(exemplar, block, size, fields[k], &numbers[i], 4), RF_BAD_INPUT);
        assert_int_equal(load_changed(exemplar, block, size, TEXEL + offsetof(RfTexel, copy), &copies[i], 4),
                         RF_BAD_INPUT);
        assert_int_equal(load_changed(exemplar, block, size, TIME, &(double){(double)numbers[i]}, 8), RF_BAD_INPUT);
        assert_int_equal(load_changed(exemplar, block, size, SIZE, &copies[i], 4), RF_BAD_INPUT);
    }
    rf_free(block);
    rf_directional_destroy(d);
    rf_exemplar_destroy(exemplar);
}

static RfResult live(const RfExemplar *exemplar, float *pixels)
{
    RfDirectionalOptions options = rf_directional_defaults();
    options.rotations = 4;
    RfDirectional *d = NULL;
    RfResult result = rf_directional_create(exemplar, &options, &d);
    for (int t = 0; t < 3 && result == RF_OK; ++t)
    {
        RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = g_velocity, .time = t};
        RfImageView frame = {pixels, 16, 16, 3, 48};
        result = rf_directional_step(d, &flow, &frame);
    }
    void *block = NULL;
    size_t size;
    if (result == RF_OK)
        result = rf_directional_save(d, &block, &size);
    rf_directional_destroy(d);
    d = NULL;
    if (result == RF_OK)
        result = rf_directional_load(exemplar, &options, block, size, &d);
    rf_directional_destroy(d);
    rf_free(block);
    return result;
}

static void memory_that_runs_out_leaks_nothing(void **state)
{
    (void)state;
    static float pixels[16 * 16 * 3];
    circles(20);
    rf_set_threads(1);
    scarce_begin(SCARCE_PLENTY);
    RfExemplar *exemplar = scene_noise_exemplar(16, 1);
    int before = scarce_live(), needed = 0;
    RfResult result = RF_OUT_OF_MEMORY;
    for (; needed < 2000 && result != RF_OK; ++needed)
    {
        scarce_allow(needed);
        result = live(exemplar, pixels);
        assert_true(result == RF_OK || result == RF_OUT_OF_MEMORY);
        assert_int_equal(scarce_live(), before);
    }
    rf_exemplar_destroy(exemplar);
    scarce_end();
    rf_set_threads(0);
    assert_int_equal(result, RF_OK);
    assert_true(needed > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exemplars_have_a_direction_or_are_said_to_have_none),
        cmocka_unit_test(canes_lie_along_the_flow),
        cmocka_unit_test(texture_follows_where_the_flow_itself_turns),
        cmocka_unit_test(what_stands_still_stays_as_it_is),
        cmocka_unit_test(a_parallel_flow_carries_the_texture),
        cmocka_unit_test(speeds_are_limited),
        cmocka_unit_test(no_pixel_of_the_fluid_is_without_texture),
        cmocka_unit_test(renewal_keeps_blends_few_and_the_texture_sharp),
        cmocka_unit_test(a_cut_first_frame_is_not_blended),
        cmocka_unit_test(what_comes_into_view_is_filled_whenever_it_does),
        cmocka_unit_test(threads_may_change_from_step_to_step),
        cmocka_unit_test(vectors_point_along_the_flow),
        cmocka_unit_test(what_makes_no_sense_is_refused),
        cmocka_unit_test(a_state_with_a_true_hash_and_absurd_numbers_is_refused),
        cmocka_unit_test(memory_that_runs_out_leaks_nothing),
    };
    return cmocka_run_group_tests_name("directional", tests, NULL, NULL);
}
