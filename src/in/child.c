// SPDX-License-Identifier: Apache-2.0
// HDF5, below NetCDF, is known to crash, to loop and to allocate without end on files made to do so, and no check of
// ours can come before its own parser. So it runs in a forked child with limits, and what it has decoded, or why it has
// not, comes back through a pipe:
//
//     Reply                     result, error, sizes, conventions
//     float[height][width][2]   if result is RF_OK
//     uint8_t[height][width]    if there is a mask
//
// The parent believes nothing in the reply: sizes are checked again, and a short reply is a failure. The child holds
// copies of the parent's other threads' locks; it touches none but malloc's, which the C library keeps usable.
#include "in/child.h"

#include "core/clock.h"
#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

enum
{
    CPU_SECONDS = 60,
    WALL_SECONDS = 120,
    /// How often the caller is asked whether to go on.
    POLL_MILLISECONDS = 100
};

#if defined(__SANITIZE_ADDRESS__)
#define RF_SHADOW_MEMORY 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define RF_SHADOW_MEMORY 1
#endif
#endif

typedef struct Reply
{
    RfResult result;
    RfError error;
    int width, height, moment_count, filled_vectors;
    bool mask;
    char conventions[256];
} Reply;

// ---- the child ---------------------------------------------------------------------------------------------------

static bool write_all(int pipe, const void *data, size_t size)
{
    const uint8_t *p = data;
    while (size > 0)
    {
        ssize_t done = write(pipe, p, size);
        if (done < 0 && errno == EINTR)
            continue;
        if (done <= 0)
            return false;
        p += done;
        size -= (size_t)done;
    }
    return true;
}

// 4 GiB over what the parent has already: the largest moment takes 2 GiB.
static void limit_child(void)
{
    struct rlimit cpu = {CPU_SECONDS, CPU_SECONDS}, core = {0, 0};
    setrlimit(RLIMIT_CPU, &cpu);
    setrlimit(RLIMIT_CORE, &core);
#ifndef RF_SHADOW_MEMORY
    unsigned long pages = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (file && fscanf(file, "%lu", &pages) == 1)
    {
        rlim_t bytes = (rlim_t)pages * (rlim_t)sysconf(_SC_PAGESIZE) + ((rlim_t)4 << 30);
        struct rlimit memory = {bytes, bytes};
        setrlimit(RLIMIT_AS, &memory);
    }
    if (file)
        fclose(file);
#endif
    // What the library has to say about a broken file is not for the user's terminal.
    int nothing = open("/dev/null", O_WRONLY | O_CLOEXEC);
    if (nothing >= 0)
    {
        dup2(nothing, STDOUT_FILENO);
        dup2(nothing, STDERR_FILENO);
    }
}

static const int deadly[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGTERM, SIGPIPE, SIGXCPU};

_Noreturn static void run_child(RfChildReadFn *read, const RfFlowSource *source, int moment, int pipe)
{
    for (size_t i = 0; i < sizeof deadly / sizeof deadly[0]; ++i)
        signal(deadly[i], SIG_DFL);
    // Ctrl-C is for the parent to deal with.
    signal(SIGINT, SIG_IGN);
    // Nobody is left to read what is found, or to be told, here.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    rf_set_progress(NULL);
    limit_child();
    RfFlowMoment content = {0};
    Reply reply;
    memset(&reply, 0, sizeof reply);
    reply.result = read(source, moment, &content);
    if (reply.result != RF_OK)
        reply.error = *rf_last_error();
    reply.width = content.field.width;
    reply.height = content.field.height;
    reply.moment_count = content.moment_count;
    reply.filled_vectors = content.filled_vectors;
    reply.mask = content.field.mask != NULL;
    memcpy(reply.conventions, content.conventions, sizeof reply.conventions);
    size_t cells = (size_t)reply.width * (size_t)reply.height;
    bool sent = write_all(pipe, &reply, sizeof reply);
    if (sent && reply.result == RF_OK)
        sent = write_all(pipe, content.field.velocity, cells * 2 * sizeof(float)) &&
               (!reply.mask || write_all(pipe, content.field.mask, cells));
    _exit(sent ? 0 : 1);
}

// ---- the parent --------------------------------------------------------------------------------------------------

/// What the parent waits for, and why it no longer does.
typedef struct Wait
{
    int pipe;
    double deadline;
    bool complete, cancelled;
} Wait;

