// SPDX-License-Identifier: Apache-2.0
#include "core/progress.h"
#include "core/result.h"

#include <string.h>

enum
{
    /// Most reports of one rf_progress_for: a loop of a minute asks every 0.12 s.
    CHUNKS = 512,
    /// Items a thread and chunk at the least, so that threads seldom wait for the last of them.
    ITEMS = 4
};

static _Thread_local const RfProgress *g_progress;

void rf_set_progress(const RfProgress *progress)
{
    g_progress = progress;
}

bool rf_progress_wanted(void)
{
    return g_progress != NULL;
}

RfResult rf_progress(const char *stage, double fraction)
{
    const RfProgress *progress = g_progress;
    if (!progress || !progress->report)
        return RF_OK;
    double told = fraction > 0 ? (fraction < 1 ? fraction : 1) : 0;
    return progress->report(progress->user, stage, told) ? RF_OK
                                                         : rf_fail(RF_CANCELLED, NULL, NULL, "stopped while %s", stage);
}

typedef struct Chunk
{
    RfParallelFn *function;
    void *context;
    int first;
} Chunk;

static void run_item(void *context, int item, int worker)
{
    const Chunk *chunk = context;
    chunk->function(chunk->context, chunk->first + item, worker);
}

RfResult rf_progress_for(const char *stage, double from, double to, int count, RfParallelFn *function, void *context)
{
    int least = ITEMS * rf_threads(), step = count / CHUNKS > least ? count / CHUNKS : least;
    // Nobody listens: nobody waits.
    step = rf_progress_wanted() ? step : count;
    for (int first = 0; first < count; first += step)
    {
        RF_TRY(rf_progress(stage, from + (to - from) * first / count));
        Chunk chunk = {function, context, first};
        rf_parallel_for(count - first < step ? count - first : step, run_item, &chunk);
    }
    return rf_progress(stage, to);
}
