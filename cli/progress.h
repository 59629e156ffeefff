// SPDX-License-Identifier: Apache-2.0
// How a run is told on stderr: a bar on a terminal, plain lines, JSON events, or nothing.
#pragma once

#include "options.h"

typedef struct Progress
{
    ProgressKind kind;
    bool quiet, verbose;
    /// Of the whole run, those a stopped run made before included.
    int total, made_before;
    int made;
    /// Compute time of the first frame and of all behind it.
    double first_seconds, later_seconds;
    double started, told;
    int last_frame;
    /// The last part told.
    double fraction;
} Progress;

double now_seconds(void);
/// What the settings ask for, on this terminal.
ProgressKind progress_kind(const Settings *settings);

/// `made_before` of `total` frames are there already.
void progress_begin(Progress *progress, const Settings *settings, int total, int made_before);
/// What goes on now; only the bar shows it.
void progress_stage(Progress *progress, const char *stage);
/// A frame is computed and written. seconds: of computing alone.
void progress_frame(Progress *progress, int frame, double seconds, const FrameReport *report);
/// Removes the bar, so that a line can be printed.
void progress_clear(Progress *progress);
void progress_done(Progress *progress);

/// Of one long computation in place of frames: `fraction` of it is done.
void progress_part(Progress *progress, const char *stage, double fraction);
/// Its end. seconds: of computing alone.
void progress_still(Progress *progress, double seconds, double energy);

/// In place of a run whose frames are all there.
void progress_nothing_left(const Settings *settings, int total);

/// One line that is no failure. `file` may be NULL.
__attribute__((format(printf, 3, 4))) void warn(const Settings *settings, const char *file, const char *format, ...);
/// The same, with -v only.
__attribute__((format(printf, 2, 3))) void tell(const Settings *settings, const char *format, ...);
