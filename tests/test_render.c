// SPDX-License-Identifier: Apache-2.0
#include "core/memory.h"
#include "data/flow_field.h"
#include "riffle/render.h"
#include "support/scenes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    W = 160,
    H = 96,
    PIXELS = W * H
};

static float g_velocity[2 * PIXELS], g_frame[3 * PIXELS], g_other[3 * PIXELS], g_field[PIXELS];
static uint8_t g_mask[PIXELS];

static RfImageView frame_of(float *pixels)
{
    return (RfImageView){pixels, W, H, 3, 3 * W};
}

static RfFlowView view_of_velocity(void)
{
    return (RfFlowView){.width = W, .height = H, .velocity = g_velocity, .next_time = 0};
}

static void picture(RfFlowPicture kind, float full_speed, const RfFlowView *view, float *pixels)
{
    RfFlowPictureOptions options = rf_flow_picture_defaults();
    RfImageView frame = frame_of(pixels);
    options.picture = kind;
    options.full_speed = full_speed;
    assert_int_equal(rf_flow_picture(view, &options, &frame), RF_OK);
}

static float grey(const float *p)
{
    return (p[0] + p[1] + p[2]) / 3;
}

static void assert_displayable(const float *pixels)
{
    for (int k = 0; k < 3 * PIXELS; ++k)
        assert_true(pixels[k] >= 0 && pixels[k] <= 1);
}

static void assert_colour(const float *p, float r, float g, float b, float tolerance)
{
    assert_true(fabsf(p[0] - r) <= tolerance && fabsf(p[1] - g) <= tolerance && fabsf(p[2] - b) <= tolerance);
}

static void the_wheel_is_white_at_rest_red_to_the_right_and_darker_beyond_full_speed(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){0, 0}, g_velocity);
    picture(RF_FLOW_WHEEL, 0, &view, g_frame);
    assert_colour(g_frame, 1, 1, 1, 0);
    scene_uniform(W, H, (RfVec2){2, 0}, g_velocity);
    picture(RF_FLOW_WHEEL, 0, &view, g_frame);
    assert_colour(g_frame + 300, 1, 0, 0, 0.01f);
    picture(RF_FLOW_WHEEL, 4, &view, g_frame);
    assert_colour(g_frame + 300, 1, 0.5f, 0.5f, 0.01f);
    picture(RF_FLOW_WHEEL, 1, &view, g_frame);
    assert_colour(g_frame + 300, 0.75f, 0, 0, 0.01f);
    scene_uniform(W, H, (RfVec2){0, 2}, g_velocity);
    picture(RF_FLOW_WHEEL, 0, &view, g_frame);
    assert_true(g_frame[0] > 0.9f && g_frame[1] > 0.8f && g_frame[2] < 0.1f); // down is yellow
}

static void a_picture_shows_the_moment_that_the_view_asks_for(void **state)
{
    (void)state;
    static float next[2 * PIXELS];
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){2, 0}, g_velocity);
    scene_uniform(W, H, (RfVec2){4, 0}, next);
    view.next_velocity = next;
    view.velocity_time = 3;
    view.next_time = 4;
    view.time = 3.5;
    picture(RF_FLOW_WHEEL, 4, &view, g_frame);
    assert_colour(g_frame, 1, 0.25f, 0.25f, 0.01f);
}

static void every_picture_of_a_flow_twice_as_fast_is_the_same(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    for (int kind = RF_FLOW_WHEEL; kind <= RF_FLOW_LIC; ++kind)
    {
        scene_two_vortices(W, H, 0, g_velocity);
        picture((RfFlowPicture)kind, 0, &view, g_frame);
        for (int k = 0; k < 2 * PIXELS; ++k)
            g_velocity[k] *= 2;
        picture((RfFlowPicture)kind, 0, &view, g_other);
        assert_memory_equal(g_frame, g_other, sizeof g_frame);
        assert_displayable(g_frame);
    }
}

static void land_is_dark_grey_in_every_picture(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_two_vortices(W, H, 0, g_velocity);
    for (int k = 0; k < PIXELS; ++k)
        g_mask[k] = hypot(k % W - 80.0, (double)(k / W) - 48.0) > 20;
    view.mask = g_mask;
    for (int kind = RF_FLOW_WHEEL; kind <= RF_FLOW_LIC; ++kind)
    {
        picture((RfFlowPicture)kind, 0, &view, g_frame);
        int same = 0;
        for (int k = 0; k < PIXELS; ++k)
            if (!g_mask[k])
                assert_colour(g_frame + 3 * k, 0.17f, 0.17f, 0.18f, 1e-6f);
            else
                same += fabsf(g_frame[3 * k] - 0.17f) < 1e-6f;
        assert_true(same < PIXELS / 100);
    }
}

