// SPDX-License-Identifier: Apache-2.0
// Flow files that are damaged, lie about their size, or kill the library that reads them.
#include "in/child.h"
#include "support/flow_check.h"

#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

typedef struct Broken
{
    const char *name, *content, *message;
} Broken;

static void broken_text_is_refused_with_a_reason(void **state)
{
    (void)state;
    static const Broken cases[] = {
        {"e.flo", "", "the file is empty"},
        {"b.flo", "PIEX1234", "does not begin with PIEH"},
        {"s.flo", "PIEH\1\1", "ends inside the header"},
        {"b.npy", "NUMPY", "not a NumPy array"},
        {"b.npz", "PK\3\4 and no more of it than this", "probably cut"},
        {"b.vec", "TITLE=\"\" VARIABLES= ZONE I=2, J=2\n1 2 3 4 1\n", "the file is cut"},
        {"c.vec", "1 2 3 4 1\n", "no line says ZONE"},
        {"b.txt", "# x y u v\n1 2 3\n", "four numbers"},
        {"c.txt", "0 0 1 1\n1 5 1 1\n7 3 1 1\n2 9 1 1\n3 4 1 1\n", "no regular grid"},
        {"b.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0\"/></VTKFile>", "six whole numbers"},
        {"c.vti", "<VTKFile type=\"PolyData\"></VTKFile>", "holds PolyData"},
        {"d.vti", "<!DOCTYPE a [<!ENTITY b \"c\">]><VTKFile type=\"ImageData\"/>", "document type"},
        {"e.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 1 0 1 0 0\"></VTKFile>", "not XML"},
        {"b.pvd", "<VTKFile><Collection></VTKFile>", "not XML"},
        {"c.pvd", "<VTKFile/>", "names no files"},
        {"b.series", "{\"files\": [\"a.vti\"]}", "not a JSON object"},
        {"b.exr", "v/1\1", ""},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; ++i)
    {
        file.size = 0;
        test_bytes_add(&file, cases[i].content, strlen(cases[i].content));
        assert_refused(save(cases[i].name), NULL, RF_BAD_INPUT + (strstr("c.vti d.vti", cases[i].name) != NULL),
                       cases[i].message);
    }
}

static size_t g_largest;

static void *allocate_and_note(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    g_largest = bytes > g_largest ? bytes : g_largest;
    return bytes < (size_t)1 << 30 ? aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment) : NULL;
}

static void release_noted(void *memory, void *user)
{
    (void)user;
    free(memory);
}

static void a_small_file_with_a_large_extent_is_refused_before_memory_is_asked_for(void **state)
{
    (void)state;
    static const char *const codings[] = {"ascii", "binary", "raw", "base64"};
    const RfAllocator noting = {allocate_and_note, release_noted, NULL};
    const double values[8] = {0};
    for (int i = 0; i < 8; ++i)
    {
        TestVti vti = {2, 2, 1, {1, 1}, "velocity", 2, values, codings[i % 4], "Float32", .compressed = i > 4};
        test_vti(&file, &vti);
        file.data[file.size] = '\0';
        // "0 2 0 2 0 ..." in WholeExtent and Extent.
        static TestBytes large;
        large.size = 0;
        char *from = (char *)file.data, *at;
        while ((at = strstr(from, "0 2 0 2 0")) != NULL)
        {
            test_bytes_add(&large, from, (size_t)(at - from));
            test_bytes_text(&large, "0 32768 0 32768 0");
            from = at + 9;
        }
        test_bytes_add(&large, from, file.size - (size_t)(from - (char *)file.data));
        assert_true(from > (char *)file.data);
        file = large;
        const char *path = save("large.vti");
        g_largest = 0;
        rf_set_allocator(&noting);
        assert_refused(path, NULL, RF_BAD_INPUT, "");
        rf_set_allocator(NULL);
        assert_true(g_largest < 100000);
        assert_non_null(strstr(rf_last_error()->place, "array velocity"));
    }
}

static void broken_numbers_are_refused_with_a_reason(void **state)
{
    (void)state;
    test_npy(&file, "<f4", false, "2, 2, 3", numbers, 12);
    assert_refused(save("c.npy"), NULL, RF_BAD_INPUT, "the shape is [2, 2, 3]");
    test_npy(&file, "<c8", false, "2, 2, 2", numbers, 0);
    assert_refused(save("d.npy"), NULL, RF_UNSUPPORTED, "numbers of this kind");
    test_npy(&file, "<f4", false, "30000, 30000, 2", numbers, 4);
    assert_refused(save("e.npy"), NULL, RF_BAD_INPUT, "needs 7200000000 bytes");
    test_flo(&file, 2, 2, (float[8]){0});
    file.data[7] = 0x80;
    assert_refused(save("f.flo"), NULL, RF_BAD_INPUT, "each side must be 1 to");

    static TestBytes array;
    test_npy(&array, "<f4", false, "1, 1, 2", numbers, 2);
    test_zip(&file, (TestZipEntry[]){{"a.npy", &array}}, 1, true);
    file.data[14] ^= 1;
    file.data[file.size - 22 - 51 + 16] ^= 1;
    assert_refused(save("c.npz"), NULL, RF_BAD_INPUT, "checksum");
    // The directory claims a gigabyte.
    test_zip(&file, (TestZipEntry[]){{"a.npy", &array}}, 1, true);
    file.data[file.size - 22 - 51 + 27] = 0x40;
    assert_refused(save("d.npz"), NULL, RF_BAD_INPUT, "claims a size");
}

