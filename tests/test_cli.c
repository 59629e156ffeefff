// SPDX-License-Identifier: Apache-2.0
// The command as a whole: what it offers, writes, prints, refuses, and how it stops and goes on.
#include "riffle/riffle.h"
#include "support/command.h"
#include "support/files.h"
#include "support/json_check.h"

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#define PROGRAM RF_BUILD_DIR "/riffle"
#define FLOW "builtin:vortex?size=96x64"
#define TEXTURE "texture " FLOW " builtin:foam?size=64 "

static CommandResult run_in(const TestFolder *folder, const char *line)
{
    return command_run(PROGRAM, folder->path, line);
}

/// Runs and frees; shows the message where the code is another one.
static void expect(const TestFolder *folder, const char *line, int code)
{
    CommandResult result = run_in(folder, line);
    if (result.code != code)
        print_error("riffle %s: %s\n", line, result.err);
    assert_int_equal(result.code, code);
    command_free(&result);
}

static void expect_text(const TestFolder *folder, const char *line, int code, const char *fragment)
{
    CommandResult result = run_in(folder, line);
    if (result.code != code || !strstr(result.err, fragment))
        print_error("riffle %s: %d, %s\n", line, result.code, result.err);
    assert_int_equal(result.code, code);
    assert_non_null(strstr(result.err, fragment));
    command_free(&result);
}

static bool exists(const TestFolder *folder, const char *name)
{
    return access(test_folder_file(folder, name), F_OK) == 0;
}

static void assert_same_file(const TestFolder *a, const char *a_name, const TestFolder *b, const char *b_name)
{
    size_t a_size = 0, b_size = 0;
    unsigned char *a_data = test_file_read(test_folder_file(a, a_name), &a_size);
    unsigned char *b_data = test_file_read(test_folder_file(b, b_name), &b_size);
    assert_non_null(a_data);
    assert_non_null(b_data);
    assert_int_equal(a_size, b_size);
    assert_memory_equal(a_data, b_data, a_size);
    free(a_data);
    free(b_data);
}

static bool has_ffmpeg(void)
{
    return system("ffmpeg -version >/dev/null 2>&1") == 0;
}

// ---- what is offered ---------------------------------------------------------------------------------------------

static const char *const g_verbs[] = {"texture", "render", "convert", "info"};

enum
{
    VERBS = 4,
    MAX_NAMES = 128
};

typedef struct Names
{
    char names[MAX_NAMES][64];
    int count;
} Names;

static bool has_name(const Names *names, const char *name)
{
    for (int i = 0; i < names->count; ++i)
        if (strcmp(names->names[i], name) == 0)
            return true;
    return false;
}

/// Options stand at the beginning of a line, behind blanks and perhaps a letter: "  -o, --output OUTPUT".
static void collect_options(const char *help, Names *names)
{
    for (const char *line = help; line && *line; line = strchr(line, '\n') ? strchr(line, '\n') + 1 : NULL)
    {
        const char *at = line + strspn(line, " ");
        if (at - line > 4 || at == line)
            continue;
        if (at[0] == '-' && at[1] != '-' && strncmp(at + 2, ", ", 2) == 0)
            at += 4;
        size_t length = strspn(at, "-abcdefghijklmnopqrstuvwxyz");
        char name[64];
        if (strncmp(at, "--", 2) != 0 || length >= sizeof name)
            continue;
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        if (!has_name(names, name))
            snprintf(names->names[names->count++], sizeof names->names[0], "%s", name);
        assert_true(names->count < MAX_NAMES);
    }
}

