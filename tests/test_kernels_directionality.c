// SPDX-License-Identifier: Apache-2.0
// The main direction of a picture.
#include "core/maths.h"
#include "kernels/directionality.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>

#include <cmocka.h>

enum
{
    SIDE = 96
};

static const float THRESHOLD = 12.0f / 256;

static float g_grey[SIDE * SIDE];

// Lines along an angle, of two lengths that are no multiple of each other.
static void draw_lines(float angle)
{
    for (int y = 0; y < SIDE; ++y)
        for (int x = 0; x < SIDE; ++x)
        {
            float across = (float)y * cosf(angle) - (float)x * sinf(angle);
            g_grey[y * SIDE + x] = 0.5f + 0.25f * sinf(0.9f * across) + 0.15f * sinf(0.37f * across);
        }
}

static float degrees_between(float a, float b)
{
    float d = fabsf(a - b) * (180 / RF_PI);
    return fminf(d, fabsf(180 - d));
}

static void lines_have_their_direction(void **state)
{
    (void)state;
    for (int degrees = 0; degrees < 180; degrees += 6)
    {
        float angle = (float)degrees * (RF_PI / 180);
        draw_lines(angle);
        RfDirectionality d = rf_directionality(g_grey, SIDE, SIDE, false, THRESHOLD);
        if (!(degrees_between(d.angle, angle) < 0.5f && d.strength > 0.97f && d.angle >= 0 && d.angle < RF_PI))
            fail_msg("%d degrees: %g, strength %g", degrees, (double)(d.angle * (180 / RF_PI)), (double)d.strength);
    }
}

static void what_has_no_direction_says_so(void **state)
{
    (void)state;
    scene_noise(SIDE, SIDE, 0.02f, 0.2f, 7, g_grey);
    assert_true(rf_directionality(g_grey, SIDE, SIDE, true, THRESHOLD / 4).strength < 0.15f);
    for (int i = 0; i < SIDE * SIDE; ++i)
        g_grey[i] = 0.3f;
    assert_true(rf_directionality(g_grey, SIDE, SIDE, false, THRESHOLD).strength == 0);
    // Edges under the threshold are none; and a picture may be a pixel.
    draw_lines(1);
    assert_true(rf_directionality(g_grey, SIDE, SIDE, false, 2).strength == 0);
    assert_true(rf_directionality(g_grey, 1, 1, false, THRESHOLD).strength == 0);
    assert_true(rf_directionality(g_grey, 1, 1, true, THRESHOLD).strength == 0);
}

// Bent lines are weaker than straight ones, whatever the direction.
static void the_wider_directions_lie_the_weaker_they_are(void **state)
{
    (void)state;
    float last = 2;
    for (int bend = 0; bend < 4; ++bend)
    {
        for (int y = 0; y < SIDE; ++y)
            for (int x = 0; x < SIDE; ++x)
            {
                float across = (float)y + 1.5f * (float)bend * sinf(0.2f * (float)x);
                g_grey[y * SIDE + x] = 0.5f + 0.4f * sinf(0.7f * across);
            }
        float strength = rf_directionality(g_grey, SIDE, SIDE, false, THRESHOLD).strength;
        assert_true(strength < last);
        last = strength;
    }
}

static void canes_lie_along_x(void **state)
{
    (void)state;
    RfImage *image = NULL;
    assert_int_equal(rf_image_read("builtin:canes?size=96", &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int i = 0; i < SIDE * SIDE; ++i)
    {
        const float *p = view.pixels + (i / SIDE) * view.row_stride + (ptrdiff_t)(i % SIDE) * view.channels;
        g_grey[i] = (p[0] + p[1] + p[2]) / 3;
    }
    RfDirectionality d = rf_directionality(g_grey, SIDE, SIDE, true, THRESHOLD);
    print_message("canes: %.1f degrees, strength %.2f\n", (double)(d.angle * (180 / RF_PI)), (double)d.strength);
    assert_true(degrees_between(d.angle, 0) < 3 && d.strength > 0.5f);
    rf_image_destroy(image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines_have_their_direction),
        cmocka_unit_test(what_has_no_direction_says_so),
        cmocka_unit_test(the_wider_directions_lie_the_weaker_they_are),
        cmocka_unit_test(canes_lie_along_x),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
