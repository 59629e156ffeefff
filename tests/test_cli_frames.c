// SPDX-License-Identifier: Apache-2.0
// What the command writes: frames, videos, maps, hashes.
#include "riffle/riffle.h"
#include "support/cli_check.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static void every_verb_makes_what_it_says(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3", 0);
    expect(&folder, TEST_TEXTURE "warp.png --method warp --frames 5", 0);
    expect(&folder, "texture " TEST_FLOW " builtin:noise?size=64 fire.png --shader fire --frames 5", 0);
    expect(&folder, "render " TEST_FLOW " wheel.png --frames 1", 0);
    expect(&folder, "render " TEST_FLOW " arrows.png --as arrows --frames 1 --size 128x96", 0);
    expect(&folder, "render " TEST_FLOW " lic.png --as lic --frames 1", 0);
    expect(&folder, "render builtin:chocolate?size=48 relief.png --as relief --size 80x60", 0);
    expect(&folder, "convert a.%04d.png b.####.exr", 0);
    expect(&folder, "convert " TEST_FLOW " flow.flo", 0);
    expect(&folder, "convert flow.flo flow.vti", 0);
    const char *const files[] = {"a.0001.png", "a.0003.png", "warp.png",   "fire.png",   "wheel.png", "arrows.png",
                                 "lic.png",    "relief.png", "b.0001.exr", "b.0003.exr", "flow.flo",  "flow.vti"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
        assert_true(exists(&folder, files[i]));
    // Nothing else stays: no state, no temporary file.
    assert_int_equal(test_folder_count(&folder), 14);
    CommandResult result = run_in(&folder, "info a.%04d.png flow.vti arrows.png builtin:gyre");
    assert_int_equal(result.code, 0);
    assert_non_null(strstr(result.out, "a.%04d.png: image, 96 x 64 pixels, 3 channels, 8 bit, sRGB-encoded"));
    assert_non_null(strstr(result.out, "3 files, frames 1 to 3"));
    assert_non_null(strstr(result.out, "flow.vti: 2D flow (vti), 96 x 64 cells, steady"));
    assert_non_null(strstr(result.out, "arrows.png: image, 128 x 96 pixels"));
    command_free(&result);
    test_folder_remove(&folder);
}

static void a_frames_hash_does_not_depend_on_the_number_of_threads(void **state)
{
    (void)state;
    static const char *const methods[] = {"lagrangian", "optimize", "directional", "eulerian",
                                          "dual",       "sprites",  "warp"};
    static const int threads[] = {1, 2, 3, 8};
    TestFolder folder = test_folder_make();
    for (size_t m = 0; m < sizeof methods / sizeof methods[0]; ++m)
    {
        char *first = NULL;
        for (int t = 0; t < 4; ++t)
        {
            char line[256];
            snprintf(line, sizeof line, TEST_TEXTURE "md5: --frames 1-6 -q --method %s --threads %d", methods[m],
                     threads[t]);
            CommandResult result = run_in(&folder, line);
            assert_int_equal(result.code, 0);
            assert_int_equal(count_lines(result.out), 6);
            if (first)
                assert_string_equal(result.out, first);
            else
                first = strdup(result.out);
            command_free(&result);
        }
        free(first);
    }
    CommandResult a = run_in(&folder, TEST_TEXTURE "md5: --frames 1-2 -q --seed 1");
    CommandResult b = run_in(&folder, TEST_TEXTURE "md5: --frames 1-2 -q --seed 2");
    assert_string_not_equal(a.out, b.out);
    command_free(&a);
    command_free(&b);
    test_folder_remove(&folder);
}

static void md5_is_of_the_frames_floats(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    // 1, 0.5, 0 as floats: printf '\0\0\200\77\0\0\0\77\0\0\0\0' | md5sum
    static const char exemplar[] = "P6\n1 1\n2\n\2\1\0";
    assert_true(test_file_write(test_folder_file(&folder, "one.ppm"), exemplar, sizeof exemplar - 1));
    CommandResult result = run_in(&folder, "convert one.ppm md5: -q");
    assert_int_equal(result.code, 0);
    assert_string_equal(result.out, "7d3b16b2f7165ac1cf37e0dc9aff5308  1\n");
    command_free(&result);
    test_folder_remove(&folder);
}