static void arrows_point_along_the_flow(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){2, 0}, g_velocity);
    picture(RF_FLOW_ARROWS, 0, &view, g_frame);
    scene_uniform(W, H, (RfVec2){-2, 0}, g_velocity);
    picture(RF_FLOW_ARROWS, 0, &view, g_other);
    int lit = 0, mirrored = 0, still = 0;
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
        {
            bool right = grey(g_frame + 3 * (y * W + x)) > 0.8f;
            lit += right;
            mirrored += right && grey(g_other + 3 * (y * W + W - 1 - x)) > 0.8f;
            still += right && grey(g_other + 3 * (y * W + x)) > 0.8f;
        }
    assert_true(lit > 500);
    assert_true(mirrored > 0.95 * lit && still < 0.85 * lit);
}

// Correlation of the picture's grey with itself `dx`, `dy` further, over the middle.
static double correlation(const float *pixels, int dx, int dy)
{
    double a = 0, aa = 0, ab = 0, n = 0;
    for (int y = 10; y < H - 10; ++y)
        for (int x = 10; x < W - 10; ++x)
        {
            double p = (double)grey(pixels + 3 * (y * W + x)), q = (double)grey(pixels + 3 * ((y + dy) * W + x + dx));
            a += p;
            aa += p * p;
            ab += p * q;
            n += 1;
        }
    return (ab / n - a / n * (a / n)) / (aa / n - a / n * (a / n));
}

static double deviation(const float *pixels)
{
    double a = 0, aa = 0;
    for (int k = 0; k < PIXELS; ++k)
    {
        double p = (double)grey(pixels + 3 * k);
        a += p / PIXELS;
        aa += p * p / PIXELS;
    }
    return sqrt(aa - a * a);
}

static void noise_is_smeared_along_the_flow_and_not_across(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){1, 0}, g_velocity);
    picture(RF_FLOW_LIC, 0, &view, g_frame);
    assert_true(correlation(g_frame, 6, 0) > 0.6 && correlation(g_frame, 0, 3) < 0.2);
    assert_true(deviation(g_frame) > 0.1);
    scene_uniform(W, H, (RfVec2){1, 1}, g_velocity);
    picture(RF_FLOW_LIC, 0, &view, g_frame);
    assert_true(correlation(g_frame, 4, 4) > 0.6 && correlation(g_frame, 4, -4) < 0.2);
}

static void where_nothing_moves_faint_noise_stays(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){0, 0}, g_velocity);
    picture(RF_FLOW_LIC, 0, &view, g_frame);
    assert_true(deviation(g_frame) > 0.01 && deviation(g_frame) < 0.08);
    assert_true(fabs(correlation(g_frame, 4, 0)) < 0.1);
}

static void a_flow_with_a_number_that_is_none_is_refused(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    RfFlowPictureOptions options = rf_flow_picture_defaults();
    RfImageView frame = frame_of(g_frame);
    scene_uniform(W, H, (RfVec2){0, 0}, g_velocity);
    g_velocity[99] = INFINITY;
    assert_int_equal(rf_flow_picture(&view, &options, &frame), RF_BAD_INPUT);
#ifndef RF_STOP_ON_MISUSE
    options.struct_size = 0;
    assert_int_equal(rf_flow_picture(&view, &options, &frame), RF_INVALID_ARGUMENT);
#endif
}

static void shade_constant(RfShader shader, float value, float *out)
{
    RfImageView parameters = {g_field, W, H, 1, W}, colour = frame_of(out);
    for (int k = 0; k < PIXELS; ++k)
        g_field[k] = value;
    assert_int_equal(rf_shade(shader, &parameters, &colour), RF_OK);
    assert_displayable(out);
}

static void fire_is_hotter_where_the_parameter_is_larger_and_lower_down(void **state)
{
    (void)state;
    float before = -1;
    for (float value = 0; value <= 1; value += 0.125f)
    {
        shade_constant(RF_SHADER_FIRE, value, g_frame);
        const float *top = g_frame + 3 * (W / 2), *bottom = g_frame + 3 * ((H - 1) * W + W / 2);
        assert_true(grey(bottom) >= before && grey(bottom) >= grey(top));
        assert_true(bottom[0] >= bottom[1] && bottom[1] >= bottom[2]);
        before = grey(bottom);
        if (value == 0)
            assert_true(grey(top) < 0.1f);
    }
    assert_true(before > 0.9f);
}