static void help_lists_exactly_the_options_that_are_there(void **state)
{
    (void)state;
    Names all = {0}, own[VERBS] = {0};
    for (int v = 0; v < VERBS; ++v)
    {
        char line[64];
        snprintf(line, sizeof line, "%s --help", g_verbs[v]);
        CommandResult result = command_run(PROGRAM, "/", line);
        assert_int_equal(result.code, 0);
        collect_options(result.out, &own[v]);
        collect_options(result.out, &all);
        assert_true(own[v].count >= 7);
        command_free(&result);
    }
    for (int v = 0; v < VERBS; ++v)
        for (int i = 0; i < all.count; ++i)
        {
            char line[128];
            snprintf(line, sizeof line, "%s %s", g_verbs[v], all.names[i]);
            CommandResult result = command_run(PROGRAM, "/", line);
            bool refused = strstr(result.err, "has no option") != NULL;
            if (refused == has_name(&own[v], all.names[i]))
                print_error("%s %s: %s\n", g_verbs[v], all.names[i], result.err);
            assert_true(refused != has_name(&own[v], all.names[i]));
            command_free(&result);
        }
}

static void help_lists_the_verbs_and_others_are_refused(void **state)
{
    (void)state;
    static const char *const absent[] = {"synth", "surface", "motion", "simulate", "measure", "Texture", "tex"};
    CommandResult help = command_run(PROGRAM, "/", "--help");
    assert_int_equal(help.code, 0);
    assert_string_equal(help.err, "");
    for (int v = 0; v < VERBS; ++v)
    {
        char start[64];
        snprintf(start, sizeof start, "\nriffle %s ", g_verbs[v]);
        assert_non_null(strstr(help.out, start));
    }
    for (size_t i = 0; i < sizeof absent / sizeof absent[0]; ++i)
    {
        char start[64];
        snprintf(start, sizeof start, "\nriffle %s ", absent[i]);
        assert_null(strstr(help.out, start));
        CommandResult result = command_run(PROGRAM, "/", absent[i]);
        assert_int_equal(result.code, 2);
        assert_non_null(strstr(result.err, "there are: texture, render, convert, info\n"));
        command_free(&result);
    }
    int count = 0;
    const RfBuiltin *builtins = rf_builtin_table(&count);
    for (int i = 0; i < count; ++i)
    {
        char name[64];
        snprintf(name, sizeof name, "builtin:%s ", builtins[i].name);
        assert_non_null(strstr(help.out, name));
    }
    command_free(&help);
}

static void the_version_is_the_librarys(void **state)
{
    (void)state;
    char expected[64];
    snprintf(expected, sizeof expected, "riffle %s\n", rf_version());
    CommandResult result = command_run(PROGRAM, "/", "--version");
    assert_string_equal(result.out, expected);
    command_free(&result);
}

static void every_option_of_a_method_is_in_the_help(void **state)
{
    (void)state;
    CommandResult result = command_run(PROGRAM, "/", "texture --help");
    int count = 0;
    const RfOption *table = rf_lagrangian_option_table(&count);
    for (int i = 0; i < count; ++i)
    {
        char name[64];
        snprintf(name, sizeof name, "--%s", table[i].name);
        assert_non_null(strstr(result.out, name));
    }
    command_free(&result);
}

// ---- what is written ---------------------------------------------------------------------------------------------

