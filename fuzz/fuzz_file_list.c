// SPDX-License-Identifier: Apache-2.0
// The first byte chooses between .pvd and .series.
#include "in/file_list.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t size)
{
    RfFileList list;
    if (size == 0)
        return 0;
    if (rf_file_list_parse(bytes[0] & 1 ? "dir/fuzz.pvd" : "dir/fuzz.series", bytes + 1, size - 1, &list) == RF_OK)
        rf_file_list_free(&list);
    return 0;
}