static void every_sth_frame_is_the_same_as_in_the_full_run(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, TEST_TEXTURE "all.%04d.png --frames 3-9", 0);
    expect(&folder, TEST_TEXTURE "some.$F4.png --frames 3-9x4", 0);
    assert_int_equal(test_folder_count(&folder), 7 + 2);
    assert_same_file(&folder, "all.0003.png", &folder, "some.0003.png");
    assert_same_file(&folder, "all.0007.png", &folder, "some.0007.png");
    test_folder_remove(&folder);
}

/// b.%04d.exr against n.%04d.npy, which has the frame's floats as they are: says which of them is wrong.
static void assert_exr_holds_the_frame(const TestFolder *folder, int frame)
{
    enum
    {
        NPY_HEADER = 128
    };
    char exr[32], npy[32];
    snprintf(exr, sizeof exr, "b.%04d.exr", frame);
    snprintf(npy, sizeof npy, "n.%04d.npy", frame);
    size_t size = 0;
    unsigned char *data = test_file_read(test_folder_file(folder, npy), &size);
    RfImage *image = NULL;
    if (rf_image_read(test_folder_file(folder, exr), &image) != RF_OK)
        fail_msg("%s: %s %s", exr, rf_last_error()->place, rf_last_error()->message);
    RfImageView view = rf_image_view(image);
    size_t count = (size_t)view.width * (size_t)view.height * (size_t)view.channels;
    assert_int_equal(size, NPY_HEADER + count * sizeof(float));
    for (size_t k = 0; k < count; ++k)
    {
        float there, wanted;
        memcpy(&there, data + NPY_HEADER + k * sizeof there, sizeof there);
        wanted = there <= 0.04045f ? there / 12.92f : powf((there + 0.055f) / 1.055f, 2.4f);
        if (!(fabsf(view.pixels[k] - wanted) <= 1e-6f))
            fail_msg("%s: sample %zu is %g, the frame has %g", exr, k, (double)view.pixels[k], (double)there);
    }
    rf_image_destroy(image);
    free(data);
}

static void one_run_feeds_all_its_outputs(void **state)
{
    (void)state;
    if (!has_ffmpeg())
    {
        print_message("skipped: no ffmpeg\n");
        skip();
    }
    TestFolder folder = test_folder_make();
    expect(&folder, TEST_TEXTURE "a.%04d.png -o b.%04d.exr -o n.%04d.npy -o c.mp4 -o null: --frames 1-3", 0);
    assert_int_equal(test_folder_count(&folder), 3 + 3 + 3 + 1);
    for (int i = 1; i <= 3; ++i)
        assert_exr_holds_the_frame(&folder, i);
    expect(&folder, "convert b.%04d.exr d.%04d.npy -o e.%04d.png", 0);
    // Eight bits, linear light in EXR, eight bits again.
    RfImage *a = NULL, *b = NULL;
    assert_int_equal(rf_image_read(test_folder_file(&folder, "a.0002.png"), &a), RF_OK);
    assert_int_equal(rf_image_read(test_folder_file(&folder, "e.0002.png"), &b), RF_OK);
    RfImageView p = rf_image_view(a), q = rf_image_view(b);
    for (int i = 0; i < p.width * p.height * p.channels; ++i)
        assert_true(fabsf(p.pixels[i] - q.pixels[i]) < 0.51f / 255);
    rf_image_destroy(a);
    rf_image_destroy(b);
    test_folder_remove(&folder);
}

static void a_video_has_one_size(void **state)
{
    (void)state;
    if (!has_ffmpeg())
    {
        print_message("skipped: no ffmpeg\n");
        skip();
    }
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:foam?size=64 a.0001.png", 0);
    expect(&folder, "convert builtin:foam?size=32 a.0002.png", 0);
    expect_text(&folder, "convert a.%04d.png a.mp4", 3,
                "a.mp4: frame 2 is 32 x 32 pixels, those before it 64 x 64: a video has one size\n");
    expect(&folder, "convert a.%04d.png b.%04d.exr", 0);
    assert_int_equal(test_folder_count(&folder), 4);
    test_folder_remove(&folder);
}