static void every_verb_makes_what_it_says(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, TEXTURE "a.%04d.png --frames 1-3", 0);
    expect(&folder, TEXTURE "warp.png --method warp --frames 5", 0);
    expect(&folder, "texture " FLOW " builtin:noise?size=64 fire.png --shader fire --frames 5", 0);
    expect(&folder, "render " FLOW " wheel.png --frames 1", 0);
    expect(&folder, "render " FLOW " arrows.png --as arrows --frames 1 --size 128x96", 0);
    expect(&folder, "render " FLOW " lic.png --as lic --frames 1", 0);
    expect(&folder, "render builtin:chocolate?size=48 relief.png --as relief --size 80x60", 0);
    expect(&folder, "convert a.%04d.png b.####.exr", 0);
    expect(&folder, "convert " FLOW " flow.flo", 0);
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
    static const char *const methods[] = {"lagrangian", "eulerian", "dual", "sprites", "warp"};
    static const int threads[] = {1, 2, 3, 8};
    TestFolder folder = test_folder_make();
    for (int m = 0; m < 5; ++m)
    {
        char *first = NULL;
        for (int t = 0; t < 4; ++t)
        {
            char line[256];
            snprintf(line, sizeof line, TEXTURE "md5: --frames 1-6 -q --method %s --threads %d", methods[m],
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
    CommandResult a = run_in(&folder, TEXTURE "md5: --frames 1-2 -q --seed 1");
    CommandResult b = run_in(&folder, TEXTURE "md5: --frames 1-2 -q --seed 2");
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
    expect(&folder, TEXTURE "all.%04d.png --frames 3-9", 0);
    expect(&folder, TEXTURE "some.$F4.png --frames 3-9x4", 0);
    assert_int_equal(test_folder_count(&folder), 7 + 2);
    assert_same_file(&folder, "all.0003.png", &folder, "some.0003.png");
    assert_same_file(&folder, "all.0007.png", &folder, "some.0007.png");
    test_folder_remove(&folder);
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
    expect(&folder, TEXTURE "a.%04d.png -o b.%04d.exr -o c.mp4 -o null: --frames 1-3", 0);
    assert_int_equal(test_folder_count(&folder), 3 + 3 + 1);
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
    Command command = command_start(PROGRAM, folder.path, TEXTURE "a.%04d.png -o a.mp4 --frames 1-3 -q", &options);
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
    expect(&folder, "texture " FLOW " builtin:chocolate?size=64 a.%04d.png -o f_%04d.png -o b.%04d.exr --frames 7", 0);
    const char *const files[] = {"a.0007.png", "a.height.0007.exr", "f_0007.png", "f_height_0007.exr", "b.0007.exr"};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
        assert_true(exists(&folder, files[i]));
    assert_int_equal(test_folder_count(&folder), 5);
    CommandResult result = run_in(&folder, "info b.0007.exr a.height.0007.exr");
    assert_non_null(strstr(result.out, "4 channels, float, linear"));
    assert_non_null(strstr(result.out, "\n  height: "));
    command_free(&result);
    expect(&folder, "render a.%04d.png r.png --as relief --map height=a.height.%04d.exr", 0);
    expect(&folder, "texture " FLOW " a.0007.png n.png --map normal=wheel.png --frames 1", 3);
    expect(&folder, "convert builtin:chocolate?size=64 n.png", 0);
    expect(&folder, "texture " FLOW " n.png m.%02d.png --map rough=n.height.exr --map-weight rough=2 --frames 1", 0);
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
    expect(&folder, TEXTURE "a.%04d.png --uv --frames 2-3", 0);
    RfImage *image = NULL;
    assert_int_equal(rf_image_read(test_folder_file(&folder, "a.uv.0003.exr"), &image), RF_OK);
    assert_int_equal(rf_image_view(image).channels, 16);
    rf_image_destroy(image);
    assert_int_equal(test_folder_count(&folder), 4);
    expect_text(&folder, TEXTURE "null: --uv", 2, "--uv needs an image output");
    test_folder_remove(&folder);
}

static void a_mask_makes_land(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    // Half the size of the flow: white left, black right.
    static const char mask[] = "P2\n4 2\n1\n1 1 0 0\n1 1 0 0\n";
    assert_true(test_file_write(test_folder_file(&folder, "mask.pgm"), mask, sizeof mask - 1));
    expect(&folder, TEXTURE "a.png --mask mask.pgm --frames 3", 0);
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

// ---- what is refused ---------------------------------------------------------------------------------------------

static void nothing_is_replaced_unless_asked(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    assert_true(test_file_write(test_folder_file(&folder, "a.0002.png"), "mine", 4));
    expect_text(&folder, TEXTURE "a.%04d.png --frames 1-3", 2, "riffle: a.0002.png: exists; -y replaces it\n");
    assert_int_equal(test_folder_count(&folder), 1);
    expect(&folder, TEXTURE "b.png -o a.0002.png --frames 1", 2);
    expect(&folder, "convert builtin:foam a.0002.png", 2);
    assert_int_equal(test_folder_count(&folder), 1);
    size_t size = 0;
    unsigned char *data = test_file_read(test_folder_file(&folder, "a.0002.png"), &size);
    assert_int_equal(size, 4);
    free(data);
    expect(&folder, TEXTURE "a.%04d.png --frames 1-3 -y", 0);
    assert_int_equal(test_folder_count(&folder), 3);
    test_folder_remove(&folder);
}

static void an_input_is_never_replaced(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:foam?size=64 foam.png", 0);
    expect(&folder, "convert " FLOW " f.%02d.flo --frames 1-3", 0);
    assert_int_equal(link(test_folder_file(&folder, "foam.png"), test_folder_file(&folder, "hard.png")), 0);
    assert_int_equal(symlink("foam.png", test_folder_file(&folder, "soft.png")), 0);
    static const char *const lines[] = {
        "texture " FLOW " foam.png foam.png --frames 1 -y",
        "texture " FLOW " foam.png ./foam.png --frames 1 -y",
        "texture " FLOW " foam.png hard.png --frames 1 -y",
        "texture " FLOW " foam.png soft.png --frames 1 -y",
        "texture " FLOW " soft.png foam.png --frames 1 -y",
        "texture " FLOW " foam.png null: -o foam.png -y --frames 1",
        "convert foam.png foam.png -y",
        "convert f.%02d.flo f.%02d.flo -y",
        "convert f.%02d.flo f.02.flo -y --frames 2",
        "texture f.%02d.flo foam.png a.png --mask foam.png -o foam.png -y --frames 1",
        "render foam.png foam.png --as relief -y",
    };
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; ++i)
        expect_text(&folder, lines[i], 2, "is an input of this run");
    assert_int_equal(test_folder_count(&folder), 6);
    test_folder_remove(&folder);
}

// ---- events ------------------------------------------------------------------------------------------------------

static void assert_json_lines(const char *text)
{
    for (const char *line = text; *line;)
    {
        const char *end = strchr(line, '\n');
        assert_non_null(end);
        if (!json_is_well_formed(line, (size_t)(end - line)))
            print_error("%.*s\n", (int)(end - line), line);
        assert_true(json_is_well_formed(line, (size_t)(end - line)));
        line = end + 1;
    }
}

static void events_are_json_a_line(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    CommandResult result = run_in(&folder, TEXTURE "null: --frames 5-8 --json");
    assert_int_equal(result.code, 0);
    assert_int_equal(count_lines(result.err), 5);
    assert_json_lines(result.err);
    assert_int_equal(strncmp(result.err, "{\"event\":\"frame\",\"frame\":5,\"ms\":", 32), 0);
    assert_non_null(strstr(result.err, "\"stages\":{\"advect\":"));
    assert_non_null(strstr(result.err, "{\"event\":\"done\",\"frames\":4,\"ms_per_frame\":"));
    assert_non_null(strstr(result.err, "\"first_ms\":"));
    assert_non_null(strstr(result.err, "\"peak_mib\":"));
    assert_non_null(strstr(result.err, "\"threads\":"));
    command_free(&result);
    // A name with a quote, a line break's like and bytes that are no UTF-8.
    result = run_in(&folder, "info --json q\"\\\x01\xff\xc3\xa9.png");
    assert_int_equal(result.code, 3);
    assert_int_equal(count_lines(result.err), 1);
    assert_json_lines(result.err);
    assert_non_null(strstr(result.err, "{\"event\":\"error\",\"file\":\"q\\\"\\\\\\u0001\\ufffd\xc3\xa9.png\""));
    command_free(&result);
    result = run_in(&folder, "texture --progress json --nonsense");
    assert_int_equal(result.code, 2);
    assert_json_lines(result.err);
    assert_non_null(strstr(result.err, "{\"event\":\"error\",\"file\":\"\""));
    command_free(&result);
    result = run_in(&folder, "info --json builtin:foam builtin:gyre builtin:chocolate");
    assert_int_equal(count_lines(result.out), 3);
    assert_json_lines(result.out);
    command_free(&result);
    test_folder_remove(&folder);
}

static void quiet_says_nothing_and_plain_says_how_it_went(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    CommandResult result = run_in(&folder, TEXTURE "null: --frames 1-2 -q");
    assert_string_equal(result.err, "");
    assert_string_equal(result.out, "");
    command_free(&result);
    result = run_in(&folder, TEXTURE "null: --frames 1-2");
    assert_non_null(strstr(result.err, "2 frames in "));
    command_free(&result);
    result = run_in(&folder, TEXTURE "null: --frames 1-2 -v");
    assert_non_null(strstr(result.err, "advect"));
    command_free(&result);
    test_folder_remove(&folder);
}

static void a_stream_of_pnm_frames_goes_to_stdout(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    CommandResult result = run_in(&folder, "convert builtin:foam?size=16 - -q");
    assert_int_equal(result.code, 0);
    assert_int_equal(strncmp(result.out, "P6\n16 16\n255\n", 13), 0);
    command_free(&result);
    test_folder_remove(&folder);
}

// ---- stopping and going on ---------------------------------------------------------------------------------------

enum
{
    RESUME_FRAMES = 24
};

#define RESUME_LINE "texture builtin:vortex?size=192x128 builtin:foam?size=64 f.%04d.png --frames 1-24 -q"

static void assert_same_frames(const TestFolder *whole, const TestFolder *broken)
{
    for (int i = 1; i <= RESUME_FRAMES; ++i)
    {
        char name[32];
        snprintf(name, sizeof name, "f.%04d.png", i);
        assert_same_file(whole, name, broken, name);
    }
}

/// Stops a run by `signal` when frame `at` is there (0: at once), continues it, and compares with the whole run. False
/// if it was done before.
static bool break_and_resume(const TestFolder *whole, const char *line, int signal, int at)
{
    TestFolder folder = test_folder_make();
    char name[32], again[512];
    snprintf(name, sizeof name, "f.%04d.png", at);
    Command command = command_start(PROGRAM, folder.path, line, NULL);
    if (at > 0)
        assert_true(command_wait_for_file(&command, test_folder_file(&folder, name)));
    kill(command.pid, signal);
    CommandResult result = command_finish(&command);
    // It may have been done already.
    assert_true(result.code == 0 || result.code == (signal == SIGKILL ? -SIGKILL : 128 + signal) ||
                (at == 0 && result.code == -signal));
    bool stopped = result.code != 0;
    command_free(&result);
    if (stopped && at > 0)
        assert_true(exists(&folder, ".f.0001.png.rfstate"));
    if (stopped)
    {
        snprintf(again, sizeof again, "%s --resume", line);
        expect(&folder, again, 0);
    }
    assert_same_frames(whole, &folder);
    assert_false(exists(&folder, ".f.0001.png.rfstate"));
    // What was half-written when the run was killed is gone, too.
    assert_int_equal(test_folder_count(&folder), test_folder_count(whole));
    test_folder_remove(&folder);
    return stopped;
}

static void a_run_resumes_with_the_same_bytes_wherever_it_was_stopped(void **state)
{
    (void)state;
    static const int signals[] = {SIGKILL, SIGINT, SIGTERM};
    static const int places[] = {0, 1, 2, 5, 11, 17};
    static const char *const lines[] = {RESUME_LINE,
                                        RESUME_LINE " --method eulerian --latency 6",
                                        RESUME_LINE " --method dual --reset-every 7",
                                        RESUME_LINE " --method sprites",
                                        RESUME_LINE " --method warp",
                                        RESUME_LINE " --uv --size 64x48"};
    int stopped = 0;
    for (int l = 0; l < 6; ++l)
    {
        TestFolder whole = test_folder_make();
        expect(&whole, lines[l], 0);
        for (int i = 0; i < 6; ++i)
            stopped += break_and_resume(&whole, lines[l], signals[(i + l) % 3], places[i]);
        stopped += break_and_resume(&whole, lines[l], SIGKILL, 3);
        test_folder_remove(&whole);
    }
    // Of 42; a fast machine may finish some before the signal.
    assert_true(stopped >= 24);
}

static void a_resumed_video_has_all_frames(void **state)
{
    (void)state;
    if (!has_ffmpeg())
    {
        print_message("skipped: no ffmpeg\n");
        skip();
    }
    static const char line[] = RESUME_LINE " -o v.mp4";
    TestFolder whole = test_folder_make(), broken = test_folder_make();
    expect(&whole, line, 0);
    Command command = command_start(PROGRAM, broken.path, line, NULL);
    assert_true(command_wait_for_file(&command, test_folder_file(&broken, "f.0006.png")));
    kill(command.pid, SIGINT);
    CommandResult result = command_finish(&command);
    assert_int_equal(result.code, 130);
    assert_false(exists(&broken, "v.mp4"));
    command_free(&result);
    expect(&broken, RESUME_LINE " -o v.mp4 --resume", 0);
    assert_same_frames(&whole, &broken);
    assert_same_file(&whole, "v.mp4", &broken, "v.mp4");
    assert_int_equal(test_folder_count(&broken), test_folder_count(&whole));
    test_folder_remove(&whole);
    test_folder_remove(&broken);
}

/// Leaves a run stopped somewhere in the folder.
static void stop_somewhere(const TestFolder *folder)
{
    Command command = command_start(PROGRAM, folder->path, RESUME_LINE, NULL);
    assert_true(command_wait_for_file(&command, test_folder_file(folder, "f.0002.png")));
    kill(command.pid, SIGKILL);
    CommandResult result = command_finish(&command);
    assert_int_equal(result.code, -SIGKILL);
    command_free(&result);
}

static void another_run_is_not_resumed(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    stop_somewhere(&folder);
    static const char *const others[] = {
        "--seed 2",         "--size 64x64",       "--fade 2", "--method warp",
        "--method sprites", "--velocity-scale 2", "--fps 25", "--map rough=builtin:noise?size=64",
        "--preset paper"};
    for (size_t i = 0; i < sizeof others / sizeof others[0]; ++i)
    {
        char line[512];
        snprintf(line, sizeof line, "%s --resume %s", RESUME_LINE, others[i]);
        expect_text(&folder, line, 3, "other inputs or options");
    }
    expect_text(&folder, RESUME_LINE, 2, "--resume goes on");
    // Damage: cut, then a flipped byte.
    size_t size = 0;
    const char *place = test_folder_file(&folder, ".f.0001.png.rfstate");
    unsigned char *data = test_file_read(place, &size);
    assert_non_null(data);
    assert_true(size > 50);
    assert_true(test_file_write(place, data, size - 1));
    expect_text(&folder, RESUME_LINE " --resume", 3, "damaged");
    data[size - 1] ^= 1;
    assert_true(test_file_write(place, data, size));
    expect_text(&folder, RESUME_LINE " --resume", 3, "damaged");
    assert_true(test_file_write(place, data, 3));
    expect_text(&folder, RESUME_LINE " --resume", 3, "damaged");
    free(data);
    expect(&folder, RESUME_LINE " -y", 0);
    test_folder_remove(&folder);
}

static void what_leaves_nothing_cannot_be_resumed(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect_text(&folder, TEXTURE "null: --resume", 2, "cannot resume");
    expect_text(&folder, TEXTURE "md5: --resume", 2, "cannot resume");
    expect_text(&folder, TEXTURE "- --resume", 2, "cannot resume");
    expect_text(&folder, TEXTURE "a.mp4 --resume", 2, "write images beside it");
    assert_int_equal(test_folder_count(&folder), 0);
    test_folder_remove(&folder);
}

static void a_long_frame_does_not_hold_up_a_signal(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    // Some ten seconds of streamlines for one frame.
    Command command = command_start(PROGRAM, folder.path,
                                    "render builtin:vortex a.%04d.png --as lic --size 5000x5000 --frames 1-9 -q", NULL);
    assert_true(command_wait_for_file(&command, test_folder_file(&folder, ".a.0001.png.rfstate")));
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    kill(command.pid, SIGINT);
    CommandResult result = command_finish(&command);
    clock_gettime(CLOCK_MONOTONIC, &end);
    assert_int_equal(result.code, 130);
    // One second is promised; the machine may be busy.
    assert_true(end.tv_sec - start.tv_sec < 4);
    assert_true(exists(&folder, ".a.0001.png.rfstate"));
    command_free(&result);
    test_folder_remove(&folder);
}

/// Runs a line, sends the signal `delay` seconds after its start, and returns the seconds from then to its end.
static double stop_after(const TestFolder *folder, const char *line, double delay, int signal, int *code)
{
    Command command = command_start(PROGRAM, folder->path, line, NULL);
    struct timespec start, end, wait = {0, (long)(1e9 * delay)};
    nanosleep(&wait, NULL);
    clock_gettime(CLOCK_MONOTONIC, &start);
    kill(command.pid, signal);
    CommandResult result = command_finish(&command);
    clock_gettime(CLOCK_MONOTONIC, &end);
    *code = result.code;
    command_free(&result);
    return (double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec);
}

static void a_signal_ends_a_long_setup_and_leaves_nothing(void **state)
{
    (void)state;
    static const char *const lines[] = {
        "texture builtin:river?size=2048x1024 builtin:foam?size=64 a.%04d.png -q",
        "texture builtin:vortex builtin:pebbles?size=4096 a.%04d.png -q",
        "texture builtin:vortex builtin:foam a.%04d.png --map rough=builtin:noise?size=4096 -q",
        "convert builtin:lava?size=4096 a.png -q",
        "info builtin:river?size=2048x1024",
    };
    for (int i = 0; i < 5; ++i)
    {
        TestFolder folder = test_folder_make();
        int code = 0, signal = i % 2 ? SIGTERM : SIGINT;
        double seconds = stop_after(&folder, lines[i], 0.3, signal, &code);
        assert_int_equal(code, 128 + signal);
        // One second is promised; the machine may be busy.
        assert_true(seconds < 2);
        // convert reads its image as a frame, behind the first state.
        assert_int_equal(test_folder_count(&folder), i == 3);
        test_folder_remove(&folder);
    }
}

static void a_long_setup_is_told(void **state)
{
    (void)state;
    static const char event[] = "{\"event\":\"setup\",\"stage\":\"drawing the exemplar\",\"fraction\":";
    TestFolder folder = test_folder_make();
    CommandResult result = run_in(&folder, "info builtin:lava?size=768 --json --threads 1");
    assert_int_equal(result.code, 0);
    assert_json_lines(result.err);
    assert_int_equal(strncmp(result.err, event, sizeof event - 1), 0);
    command_free(&result);
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_signal_ends_a_long_setup_and_leaves_nothing),
        cmocka_unit_test(a_long_setup_is_told),
        cmocka_unit_test(help_lists_exactly_the_options_that_are_there),
        cmocka_unit_test(help_lists_the_verbs_and_others_are_refused),
        cmocka_unit_test(the_version_is_the_librarys),
        cmocka_unit_test(every_option_of_a_method_is_in_the_help),
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
        cmocka_unit_test(nothing_is_replaced_unless_asked),
        cmocka_unit_test(an_input_is_never_replaced),
        cmocka_unit_test(events_are_json_a_line),
        cmocka_unit_test(quiet_says_nothing_and_plain_says_how_it_went),
        cmocka_unit_test(a_stream_of_pnm_frames_goes_to_stdout),
        cmocka_unit_test(a_run_resumes_with_the_same_bytes_wherever_it_was_stopped),
        cmocka_unit_test(a_resumed_video_has_all_frames),
        cmocka_unit_test(another_run_is_not_resumed),
        cmocka_unit_test(what_leaves_nothing_cannot_be_resumed),
        cmocka_unit_test(a_long_frame_does_not_hold_up_a_signal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
