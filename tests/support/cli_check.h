// SPDX-License-Identifier: Apache-2.0
// What tests of the command share: running it in a folder and checking how it ended and what it left. Header only,
// since the support library does without cmocka.
#pragma once

#include "support/command.h"
#include "support/files.h"
#include "support/json_check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define PROGRAM RF_BUILD_DIR "/riffle"
#define TEST_FLOW "builtin:vortex?size=96x64"
#define TEST_TEXTURE "texture " TEST_FLOW " builtin:foam?size=64 "

static inline CommandResult run_in(const TestFolder *folder, const char *line)
{
    return command_run(PROGRAM, folder->path, line);
}

/// Runs and frees; shows the message where the code is another one.
static inline void expect(const TestFolder *folder, const char *line, int code)
{
    CommandResult result = run_in(folder, line);
    if (result.code != code)
        print_error("riffle %s: %s\n", line, result.err);
    assert_int_equal(result.code, code);
    command_free(&result);
}

static inline void expect_text(const TestFolder *folder, const char *line, int code, const char *fragment)
{
    CommandResult result = run_in(folder, line);
    if (result.code != code || !strstr(result.err, fragment))
        print_error("riffle %s: %d, %s\n", line, result.code, result.err);
    assert_int_equal(result.code, code);
    assert_non_null(strstr(result.err, fragment));
    command_free(&result);
}

static inline bool exists(const TestFolder *folder, const char *name)
{
    return access(test_folder_file(folder, name), F_OK) == 0;
}

static inline void assert_same_file(const TestFolder *a, const char *a_name, const TestFolder *b, const char *b_name)
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

static inline bool has_ffmpeg(void)
{
    return system("ffmpeg -version >/dev/null 2>&1") == 0;
}

static inline void assert_json_lines(const char *text)
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