static void frames_behind_the_flows_end_keep_its_last_velocity(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:gyre?size=64x32 g.%02d.flo --frames 3-5", 0);
    expect_text(&folder, "convert g.%02d.flo h.%02d.flo --frames 5-7", 0, "has the frames 3 to 5");
    assert_same_file(&folder, "g.05.flo", &folder, "h.05.flo");
    assert_same_file(&folder, "g.05.flo", &folder, "h.07.flo");
    expect_text(&folder, "convert g.%02d.flo i.%02d.flo --frames 6-7", 2, "has the frames 3 to 5");
    expect_text(&folder, "convert g.%02d.flo i.%02d.flo --frames 1-7", 2, "has the frames 3 to 5");
    test_folder_remove(&folder);
}

static void frames_are_written_even_where_there_is_no_encoder(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    CommandOptions options = {.path = "/nowhere"};
    Command command = command_start(PROGRAM, folder.path, TEST_TEXTURE "a.%04d.png -o a.mp4 --frames 1-3 -q", &options);
    CommandResult result = command_finish(&command);
    assert_int_equal(result.code, 1);
    assert_int_equal(count_lines(result.err), 1);
    assert_non_null(strstr(result.err, "ffmpeg"));
    assert_non_null(strstr(result.err, "riffle convert a.%04d.png a.mp4"));
    assert_int_equal(test_folder_count(&folder), 3);
    command_free(&result);
    test_folder_remove(&folder);
}

static void maps_are_written_beside_png_and_together_in_exr(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "texture " TEST_FLOW " builtin:chocolate?size=64 a.%04d.png -o f_%04d.png -o b.%04d.exr --frames 7",
           0);
    const char *const files[] = {"a.0007.png", "a.height.0007.exr", "f_0007.png", "f_height_0007.exr", "b.0007.exr"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
        assert_true(exists(&folder, files[i]));
    assert_int_equal(test_folder_count(&folder), 5);
    CommandResult result = run_in(&folder, "info b.0007.exr a.height.0007.exr");
    assert_non_null(strstr(result.out, "4 channels, float, linear"));
    assert_non_null(strstr(result.out, "\n  height: "));
    command_free(&result);
    expect(&folder, "render a.%04d.png r.png --as relief --map height=a.height.%04d.exr", 0);
    expect(&folder, "texture " TEST_FLOW " a.0007.png n.png --map normal=wheel.png --frames 1", 3);
    expect(&folder, "convert builtin:chocolate?size=64 n.png", 0);
    expect(&folder, "texture " TEST_FLOW " n.png m.%02d.png --map rough=n.height.exr --map-weight rough=2 --frames 1",
           0);
    assert_true(exists(&folder, "m.rough.01.exr"));
    test_folder_remove(&folder);
}

