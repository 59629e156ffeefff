// SPDX-License-Identifier: Apache-2.0
// NPY 1.0: float32, little endian, C order, shape (height, width, channels).
#include "out/image.h"

#include "core/result.h"

#include <stdio.h>
#include <string.h>

enum
{
    // Of magic, version, length and dictionary together; a multiple of 64, so that the data is aligned.
    HEADER_SIZE = 128,
    PREFIX_SIZE = 10
};

static RfResult encode_npy(RfOutFile *file, const RfImage *image)
{
    RfImageView view = rf_image_view(image);
    char header[HEADER_SIZE];
    memset(header, ' ', sizeof header);
    memcpy(header, "\x93NUMPY\x01\x00", 8);
    header[8] = HEADER_SIZE - PREFIX_SIZE;
    header[9] = 0;
    char dictionary[HEADER_SIZE - PREFIX_SIZE];
    int length =
        snprintf(dictionary, sizeof dictionary, "{'descr': '<f4', 'fortran_order': False, 'shape': (%d, %d, %d), }",
                 view.height, view.width, view.channels);
    assert(length > 0 && length < (int)sizeof dictionary);
    memcpy(header + PREFIX_SIZE, dictionary, (size_t)length);
    header[HEADER_SIZE - 1] = '\n';
    RF_TRY(rf_out_write(file, header, HEADER_SIZE));
    size_t row = (size_t)view.width * (size_t)view.channels * sizeof(float);
    for (int y = 0; y < view.height; ++y)
        RF_TRY(rf_out_write(file, view.pixels + (ptrdiff_t)y * view.row_stride, row));
    return RF_OK;
}

const RfImageWriter rf_npy_writer = {"npy", encode_npy};
