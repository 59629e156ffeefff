// SPDX-License-Identifier: Apache-2.0
#include "progress.h"
#include "errors.h"

#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

enum
{
    BAR_CELLS = 24
};

// Terminals and logs are told at most this often, in seconds.
static const double g_bar_every = 0.1, g_line_every = 2;

double now_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

ProgressKind progress_kind(const Settings *settings)
{
    if (settings->quiet)
        return PROGRESS_NONE;
    if (settings->progress != PROGRESS_AUTO)
        return settings->progress;
    return isatty(STDERR_FILENO) ? PROGRESS_BAR : PROGRESS_PLAIN;
}

void progress_begin(Progress *progress, const Settings *settings, int total, int made_before)
{
    *progress = (Progress){.kind = progress_kind(settings),
                           .quiet = settings->quiet,
                           .verbose = settings->verbose,
                           .total = total,
                           .made_before = made_before,
                           .started = now_seconds()};
    progress->told = progress->started;
}

void progress_clear(Progress *progress)
{
    if (progress->kind == PROGRESS_BAR)
        fputs("\r\033[K", stderr);
}

static void format_time(double seconds, char *text, size_t size)
{
    if (seconds < 100)
        snprintf(text, size, "%.0f s", seconds);
    else if (seconds < 6000)
        snprintf(text, size, "%.0f min", seconds / 60);
    else
        snprintf(text, size, "%.1f h", seconds / 3600);
}

/// "12.3 frames/s, 15 s left"
static void format_rate(const Progress *progress, char *text, size_t size)
{
    double elapsed = now_seconds() - progress->started;
    double rate = progress->made > 0 && elapsed > 0 ? progress->made / elapsed : 0;
    char left[32] = "?";
    if (rate > 0)
        format_time((progress->total - progress->made_before - progress->made) / rate, left, sizeof left);
    snprintf(text, size, "%.3g frames/s, %s left", rate, left);
}

static void draw_bar(Progress *progress, const char *stage)
{
    char bar[BAR_CELLS + 1], rate[96];
    int done = progress->made_before + progress->made;
    int cells = progress->total > 0 ? (int)((int64_t)done * BAR_CELLS / progress->total) : 0;
    memset(bar, '.', BAR_CELLS);
    memset(bar, '#', (size_t)(cells < BAR_CELLS ? cells : BAR_CELLS));
    bar[BAR_CELLS] = '\0';
    format_rate(progress, rate, sizeof rate);
    fprintf(stderr, "\r\033[K[%s] %d of %d  frame %d  %s  %s", bar, done, progress->total, progress->last_frame, stage,
            rate);
    fflush(stderr);
    progress->told = now_seconds();
}

void progress_stage(Progress *progress, const char *stage)
{
    if (progress->kind == PROGRESS_BAR && now_seconds() - progress->told >= g_bar_every)
        draw_bar(progress, stage);
}

static void tell_json(int frame, double seconds, const FrameReport *report)
{
    fprintf(stderr, "{\"event\":\"frame\",\"frame\":%d,\"ms\":", frame);
    print_json_number(stderr, 1e3 * seconds);
    fputs(",\"stages\":{", stderr);
    for (int i = 0; i < report->stage_count; ++i)
    {
        fputs(i ? "," : "", stderr);
        print_json_text(stderr, report->stages[i].name);
        fputc(':', stderr);
        print_json_number(stderr, 1e3 * report->stages[i].seconds);
    }
    fputc('}', stderr);
    for (int i = 0; i < report->figure_count; ++i)
    {
        fputc(',', stderr);
        print_json_text(stderr, report->figures[i].name);
        fputc(':', stderr);
        print_json_number(stderr, report->figures[i].value);
    }
    fputs("}\n", stderr);
}

static void tell_line(Progress *progress, int frame, double seconds, const FrameReport *report)
{
    char rate[96];
    format_rate(progress, rate, sizeof rate);
    fprintf(stderr, "frame %d (%d of %d): %.1f ms", frame, progress->made_before + progress->made, progress->total,
            1e3 * seconds);
    const char *between = " (";
    for (int i = 0; i < report->stage_count && progress->verbose; ++i, between = ", ")
        fprintf(stderr, "%s%s %.1f", between, report->stages[i].name, 1e3 * report->stages[i].seconds);
    for (int i = 0; i < report->figure_count && progress->verbose; ++i, between = ", ")
        fprintf(stderr, "%s%s %.3g", between, report->figures[i].name, report->figures[i].value);
    fprintf(stderr, "%s, %s\n", between[0] == ',' ? ")" : "", rate);
    progress->told = now_seconds();
}

void progress_frame(Progress *progress, int frame, double seconds, const FrameReport *report)
{
    if (progress->made == 0)
        progress->first_seconds = seconds;
    else
        progress->later_seconds += seconds;
    ++progress->made;
    progress->last_frame = frame;
    double silent = now_seconds() - progress->told;
    if (progress->kind == PROGRESS_JSON)
        tell_json(frame, seconds, report);
    else if (progress->kind == PROGRESS_BAR && silent >= g_bar_every)
        draw_bar(progress, "");
    if (progress->kind == PROGRESS_PLAIN && (progress->verbose || silent >= g_line_every))
        tell_line(progress, frame, seconds, report);
}

