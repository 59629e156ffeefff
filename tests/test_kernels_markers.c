// SPDX-License-Identifier: Apache-2.0
// Markers that a flow carries, and the closed line of least difference.
#include "kernels/markers.h"
#include "kernels/ring_cut.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    W = 40,
    H = 30
};

static RfFlowView linear_flow(float *velocity, float xx, float xy, float yx, float yy, double time)
{
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
        {
            float px = (float)x + 0.5f - 0.5f * W, py = (float)y + 0.5f - 0.5f * H;
            velocity[2 * (y * W + x)] = xx * px + xy * py;
            velocity[2 * (y * W + x) + 1] = yx * px + yy * py;
        }
    return (RfFlowView){.width = W, .height = H, .velocity = velocity, .time = time};
}

// Every pixel comes from itself.
static RfMarkers identity(int width, int height, bool tiles)
{
    RfMarkers m;
    assert_int_equal(rf_markers_create(width, height, tiles, &m), RF_OK);
    for (int i = 0; i < width * height; ++i)
    {
        RfVec2 at = {(float)(i % width), (float)(i / width)};
        m.pixels[i] = (RfMarker){at, at, rf_bend_of((RfVec2){1, 0}), 1, 0};
    }
    return m;
}

static void a_rigid_rotation_turns_the_texture_with_it(void **state)
{
    (void)state;
    static float velocity[2 * W * H];
    RfMarkers m = identity(W, H, false);
    const float spin = 0.1f;
    for (int f = 1; f <= 10; ++f)
    {
        RfFlowView flow = linear_flow(velocity, 0, -spin, spin, 0, f);
        rf_markers_carry(&m, &flow, f - 1);
        rf_markers_fill(&m);
    }
    // Turned by 1 radian: the source of a point is the point turned back about the middle.
    RfVec2 middle = {0.5f * W - 0.5f, 0.5f * H - 0.5f};
    for (int y = 10; y < 20; ++y)
        for (int x = 14; x < 26; ++x)
        {
            RfVec2 d = {(float)x - middle.x, (float)y - middle.y};
            RfVec2 s = {middle.x + cosf(1) * d.x + sinf(1) * d.y, middle.y - sinf(1) * d.x + cosf(1) * d.y};
            RfVoices voices;
            rf_markers_hear(&m, x, y, &voices);
            assert_int_equal(voices.count, 1);
            if (fabsf(voices.places[0].x - s.x) > 0.05f || fabsf(voices.places[0].y - s.y) > 0.05f)
                fail_msg("(%d, %d) comes from %g, %g instead of %g, %g", x, y, (double)voices.places[0].x,
                         (double)voices.places[0].y, (double)s.x, (double)s.y);
            RfBendParts parts = rf_bend_parts(m.pixels[y * W + x].bend);
            assert_true(fabsf(parts.turn.x - cosf(1)) < 0.005f && fabsf(parts.turn.y + sinf(1)) < 0.005f);
            assert_true(parts.most < 1.001f && parts.least > 0.999f);
        }
    rf_markers_free(&m);
}

static void strain_is_told_by_the_bend(void **state)
{
    (void)state;
    static float velocity[2 * W * H];
    // Stretched along x, squeezed along y: the texture's steps are the inverse.
    RfMarkers m = identity(W, H, false);
    for (int f = 1; f <= 10; ++f)
    {
        RfFlowView flow = linear_flow(velocity, 0.03f, 0, 0, -0.03f, f);
        rf_markers_carry(&m, &flow, f - 1);
        rf_markers_fill(&m);
    }
    RfBend bend = m.pixels[(H / 2) * W + W / 2].bend;
    assert_true(fabsf(bend.x.x - expf(-0.3f)) < 2e-3f && fabsf(bend.y.y - expf(0.3f)) < 2e-3f);
    RfBendParts parts = rf_bend_parts(bend);
    assert_true(fabsf(parts.most - expf(0.3f)) < 2e-3f && fabsf(parts.least - expf(-0.3f)) < 2e-3f);
    RfVec2 source = rf_markers_source(&m, (RfVec2){0.5f * W - 0.5f + 4, 0.5f * H - 0.5f});
    assert_true(fabsf(source.x - (0.5f * W - 0.5f + 4 * expf(-0.3f))) < 0.05f);
    rf_markers_free(&m);
}

