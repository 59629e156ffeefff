// SPDX-License-Identifier: Apache-2.0
// Numbers as files store them: any width, either endianness, unaligned.
#pragma once

#include "riffle/base.h"

#include <string.h>

typedef enum RfNumberKind
{
    RF_NUMBER_I8,
    RF_NUMBER_U8,
    RF_NUMBER_I16,
    RF_NUMBER_U16,
    RF_NUMBER_I32,
    RF_NUMBER_U32,
    RF_NUMBER_I64,
    RF_NUMBER_U64,
    RF_NUMBER_F16,
    RF_NUMBER_F32,
    RF_NUMBER_F64
} RfNumberKind;

static inline uint16_t rf_load_u16(const uint8_t *p, bool big)
{
    return big ? (uint16_t)(p[0] << 8 | p[1]) : (uint16_t)(p[1] << 8 | p[0]);
}

static inline uint32_t rf_load_u32(const uint8_t *p, bool big)
{
    uint32_t x;
    memcpy(&x, p, 4);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    big = !big;
#endif
    return big ? __builtin_bswap32(x) : x;
}

static inline uint64_t rf_load_u64(const uint8_t *p, bool big)
{
    uint64_t x;
    memcpy(&x, p, 8);
#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    big = !big;
#endif
    return big ? __builtin_bswap64(x) : x;
}

static inline float rf_load_f32(const uint8_t *p, bool big)
{
    uint32_t bits = rf_load_u32(p, big);
    float x;
    memcpy(&x, &bits, 4);
    return x;
}

static inline double rf_load_f64(const uint8_t *p, bool big)
{
    uint64_t bits = rf_load_u64(p, big);
    double x;
    memcpy(&x, &bits, 8);
    return x;
}

static inline int rf_number_size(RfNumberKind kind)
{
    static const uint8_t sizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 2, 4, 8};
    return sizes[kind];
}

/// IEEE 754 binary16.
double rf_half_to_double(uint16_t half);

/// One number at `p`, which need not be aligned.
double rf_load_number(const uint8_t *p, RfNumberKind kind, bool big);
