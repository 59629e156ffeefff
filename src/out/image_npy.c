// SPDX-License-Identifier: Apache-2.0
// NPY 1.0: float32, little endian, C order, shape (height, width, channels).
#include "out/image.h"
#include "out/npy.h"

#include "core/result.h"

#include <stdio.h>

static RfResult encode_npy(RfOutFile *file, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    char shape[64];
    snprintf(shape, sizeof shape, "%d, %d, %d", view.height, view.width, view.channels);
    RF_TRY(rf_npy_header_write(file, shape));
    size_t row = (size_t)view.width * (size_t)view.channels * sizeof(float);
    for (int y = 0; y < view.height; ++y)
        RF_TRY(rf_out_write(file, view.pixels + (ptrdiff_t)y * view.row_stride, row));
    return RF_OK;
}

const RfImageWriter rf_npy_writer = {"npy", encode_npy};
