// SPDX-License-Identifier: Apache-2.0
// The command as a whole: what it offers, refuses and says.
#include "riffle/riffle.h"
#include "support/cli_check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

// ---- what is offered ---------------------------------------------------------------------------------------------

static const char *const g_verbs[] = {"texture", "synth", "render", "measure", "convert", "info"};

enum
{
    VERBS = 6,
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
    static const char *const absent[] = {"surface", "motion", "simulate", "judge", "Texture", "tex"};
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
        assert_non_null(strstr(result.err, "there are: texture, synth, render, measure, convert, info\n"));
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

static void the_help_tells_what_layers_and_normals_hold(void **state)
{
    (void)state;
    CommandResult result = command_run(PROGRAM, "/", "texture --help");
    // Lines may break anywhere.
    for (char *c = result.out; *c; ++c)
        *c = *c == '\n' ? ' ' : *c;
    assert_non_null(strstr(result.out, "u0 v0 weight0 id0 ... u3 v3 weight3 id3"));
    assert_non_null(strstr(result.out, "x right, y up and z out in 0 to 1 (0.5 is 0; green is up, as in OpenGL)"));
    command_free(&result);
}

// ---- what is refused ---------------------------------------------------------------------------------------------

static void nothing_is_replaced_unless_asked(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    assert_true(test_file_write(test_folder_file(&folder, "a.0002.png"), "mine", 4));
    expect_text(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3", 2, "riffle: a.0002.png: exists; -y replaces it\n");
    assert_int_equal(test_folder_count(&folder), 1);
    expect(&folder, TEST_TEXTURE "b.png -o a.0002.png --frames 1", 2);
    expect(&folder, "convert builtin:foam a.0002.png", 2);
    assert_int_equal(test_folder_count(&folder), 1);
    size_t size = 0;
    unsigned char *data = test_file_read(test_folder_file(&folder, "a.0002.png"), &size);
    assert_int_equal(size, 4);
    free(data);
    expect(&folder, TEST_TEXTURE "a.%04d.png --frames 1-3 -y", 0);
    assert_int_equal(test_folder_count(&folder), 3);
    test_folder_remove(&folder);
}

static void an_input_is_never_replaced(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert builtin:foam?size=64 foam.png", 0);
    expect(&folder, "convert " TEST_FLOW " f.%02d.flo --frames 1-3", 0);
    assert_int_equal(link(test_folder_file(&folder, "foam.png"), test_folder_file(&folder, "hard.png")), 0);
    assert_int_equal(symlink("foam.png", test_folder_file(&folder, "soft.png")), 0);
    static const char *const lines[] = {
        "texture " TEST_FLOW " foam.png foam.png --frames 1 -y",
        "texture " TEST_FLOW " foam.png ./foam.png --frames 1 -y",
        "texture " TEST_FLOW " foam.png hard.png --frames 1 -y",
        "texture " TEST_FLOW " foam.png soft.png --frames 1 -y",
        "texture " TEST_FLOW " soft.png foam.png --frames 1 -y",
        "texture " TEST_FLOW " foam.png null: -o foam.png -y --frames 1",
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

static void events_are_json_a_line(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    CommandResult result = run_in(&folder, TEST_TEXTURE "null: --frames 5-8 --json");
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
    CommandResult result = run_in(&folder, TEST_TEXTURE "null: --frames 1-2 -q");
    assert_string_equal(result.err, "");
    assert_string_equal(result.out, "");
    command_free(&result);
    result = run_in(&folder, TEST_TEXTURE "null: --frames 1-2");
    assert_non_null(strstr(result.err, "2 frames in "));
    command_free(&result);
    result = run_in(&folder, TEST_TEXTURE "null: --frames 1-2 -v --threads 1");
    assert_non_null(strstr(result.err, "advect"));
    assert_non_null(strstr(result.err, ", 1 thread\nframe 1 "));
    assert_non_null(strstr(result.err, " MiB, 1 thread\n"));
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
        cmocka_unit_test(help_lists_exactly_the_options_that_are_there),
        cmocka_unit_test(help_lists_the_verbs_and_others_are_refused),
        cmocka_unit_test(the_version_is_the_librarys),
        cmocka_unit_test(every_option_of_a_method_is_in_the_help),
        cmocka_unit_test(the_help_tells_what_layers_and_normals_hold),
        cmocka_unit_test(nothing_is_replaced_unless_asked),
        cmocka_unit_test(an_input_is_never_replaced),
        cmocka_unit_test(events_are_json_a_line),
        cmocka_unit_test(quiet_says_nothing_and_plain_says_how_it_went),
        cmocka_unit_test(a_stream_of_pnm_frames_goes_to_stdout),
        cmocka_unit_test(a_long_setup_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
