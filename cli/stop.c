// SPDX-License-Identifier: Apache-2.0
#include "stop.h"
#include "errors.h"

#include <signal.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

enum
{
    /// Given to the library to end what it is doing.
    HARMLESS_SECONDS = 1
};

static volatile sig_atomic_t g_stop, g_harmless;
/// Written once, before g_stop.
static struct timespec g_asked;

static void on_signal(int number)
{
    if (g_stop)
        _exit(CODE_SIGNAL + number);
    clock_gettime(CLOCK_MONOTONIC, &g_asked);
    g_stop = number;
    if (g_harmless)
        alarm(HARMLESS_SECONDS);
}

static void on_alarm(int number)
{
    (void)number;
    if (g_harmless && g_stop)
        _exit(CODE_SIGNAL + g_stop);
}

void stop_install(void)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    action.sa_handler = on_alarm;
    sigaction(SIGALRM, &action, NULL);
    action.sa_handler = SIG_IGN;
    sigaction(SIGPIPE, &action, NULL);
    sigaction(SIGXFSZ, &action, NULL);
}

int stop_asked(void)
{
    return g_stop;
}

double stop_age(void)
{
    struct timespec now;
    if (!g_stop)
        return 0;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)(now.tv_sec - g_asked.tv_sec) + 1e-9 * (double)(now.tv_nsec - g_asked.tv_nsec);
}

void stop_is_harmless(bool harmless)
{
    g_harmless = harmless;
}