static void clouds_leave_blue_sky_where_the_parameter_is_low_and_hide_it_where_it_is_high(void **state)
{
    (void)state;
    shade_constant(RF_SHADER_CLOUDS, 0.2f, g_frame);
    assert_true(g_frame[2] > 0.6f && g_frame[0] < 0.3f);
    shade_constant(RF_SHADER_CLOUDS, 0.9f, g_frame);
    assert_true(fabsf(g_frame[2] - g_frame[0]) < 0.25f && grey(g_frame) > 0.5f);
}

static void a_cloud_is_brighter_towards_the_sun(void **state)
{
    (void)state;
    RfImageView parameters = {g_field, W, H, 1, W}, colour = frame_of(g_frame);
    for (int k = 0; k < PIXELS; ++k)
        g_field[k] = 0.3f + 0.6f * expf(-(float)((k % W - 80) * (k % W - 80) + (k / W - 48) * (k / W - 48)) / 400);
    assert_int_equal(rf_shade(RF_SHADER_CLOUDS, &parameters, &colour), RF_OK);
    assert_true(grey(g_frame + 3 * (40 * W + 70)) > grey(g_frame + 3 * (56 * W + 90)) + 0.1f);
}

static void three_equal_channels_shade_as_one_and_no_shader_passes_the_parameter_on(void **state)
{
    (void)state;
    static float three[3 * PIXELS];
    RfImageView one = {g_field, W, H, 1, W}, all = {three, W, H, 3, 3 * W};
    RfImageView a = frame_of(g_frame), b = frame_of(g_other);
    scene_noise(W, H, 0.01f, 0.1f, 1, g_field);
    for (int k = 0; k < 3 * PIXELS; ++k)
        three[k] = g_field[k / 3];
    assert_int_equal(rf_shade(RF_SHADER_CLOUDS, &one, &a), RF_OK);
    assert_int_equal(rf_shade(RF_SHADER_CLOUDS, &all, &b), RF_OK);
    for (int k = 0; k < 3 * PIXELS; ++k)
        assert_true(fabsf(g_frame[k] - g_other[k]) < 1e-4f);
    assert_int_equal(rf_shade(RF_SHADER_NONE, &one, &a), RF_OK);
    for (int k = 0; k < 3 * PIXELS; ++k)
        assert_true(g_frame[k] == g_field[k / 3]);
    g_field[5] = NAN;
    assert_int_equal(rf_shade(RF_SHADER_FIRE, &one, &a), RF_OK);
    assert_displayable(g_frame);
#ifndef RF_STOP_ON_MISUSE
    b.width = W - 1;
    assert_int_equal(rf_shade(RF_SHADER_FIRE, &one, &b), RF_INVALID_ARGUMENT);
#endif
}

static void relief_of(float scale, float *out)
{
    static float white[3 * PIXELS];
    for (int k = 0; k < 3 * PIXELS; ++k)
        white[k] = 0.6f;
    RfImageView height = {g_field, W, H, 1, W}, colour = frame_of(white), frame = frame_of(out);
    assert_int_equal(rf_render_relief(&height, &colour, scale, &frame), RF_OK);
    assert_displayable(out);
}

static void the_whole_slab_is_seen_before_the_sky(void **state)
{
    (void)state;
    scene_noise(W, H, 0.01f, 0.1f, 1, g_field);
    for (float scale = 0; scale < 1.1f; scale += 0.5f)
    {
        relief_of(scale, g_frame);
        int slab = 0;
        for (int y = 0; y < H; ++y)
            for (int x = 0; x < W; ++x)
            {
                const float *p = g_frame + 3 * (y * W + x), *corner = g_frame + 3 * (y * W);
                bool border = x < 2 || y < 2 || x >= W - 2 || y >= H - 2, sky = memcmp(p, corner, 12) == 0;
                slab += !sky;
                if (border)
                    assert_true(sky);
            }
        assert_true(slab > PIXELS / 5);
    }
}

static void a_hill_is_lit_from_the_left_and_casts_its_shadow_to_the_right(void **state)
{
    (void)state;
    memset(g_field, 0, sizeof g_field);
    relief_of(0.3f, g_other);
    for (int k = 0; k < PIXELS; ++k)
        g_field[k] = hypotf((float)(k % W - 70), (float)(k / W - 48)) < 16 ? 1.0f : 0;
    relief_of(0.3f, g_frame);
    double left = 0, right = 0;
    // The ground beside the hill, a little nearer than it: there the far sun's shadow falls.
    for (int y = 60; y < 70; ++y)
        for (int x = 0; x < 14; ++x)
        {
            int on_left = 3 * (y * W + 30 + x), on_right = 3 * (y * W + 98 + x);
            left += (double)(grey(g_frame + on_left) - grey(g_other + on_left)) / (10 * 14);
            right += (double)(grey(g_frame + on_right) - grey(g_other + on_right)) / (10 * 14);
        }
    assert_true(right < left - 0.1);
}

