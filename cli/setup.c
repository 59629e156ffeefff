// SPDX-License-Identifier: Apache-2.0
#include "setup.h"
#include "errors.h"
#include "progress.h"
#include "stop.h"

#include <stdio.h>

// A short set-up is not told at all; a long one at most this often, in seconds.
static const double g_bar_after = 0.4, g_bar_every = 0.1, g_line_every = 2;

typedef struct Setup
{
    bool active, shown;
    ProgressKind kind;
    double told;
} Setup;

static Setup g_setup;

static void tell_setup(const Setup *setup, const char *stage, double fraction)
{
    if (setup->kind == PROGRESS_BAR)
        fprintf(stderr, "\r\033[K%s: %.0f %%", stage, 100 * fraction);
    else if (setup->kind == PROGRESS_PLAIN)
        fprintf(stderr, "%s: %.0f %%\n", stage, 100 * fraction);
    else
    {
        fputs("{\"event\":\"setup\",", stderr);
        print_json_member(stderr, "stage", stage);
        fputs(",\"fraction\":", stderr);
        print_json_number(stderr, fraction);
        fputs("}\n", stderr);
    }
    fflush(stderr);
}

static bool report(void *user, const char *stage, double fraction)
{
    Setup *setup = user;
    double now = now_seconds(), silent = now - setup->told;
    bool bar = setup->kind == PROGRESS_BAR;
    if (setup->kind != PROGRESS_NONE && silent >= (bar ? (setup->shown ? g_bar_every : g_bar_after) : g_line_every))
    {
        tell_setup(setup, stage, fraction);
        setup->shown = true;
        setup->told = now;
    }
    return !stop_asked();
}

void setup_begin(const Settings *settings)
{
    static const RfProgress progress = {report, &g_setup};
    g_setup = (Setup){.active = true, .kind = progress_kind(settings), .told = now_seconds()};
    stop_is_harmless(true);
    rf_set_progress(&progress);
}

bool setup_end(void)
{
    bool active = g_setup.active;
    if (active)
    {
        rf_set_progress(NULL);
        stop_is_harmless(false);
        if (g_setup.shown && g_setup.kind == PROGRESS_BAR)
            fputs("\r\033[K", stderr);
        g_setup.active = false;
    }
    return active;
}