static void samples_keep_their_depth(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    RfImage *image = NULL, *back = NULL;
    assert_int_equal(rf_image_create(16, 16, 1, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int i = 0; i < 256; ++i)
        view.pixels[i] = (float)(i * 257 % 4096) / 65535;
    rf_image_set_origin(image, RF_SAMPLE_U16, RF_ENCODING_SRGB);
    assert_int_equal(rf_image_write(test_folder_file(&folder, "deep.png"), image), RF_OK);
    rf_image_set_origin(image, RF_SAMPLE_HALF, RF_ENCODING_LINEAR);
    assert_int_equal(rf_image_write(test_folder_file(&folder, "half.exr"), image), RF_OK);
    rf_image_destroy(image);
    static const char *const lines[] = {"convert deep.png out.png", "convert half.exr out.png",
                                        "convert half.exr out.exr",
                                        "texture builtin:shear?size=32x32 deep.png out.png --method warp --frames 1",
                                        "texture builtin:shear?size=32x32 half.exr out.exr --method warp --frames 1"};
    static const RfSampleFormat formats[] = {RF_SAMPLE_U16, RF_SAMPLE_U16, RF_SAMPLE_HALF, RF_SAMPLE_U16,
                                             RF_SAMPLE_HALF};
    for (int i = 0; i < 5; ++i)
    {
        expect(&folder, lines[i], 0);
        const char *name = test_folder_file(&folder, strstr(lines[i], "out.exr") ? "out.exr" : "out.png");
        assert_int_equal(rf_image_read(name, &back), RF_OK);
        assert_int_equal(rf_image_format(back), formats[i]);
        if (i == 2)
            assert_same_file(&folder, "half.exr", &folder, "out.exr");
        rf_image_destroy(back);
        unlink(name);
    }
    test_folder_remove(&folder);
}

static void layers_name_places_in_the_exemplar(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, TEST_TEXTURE "a.%04d.png --uv --frames 2-3", 0);
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(test_folder_file(&folder, "a.uv.0003.exr"), &image), RF_OK);
    assert_int_equal(rf_image_view(image).channels, 16);
    rf_image_destroy(image);
    assert_int_equal(test_folder_count(&folder), 4);
    expect_text(&folder, TEST_TEXTURE "null: --uv", 2, "--uv needs an image output");
    test_folder_remove(&folder);
}

static void a_mask_makes_land(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    // Half the size of the flow: white left, black right.
    static const char mask[] = "P2\n4 2\n1\n1 1 0 0\n1 1 0 0\n";
    assert_true(test_file_write(test_folder_file(&folder, "mask.pgm"), mask, sizeof mask - 1));
    expect(&folder, TEST_TEXTURE "a.png --mask mask.pgm --frames 3", 0);
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(test_folder_file(&folder, "a.png"), &image), RF_OK);
    RfImageView view = rf_image_view(image);
    float left = 0, right = 0;
    for (int y = 0; y < view.height; ++y)
        for (int x = 0; x < view.width; ++x)
            *(x < view.width / 2 ? &left : &right) += view.pixels[y * view.row_stride + x * view.channels];
    assert_true(left > 100);
    assert_true(right == 0);
    rf_image_destroy(image);
    test_folder_remove(&folder);
}

static void a_map_of_an_unknown_name_is_plain_data_and_told_to_be(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:foam?size=64 n.png", 0);
    expect_text(&folder, TEST_TEXTURE "null: --frames 1 --map normals=n.png", 0,
                "warning: n.png: map normals is treated as plain data, as height, displacement, ");
    expect_text(&folder, TEST_TEXTURE "null: --frames 1 --map motion=n.png --json", 0,
                "\"map motion has 3 channels, not 2: it is treated as plain data and not turned\"");
    static const char *const known[] = {"normal", "height", "alpha", "roughness", "displacement"};
    for (int i = 0; i < 5; ++i)
    {
        char line[160];
        snprintf(line, sizeof line, TEST_TEXTURE "null: --frames 1 --map %s=n.png", known[i]);
        CommandResult result = run_in(&folder, line);
        assert_int_equal(result.code, 0);
        assert_null(strstr(result.err, "warning"));
        command_free(&result);
    }
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_verb_makes_what_it_says),
        cmocka_unit_test(a_frames_hash_does_not_depend_on_the_number_of_threads),
        cmocka_unit_test(md5_is_of_the_frames_floats),
        cmocka_unit_test(every_sth_frame_is_the_same_as_in_the_full_run),
        cmocka_unit_test(one_run_feeds_all_its_outputs),
        cmocka_unit_test(a_video_has_one_size),
        cmocka_unit_test(frames_behind_the_flows_end_keep_its_last_velocity),
        cmocka_unit_test(frames_are_written_even_where_there_is_no_encoder),
        cmocka_unit_test(maps_are_written_beside_png_and_together_in_exr),
        cmocka_unit_test(samples_keep_their_depth),
        cmocka_unit_test(layers_name_places_in_the_exemplar),
        cmocka_unit_test(a_mask_makes_land),
        cmocka_unit_test(a_map_of_an_unknown_name_is_plain_data_and_told_to_be),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
