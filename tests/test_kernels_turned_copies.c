// SPDX-License-Identifier: Apache-2.0
// Turned copies of an exemplar, and classes of what it looks like.
#include "core/maths.h"
#include "kernels/looks.h"
#include "kernels/principal.h"
#include "kernels/turned_copies.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    SIDE = 48,
    COPIES = 8,
    BOX = 12
};

static RfPatchTerms g_terms;

typedef struct Material
{
    RfExemplar *exemplar;
    RfComparison comparison;
    RfSampler sampler;
    RfTurnedCopies copies;
} Material;

static RfExemplar *exemplar_of(RfTiling tiling)
{
    RfExemplar *noise = scene_noise_exemplar(SIDE, 3), *exemplar = NULL;
    RfMapView map = rf_exemplar_map(noise, 0, NULL);
    assert_int_equal(rf_exemplar_create(&map, 1, tiling, &exemplar), RF_OK);
    rf_exemplar_destroy(noise);
    return exemplar;
}

static Material *make(RfTiling tiling, float direction)
{
    Material *m = calloc(1, sizeof *m);
    m->exemplar = exemplar_of(tiling);
    assert_int_equal(rf_comparison_create(m->exemplar, &m->comparison), RF_OK);
    assert_int_equal(rf_sampler_create(m->exemplar, &m->sampler), RF_OK);
    assert_int_equal(rf_turned_copies_create(&m->sampler, &m->comparison, direction, COPIES, BOX, &m->copies), RF_OK);
    return m;
}

static void destroy(Material *m)
{
    rf_turned_copies_free(&m->copies);
    rf_sampler_free(&m->sampler);
    rf_exemplar_destroy(m->exemplar);
    free(m);
}

// What a box of the turned exemplar would show whose first pixel shows `source`.
static void draw_box(const Material *m, int copy, RfVec2 source, float *pixels)
{
    RfJacobian j = rf_turned_copy_jacobian(&m->copies, copy);
    for (int i = 0; i < BOX * BOX; ++i)
    {
        float values[RF_SAMPLE_CHANNELS];
        RfVec2 step = {(float)(i % BOX), (float)(i / BOX)};
        rf_sampler_at(&m->sampler, rf_vec2_add(source, rf_jacobian_step(j, step)), j, values);
        rf_turned_copies_compared(&m->copies, values, pixels + i * m->comparison.channels);
    }
}

static void a_piece_of_every_copy_is_found_where_it_is(void **state)
{
    (void)state;
    static float pixels[BOX * BOX * 3], weights[BOX * BOX];
    for (int i = 0; i < BOX * BOX; ++i)
        weights[i] = i % BOX < 3 || i / BOX < 3;
    for (int tiling = RF_TILING_NO; tiling <= RF_TILING_YES; ++tiling)
    {
        Material *m = make((RfTiling)tiling, 0.3f);
        for (int copy = 0; copy < COPIES; ++copy)
        {
            // Where a copy has a pixel, near the exemplar's middle; of one that tiles also across its border.
            RfVec2 near = {tiling == RF_TILING_YES ? 3.0f : 22.0f, 25};
            RfVec2 point = rf_turned_copy_point(&m->copies, copy, near);
            RfVec2 back = {-0.5f * BOX, -0.5f * BOX};
            point = rf_vec2_add(point, back);
            point = (RfVec2){floorf(point.x), floorf(point.y)};
            RfVec2 source = rf_turned_copy_source(&m->copies, copy, point);
            draw_box(m, copy, source, pixels);
            RfPatchQuery query = {.width = BOX, .height = BOX, .pixels = pixels, .weights = weights};
            RfPatchMatch match = rf_patch_search(&m->copies.pictures[copy], &query, &g_terms);
            RfVec2 found = rf_turned_copy_source(&m->copies, copy, (RfVec2){(float)match.x, (float)match.y});
            assert_true(match.distance < 1e-4);
            assert_true(rf_vec2_length(rf_vec2_sub(found, source)) < 1e-3f);
        }
        destroy(m);
    }
}