static double peak_mib(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)usage.ru_maxrss / 1024;
}

void progress_done(Progress *progress)
{
    int later = progress->made - 1;
    double mean = later > 0 ? progress->later_seconds / later : progress->first_seconds;
    progress_clear(progress);
    if (progress->kind == PROGRESS_JSON)
    {
        fprintf(stderr, "{\"event\":\"done\",\"frames\":%d,\"ms_per_frame\":", progress->made);
        print_json_number(stderr, 1e3 * mean);
        fputs(",\"first_ms\":", stderr);
        print_json_number(stderr, 1e3 * progress->first_seconds);
        fputs(",\"peak_mib\":", stderr);
        print_json_number(stderr, peak_mib());
        fprintf(stderr, ",\"threads\":%d}\n", rf_threads());
    }
    else if (progress->kind != PROGRESS_NONE)
        fprintf(stderr, "%d frame%s in %.1f s: %.1f ms a frame to compute, the first %.1f ms; %.0f MiB, %d thread%s\n",
                progress->made, progress->made == 1 ? "" : "s", now_seconds() - progress->started, 1e3 * mean,
                1e3 * progress->first_seconds, peak_mib(), rf_threads(), rf_threads() == 1 ? "" : "s");
}

void progress_part(Progress *progress, const char *stage, double fraction)
{
    double now = now_seconds(), silent = now - progress->told, elapsed = now - progress->started;
    bool bar = progress->kind == PROGRESS_BAR;
    bool nothing_new = !bar && fraction <= progress->fraction;
    if (progress->kind == PROGRESS_NONE || nothing_new || silent < (bar ? g_bar_every : g_line_every))
        return;
    progress->told = now;
    progress->fraction = fraction;
    if (progress->kind == PROGRESS_JSON)
    {
        fputs("{\"event\":\"stage\",", stderr);
        print_json_member(stderr, "stage", stage);
        fputs(",\"fraction\":", stderr);
        print_json_number(stderr, fraction);
        fputs("}\n", stderr);
        return;
    }
    char cells[BAR_CELLS + 1], left[32] = "?";
    int done = (int)(fraction * BAR_CELLS);
    memset(cells, '.', BAR_CELLS);
    memset(cells, '#', (size_t)(done < BAR_CELLS ? done : BAR_CELLS));
    cells[BAR_CELLS] = '\0';
    if (fraction > 0)
        format_time(elapsed * (1 - fraction) / fraction, left, sizeof left);
    if (bar)
        fprintf(stderr, "\r\033[K[%s] %s  %s left", cells, stage, left);
    else
        fprintf(stderr, "%.0f %%: %s, %s left\n", 100 * fraction, stage, left);
    fflush(stderr);
}

void progress_still(Progress *progress, double seconds, double energy)
{
    progress_clear(progress);
    if (progress->kind == PROGRESS_JSON)
    {
        fputs("{\"event\":\"done\",\"ms\":", stderr);
        print_json_number(stderr, 1e3 * seconds);
        fputs(",\"peak_mib\":", stderr);
        print_json_number(stderr, peak_mib());
        fprintf(stderr, ",\"threads\":%d,\"energy\":", rf_threads());
        print_json_number(stderr, energy);
        fputs("}\n", stderr);
    }
    else if (progress->kind != PROGRESS_NONE)
        fprintf(stderr, "made in %.1f s, %.1f ms to compute; energy %.4f; %.0f MiB, %d thread%s\n",
                now_seconds() - progress->started, 1e3 * seconds, energy, peak_mib(), rf_threads(),
                rf_threads() == 1 ? "" : "s");
}

void progress_nothing_left(const Settings *settings, int total)
{
    Progress progress;
    progress_begin(&progress, settings, total, total);
    if (progress.kind == PROGRESS_JSON)
        progress_done(&progress);
    else if (progress.kind != PROGRESS_NONE)
        fprintf(stderr, "nothing is left to do: %s there, and no stopped run; -y without --resume starts afresh\n",
                total == 1 ? "the frame is" : "all frames are");
}

void warn(const Settings *settings, const char *file, const char *format, ...)
{
    if (settings->quiet || (settings->progress == PROGRESS_NONE))
        return;
    char message[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    if (settings_json(settings))
    {
        fputs("{\"event\":\"warning\",", stderr);
        print_json_member(stderr, "file", file ? file : "");
        fputc(',', stderr);
        print_json_member(stderr, "message", message);
        fputs("}\n", stderr);
    }
    else
        fprintf(stderr, "riffle: warning: %s%s%s\n", file ? file : "", file ? ": " : "", message);
}

void tell(const Settings *settings, const char *format, ...)
{
    if (!settings->verbose || settings_json(settings))
        return;
    va_list arguments;
    va_start(arguments, format);
    vfprintf(stderr, format, arguments);
    va_end(arguments);
    fputc('\n', stderr);
}
