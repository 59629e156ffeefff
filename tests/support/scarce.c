// SPDX-License-Identifier: Apache-2.0
#include "support/scarce.h"
#include "riffle/riffle.h"

#include <stdlib.h>

static int g_left, g_live;

static void *take(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    void *memory = NULL;
    if (__atomic_fetch_sub(&g_left, 1, __ATOMIC_RELAXED) <= 0 || posix_memalign(&memory, alignment, bytes) != 0)
        return NULL;
    __atomic_fetch_add(&g_live, 1, __ATOMIC_RELAXED);
    return memory;
}

static void give(void *memory, void *user)
{
    (void)user;
    __atomic_fetch_sub(&g_live, 1, __ATOMIC_RELAXED);
    free(memory);
}

void scarce_begin(int allocations)
{
    const RfAllocator scarce = {take, give, NULL};
    scarce_allow(allocations);
    rf_set_allocator(&scarce);
}

void scarce_allow(int allocations)
{
    g_left = allocations;
}

int scarce_live(void)
{
    return g_live;
}

void scarce_end(void)
{
    rf_set_allocator(NULL);
}
