// SPDX-License-Identifier: Apache-2.0
// Flows as arrays, in time, as pictures and tables, written, and the real ones.
#include "support/flow_check.h"

// ---- arrays ------------------------------------------------------------------------------------------------------

static void assert_second_moment(const char *path)
{
    RfFlow *flow = open_flow(path, NULL);
    RfFlowView view;
    assert_int_equal(rf_flow_info(flow).moment_count, 2);
    assert_int_equal(rf_flow_at(flow, 1, &view), RF_OK);
    assert_int_equal(view.width, 3);
    assert_int_equal(view.height, 2);
    for (int k = 0; k < 12; ++k)
    {
        assert_true(view.velocity[k] == (float)numbers[k]);
        assert_true(view.next_velocity[k] == (float)numbers[12 + k]);
    }
    rf_flow_close(flow);
}

static void an_array_reads_the_same_in_every_width_and_byte_order(void **state)
{
    (void)state;
    fill_numbers();
    static const char *const kinds[] = {"<f2", "<f4", "<f8", ">f2", ">f4", ">f8"};
    for (int i = 0; i < 6; ++i)
    {
        test_npy(&file, kinds[i], false, "2, 2, 3, 2", numbers, 24);
        assert_second_moment(save("a.npy"));
    }
}

static void an_array_in_fortran_order_reads_the_same(void **state)
{
    (void)state;
    fill_numbers();
    double turned[24];
    for (int t = 0; t < 2; ++t)
        for (int y = 0; y < 2; ++y)
            for (int x = 0; x < 3; ++x)
                for (int c = 0; c < 2; ++c)
                    turned[t + 2 * (y + 2 * (x + 3 * c))] = numbers[c + 2 * (x + 3 * (y + 2 * t))];
    test_npy(&file, "<f4", true, "2, 2, 3, 2", turned, 24);
    assert_second_moment(save("f.npy"));
}

static void an_archive_reads_the_same_stored_and_deflated(void **state)
{
    (void)state;
    fill_numbers();
    static TestBytes other, flow;
    test_npy(&other, "<f4", false, "4,", numbers, 4);
    test_npy(&flow, "<f4", false, "2, 2, 3, 2", numbers, 24);
    for (int deflated = 0; deflated < 2; ++deflated)
    {
        test_zip(&file, (TestZipEntry[]){{"times.npy", &other}, {"flow.npy", &flow}}, 2, deflated);
        assert_second_moment(save("a.npz"));
    }
}

static void an_archive_of_two_components_is_put_together(void **state)
{
    (void)state;
    fill_numbers();
    static TestBytes parts[2];
    for (int c = 0; c < 2; ++c)
    {
        double half[12];
        for (int k = 0; k < 12; ++k)
            half[k] = numbers[2 * k + c];
        test_npy(&parts[c], c ? ">f4" : "<f8", false, "2, 2, 3", half, 12);
    }
    test_zip(&file, (TestZipEntry[]){{"v.npy", &parts[1]}, {"u.npy", &parts[0]}}, 2, true);
    assert_second_moment(save("pair.npz"));
}

static void unknown_vectors_of_middlebury_become_mask(void **state)
{
    (void)state;
    test_flo(&file, 2, 1, (float[]){1, 2, 1e10f, 1e10f});
    RfFlowView view;
    RfFlow *flow = open_first(save("hole.flo"), &view);
    assert_non_null(view.mask);
    assert_int_equal(view.mask[0], 1);
    assert_int_equal(view.mask[1], 0);
    assert_velocity(&view, 1, 0, 0, 0);
    // Land is in neither.
    assert_true(fabsf(rf_flow_info(flow).max_speed - hypotf(1, 2)) < 1e-6f);
    assert_true(fabsf(rf_flow_info(flow).mean_speed - hypotf(1, 2)) < 1e-6f);
    rf_flow_close(flow);
}

// ---- time --------------------------------------------------------------------------------------------------------

static void write_sequence(const char *format, int first, int count)
{
    for (int i = 0; i < count; ++i)
    {
        char name[64];
        snprintf(name, sizeof name, format, first + i);
        test_flo(&file, 1, 1, (float[]){(float)i, 0});
        save(name);
    }
}

