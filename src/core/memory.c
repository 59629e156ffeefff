// SPDX-License-Identifier: Apache-2.0
#include "core/memory.h"
#include "core/result.h"

#include <stdlib.h>
#include <string.h>

enum
{
    ALIGNMENT = 64
};

static void *default_allocate(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    void *memory = NULL;
    return posix_memalign(&memory, alignment, bytes) == 0 ? memory : NULL;
}

static void default_release(void *memory, void *user)
{
    (void)user;
    free(memory);
}

static const RfAllocator default_allocator = {default_allocate, default_release, NULL};
static RfAllocator g_allocator = {default_allocate, default_release, NULL};

void rf_set_allocator(const RfAllocator *allocator)
{
    g_allocator = allocator ? *allocator : default_allocator;
}

void *rf_allocate(size_t count, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || bytes > (size_t)PTRDIFF_MAX)
    {
        rf_fail(RF_OUT_OF_MEMORY, NULL, NULL, "out of memory: %zu times %zu bytes are more than can be addressed",
                count, size);
        return NULL;
    }
    void *memory = g_allocator.allocate(bytes > 0 ? bytes : 1, ALIGNMENT, g_allocator.user);
    if (!memory)
        rf_fail(RF_OUT_OF_MEMORY, NULL, NULL, "out of memory: %zu bytes wanted", bytes);
    return memory;
}

void *rf_allocate_zero(size_t count, size_t size)
{
    void *memory = rf_allocate(count, size);
    if (memory)
        memset(memory, 0, count * size);
    return memory;
}

void *rf_reallocate(void *memory, size_t old_count, size_t new_count, size_t size)
{
    void *moved = rf_allocate(new_count, size);
    if (!moved)
        return NULL;
    size_t kept = old_count < new_count ? old_count : new_count;
    if (kept > 0)
        memcpy(moved, memory, kept * size);
    rf_release(memory);
    return moved;
}

void rf_release(void *memory)
{
    if (memory)
        g_allocator.release(memory, g_allocator.user);
}

void rf_free(void *memory)
{
    rf_release(memory);
}

// Overflow blocks are chained through their first 64 bytes.
void *rf_arena_push(RfArena *arena, size_t count, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(count, size, &bytes) || bytes > (size_t)PTRDIFF_MAX - 2 * ALIGNMENT)
    {
        rf_fail(RF_OUT_OF_MEMORY, NULL, NULL, "out of memory: %zu times %zu bytes are more than can be addressed",
                count, size);
        return NULL;
    }
    bytes = bytes > 0 ? (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT : ALIGNMENT;
    arena->wanted += bytes;
    if (arena->capacity - arena->used >= bytes)
    {
        uint8_t *place = arena->memory + arena->used;
        arena->used += bytes;
        return place;
    }
    uint8_t *block = rf_allocate(bytes + ALIGNMENT, 1);
    if (!block)
        return NULL;
    memcpy(block, &arena->overflow, sizeof arena->overflow);
    arena->overflow = block;
    return block + ALIGNMENT;
}

static void free_overflow(RfArena *arena)
{
    while (arena->overflow)
    {
        void *next;
        memcpy(&next, arena->overflow, sizeof next);
        rf_release(arena->overflow);
        arena->overflow = next;
    }
}

void rf_arena_reset(RfArena *arena)
{
    if (arena->overflow)
    {
        free_overflow(arena);
        size_t capacity = arena->wanted + arena->wanted / 2;
        uint8_t *memory = rf_allocate(capacity, 1);
        if (memory) // Without it the arena stays small and every step goes to the heap: slower, not wrong.
        {
            rf_release(arena->memory);
            arena->memory = memory;
            arena->capacity = capacity;
        }
    }
    arena->used = 0;
    arena->wanted = 0;
}

void rf_arena_free(RfArena *arena)
{
    free_overflow(arena);
    rf_release(arena->memory);
    *arena = (RfArena){0};
}
