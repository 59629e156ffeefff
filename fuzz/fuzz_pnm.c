// SPDX-License-Identifier: Apache-2.0
// Any bytes at all, handed to the PGM and PPM reader.
#include "in/image.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    RfImage *image = NULL;
    if (rf_pnm_reader.decode("fuzz.pnm", data, size, &image) == RF_OK)
        rf_image_destroy(image);
    return 0;
}