static void copies_point_where_they_say(void **state)
{
    (void)state;
    Material *m = make(RF_TILING_YES, 0.3f);
    for (int copy = 0; copy < COPIES; ++copy)
    {
        float direction = rf_turned_copy_direction(&m->copies, copy);
        assert_int_equal(rf_turned_copy_of(&m->copies, direction), copy);
        assert_int_equal(rf_turned_copy_of(&m->copies, direction + 0.3f), copy);
        assert_int_equal(rf_turned_copy_of(&m->copies, direction - 0.3f - 4 * RF_PI), copy);
        // A step along the copy's direction goes along the exemplar's.
        RfVec2 step =
            rf_jacobian_step(rf_turned_copy_jacobian(&m->copies, copy), (RfVec2){cosf(direction), sinf(direction)});
        assert_true(fabsf(step.x - cosf(0.3f)) < 1e-5f && fabsf(step.y - sinf(0.3f)) < 1e-5f);
        RfVec2 source = {11.25f, 40.5f};
        RfVec2 there = rf_turned_copy_source(&m->copies, copy, rf_turned_copy_point(&m->copies, copy, source));
        assert_true(rf_vec2_length(rf_vec2_sub(there, source)) < 1e-3f);
    }
    destroy(m);
}

static void compared_values_keep_their_distances(void **state)
{
    (void)state;
    Material *m = make(RF_TILING_YES, 0);
    const RfExemplar *e = m->exemplar;
    double along[3] = {0}, mean[3] = {0};
    int pixels = SIDE * SIDE;
    for (int i = 0; i < pixels; ++i)
    {
        const float *a = e->pixels + (ptrdiff_t)i * 3, *b = e->pixels + (ptrdiff_t)(pixels - 1 - i) * 3;
        float p[3], q[3];
        rf_turned_copies_compared(&m->copies, a, p);
        rf_turned_copies_compared(&m->copies, b, q);
        double plain = 0, turned = 0;
        for (int c = 0; c < 3; ++c)
        {
            double d = (double)(a[c] - b[c]), t = (double)(p[c] - q[c]);
            plain += d * d;
            turned += t * t;
            mean[c] += (double)p[c] / pixels;
            along[c] += (double)(p[c] * p[c]) / pixels;
        }
        assert_true(fabs(plain - turned) < 1e-5);
    }
    for (int c = 0; c < 3; ++c)
        along[c] -= mean[c] * mean[c];
    assert_true(along[0] > along[1] && along[1] > along[2]);
    assert_true(fabs(along[0] + along[1] + along[2] - (double)m->copies.variance) < 1e-4);
    destroy(m);
}

static void looks_are_equally_frequent_and_tell_bright_from_dark(void **state)
{
    (void)state;
    enum
    {
        W = 64,
        H = 32
    };
    static float values[W * H];
    static uint8_t looks[W * H];
    // Brighter to the right, rougher downwards.
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            values[y * W + x] = (float)x + 0.4f * (float)y * ((x + y) % 2 ? 1 : -1);
    assert_int_equal(rf_looks_find(values, W, H, false, 2, looks), RF_OK);
    int64_t count[RF_LOOKS] = {0};
    for (int i = 0; i < W * H; ++i)
        ++count[looks[i]];
    for (int k = 0; k < RF_LOOKS; ++k)
        assert_true(count[k] == W * H / RF_LOOKS);
    assert_true(looks[16 * W + 4] / RF_LOOK_QUANTILES < looks[16 * W + 60] / RF_LOOK_QUANTILES);
    assert_true(looks[3 * W + 28] % RF_LOOK_QUANTILES < looks[28 * W + 28] % RF_LOOK_QUANTILES);
    float shares[RF_LOOKS];
    count[7] *= 100;
    rf_looks_shares(count, 4, shares);
    assert_true(shares[7] == 4 && shares[8] < 1);
    memset(count, 0, sizeof count);
    rf_looks_shares(count, 4, shares);
    assert_true(shares[7] == 1);
}

static void principal_axes_of_few_numbers(void **state)
{
    (void)state;
    double covariance[9] = {2, 1, 0, 1, 2, 0, 0, 0, 5};
    float axes[9];
    rf_principal_axes(covariance, 3, axes);
    assert_true(fabsf(fabsf(axes[2]) - 1) < 1e-6f);                                               // 5
    assert_true(fabsf(axes[3] - axes[4]) < 1e-6f && fabsf(fabsf(axes[3]) - sqrtf(0.5f)) < 1e-6f); // 3
    assert_true(fabsf(axes[6] + axes[7]) < 1e-6f);                                                // 1
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_piece_of_every_copy_is_found_where_it_is),
        cmocka_unit_test(copies_point_where_they_say),
        cmocka_unit_test(compared_values_keep_their_distances),
        cmocka_unit_test(looks_are_equally_frequent_and_tell_bright_from_dark),
        cmocka_unit_test(principal_axes_of_few_numbers),
    };
    return cmocka_run_group_tests_name("turned_copies", tests, NULL, NULL);
}