static void every_step_lies_between_the_two_moments_round_it(void **state)
{
    (void)state;
    write_sequence("s%03d.flo", 10, 3);
    RfFlowReadOptions options = rf_flow_read_defaults();
    options.moment_every = 4;
    options.velocity_scale = 10;
    RfFlow *flow = open_flow(test_folder_file(&folder, "s%03d.flo"), &options);
    assert_int_equal(rf_flow_info(flow).first_frame, 10);
    assert_int_equal(rf_flow_info(flow).last_frame, 18);
    // Frame, moment before, moment after (-1: none); in an order that goes back as well.
    static const int cases[][3] = {{10, 0, 1},  {11, 0, 1},  {14, 0, 1}, {15, 1, 2}, {18, 1, 2},
                                   {19, 2, -1}, {99, 2, -1}, {12, 0, 1}, {16, 1, 2}, {5, 0, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i)
    {
        RfFlowView view;
        assert_int_equal(rf_flow_at(flow, cases[i][0], &view), RF_OK);
        assert_true(view.time == cases[i][0]);
        assert_true(view.velocity[0] == (float)(10 * cases[i][1]));
        assert_true(view.velocity_time == 10 + 4 * cases[i][1]);
        assert_int_equal(view.next_velocity != NULL, cases[i][2] >= 0);
        if (view.next_velocity)
        {
            assert_true(view.next_velocity[0] == (float)(10 * cases[i][2]));
            assert_true(view.next_time == 10 + 4 * cases[i][2]);
        }
    }
    rf_flow_close(flow);
}

static void a_list_of_files_is_a_flow_of_as_many_moments(void **state)
{
    (void)state;
    write_sequence("l%d.flo", 1, 3);
    static const char *const lists[][2] = {
        {"l.pvd", "<VTKFile type=\"Collection\"><Collection><DataSet timestep=\"0\" file=\"l3.flo\"/>"
                  "<DataSet timestep=\"1\" part=\"0\" file=\"l1.flo\"/></Collection></VTKFile>"},
        {"l.flo.series", "{\"file-series-version\" : \"1.0\", \"files\" : [ { \"name\" : \"l3.flo\", \"time\" : 0 },"
                         "\n{ \"time\" : 1, \"name\" : \"l1.flo\" } ] }"}};
    for (int i = 0; i < 2; ++i)
    {
        file.size = 0;
        test_bytes_add(&file, lists[i][1], strlen(lists[i][1]));
        RfFlowView view;
        RfFlow *flow = open_first(save(lists[i][0]), &view);
        assert_int_equal(rf_flow_info(flow).moment_count, 2);
        assert_true(view.velocity[0] == 2 && view.next_velocity[0] == 0);
        rf_flow_close(flow);
    }
}

static void a_builtin_flow_is_endless_or_steady(void **state)
{
    (void)state;
    RfFlowView view;
    RfFlow *flow = open_flow("builtin:gyre?size=32x16", NULL);
    assert_int_equal(rf_flow_info(flow).moment_count, 0);
    assert_int_equal(rf_flow_info(flow).first_frame, 1);
    assert_int_equal(rf_flow_info(flow).last_frame, 100);
    assert_int_equal(rf_flow_at(flow, 7, &view), RF_OK);
    assert_true(view.velocity_time == 6 && view.next_time == 7 && view.next_velocity);
    rf_flow_close(flow);
    flow = open_first("builtin:vortex?size=16x16", &view);
    assert_int_equal(rf_flow_info(flow).moment_count, 1);
    assert_null(view.next_velocity);
    rf_flow_close(flow);
}

static void moments_of_different_sizes_are_refused_by_name(void **state)
{
    (void)state;
    write_sequence("d%d.flo", 1, 1);
    test_flo(&file, 2, 1, (float[]){1, 2, 3, 4});
    const char *second = save("d2.flo");
    RfFlow *flow = open_flow(test_folder_file(&folder, "d%d.flo"), NULL);
    RfFlowView view;
    assert_int_equal(rf_flow_at(flow, 1, &view), RF_BAD_INPUT);
    assert_string_equal(rf_last_error()->file, second);
    assert_non_null(strstr(rf_last_error()->message, "one size"));
    rf_flow_close(flow);
}

static void what_is_not_finite_is_refused_with_its_cell(void **state)
{
    (void)state;
    test_flo(&file, 2, 2, (float[]){0, 0, 0, 0, 0, 0, 0, NAN});
    assert_refused(save("nan.flo"), NULL, RF_BAD_INPUT, "not a finite number");
    assert_string_equal(rf_last_error()->place, "cell 1, 1");
}

// ---- pictures and tables -----------------------------------------------------------------------------------------

static void a_picture_beside_its_json_is_a_flow(void **state)
{
    (void)state;
    RfImage *image;
    assert_int_equal(rf_image_create(8, 8, 3, &image), RF_OK);
    RfImageView pixels = rf_image_view(image);
    pixels.pixels[0] = 1;
    pixels.pixels[1] = 0.2f;
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    const char *path = test_folder_file(&folder, "wind.png");
    assert_int_equal(rf_image_write(path, image), RF_OK);
    rf_image_destroy(image);
    assert_refused(path, NULL, RF_BAD_INPUT, "wind.json is missing");

    file.size = 0;
    test_bytes_text(&file,
                    "{\"note\": [{\"uMin\": 7}, \"},\\\"\"], \"uMin\": -1e1,\n\"uMax\": 30, \"vMin\":0,\"vMax\":5.0}");
    save("wind.json");
    RfFlowView view;
    RfFlow *flow = open_first(path, &view);
    assert_velocity(&view, 0, 0, 30, -1);
    assert_velocity(&view, 1, 1, -10, 0);
    rf_flow_close(flow);
}

static void invalid_vectors_of_insight_are_filled_and_counted(void **state)
{
    (void)state;
    test_vec(&file);
    RfFlowView view;
    RfFlow *flow = open_first(save("piv.vec"), &view);
    assert_int_equal(rf_flow_info(flow).filled_vectors, 1);
    assert_int_equal(view.width, 3);
    assert_null(view.mask);
    for (int k = 0; k < 6; ++k)
        assert_velocity(&view, k % 3, k / 3, 1, -0.5);
    rf_flow_close(flow);
}

static void millimetres_and_metres_a_second_go_by_the_frame_rate(void **state)
{
    (void)state;
    file.size = 0;
    test_bytes_text(&file, "TITLE=\"\" VARIABLES=\"X mm\", \"Y mm\", \"U m/s\", \"V m/s\", \"CHC\", ZONE I=2, J=2\n"
                           "0,2,0.6,0.3,1\n4,2,0.6,0.3,1\n0,0,0.6,0.3,1\n4,0,0.6,0.3,1\n");
    RfFlowView view;
    RfFlow *flow = open_first(save("mm.vec"), &view);
    // 600 mm/s at 24 frames a second over 4 mm, and 300 mm/s over 2 mm.
    assert_velocity(&view, 1, 1, 600.0 / 24 / 4, -300.0 / 24 / 2);
    rf_flow_close(flow);
}

static void a_table_whose_y_falls_runs_up(void **state)
{
    (void)state;
    // Two columns 8 apart, two rows 4 apart; the second vector is flagged.
    for (int falls = 0; falls < 2; ++falls)
    {
        file.size = 0;
        test_bytes_text(&file, "# x\ty\tu\tv\tmask\n");
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i)
                test_bytes_text(&file, "%d\t%d\t%d\t4\t%d\n", 8 * i, 4 * (falls ? 1 - j : j), 8 * (j + 1),
                                i == 1 && j == 0);
        RfFlowView view;
        RfFlow *flow = open_first(save("table.txt"), &view);
        assert_velocity(&view, 0, 0, 1, falls ? -1 : 1);
        assert_velocity(&view, 0, 1, 2, falls ? -1 : 1);
        assert_int_equal(rf_flow_info(flow).filled_vectors, 1);
        rf_flow_close(flow);
    }
}

