// SPDX-License-Identifier: Apache-2.0
// Random numbers as a function of (seed, frame, item, draw): no state, so no order of evaluation can change them.
#pragma once

#include <stdint.h>

// The finaliser of SplitMix64 (Steele, Lea, Flood. Fast splittable pseudorandom number generators. 2014).
static inline uint64_t rf_hash64(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static inline uint64_t rf_random_bits(uint64_t seed, uint64_t frame, uint64_t item, uint64_t draw)
{
    return rf_hash64(rf_hash64(rf_hash64(rf_hash64(seed) ^ frame) ^ item) ^ draw);
}

/// Uniform in [0, 1), 24 bits.
static inline float rf_random_float(uint64_t seed, uint64_t frame, uint64_t item, uint64_t draw)
{
    return (float)(rf_random_bits(seed, frame, item, draw) >> 40) * 0x1p-24f;
}

/// Uniform in 0 .. count - 1, count > 0; the bias is under count / 2^32.
static inline uint32_t rf_random_below(uint32_t count, uint64_t seed, uint64_t frame, uint64_t item, uint64_t draw)
{
    return (uint32_t)(((rf_random_bits(seed, frame, item, draw) >> 32) * count) >> 32);
}
