// SPDX-License-Identifier: Apache-2.0
#include "core/options.h"
#include "core/hash.h"
#include "core/result.h"

#include <string.h>

static double field_value(const void *options, const RfOption *option)
{
    const uint8_t *field = (const uint8_t *)options + option->offset;
    float f;
    int i;
    uint64_t u;
    bool b;
    switch (option->kind)
    {
    case RF_OPTION_FLOAT:
        memcpy(&f, field, sizeof f);
        return (double)f;
    case RF_OPTION_INT:
    case RF_OPTION_CHOICE:
        memcpy(&i, field, sizeof i);
        return i;
    case RF_OPTION_UINT64:
        memcpy(&u, field, sizeof u);
        return (double)u;
    case RF_OPTION_BOOL:
        memcpy(&b, field, sizeof b);
        return b;
    }
    return 0;
}

/// A float was rounded on its way into the struct, so its bounds are rounded alike: 1.05 is in a range from 1.05.
static double bound(RfOptionKind kind, double value)
{
    return kind == RF_OPTION_FLOAT ? (double)(float)value : value;
}

RfResult rf_options_check(const void *options, uint32_t struct_size, size_t size, const char *defaults_name,
                          const RfOption *table, int count)
{
    RF_REQUIRE(struct_size == size, "options: struct_size is %u, not %zu: start from %s()", struct_size, size,
               defaults_name);
    for (int i = 0; i < count; ++i)
    {
        double value = field_value(options, &table[i]);
        double least = bound(table[i].kind, table[i].minimum), most = bound(table[i].kind, table[i].maximum);
        // Written so that NaN fails.
        RF_REQUIRE(value >= least && value <= most, "%s %g: must be %g to %g", table[i].name, value, table[i].minimum,
                   table[i].maximum);
    }
    return RF_OK;
}

uint64_t rf_options_hash(const void *options, const RfOption *table, int count, uint64_t seed)
{
    uint64_t hash = seed;
    for (int i = 0; i < count; ++i)
    {
        size_t size = table[i].kind == RF_OPTION_UINT64 ? 8 : table[i].kind == RF_OPTION_BOOL ? 1 : 4;
        hash = rf_hash_bytes((const uint8_t *)options + table[i].offset, size, hash);
    }
    return hash;
}