// ---- writing -----------------------------------------------------------------------------------------------------

static void what_is_written_reads_back_the_same(void **state)
{
    (void)state;
    float velocity[5 * 3 * 2];
    uint8_t mask[5 * 3];
    for (int k = 0; k < 30; ++k)
        velocity[k] = sinf((float)k) * 3;
    for (int k = 0; k < 15; ++k)
        mask[k] = k % 4 != 3;
    RfFlowView view = {.width = 5, .height = 3, .velocity = velocity, .mask = mask};
    static const char *const names[] = {"w.flo", "w.npy", "w.exr", "w.vti"};
    for (int i = 0; i < 4; ++i)
    {
        const char *path = test_folder_file(&folder, names[i]);
        assert_int_equal(rf_flow_write(path, &view, 24), RF_OK);
        RfFlowView back;
        RfFlow *flow = open_first(path, &back);
        bool masked = strstr(names[i], "vti");
        assert_int_equal(back.width, 5);
        assert_int_equal(back.height, 3);
        assert_int_equal(back.mask != NULL, masked);
        for (int k = 0; k < 15; ++k)
        {
            bool land = !masked && !mask[k];
            assert_velocity(&back, k % 5, k / 5, land ? 0 : (double)velocity[2 * k],
                            land ? 0 : (double)velocity[2 * k + 1]);
            if (masked)
                assert_int_equal(back.mask[k], mask[k]);
        }
        rf_flow_close(flow);
    }
    assert_int_equal(rf_flow_write(test_folder_file(&folder, "w.doc"), &view, 24), RF_UNSUPPORTED);
}

