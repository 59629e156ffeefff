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
    case RF_OPTION_INTS: // the first one
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

static int ints_of(const void *options, const RfOption *option, int values[RF_MAX_OPTION_INTS])
{
    int count = 0;
    memcpy(values, (const uint8_t *)options + option->offset, RF_MAX_OPTION_INTS * sizeof *values);
    while (count < RF_MAX_OPTION_INTS && values[count] != 0)
        ++count;
    return count;
}

static RfResult check_ints(const void *options, const RfOption *option)
{
    int values[RF_MAX_OPTION_INTS], count = ints_of(options, option, values);
    RF_REQUIRE(count > 0, "%s: at least one is needed", option->name);
    for (int i = 0; i < count; ++i)
        RF_REQUIRE(values[i] >= option->minimum && values[i] <= option->maximum, "%s %d: must be %g to %g",
                   option->name, values[i], option->minimum, option->maximum);
    return RF_OK;
}

RfResult rf_options_check(const void *options, uint32_t struct_size, size_t size, const char *defaults_name,
                          const RfOption *table, int count)
{
    RF_REQUIRE(struct_size == size, "options: struct_size is %u, not %zu: start from %s()", struct_size, size,
               defaults_name);
    for (int i = 0; i < count; ++i)
    {
        if (table[i].kind == RF_OPTION_INTS)
        {
            RF_TRY(check_ints(options, &table[i]));
            continue;
        }
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
        if (table[i].kind == RF_OPTION_INTS) // what stands behind the end means nothing
        {
            int values[RF_MAX_OPTION_INTS], length = ints_of(options, &table[i], values);
            hash = rf_hash_bytes(values, (size_t)length * sizeof *values, hash ^ (uint64_t)length);
            continue;
        }
        size_t size = table[i].kind == RF_OPTION_UINT64 ? 8 : table[i].kind == RF_OPTION_BOOL ? 1 : 4;
        hash = rf_hash_bytes((const uint8_t *)options + table[i].offset, size, hash);
    }
    return hash;
}
