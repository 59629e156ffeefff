// SPDX-License-Identifier: Apache-2.0
#include "out/npy.h"

#include "core/result.h"

#include <stdio.h>
#include <string.h>

enum
{
    // Of magic, version, length and dictionary together; a multiple of 64, so that the data is aligned.
    HEADER_SIZE = 128,
    PREFIX_SIZE = 10
};

RfResult rf_npy_header_write(RfOutFile *file, const char *shape)
{
    char header[HEADER_SIZE], dictionary[HEADER_SIZE - PREFIX_SIZE];
    memset(header, ' ', sizeof header);
    memcpy(header, "\x93NUMPY\x01\x00", 8);
    header[8] = HEADER_SIZE - PREFIX_SIZE;
    header[9] = 0;
    int length =
        snprintf(dictionary, sizeof dictionary, "{'descr': '<f4', 'fortran_order': False, 'shape': (%s), }", shape);
    assert(length > 0 && length < (int)sizeof dictionary);
    memcpy(header + PREFIX_SIZE, dictionary, (size_t)length);
    header[HEADER_SIZE - 1] = '\n';
    return rf_out_write(file, header, HEADER_SIZE);
}
