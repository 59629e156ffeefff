// SPDX-License-Identifier: Apache-2.0
#include "riffle/riffle.h"
#include "support/files.h"

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static TestFolder g_folder;

static int make_folder(void **state)
{
    (void)state;
    g_folder = test_folder_make();
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    test_folder_remove(&g_folder);
    return 0;
}

static void need_ffmpeg(void)
{
    if (system("ffmpeg -version >/dev/null 2>&1 && ffprobe -version >/dev/null 2>&1") != 0)
    {
        print_message("skipped: no ffmpeg\n");
        skip();
    }
}

// A red, a green and a blue third, and a bar that moves down.
static void draw(RfImage *image, int frame)
{
    RfImageView view = rf_image_view(image);
    for (int y = 0; y < view.height; ++y)
    {
        for (int x = 0; x < view.width; ++x)
        {
            float *pixel = view.pixels + y * view.row_stride + x * view.channels;
            for (int c = 0; c < view.channels; ++c)
                pixel[c] = c == 3 ? 1 : c == x * 3 / view.width ? 0.8f : 0.1f;
            if (y == frame % view.height)
                pixel[0] = 1;
        }
    }
}

static RfResult make_video(const char *path, int width, int height, int channels, int frames)
{
    RfVideo *video;
    RfImage *image;
    RfResult result = rf_video_open(path, width, height, 24, &video);
    if (result != RF_OK)
        return result;
    assert_int_equal(rf_image_create(width, height, channels, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int i = 0; i < frames && result == RF_OK; ++i)
    {
        draw(image, i);
        result = rf_video_write(video, &view);
    }
    rf_image_destroy(image);
    RfResult closed = rf_video_close(video, true);
    return result != RF_OK ? result : closed;
}

// What a command prints, up to 255 characters.
static void run(char out[256], const char *format, const char *path)
{
    char command[1024];
    snprintf(command, sizeof command, format, path);
    FILE *stream = popen(command, "r");
    size_t length = fread(out, 1, 255, stream);
    out[length] = '\0';
    pclose(stream);
}

static void every_container_has_the_frames_and_the_size(void **state)
{
    (void)state;
    need_ffmpeg();
    static const struct
    {
        const char *name, *probe;
    } kinds[] = {{"a.mp4", "66,50,24/1,10"}, {"a.mov", "66,50,24/1,10"}, {"a.webm", "66,50,24/1,10"}};
    for (int k = 0; k < 3; ++k)
    {
        const char *path = test_folder_file(&g_folder, kinds[k].name);
        // Odd sizes grow by a row and a column.
        if (make_video(path, 65, 49, 3, 10) != RF_OK)
            fail_msg("%s", rf_last_error()->message);
        char found[256];
        run(found,
            "ffprobe -v error -count_frames -show_entries stream=width,height,r_frame_rate,nb_read_frames -of csv=p=0 "
            "%s",
            path);
        found[strcspn(found, "\n")] = '\0';
        assert_string_equal(found, kinds[k].probe);
    }
    char found[256];
    const char *path = test_folder_file(&g_folder, "a.gif");
    if (make_video(path, 65, 49, 4, 10) != RF_OK)
        fail_msg("%s", rf_last_error()->message);
    run(found, "ffprobe -v error -count_frames -show_entries stream=width,height,nb_read_frames -of csv=p=0 %s", path);
    assert_string_equal(found, "65,49,10\n");
    assert_int_equal(test_folder_count(&g_folder), 4);
}

static void colours_survive_within_a_few_levels(void **state)
{
    (void)state;
    need_ffmpeg();
    static const char *const names[] = {"c.mp4", "c.webm", "c.gif"};
    for (int k = 0; k < 3; ++k)
    {
        const char *path = test_folder_file(&g_folder, names[k]);
        assert_int_equal(make_video(path, 96, 64, 3, 4), RF_OK);
        char command[1024];
        const char *raw = test_folder_file(&g_folder, "frame.rgb");
        snprintf(command, sizeof command,
                 "ffmpeg -v error -y -i %s -frames:v 1 -vf scale=flags=accurate_rnd+full_chroma_int -f rawvideo "
                 "-pix_fmt rgb24 %s",
                 path, raw);
        assert_int_equal(system(command), 0);
        size_t size;
        unsigned char *pixels = test_file_read(raw, &size);
        assert_int_equal(size, 96 * 64 * 3);
        // The middle of each third, away from its borders.
        for (int third = 0; third < 3; ++third)
        {
            const unsigned char *pixel = pixels + 3 * (40 * 96 + third * 32 + 16);
            for (int c = 0; c < 3; ++c)
                assert_in_range(pixel[c], c == third ? 204 - 8 : 26 - 8, c == third ? 204 + 8 : 26 + 8);
        }
        free(pixels);
    }
}

static void grey_and_alpha_are_taken_and_the_same_frames_give_the_same_file(void **state)
{
    (void)state;
    need_ffmpeg();
    unsigned char *bytes[2];
    size_t sizes[2];
    assert_int_equal(make_video(test_folder_file(&g_folder, "grey.mp4"), 64, 64, 1, 3), RF_OK);
    for (int i = 0; i < 2; ++i)
    {
        const char *path = test_folder_file(&g_folder, i ? "one.mp4" : "two.mp4");
        assert_int_equal(make_video(path, 160, 96, 4, 12), RF_OK);
        bytes[i] = test_file_read(path, &sizes[i]);
    }
    assert_int_equal(sizes[0], sizes[1]);
    assert_memory_equal(bytes[0], bytes[1], sizes[0]);
    free(bytes[0]);
    free(bytes[1]);
}

static void a_video_not_kept_leaves_nothing(void **state)
{
    (void)state;
    need_ffmpeg();
    TestFolder folder = test_folder_make();
    RfVideo *video;
    RfImage *image;
    assert_int_equal(rf_image_create(64, 64, 3, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    assert_int_equal(rf_video_open(test_folder_file(&folder, "v.mp4"), 64, 64, 24, &video), RF_OK);
    assert_int_equal(rf_video_write(video, &view), RF_OK);
    assert_int_equal(rf_video_close(video, false), RF_OK);
    assert_int_equal(rf_video_open(test_folder_file(&folder, "none.mp4"), 64, 64, 24, &video), RF_OK);
    assert_int_equal(rf_video_close(video, true), RF_INVALID_ARGUMENT);
    assert_int_equal(rf_video_close(NULL, true), RF_OK);
    assert_int_equal(test_folder_count(&folder), 0);
    rf_image_destroy(image);
    test_folder_remove(&folder);
}

// Puts a program named ffmpeg in front of all others for the rest of the call.
static void with_program(const char *script, void (*call)(const char *path), const char *path)
{
    char *old = strdup(getenv("PATH"));
    TestFolder folder = test_folder_make();
    if (script)
    {
        const char *program = test_folder_file(&folder, "ffmpeg");
        assert_true(test_file_write(program, script, strlen(script)));
        chmod(program, 0755);
    }
    setenv("PATH", folder.path, 1);
    call(path);
    setenv("PATH", old, 1);
    free(old);
    test_folder_remove(&folder);
}

static void expect_unsupported(const char *path)
{
    assert_int_equal(make_video(path, 64, 64, 3, 2), RF_UNSUPPORTED);
    assert_non_null(strstr(rf_last_error()->message, "install it"));
}

static void expect_death(const char *path)
{
    assert_int_equal(make_video(path, 512, 512, 3, 20), RF_WRITE_FAILED);
    assert_non_null(strstr(rf_last_error()->message, "out of paper"));
    assert_string_equal(rf_last_error()->file, path);
}

static void without_ffmpeg_the_remedy_is_said(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    with_program(NULL, expect_unsupported, test_folder_file(&folder, "v.mp4"));
    with_program(NULL, expect_unsupported, test_folder_file(&folder, "v.gif"));
    assert_int_equal(test_folder_count(&folder), 0);
    test_folder_remove(&folder);
}

static void a_dying_encoder_fails_the_call_and_not_the_program(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    // At once, after some frames, and after all of them.
    with_program("#!/bin/sh\necho some words >&2\necho out of paper >&2\nexit 1\n", expect_death,
                 test_folder_file(&folder, "v.gif"));
    with_program("#!/bin/sh\n/usr/bin/head -c 1000000 >/dev/null\necho out of paper >&2\nexit 0\n", expect_death,
                 test_folder_file(&folder, "v.gif"));
    with_program("#!/bin/sh\n/bin/cat >/dev/null\necho out of paper >&2\nexit 3\n", expect_death,
                 test_folder_file(&folder, "v.gif"));
    assert_int_equal(test_folder_count(&folder), 0);
    test_folder_remove(&folder);
}

static void a_full_disk_and_a_missing_folder_fail(void **state)
{
    (void)state;
    need_ffmpeg();
    TestFolder folder = test_folder_make();
    assert_int_equal(make_video(test_folder_file(&folder, "gone/v.mp4"), 64, 64, 3, 2), RF_WRITE_FAILED);
    RfVideo *video;
    assert_int_equal(rf_video_open(test_folder_file(&folder, "v.avi"), 64, 64, 24, &video), RF_UNSUPPORTED);
    static const char *const names[] = {"v.gif", "v.mp4", "v.webm", "v.mov"};
    for (int i = 0; i < 4; ++i)
    {
        const char *path = test_folder_file(&folder, names[i]);
        pid_t child = fork();
        if (child == 0)
        {
            signal(SIGXFSZ, SIG_IGN);
            struct rlimit small = {1000, 1000};
            setrlimit(RLIMIT_FSIZE, &small);
            _exit((int)make_video(path, 256, 256, 3, 30));
        }
        int status = 0;
        waitpid(child, &status, 0);
        assert_true(WIFEXITED(status));
        assert_int_equal(WEXITSTATUS(status), RF_WRITE_FAILED);
    }
    assert_int_equal(test_folder_count(&folder), 0);
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_container_has_the_frames_and_the_size),
        cmocka_unit_test(colours_survive_within_a_few_levels),
        cmocka_unit_test(grey_and_alpha_are_taken_and_the_same_frames_give_the_same_file),
        cmocka_unit_test(a_video_not_kept_leaves_nothing),
        cmocka_unit_test(without_ffmpeg_the_remedy_is_said),
        cmocka_unit_test(a_dying_encoder_fails_the_call_and_not_the_program),
        cmocka_unit_test(a_full_disk_and_a_missing_folder_fail),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
