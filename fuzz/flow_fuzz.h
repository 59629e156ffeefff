// SPDX-License-Identifier: Apache-2.0
// What every fuzzer of a flow format does: decode the first and the last moment. Who got the first must get the last
// too, unless a `library` decodes, which looks at a moment's bytes when it is asked for it.
#pragma once

#include "in/flow_format.h"

#include <stdlib.h>

static inline int fuzz_flow(const RfFlowFormat *format, bool library, const uint8_t *bytes, size_t size)
{
    RfFlowReadOptions options = rf_flow_read_defaults();
    RfFlowSource source = {"fuzz", bytes, size, &options};
    RfFlowMoment moment = {0};
    int last = 0;
    if (format->read(&source, 0, &moment) == RF_OK)
    {
        if (moment.moment_count < 1 || !moment.field.velocity || !moment.conventions[0])
            abort();
        last = moment.moment_count - 1;
    }
    rf_flow_moment_free(&moment);
    if (last > 0)
    {
        if (format->read(&source, last, &moment) != RF_OK && (!library || !rf_last_error()->message[0]))
            abort();
        rf_flow_moment_free(&moment);
    }
    return 0;
}

#define RF_FUZZ_FLOW(format, library)                                                                                  \
    int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);                                                     \
    int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)                                                      \
    {                                                                                                                  \
        return fuzz_flow(&format, library, bytes, size);                                                               \
    }
