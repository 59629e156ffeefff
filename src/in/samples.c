// SPDX-License-Identifier: Apache-2.0
#include "in/samples.h"

#include <math.h>

double rf_half_to_double(uint16_t half)
{
    int exponent = half >> 10 & 31, fraction = half & 1023;
    double magnitude = exponent == 0   ? ldexp(fraction, -24)
                       : exponent < 31 ? ldexp(1024 + fraction, exponent - 25)
                       : fraction == 0 ? INFINITY
                                       : NAN;
    return half & 0x8000 ? -magnitude : magnitude;
}

double rf_load_number(const uint8_t *p, RfNumberKind kind, bool big)
{
    switch (kind)
    {
    case RF_NUMBER_I8:
        return (int8_t)p[0];
    case RF_NUMBER_U8:
        return p[0];
    case RF_NUMBER_I16:
        return (int16_t)rf_load_u16(p, big);
    case RF_NUMBER_U16:
        return rf_load_u16(p, big);
    case RF_NUMBER_I32:
        return (int32_t)rf_load_u32(p, big);
    case RF_NUMBER_U32:
        return rf_load_u32(p, big);
    case RF_NUMBER_I64:
        return (double)(int64_t)rf_load_u64(p, big);
    case RF_NUMBER_U64:
        return (double)rf_load_u64(p, big);
    case RF_NUMBER_F16:
        return rf_half_to_double(rf_load_u16(p, big));
    case RF_NUMBER_F32:
        return (double)rf_load_f32(p, big);
    case RF_NUMBER_F64:
        return rf_load_f64(p, big);
    }
    return 0;
}
