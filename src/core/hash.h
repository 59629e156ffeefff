// SPDX-License-Identifier: Apache-2.0
// A 64-bit content hash for saved states: detects damage and mix-ups, not attacks.
#pragma once

#include "core/random.h"

#include <stddef.h>
#include <string.h>

static inline uint64_t rf_hash_bytes(const void *data, size_t size, uint64_t seed)
{
    const uint8_t *bytes = (const uint8_t *)data;
    uint64_t hash = rf_hash64(seed ^ size);
    size_t i = 0;
    for (; i + 8 <= size; i += 8)
    {
        uint64_t word;
        memcpy(&word, bytes + i, 8);
        hash = (hash ^ word) * 0x9fb21c651e98df25u;
        hash ^= hash >> 29;
    }
    uint64_t tail = 0;
    if (i < size)
        memcpy(&tail, bytes + i, size - i);
    return rf_hash64(hash ^ tail);
}
