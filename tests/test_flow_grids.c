// SPDX-License-Identifier: Apache-2.0
// Flows in NetCDF and VTK files.
#include "support/flow_check.h"

// ---- NetCDF ------------------------------------------------------------------------------------------------------

static void a_shear_over_rising_latitudes_is_turned_round_sign_and_all(void **state)
{
    (void)state;
    if (no_netcdf())
    {
        print_message("this build reads no NetCDF\n");
        skip();
    }
    // u grows northwards, v is northward; 0.5 degree rows from 59.5 to 60.5 north, 1 degree columns.
    const double lat[] = {59.5, 60, 60.5}, lon[] = {5, 6};
    const double u[] = {10, 10, 20, 20, 30, -99}, v[] = {3, 3, 3, 3, 3, 3};
    const int sizes[] = {1, 3, 2};
    const TestNcVariable variables[] = {
        {.name = "lat", .dimension_count = 1, .dimensions = {1}, .units = "degrees_north", .values = lat},
        {.name = "lon", .dimension_count = 1, .dimensions = {2}, .units = "degrees_east", .values = lon},
        {.name = "a",
         .dimension_count = 3,
         .dimensions = {0, 1, 2},
         .standard_name = "eastward_wind",
         .has_fill = true,
         .fill = -99,
         .values = u},
        {.name = "b", .dimension_count = 3, .dimensions = {0, 1, 2}, .standard_name = "northward_wind", .values = v}};
    test_nc(&file, grid_names, sizes, 3, variables, 4);
    RfFlowView view;
    RfFlow *flow = open_first(save("shear.nc"), &view);
    const double degree = 111200, fps = 24, to_radians = 3.14159265358979 / 180;
    assert_velocity(&view, 0, 0, 30 / (degree * cos(60.5 * to_radians) * fps), -3 / (0.5 * degree * fps));
    assert_velocity(&view, 0, 2, 10 / (degree * cos(59.5 * to_radians) * fps), -3 / (0.5 * degree * fps));
    // The fill value stood in the last row of the file: now the first.
    assert_velocity(&view, 1, 0, 0, 0);
    assert_non_null(view.mask);
    for (int k = 0; k < 6; ++k)
        assert_int_equal(view.mask[k], k != 1);
    assert_non_null(strstr(rf_flow_info(flow).conventions, "y ran up"));
    rf_flow_close(flow);
}

static void packed_moments_over_metres_are_scaled(void **state)
{
    (void)state;
    if (no_netcdf())
    {
        print_message("this build reads no NetCDF\n");
        skip();
    }
    // Moments 1 and 2 m/s along x, 4 m cells; y falls, so the rows stay.
    const char *const names[] = {"time", "depth", "y", "x"};
    const int sizes[] = {2, 2, 2, 2};
    const double y[] = {8, 4}, x[] = {0, 4};
    const double u[] = {100, 100, 100, 100, 7, 7, 7, 7, 200, 200, 200, 200, 7, 7, 7, 7};
    const double v[] = {0, 0, 100, 0, 7, 7, 7, 7, 0, 0, 0, -32767, 7, 7, 7, 7};
    TestNcVariable variables[] = {
        {.name = "y", .dimension_count = 1, .dimensions = {2}, .units = "m", .values = y},
        {.name = "x", .dimension_count = 1, .dimensions = {3}, .units = "m", .values = x},
        {.name = "east", .dimension_count = 4, .dimensions = {0, 1, 2, 3}, .packed = true, .scale = 0.01, .values = u},
        {.name = "north",
         .dimension_count = 4,
         .dimensions = {0, 1, 2, 3},
         .packed = true,
         .scale = 0.01,
         .has_fill = true,
         .fill = -32767,
         .values = v}};
    test_nc(&file, names, sizes, 4, variables, 4);
    const char *path = save("packed.nc");
    assert_refused(path, NULL, RF_BAD_INPUT, "it has: y, x, east, north; name them with --variables");

    RfFlowReadOptions options = rf_flow_read_defaults();
    options.variables = "east,north";
    options.fps = 10;
    RfFlow *flow = open_flow(path, &options);
    RfFlowView view;
    assert_int_equal(rf_flow_info(flow).moment_count, 2);
    assert_int_equal(rf_flow_at(flow, 0, &view), RF_OK);
    assert_velocity(&view, 0, 0, 1 / 40.0, 0);
    assert_velocity(&view, 0, 1, 1 / 40.0, -1 / 40.0);
    assert_true(fabsf(view.next_velocity[0] - 2 / 40.0f) < 1e-7f);
    assert_null(view.mask);
    assert_int_equal(rf_flow_at(flow, 1, &view), RF_OK);
    assert_non_null(view.mask);
    assert_int_equal(view.mask[3], 0);
    assert_int_equal(view.mask[2], 1);
    rf_flow_close(flow);
}

// ---- VTK ---------------------------------------------------------------------------------------------------------

static void a_plane_of_vtk_reads_the_same_in_every_coding(void **state)
{
    (void)state;
    // Two rows of three; u grows upwards, v is 1 upwards.
    const double values[] = {1, 1, 9, 1, 1, 9, 1, 1, 9, 2, 1, 9, 2, 1, 9, 3, 1, 9};
    static const char *const codings[] = {"ascii", "binary", "raw", "base64"};
    for (int i = 0; i < 4 * 32; ++i)
    {
        TestVti vti = {.width = 3,
                       .height = 2,
                       .depth = 1,
                       .spacing = {0.5, 0.25},
                       .name = i & 16 ? "U" : "velocity",
                       .components = 3,
                       .values = values,
                       .coding = codings[i / 32],
                       .type = i & 8 ? "Float64" : "Float32",
                       .points = i & 16,
                       .big_endian = i & 1,
                       .wide = i & 2,
                       .compressed = i & 4};
        test_vti(&file, &vti);
        RfFlowView view;
        RfFlow *flow = open_first(save("plane.vti"), &view);
        assert_int_equal(view.width, 3);
        assert_int_equal(view.height, 2);
        assert_velocity(&view, 0, 0, 2 / (0.5 * 24), -1 / (0.25 * 24));
        assert_velocity(&view, 2, 0, 3 / (0.5 * 24), -1 / (0.25 * 24));
        assert_velocity(&view, 1, 1, 1 / (0.5 * 24), -1 / (0.25 * 24));
        rf_flow_close(flow);
    }
}

static void a_volume_is_refused_with_the_remedy(void **state)
{
    (void)state;
    double values[24] = {0};
    TestVti vti = {.width = 2,
                   .height = 2,
                   .depth = 2,
                   .spacing = {1, 1},
                   .name = "vel",
                   .components = 3,
                   .values = values,
                   .coding = "ascii",
                   .type = "Float32"};
    test_vti(&file, &vti);
    assert_refused(save("volume.vti"), NULL, RF_BAD_INPUT, "cut one slice");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_shear_over_rising_latitudes_is_turned_round_sign_and_all),
        cmocka_unit_test(packed_moments_over_metres_are_scaled),
        cmocka_unit_test(a_plane_of_vtk_reads_the_same_in_every_coding),
        cmocka_unit_test(a_volume_is_refused_with_the_remedy),
    };
    return cmocka_run_group_tests_name("flows on grids", tests, make_folder, remove_folder);
}
