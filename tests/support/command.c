// SPDX-License-Identifier: Apache-2.0
#include "support/command.h"

#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

enum
{
    MAX_ARGUMENTS = 256
};

static void pause_briefly(void)
{
    nanosleep(&(struct timespec){.tv_nsec = 2000000}, NULL);
}

static void become(const char *program, const char *folder, char *line, const CommandOptions *options,
                   const Command *command)
{
    char *arguments[MAX_ARGUMENTS + 2] = {(char *)program};
    int count = 1;
    for (char *word = strtok(line, " "); word && count < MAX_ARGUMENTS; word = strtok(NULL, " "))
        arguments[count++] = word;
    struct rlimit limit = {.rlim_cur = options->file_limit, .rlim_max = options->file_limit};
    bool ready = dup2(command->out, STDOUT_FILENO) >= 0 && dup2(command->err, STDERR_FILENO) >= 0 &&
                 chdir(folder) == 0 && (options->file_limit == 0 || setrlimit(RLIMIT_FSIZE, &limit) == 0) &&
                 (!options->path || setenv("PATH", options->path, 1) == 0);
    if (ready)
        execv(program, arguments);
    _exit(127);
}

Command command_start(const char *program, const char *folder, const char *line, const CommandOptions *options)
{
    static const CommandOptions none = {0};
    Command command = {.out = memfd_create("out", MFD_CLOEXEC), .err = memfd_create("err", MFD_CLOEXEC)};
    char *copy = strdup(line);
    if (command.out < 0 || command.err < 0 || !copy)
        abort();
    command.pid = fork();
    if (command.pid == 0)
        become(program, folder, copy, options ? options : &none, &command);
    if (command.pid < 0)
        abort();
    free(copy);
    return command;
}

static char *read_back(int file)
{
    off_t size = lseek(file, 0, SEEK_END);
    char *text = calloc(1, (size_t)size + 1);
    if (!text || pread(file, text, (size_t)size, 0) != size)
        abort();
    close(file);
    return text;
}

CommandResult command_finish(Command *command)
{
    int status = 0;
    time_t give_up = time(NULL) + 120;
    while (waitpid(command->pid, &status, WNOHANG) == 0)
    {
        if (time(NULL) > give_up)
            kill(command->pid, SIGKILL);
        pause_briefly();
    }
    CommandResult result = {.code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status)};
    result.out = read_back(command->out);
    result.err = read_back(command->err);
    return result;
}

CommandResult command_run(const char *program, const char *folder, const char *line)
{
    Command command = command_start(program, folder, line, NULL);
    return command_finish(&command);
}

void command_free(CommandResult *result)
{
    free(result->out);
    free(result->err);
    *result = (CommandResult){0};
}

static bool has_ended(const Command *command)
{
    siginfo_t info = {0};
    return waitid(P_PID, (id_t)command->pid, &info, WEXITED | WNOHANG | WNOWAIT) == 0 && info.si_pid != 0;
}

bool command_wait_for_file(const Command *command, const char *path)
{
    time_t give_up = time(NULL) + 60;
    while (access(path, F_OK) != 0)
    {
        if (time(NULL) > give_up || has_ended(command))
            return access(path, F_OK) == 0;
        pause_briefly();
    }
    return true;
}

int count_lines(const char *text)
{
    int lines = 0;
    for (; *text; ++text)
        lines += *text == '\n';
    return lines;
}
