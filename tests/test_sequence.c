// SPDX-License-Identifier: Apache-2.0
#include "riffle/riffle.h"
#include "support/files.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

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

static void touch(const char *names)
{
    char name[128];
    for (; *names; names += strspn(names, " "))
    {
        size_t length = strcspn(names, " ");
        snprintf(name, sizeof name, "%.*s", (int)length, names);
        assert_true(test_file_write(test_folder_file(&g_folder, name), "", 0));
        names += length;
    }
}

// The sequence as "number:name number:name".
static void assert_sequence(const char *path, const char *extensions, const char *wanted)
{
    char found[1024] = "";
    RfSequence *sequence;
    if (rf_sequence_open(test_folder_file(&g_folder, path), extensions, &sequence) != RF_OK)
        fail_msg("%s: %s", rf_last_error()->file, rf_last_error()->message);
    for (int i = 0; i < rf_sequence_count(sequence); ++i)
    {
        const char *file = rf_sequence_path(sequence, i);
        size_t length = strlen(found);
        assert_memory_equal(file, g_folder.path, strlen(g_folder.path));
        snprintf(found + length, sizeof found - length, "%s%d:%s", i ? " " : "", rf_sequence_number(sequence, i),
                 strrchr(file, '/') + 1);
    }
    rf_sequence_destroy(sequence);
    assert_string_equal(found, wanted);
}

static void assert_refused(const char *path, const char *extensions, RfResult result, const char *message)
{
    RfSequence *sequence;
    const char *file = test_folder_file(&g_folder, path);
    assert_int_equal(rf_sequence_open(file, extensions, &sequence), result);
    assert_null(sequence);
    assert_string_equal(rf_last_error()->file, file);
    if (!strstr(rf_last_error()->message, message))
        fail_msg("%s", rf_last_error()->message);
}

static void three_ways_of_writing_a_pattern_find_the_same_files(void **state)
{
    (void)state;
    // The fifth digit appears when four are used up; the others are no members.
    touch("w.0002.flo w.0010.flo w.0001.flo w.10000.flo w.9999.flo w.00003.flo w.3.flo w.0004.png xw.0005.flo "
          "w.00a1.flo");
    mkdir(test_folder_file(&g_folder, "w.0006.flo"), 0777);
    const char *wanted = "1:w.0001.flo 2:w.0002.flo 10:w.0010.flo 9999:w.9999.flo 10000:w.10000.flo";
    assert_sequence("w.%04d.flo", NULL, wanted);
    assert_sequence("w.####.flo", NULL, wanted);
    assert_sequence("w.$F4.flo", NULL, wanted);
}

static void a_pattern_without_a_width_takes_numbers_without_padding(void **state)
{
    (void)state;
    touch("7.png 12.png 0.png 08.png");
    assert_sequence("%d.png", NULL, "0:0.png 7:7.png 12:12.png");
    assert_sequence("$F.png", NULL, "0:0.png 7:7.png 12:12.png");
}

static void a_directory_is_ordered_by_the_last_number_in_the_names(void **state)
{
    (void)state;
    touch("v2_run10.png v2_run9.PNG v2_run100.png notes.txt .hidden1.png v2_run8.jpg");
    assert_sequence(".", "png,jpg", "8:v2_run8.jpg 9:v2_run9.PNG 10:v2_run10.png 100:v2_run100.png");
    assert_sequence("./", "png", "9:v2_run9.PNG 10:v2_run10.png 100:v2_run100.png");
}

static void names_without_a_number_are_counted_from_one_in_natural_order(void **state)
{
    (void)state;
    touch("b.png a.png a2b.png 20161120061200123456789.png");
    assert_sequence(".", "png", "1:20161120061200123456789.png 2:a.png 3:b.png 4:a2b.png");
}

static void a_single_file_is_a_sequence_of_one(void **state)
{
    (void)state;
    touch("wind.flo wind_42.flo odd%04d.flo");
    assert_sequence("wind.flo", NULL, "1:wind.flo");
    assert_sequence("wind_42.flo", "png", "42:wind_42.flo");
    // It is there under the very name, so it is no pattern.
    assert_sequence("odd%04d.flo", NULL, "4:odd%04d.flo");
}

static void what_cannot_be_found_is_said_with_what_is_there(void **state)
{
    (void)state;
    touch("w.001.flo readme.txt");
    assert_refused("w.%04d.flo", NULL, RF_UNREADABLE, "write w.%03d.flo");
    assert_refused("x.%04d.flo", NULL, RF_UNREADABLE, "no file of this name");
    assert_refused("gone/x.%04d.flo", NULL, RF_UNREADABLE, "folder cannot be opened");
    assert_refused("gone.flo", NULL, RF_UNREADABLE, "cannot be opened");
    assert_refused(".", "exr,png", RF_UNREADABLE, "no file of kind exr,png, but 2 others");
    assert_refused("a%04db%04d.flo", NULL, RF_UNREADABLE, "2 places");
    mkdir(test_folder_file(&g_folder, "empty"), 0777);
    assert_refused("empty", NULL, RF_UNREADABLE, "empty");
}

static void two_sequences_in_one_directory_are_refused(void **state)
{
    (void)state;
    touch("u.0001.png v.0001.png");
    assert_refused(".", "png", RF_BAD_INPUT, "two files of number 1: u.0001.png and v.0001.png");
    assert_sequence("v.####.png", NULL, "1:v.0001.png");
}

int main(void)
{
#define IN_A_FOLDER(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)
    const struct CMUnitTest tests[] = {
        IN_A_FOLDER(three_ways_of_writing_a_pattern_find_the_same_files),
        IN_A_FOLDER(a_pattern_without_a_width_takes_numbers_without_padding),
        IN_A_FOLDER(a_directory_is_ordered_by_the_last_number_in_the_names),
        IN_A_FOLDER(names_without_a_number_are_counted_from_one_in_natural_order),
        IN_A_FOLDER(a_single_file_is_a_sequence_of_one),
        IN_A_FOLDER(what_cannot_be_found_is_said_with_what_is_there),
        IN_A_FOLDER(two_sequences_in_one_directory_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
