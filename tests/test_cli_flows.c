// SPDX-License-Identifier: Apache-2.0
// What the command makes of flows: their numbers, pictures and conversions, and what it warns of.
#include "riffle/riffle.h"
#include "support/cli_check.h"
#include "support/flow_files.h"

#include <math.h>

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

static void assert_first_pixel(const TestFolder *folder, const char *name, float r, float g, float b)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(test_folder_file(folder, name), &image), RF_OK);
    const float *p = rf_image_view(image).pixels;
    if (fabsf(p[0] - r) > 0.01f || fabsf(p[1] - g) > 0.01f || fabsf(p[2] - b) > 0.01f)
        fail_msg("%s: %g %g %g", name, (double)p[0], (double)p[1], (double)p[2]);
    rf_image_destroy(image);
}

static void one_scale_serves_all_frames_and_the_fastest_is_not_darkened(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    put_flow(&folder, "s1.flo", 32, 20, 1);
    put_flow(&folder, "s2.flo", 32, 20, 1.5f);
    put_flow(&folder, "s3.flo", 32, 20, 4);
    put_flow(&folder, "s4.flo", 32, 20, 2);
    // Moments lie at frames 1, 4, 7 and 10.
    expect(&folder, "render s%d.flo a%02d.png --moment-every 3 --size 96x60", 0);
    assert_first_pixel(&folder, "a01.png", 1, 0.75f, 0.75f);
    assert_first_pixel(&folder, "a07.png", 1, 0, 0);
    assert_first_pixel(&folder, "a10.png", 1, 0.5f, 0.5f);
    // Frame 5 needs the third moment, frame 4 does not.
    expect(&folder, "render s%d.flo b%02d.png --moment-every 3 --frames 1-4", 0);
    assert_first_pixel(&folder, "b04.png", 1, 0, 0);
    expect(&folder, "render s%d.flo c%02d.png --moment-every 3 --frames 1-5", 0);
    assert_first_pixel(&folder, "c04.png", 1, 0.625f, 0.625f);
    expect(&folder, "render s%d.flo d%02d.png --full-speed 2", 0);
    assert_first_pixel(&folder, "d01.png", 1, 0.5f, 0.5f);
    assert_first_pixel(&folder, "d03.png", 0.75f, 0, 0);
    test_folder_remove(&folder);
}

static void absurd_speeds_and_stretched_frames_are_warned_of(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    put_flow(&folder, "fast.flo", 32, 20, 5.1f);
    put_flow(&folder, "slow.flo", 32, 20, 4.9f);
    expect_text(&folder, "texture fast.flo builtin:foam?size=64 null: --frames 1-2", 0,
                "fast.flo: crosses 0.255 of its domain in a frame (5.1 of 20 cells at its fastest): is it in other "
                "units? --velocity-scale 0.039 would make it 0.01\n");
    expect_silence(&folder, "texture slow.flo builtin:foam?size=64 null: --frames 1-2 --size 64x40");
    // A pixel off is rounding.
    expect_silence(&folder, "texture slow.flo builtin:foam?size=64 null: --frames 1-2 --size 11x7");
    expect_text(&folder, "texture slow.flo builtin:foam?size=64 null: --frames 1-2 --size 70x40", 0,
                "slow.flo: 32 x 20 cells in frames of 70 x 40 pixels: all is stretched 1.09 times along x; "
                "--size 64x40 would not\n");
    expect_text(&folder, "render slow.flo a.png --size 60x40 --json", 0,
                "{\"event\":\"warning\",\"file\":\"slow.flo\"");
    test_folder_remove(&folder);
}

static void many_moments_become_one_array_or_a_file_each(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:gyre?size=32x16 a.npy -o n%02d.npy -o f%02d.flo --frames 1-7x3", 0);
    assert_int_equal(test_folder_count(&folder), 1 + 3 + 3);
    CommandResult result = run_in(&folder, "info a.npy n04.npy");
    assert_non_null(strstr(result.out, "a.npy: 2D flow (npy), 32 x 16 cells, 3 moments, frames 0 to 2"));
    assert_non_null(strstr(result.out, "n04.npy: 2D flow (npy), 32 x 16 cells, steady"));
    command_free(&result);
    expect(&folder, "convert a.npy g%02d.flo", 0);
    assert_same_file(&folder, "f01.flo", &folder, "g00.flo");
    assert_same_file(&folder, "f07.flo", &folder, "g02.flo");
    expect_text(&folder, "convert builtin:gyre?size=32x16 a.npy --frames 1-3", 2, "a.npy: exists");
    expect_text(&folder, "convert builtin:gyre?size=32x16 b.npy --frames 1-3 --resume", 2, "cannot be resumed");
    expect_text(&folder, "convert builtin:gyre?size=32x16 b.flo --frames 1-3", 2, "one name for 3 frames");
    // What ends before its time leaves nothing.
    assert_true(test_file_write(test_folder_file(&folder, "f07.flo"), "PIEH", 4));
    expect(&folder, "convert f%02d.flo b.npy", 3);
    assert_false(exists(&folder, "b.npy"));
    assert_int_equal(test_folder_count(&folder), 10);
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_with_gaps_are_told_and_moment_every_makes_them_frames),
        cmocka_unit_test(one_scale_serves_all_frames_and_the_fastest_is_not_darkened),
        cmocka_unit_test(absurd_speeds_and_stretched_frames_are_warned_of),
        cmocka_unit_test(many_moments_become_one_array_or_a_file_each),
        cmocka_unit_test(a_steady_flow_is_one_picture_where_there_is_one_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
