// SPDX-License-Identifier: Apache-2.0
// MD5 (RFC 1321), for comparing the frames of two runs; nothing here needs more than that.
#pragma once

#include <stddef.h>
#include <stdint.h>

typedef struct Md5
{
    uint32_t state[4];
    uint64_t bytes;
    uint8_t tail[64];
} Md5;

void md5_begin(Md5 *md5);
void md5_add(Md5 *md5, const void *data, size_t size);
/// 32 hexadecimal digits and a 0.
void md5_end(Md5 *md5, char text[33]);