static void a_damaged_netcdf_is_refused(void **state)
{
    (void)state;
    if (no_netcdf())
    {
        print_message("this build reads no NetCDF\n");
        skip();
    }
    file.size = 0;
    test_bytes_add(&file, "\x89HDF\r\n\x1a\n and nothing that HDF5 knows", 36);
    assert_refused(save("b.nc"), NULL, RF_BAD_INPUT, "NetCDF");
    const int sizes[] = {1, 100000, 2};
    const TestNcVariable variable = {.name = "salt", .dimension_count = 1, .dimensions = {0}, .values = numbers};
    test_nc(&file, grid_names, sizes, 3, &variable, 1);
    assert_refused(
        save("c.nc"), NULL, RF_BAD_INPUT,
        "no velocity here: looked for u, v (also velocity_x, velocity_y; uo, vo; u10, v10; eastward_/northward_ "
        "standard names); it has: salt; name them with --variables");
}

static void a_netcdf_cut_in_a_later_moment_gives_the_first(void **state)
{
    (void)state;
    if (no_netcdf())
    {
        print_message("this build reads no NetCDF\n");
        skip();
    }
    const char *const names[] = {"time", "y", "x"};
    const int sizes[] = {4, 2, 3};
    const TestNcVariable variables[] = {
        {.name = "u", .dimension_count = 3, .dimensions = {0, 1, 2}, .values = numbers},
        {.name = "v", .dimension_count = 3, .dimensions = {0, 1, 2}, .values = numbers}};
    test_nc(&file, names, sizes, 3, variables, 2);
    file.size -= 4;
    RfFlowView view;
    RfFlow *flow = open_first(save("cut.nc"), &view);
    assert_int_equal(rf_flow_at(flow, rf_flow_info(flow).last_frame, &view), RF_BAD_INPUT);
    assert_non_null(strstr(rf_last_error()->message, "the file is cut"));
    rf_flow_close(flow);
}

static RfResult crash(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)source;
    (void)moment;
    (void)out;
    raise(SIGSEGV);
    return RF_OK;
}

static RfResult leave(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)source;
    (void)moment;
    (void)out;
    _exit(0);
}

static void a_library_that_dies_is_survived(void **state)
{
    (void)state;
    RfFlowSource source = {.path = "bad.nc"};
    RfFlowMoment moment = {0};
    assert_int_equal(rf_child_read(crash, "the library", &source, 0, &moment), RF_BAD_INPUT);
    assert_string_equal(rf_last_error()->file, "bad.nc");
    assert_non_null(strstr(rf_last_error()->message, "the library died of it"));
    assert_int_equal(rf_child_read(leave, "the library", &source, 0, &moment), RF_BAD_INPUT);
    assert_non_null(strstr(rf_last_error()->message, "gave no answer"));
    assert_null(moment.field.velocity);
}

static void options_out_of_range_are_refused(void **state)
{
    (void)state;
#ifdef RF_STOP_ON_MISUSE
    print_message("this build stops at misuse\n");
    skip();
#endif
    RfFlow *flow;
    RfFlowReadOptions empty = {0}, zero = rf_flow_read_defaults(), one = zero;
    zero.fps = 0;
    one.variables = "u";
    assert_int_equal(rf_flow_open("builtin:vortex", &empty, &flow), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_flow_open("builtin:vortex", &zero, &flow), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_flow_open("builtin:vortex", &one, &flow), RF_INVALID_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(broken_text_is_refused_with_a_reason),
        cmocka_unit_test(a_small_file_with_a_large_extent_is_refused_before_memory_is_asked_for),
        cmocka_unit_test(broken_numbers_are_refused_with_a_reason),
        cmocka_unit_test(a_damaged_netcdf_is_refused),
        cmocka_unit_test(a_netcdf_cut_in_a_later_moment_gives_the_first),
        cmocka_unit_test(a_library_that_dies_is_survived),
        cmocka_unit_test(options_out_of_range_are_refused),
    };
    return cmocka_run_group_tests_name("broken flows", tests, make_folder, remove_folder);
}
