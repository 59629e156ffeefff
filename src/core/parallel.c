// SPDX-License-Identifier: Apache-2.0
#include "core/parallel.h"
#include "riffle/base.h"

#include <omp.h>

static int g_threads;

void rf_set_threads(int count)
{
    g_threads = count < 0 ? 0 : count > RF_MAX_THREADS ? RF_MAX_THREADS : count;
}

int rf_threads(void)
{
    if (g_threads > 0)
        return g_threads;
    int processors = omp_get_num_procs();
    return processors < 1 ? 1 : processors > RF_MAX_THREADS ? RF_MAX_THREADS : processors;
}

void rf_parallel_for(int count, RfParallelFn *function, void *context)
{
    int threads = rf_threads();
    if (threads > count)
        threads = count;
    if (threads <= 1)
    {
        for (int item = 0; item < count; ++item)
            function(context, item, 0);
        return;
    }
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
    for (int item = 0; item < count; ++item)
        function(context, item, omp_get_thread_num());
}
