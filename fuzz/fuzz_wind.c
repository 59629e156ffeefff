// SPDX-License-Identifier: Apache-2.0
// The JSON beside a PNG; the PNG has its own fuzzer.
#include "in/json.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    static const char *const keys[] = {"uMin", "uMax", "vMin", "vMax"};
    for (int i = 0; i < 4; ++i)
    {
        double number;
        if (rf_json_number("fuzz", bytes, size, keys[i], &number) != RF_OK)
            return 0;
    }
    return 0;
}
