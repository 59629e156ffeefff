// SPDX-License-Identifier: Apache-2.0
// What the command makes of flows: their numbers, pictures and conversions, and what it warns of.
#include "riffle/riffle.h"
#include "support/cli_check.h"
#include "support/flow_files.h"

/// A uniform flow of u along x.
static void put_flow(const TestFolder *folder, const char *name, int width, int height, float u)
{
    static TestBytes bytes;
    static float uv[2 * 64 * 64];
    for (int k = 0; k < width * height; ++k)
    {
        uv[2 * k] = u;
        uv[2 * k + 1] = 0;
    }
    test_flo(&bytes, width, height, uv);
    assert_true(test_file_write(test_folder_file(folder, name), bytes.data, bytes.size));
}

static void expect_silence(const TestFolder *folder, const char *line)
{
    CommandResult result = run_in(folder, line);
    if (strstr(result.err, "warning"))
        print_error("riffle %s: %s\n", line, result.err);
    assert_int_equal(result.code, 0);
    assert_null(strstr(result.err, "warning"));
    command_free(&result);
}

static void numbers_with_gaps_are_told_and_moment_every_makes_them_frames(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    put_flow(&folder, "g0.flo", 8, 8, 0);
    put_flow(&folder, "g3.flo", 8, 8, 0.6f);
    put_flow(&folder, "g6.flo", 8, 8, 1.2f);
    expect_text(&folder, "convert g%d.flo a%d.flo", 0,
                "g%d.flo: the files' numbers go up by 3, but each file is one moment, frames 0 to 2; "
                "--moment-every 3 makes them frames 0 to 6\n");
    assert_same_file(&folder, "g3.flo", &folder, "a1.flo");
    expect_silence(&folder, "convert g%d.flo b%d.flo --moment-every 3");
    assert_same_file(&folder, "g3.flo", &folder, "b3.flo");
    assert_same_file(&folder, "g6.flo", &folder, "b6.flo");
    expect_text(&folder, "info g%d.flo --json", 0,
                "{\"event\":\"warning\",\"file\":\"g%d.flo\",\"message\":\"the files");
    // A number that is missing is passed over, and said to be.
    put_flow(&folder, "g7.flo", 8, 8, 1.4f);
    expect_text(&folder, "info g%d.flo --moment-every 3", 0,
                "have gaps, which are passed over: each file is one moment, "
                "frames 0 to 9\n");
    test_folder_remove(&folder);
}

static void a_steady_flow_is_one_picture_where_there_is_one_name(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    put_flow(&folder, "one.flo", 16, 8, 1);
    expect(&folder, "render one.flo a.png", 0);
    expect(&folder, "render one.flo b.png -o c.exr --as lic", 0);
    assert_int_equal(test_folder_count(&folder), 4);
    // Numbers and unsteady flows mean frames.
    expect(&folder, "render one.flo d.%03d.png", 0);
    assert_int_equal(test_folder_count(&folder), 104);
    expect_text(&folder, "render builtin:gyre?size=32x16 e.png", 2, "one name for 100 frames");
    expect_text(&folder, "render one.flo e.png -o e.%03d.png", 2, "one name for 100 frames");
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_with_gaps_are_told_and_moment_every_makes_them_frames),
        cmocka_unit_test(a_steady_flow_is_one_picture_where_there_is_one_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
