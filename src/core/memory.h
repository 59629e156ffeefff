// SPDX-License-Identifier: Apache-2.0
// All memory of the library: checked allocation, and a scratch arena that learns its peak.
#pragma once

#include "riffle/base.h"

/// 64-byte aligned, NOT cleared; NULL (with the last error set) if there is none or count * size overflows. 0 bytes
/// give a valid pointer.
void *rf_allocate(size_t count, size_t size);
/// The same, cleared.
void *rf_allocate_zero(size_t count, size_t size);
/// Copies min(old, new) elements to a new place and frees the old one; on failure the old block stays.
void *rf_reallocate(void *memory, size_t old_count, size_t new_count, size_t size);
/// Accepts NULL.
void rf_release(void *memory);

/// Scratch of one worker: push in any number, then reset all at once. A push that does not fit goes to the heap; the
/// reset then grows the arena to 1.5 times the peak, so that a steady step takes nothing from the heap.
typedef struct RfArena
{
    uint8_t *memory;
    size_t capacity, used, wanted;
    void *overflow;
} RfArena;

/// 64-byte aligned, not cleared; NULL with the last error set.
void *rf_arena_push(RfArena *arena, size_t count, size_t size);
void rf_arena_reset(RfArena *arena);
void rf_arena_free(RfArena *arena);