static void a_bend_that_mirrors_has_a_negative_stretch(void **state)
{
    (void)state;
    RfBendParts parts = rf_bend_parts((RfBend){{1, 0}, {0, -0.5f}});
    assert_true(fabsf(parts.most - 1) < 1e-6f && fabsf(parts.least + 0.5f) < 1e-6f);
}

static void borders_move_by_parts_of_a_pixel(void **state)
{
    (void)state;
    static float velocity[2 * W * H];
    for (int i = 0; i < W * H; ++i)
        velocity[2 * i] = 0.25f;
    RfMarkers m = identity(W, H, false);
    for (int i = 0; i < W * H; ++i)
        if (i % W >= 20)
            m.pixels[i].source.y += 100;
    float before = 1;
    // The share of what lies left of the border grows in a pixel that the border crosses.
    for (int f = 1; f <= 4; ++f)
    {
        RfFlowView flow = {.width = W, .height = H, .velocity = velocity, .time = f};
        rf_markers_carry(&m, &flow, f - 1);
        rf_markers_fill(&m);
        RfVoices voices;
        rf_markers_hear(&m, 20, 15, &voices);
        float right = 0;
        for (int g = 0; g < voices.count; ++g)
            right += voices.places[g].y > 50 ? voices.shares[g] : 0;
        assert_true(right < before);
        before = right;
    }
    assert_true(before < 0.5f);
    rf_markers_free(&m);
}

static void what_flows_in_continues_what_is_there(void **state)
{
    (void)state;
    static float velocity[2 * W * H];
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        for (int i = 0; i < W * H; ++i)
            velocity[2 * i] = 3;
        RfMarkers m = identity(W, H, tiles);
        RfFlowView flow = {.width = W, .height = H, .velocity = velocity, .time = 1};
        rf_markers_carry(&m, &flow, 0);
        rf_markers_fill(&m);
        for (int x = 0; x < W; ++x)
        {
            float expected = (float)(tiles && x < 3 ? x - 3 + W : x - 3);
            assert_true(fabsf(m.pixels[7 * W + x].source.x - expected) < 1e-3f);
            assert_true(m.pixels[7 * W + x].continued == (float)(tiles ? 0 : rf_max_int(3 - x, 0)));
        }
        // All of it swept out, where nothing comes in from the other side: it stays.
        for (int i = 0; i < W * H; ++i)
            velocity[2 * i] = 1000;
        flow.time = 2;
        RfMarker was = m.pixels[7 * W + 9];
        rf_markers_carry(&m, &flow, 1);
        rf_markers_fill(&m);
        if (!tiles)
            assert_true(m.pixels[7 * W + 9].source.x == was.source.x && m.pixels[7 * W + 9].at.x == 9);
        for (int i = 0; i < W * H; ++i)
            assert_true(m.pixels[i].share == 1);
        rf_markers_free(&m);
    }
}

// Gaps that open wherever a flow turns are between markers: nothing flows in there.
static void a_turning_disc_is_not_continued(void **state)
{
    (void)state;
    static float velocity[2 * W * H];
    RfMarkers m = identity(W, H, false);
    for (int f = 1; f <= 60; ++f)
    {
        RfFlowView flow = linear_flow(velocity, 0, -0.05f, 0.05f, 0, f);
        rf_markers_carry(&m, &flow, f - 1);
        rf_markers_fill(&m);
    }
    double sum = 0, count = 0;
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
        {
            float dx = (float)x - 0.5f * (W - 1), dy = (float)y - 0.5f * (H - 1);
            bool inside = dx * dx + dy * dy < 0.16f * H * H;
            sum += inside ? (double)m.pixels[y * W + x].continued : 0;
            count += inside;
        }
    assert_true(sum < 0.2 * count);
    rf_markers_free(&m);
}