static void a_field_of_one_texel_and_heights_that_are_no_numbers_can_be_drawn(void **state)
{
    (void)state;
    float one = 0.5f, colour[3] = {1, 0, 0};
    RfImageView height = {&one, 1, 1, 1, 1}, red = {colour, 1, 1, 3, 3}, frame = frame_of(g_frame);
    assert_int_equal(rf_render_relief(&height, &red, 0.1f, &frame), RF_OK);
    assert_displayable(g_frame);
    for (int k = 0; k < PIXELS; ++k)
        g_field[k] = k % 3 == 0 ? NAN : k % 3 == 1 ? 1e30f : -INFINITY;
    relief_of(0.2f, g_frame);
#ifndef RF_STOP_ON_MISUSE
    assert_int_equal(rf_render_relief(&height, &red, NAN, &frame), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_render_relief(&height, &height, 0.1f, &frame), RF_INVALID_ARGUMENT);
#endif
}

static void draw_everything(float *pixels[6])
{
    RfFlowView view = view_of_velocity();
    for (int kind = RF_FLOW_WHEEL; kind <= RF_FLOW_LIC; ++kind)
        picture((RfFlowPicture)kind, 0, &view, pixels[kind]);
    for (int shader = RF_SHADER_FIRE; shader <= RF_SHADER_CLOUDS; ++shader)
    {
        RfImageView parameters = {g_field, W, H, 1, W}, colour = frame_of(pixels[2 + shader]);
        assert_int_equal(rf_shade((RfShader)shader, &parameters, &colour), RF_OK);
    }
    relief_of(0.2f, pixels[5]);
}

static void any_number_of_threads_gives_the_same_bytes(void **state)
{
    (void)state;
    static float first[6][3 * PIXELS], again[6][3 * PIXELS];
    float *a[6], *b[6];
    for (int i = 0; i < 6; ++i)
    {
        a[i] = first[i];
        b[i] = again[i];
    }
    scene_two_vortices(W, H, 0, g_velocity);
    scene_noise(W, H, 0.01f, 0.1f, 1, g_field);
    rf_set_threads(1);
    draw_everything(a);
    rf_set_threads(3);
    draw_everything(b);
    rf_set_threads(0);
    assert_memory_equal(first, again, sizeof first);
}

static void streaks_do_not_break_where_tiles_meet(void **state)
{
    (void)state;
    RfFlowView view = view_of_velocity();
    scene_uniform(W, H, (RfVec2){2, 0.3f}, g_velocity);
    picture(RF_FLOW_LIC, 0, &view, g_frame);
    // The first tile ends between columns 95 and 96.
    double across = 0, inside = 0;
    for (int y = 0; y < H; ++y)
        for (int x = 1; x < W; ++x)
        {
            const float *p = g_frame + 3 * (y * W + x);
            *(x == 96 ? &across : &inside) += fabs((double)(grey(p) - grey(p - 3))) / (x == 96 ? 1 : W - 2);
        }
    assert_true(across < 1.5 * inside);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_wheel_is_white_at_rest_red_to_the_right_and_darker_beyond_full_speed),
        cmocka_unit_test(a_picture_shows_the_moment_that_the_view_asks_for),
        cmocka_unit_test(every_picture_of_a_flow_twice_as_fast_is_the_same),
        cmocka_unit_test(land_is_dark_grey_in_every_picture),
        cmocka_unit_test(arrows_point_along_the_flow),
        cmocka_unit_test(noise_is_smeared_along_the_flow_and_not_across),
        cmocka_unit_test(where_nothing_moves_faint_noise_stays),
        cmocka_unit_test(a_flow_with_a_number_that_is_none_is_refused),
        cmocka_unit_test(fire_is_hotter_where_the_parameter_is_larger_and_lower_down),
        cmocka_unit_test(clouds_leave_blue_sky_where_the_parameter_is_low_and_hide_it_where_it_is_high),
        cmocka_unit_test(a_cloud_is_brighter_towards_the_sun),
        cmocka_unit_test(three_equal_channels_shade_as_one_and_no_shader_passes_the_parameter_on),
        cmocka_unit_test(the_whole_slab_is_seen_before_the_sky),
        cmocka_unit_test(a_hill_is_lit_from_the_left_and_casts_its_shadow_to_the_right),
        cmocka_unit_test(a_field_of_one_texel_and_heights_that_are_no_numbers_can_be_drawn),
        cmocka_unit_test(any_number_of_threads_gives_the_same_bytes),
        cmocka_unit_test(streaks_do_not_break_where_tiles_meet),
    };
    return cmocka_run_group_tests_name("render", tests, NULL, NULL);
}