// ---- real files --------------------------------------------------------------------------------------------------

typedef struct Real
{
    const char *name, *format;
    int width, height, moments, filled;
} Real;

static void real_files_read_with_their_known_sizes(void **state)
{
    (void)state;
    static const Real cases[] = {
        {"flows2d/mmflow_00001.flo", "flo", 50, 50, 1, 0},   {"flows2d/openpiv_karman.txt", "openpiv", 42, 15, 1, 16},
        {"flows2d/pivpy_day2/0.vec", "vec", 41, 43, 1, 263}, {"flows2d/pivpy_day2", "vec", 41, 43, 6, 263},
        {"flows2d/gfs_wind", "png", 360, 180, 9, 0},         {"flows2d/example_data_HIT.nc", "nc", 256, 256, 1, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i)
    {
        const char *path = test_data_file(cases[i].name);
        if (!path)
        {
            print_message("%s is not among the data\n", cases[i].name);
            skip();
        }
        if (strcmp(cases[i].format, "nc") == 0 && no_netcdf())
            continue;
        RfFlow *flow = open_flow(path, NULL);
        RfFlowInfo info = rf_flow_info(flow);
        assert_string_equal(info.format, cases[i].format);
        assert_int_equal(info.width, cases[i].width);
        assert_int_equal(info.height, cases[i].height);
        assert_int_equal(info.moment_count, cases[i].moments);
        assert_int_equal(info.filled_vectors, cases[i].filled);
        rf_flow_close(flow);
    }
}

static double divergence(const RfFlowView *view, float sign)
{
    double sum = 0;
    for (int y = 1; y < view->height - 1; ++y)
        for (int x = 1; x < view->width - 1; ++x)
        {
            const float *cell = view->velocity + 2 * (y * view->width + x);
            double d = (double)(cell[2] - cell[-2] + sign * (cell[2 * view->width + 1] - cell[1 - 2 * view->width]));
            sum += d * d;
        }
    return sum;
}

static void real_flows_converge_less_than_with_v_the_other_way(void **state)
{
    (void)state;
    static const char *const names[] = {"flows2d/pivpy_day2/0.vec", "flows2d/pivpy_day2/3.vec", "flows2d/gfs_wind",
                                        "flows2d/example_data_HIT.nc"};
    for (int i = 0; i < (no_netcdf() ? 3 : 4); ++i)
    {
        const char *path = test_data_file(names[i]);
        if (!path)
        {
            print_message("%s is not among the data\n", names[i]);
            skip();
        }
        RfFlowView view;
        RfFlow *flow = open_first(path, &view);
        assert_true(divergence(&view, 1) < 0.8 * divergence(&view, -1));
        rf_flow_close(flow);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_array_reads_the_same_in_every_width_and_byte_order),
        cmocka_unit_test(an_array_in_fortran_order_reads_the_same),
        cmocka_unit_test(an_archive_reads_the_same_stored_and_deflated),
        cmocka_unit_test(an_archive_of_two_components_is_put_together),
        cmocka_unit_test(unknown_vectors_of_middlebury_become_mask),
        cmocka_unit_test(every_step_lies_between_the_two_moments_round_it),
        cmocka_unit_test(a_list_of_files_is_a_flow_of_as_many_moments),
        cmocka_unit_test(a_builtin_flow_is_endless_or_steady),
        cmocka_unit_test(moments_of_different_sizes_are_refused_by_name),
        cmocka_unit_test(what_is_not_finite_is_refused_with_its_cell),
        cmocka_unit_test(a_picture_beside_its_json_is_a_flow),
        cmocka_unit_test(invalid_vectors_of_insight_are_filled_and_counted),
        cmocka_unit_test(millimetres_and_metres_a_second_go_by_the_frame_rate),
        cmocka_unit_test(a_table_whose_y_falls_runs_up),
        cmocka_unit_test(what_is_written_reads_back_the_same),
        cmocka_unit_test(real_files_read_with_their_known_sizes),
        cmocka_unit_test(real_flows_converge_less_than_with_v_the_other_way),
    };
    return cmocka_run_group_tests_name("flow i/o", tests, make_folder, remove_folder);
}
