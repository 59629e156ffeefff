// SPDX-License-Identifier: Apache-2.0
// Runs the built program as a user would: its own process, its own folder, what it printed and how it ended.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

typedef struct Command
{
    pid_t pid;
    int out, err;
} Command;

typedef struct CommandResult
{
    /// Exit code, or minus the signal that killed it.
    int code;
    /// What it printed, from malloc.
    char *out, *err;
} CommandResult;

typedef struct CommandOptions
{
    /// RLIMIT_FSIZE in bytes, 0: none. Stands for a full disk.
    size_t file_limit;
    /// $PATH of the program; NULL: as here.
    const char *path;
} CommandOptions;

/// Starts `program` in `folder`; `line` is split at blanks. `options` may be NULL.
Command command_start(const char *program, const char *folder, const char *line, const CommandOptions *options);
/// Waits for its end, two minutes at most; then it is killed.
CommandResult command_finish(Command *command);
CommandResult command_run(const char *program, const char *folder, const char *line);
void command_free(CommandResult *result);

/// Waits until the file is there; false after a minute, or when the command has ended before.
bool command_wait_for_file(const Command *command, const char *path);
/// Number of lines in a text that ends each with a line break.
int count_lines(const char *text);
