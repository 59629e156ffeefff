// SPDX-License-Identifier: Apache-2.0
// How the command stops at signals, and goes on where it stopped.
#include "support/cli_check.h"
#include "support/sanitized.h"

#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

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
    // Every method is stopped by every signal, sanitizers or not.
    int stopped = 0, runs = 0, step = TEST_SANITIZED ? 2 : 1;
    for (int l = 0; l < 6; ++l)
    {
        TestFolder whole = test_folder_make();
        expect(&whole, lines[l], 0);
        for (int i = 0; i < 6; i += step, ++runs)
            stopped += break_and_resume(&whole, lines[l], signals[(i + l) % 3], places[i]);
        stopped += break_and_resume(&whole, lines[l], SIGKILL, 3);
        ++runs;
        test_folder_remove(&whole);
    }
    // A fast machine may finish some before the signal.
    assert_true(stopped >= runs * 4 / 7);
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

static void a_finished_run_has_nothing_left_and_stays_as_it_is(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3", 0);
    // Other bytes would be made again: what is there is not looked into.
    assert_true(test_file_write(test_folder_file(&folder, "a.0002.png"), "mine", 4));
    expect_text(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3 --resume", 0,
                "nothing is left to do: all frames are there");
    expect_text(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3 --resume --json", 0,
                "{\"event\":\"done\",\"frames\":0,");
    size_t size = 0;
    unsigned char *data = test_file_read(test_folder_file(&folder, "a.0002.png"), &size);
    assert_int_equal(size, 4);
    free(data);
    assert_int_equal(test_folder_count(&folder), 3);
    // One more frame is another run, which would replace these.
    expect_text(&folder, TEST_TEXTURE "a.%04d.png --frames 1-4 --resume", 2, "a.0001.png: exists");
    expect(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3 --resume -y", 0);
    data = test_file_read(test_folder_file(&folder, "a.0002.png"), &size);
    assert_true(size > 4);
    free(data);
    test_folder_remove(&folder);
}

static void what_leaves_nothing_cannot_be_resumed(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect_text(&folder, TEST_TEXTURE "null: --resume", 2, "cannot resume");
    expect_text(&folder, TEST_TEXTURE "md5: --resume", 2, "cannot resume");
    expect_text(&folder, TEST_TEXTURE "- --resume", 2, "cannot resume");
    expect_text(&folder, TEST_TEXTURE "a.mp4 --resume", 2, "write images beside it");
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_signal_ends_a_long_setup_and_leaves_nothing),
        cmocka_unit_test(a_run_resumes_with_the_same_bytes_wherever_it_was_stopped),
        cmocka_unit_test(a_resumed_video_has_all_frames),
        cmocka_unit_test(another_run_is_not_resumed),
        cmocka_unit_test(a_finished_run_has_nothing_left_and_stays_as_it_is),
        cmocka_unit_test(what_leaves_nothing_cannot_be_resumed),
        cmocka_unit_test(a_long_frame_does_not_hold_up_a_signal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