static void no_marker_no_voice(void **state)
{
    (void)state;
    RfMarkers m;
    RfVoices voices;
    assert_int_equal(rf_markers_create(W, H, false, &m), RF_OK);
    rf_markers_hear(&m, 5, 5, &voices);
    assert_int_equal(voices.count, 0);
    assert_true(rf_markers_share(&m, 5, 5) == 0);
    m.pixels[5 * W + 6] = (RfMarker){{6, 5}, {1, 2}, rf_bend_of((RfVec2){1, 0}), 0.5f, 0};
    rf_markers_hear(&m, 5, 5, &voices);
    assert_int_equal(voices.count, 1);
    assert_true(voices.places[0].x == 0 && voices.places[0].y == 2 && voices.shares[0] == 1);
    // A gap is a pixel between two.
    assert_true(rf_markers_share(&m, 6, 5) == 0.5f && rf_markers_share(&m, 5, 5) == 0);
    m.pixels[5 * W + 4] = (RfMarker){{4, 5}, {1, 2}, rf_bend_of((RfVec2){1, 0}), 0.25f, 0};
    assert_true(rf_markers_share(&m, 5, 5) == 0.375f);
    rf_markers_free(&m);
}

// ---- the closed line

static RfRing g_ring;

// Dynamic programming over (first, last) pairs, as a matrix product of least sums: slow, plain and different.
static float reference(void)
{
    static float now[RF_RING_RADII][RF_RING_RADII], next[RF_RING_RADII][RF_RING_RADII];
    int n = g_ring.radii;
    for (int a = 0; a < n; ++a)
        for (int b = 0; b < n; ++b)
            now[a][b] = a == b ? g_ring.errors[0][a] : INFINITY;
    for (int angle = 1; angle < RF_RING_ANGLES; ++angle)
    {
        for (int a = 0; a < n; ++a)
            for (int b = 0; b < n; ++b)
            {
                next[a][b] = INFINITY;
                for (int c = 0; c < n; ++c)
                    if (abs(b - c) <= 1)
                        next[a][b] = fminf(next[a][b], now[a][c] + g_ring.errors[angle][b]);
            }
        memcpy(now, next, sizeof now);
    }
    float least = INFINITY;
    for (int a = 0; a < n; ++a)
        for (int b = 0; b < n; ++b)
            if (abs(a - b) <= 1)
                least = fminf(least, now[a][b]);
    return least;
}

static void the_cut_is_closed_and_the_least(void **state)
{
    (void)state;
    srand(4);
    for (int round = 0; round < 20; ++round)
    {
        int path[RF_RING_ANGLES];
        g_ring.radii = 1 + round;
        for (int a = 0; a < RF_RING_ANGLES; ++a)
            for (int r = 0; r < g_ring.radii; ++r)
                g_ring.errors[a][r] = (float)(rand() % 1000);
        float told = rf_ring_cut(&g_ring, path), sum = 0;
        for (int a = 0; a < RF_RING_ANGLES; ++a)
        {
            assert_in_range(path[a], 0, g_ring.radii - 1);
            assert_true(abs(path[a] - path[(a + 1) % RF_RING_ANGLES]) <= 1);
            sum += g_ring.errors[a][path[a]];
        }
        assert_true(fabsf(sum - told) < 0.5f);
        assert_true(fabsf(told - reference()) < 0.5f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_rigid_rotation_turns_the_texture_with_it),
        cmocka_unit_test(strain_is_told_by_the_bend),
        cmocka_unit_test(a_bend_that_mirrors_has_a_negative_stretch),
        cmocka_unit_test(borders_move_by_parts_of_a_pixel),
        cmocka_unit_test(what_flows_in_continues_what_is_there),
        cmocka_unit_test(a_turning_disc_is_not_continued),
        cmocka_unit_test(no_marker_no_voice),
        cmocka_unit_test(the_cut_is_closed_and_the_least),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
