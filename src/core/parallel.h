// SPDX-License-Identifier: Apache-2.0
// The one parallel primitive. Items are claimed one by one, so an item should be worth some microseconds; results may
// depend on the item, never on the worker. Reductions: write one partial result an item and add them in order
// afterwards.
#pragma once

enum
{
    RF_MAX_THREADS = 256
};

/// item: 0 .. count - 1; worker: 0 .. rf_threads() - 1, for per-worker scratch only.
typedef void RfParallelFn(void *context, int item, int worker);

void rf_parallel_for(int count, RfParallelFn *function, void *context);
