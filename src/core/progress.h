// SPDX-License-Identifier: Apache-2.0
// Where a long call tells how far it is and asks whether to go on. Only the thread that made the call does, between
// parallel loops or the chunks of one (rf_progress_for), never an item of one.
#pragma once

#include "core/parallel.h"
#include "riffle/base.h"

/// RF_CANCELLED, with the last error set, if the thread's RfProgress says stop; RF_OK without one. `fraction` is
/// brought into 0 to 1.
RfResult rf_progress(const char *stage, double fraction);
/// True if somebody listens, so that waiting may be cut into short pieces.
bool rf_progress_wanted(void);

/// As rf_parallel_for, reporting fractions of the stage from `from` to `to`. Cancelled: some items have not run.
RfResult rf_progress_for(const char *stage, double from, double to, int count, RfParallelFn *function, void *context);