// False at the end of the pipe, when time is up and when the caller wants no more of it.
static bool read_all(Wait *wait, void *data, size_t size)
{
    uint8_t *p = data;
    while (size > 0)
    {
        double left = wait->deadline - rf_seconds();
        wait->cancelled = rf_progress("reading the flow", 0) != RF_OK;
        if (wait->cancelled)
            return false;
        struct pollfd poller = {.fd = wait->pipe, .events = POLLIN};
        int most = rf_progress_wanted() ? POLL_MILLISECONDS : WALL_SECONDS * 1000;
        int ready = left > 0 ? poll(&poller, 1, left * 1000 < most ? (int)(left * 1000) + 1 : most) : -1;
        if (ready == 0 || (ready < 0 && left > 0 && errno == EINTR))
            continue;
        ssize_t got = ready > 0 ? read(wait->pipe, p, size) : 0;
        if (got < 0 && errno == EINTR)
            continue;
        if (got <= 0)
            return false;
        p += got;
        size -= (size_t)got;
    }
    return true;
}

static RfResult receive(const RfFlowSource *source, Wait *wait, RfFlowMoment *out)
{
    Reply reply;
    wait->complete = read_all(wait, &reply, sizeof reply);
    if (!wait->complete)
        return wait->cancelled ? RF_CANCELLED : RF_BAD_INPUT;
    reply.error.place[sizeof reply.error.place - 1] = '\0';
    reply.error.message[sizeof reply.error.message - 1] = '\0';
    if (reply.result != RF_OK)
        return rf_fail(reply.result, source->path, reply.error.place, "%s", reply.error.message);
    RF_TRY(rf_flow_moment_create(source, reply.width, reply.height, out));
    if (reply.mask)
        RF_TRY(rf_flow_field_add_mask(&out->field));
    size_t cells = (size_t)reply.width * (size_t)reply.height;
    wait->complete = read_all(wait, out->field.velocity, cells * 2 * sizeof(float)) &&
                     (!reply.mask || read_all(wait, out->field.mask, cells));
    if (wait->cancelled)
        return RF_CANCELLED;
    out->moment_count = reply.moment_count;
    out->filled_vectors = reply.filled_vectors;
    memcpy(out->conventions, reply.conventions, sizeof out->conventions);
    out->conventions[sizeof out->conventions - 1] = '\0';
    return wait->complete && out->moment_count >= 1 ? RF_OK : RF_BAD_INPUT;
}

static RfResult how_it_died(const RfFlowSource *source, const char *library, int status, bool late)
{
    if (late || (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU))
        return rf_fail(RF_BAD_INPUT, source->path, NULL,
                       "%s took more than %d seconds: the file is damaged, or too large", library, CPU_SECONDS);
    if (WIFSIGNALED(status))
        return rf_fail(RF_BAD_INPUT, source->path, NULL, "%s died of it (signal %d): the file is damaged", library,
                       WTERMSIG(status));
    return rf_fail(RF_BAD_INPUT, source->path, NULL, "%s gave no answer: the file is damaged", library);
}

RfResult rf_child_read(RfChildReadFn *read, const char *library, const RfFlowSource *source, int moment,
                       RfFlowMoment *out)
{
    int ends[2];
    if (pipe2(ends, O_CLOEXEC) != 0)
        return rf_fail(RF_UNREADABLE, source->path, NULL, "no pipe for the reader's process: %s", strerror(errno));
    pid_t child = fork();
    if (child == 0)
    {
        close(ends[0]);
        run_child(read, source, moment, ends[1]);
    }
    close(ends[1]);
    if (child < 0)
    {
        close(ends[0]);
        return rf_fail(RF_UNREADABLE, source->path, NULL, "no process for the reader: %s", strerror(errno));
    }
    Wait wait = {.pipe = ends[0], .deadline = rf_seconds() + WALL_SECONDS};
    RfResult result = receive(source, &wait, out);
    close(ends[0]);
    bool late = !wait.complete && rf_seconds() >= wait.deadline;
    if (late || wait.cancelled)
        kill(child, SIGKILL);
    int status = 0;
    while (waitpid(child, &status, 0) < 0 && errno == EINTR)
        continue;
    if (!wait.complete && result == RF_BAD_INPUT)
        result = how_it_died(source, library, status, late);
    if (result != RF_OK)
        rf_flow_moment_free(out);
    return result;
}
