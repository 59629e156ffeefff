// SPDX-License-Identifier: Apache-2.0
// The flows of the gallery, for 300 frames each: real wind, particle image velocimetry and turbulence where the data
// are there, and the built-in ones with obstacles. Frames are small; the radius is an eighth of the shorter side.
#include "riffle/riffle.h"
#include "support/files.h"
#include "support/sanitized.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

enum
{
    FRAMES = TEST_SANITIZED ? 40 : 300
};

static RfExemplar *make_exemplar(const char *name)
{
    RfImage *image;
    RfExemplar *exemplar;
    assert_int_equal(rf_image_read(name, &image), RF_OK);
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar), RF_OK);
    rf_image_destroy(image);
    return exemplar;
}

static void check_for_holes(const char *path, RfFlowReadOptions reading, int width, int height)
{
    RfFlow *flow;
    RfLagrangian *lagrangian;
    RfImage *image;
    RfExemplar *exemplar = make_exemplar("builtin:foam?size=128");
    assert_int_equal(rf_flow_open(path, &reading, &flow), RF_OK);
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.particle_radius = (float)(width < height ? width : height) / 8;
    assert_int_equal(rf_lagrangian_create(exemplar, &options, &lagrangian), RF_OK);
    assert_int_equal(rf_image_create(width, height, 3, &image), RF_OK);
    RfImageView frame = rf_image_view(image);
    int first = rf_flow_info(flow).first_frame;
    for (int n = first; n < first + FRAMES; ++n)
    {
        RfFlowView view;
        assert_int_equal(rf_flow_at(flow, n, &view), RF_OK);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        if (rf_lagrangian_stats(lagrangian).holes != 0)
            fail_msg("%s: %lld pixels without texture in frame %d", path,
                     (long long)rf_lagrangian_stats(lagrangian).holes, n);
    }
    rf_image_destroy(image);
    rf_lagrangian_destroy(lagrangian);
    rf_flow_close(flow);
    rf_exemplar_destroy(exemplar);
}

static void check_real(const char *name, float scale, int every, int width, int height)
{
    const char *path = test_data_file(name);
    if (!path)
    {
        print_message("skipped: %s is not there\n", name);
        skip();
    }
    RfFlowReadOptions reading = rf_flow_read_defaults();
    reading.velocity_scale = scale;
    reading.moment_every = every;
    check_for_holes(path, reading, width, height);
}

static void wind_leaves_no_hole_in_300_frames(void **state)
{
    (void)state;
    check_real("flows2d/gfs_wind", 0.06f, 36, 360, 180);
}

static void velocimetry_leaves_no_hole_in_300_frames(void **state)
{
    (void)state;
    check_real("flows2d/pivpy_day2", 1.5f, 60, 246, 258);
}

static void turbulence_leaves_no_hole_in_300_frames(void **state)
{
    (void)state;
    check_real("flows2d/example_data_HIT.nc", 10, 1, 256, 256);
}

static void built_in_flows_leave_no_hole_in_300_frames(void **state)
{
    (void)state;
    static const char *const flows[] = {"builtin:river?size=256x128", "builtin:cylinder?size=256x128",
                                        "builtin:gyre?size=256x128", "builtin:turbulence?size=128x128"};
    for (size_t i = 0; i < sizeof flows / sizeof flows[0]; ++i)
        check_for_holes(flows[i], rf_flow_read_defaults(), i < 3 ? 256 : 128, 128);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wind_leaves_no_hole_in_300_frames),
        cmocka_unit_test(velocimetry_leaves_no_hole_in_300_frames),
        cmocka_unit_test(turbulence_leaves_no_hole_in_300_frames),
        cmocka_unit_test(built_in_flows_leave_no_hole_in_300_frames),
    };
    return cmocka_run_group_tests_name("real flows", tests, NULL, NULL);
}
