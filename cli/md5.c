// SPDX-License-Identifier: Apache-2.0
#include "md5.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static uint32_t rotate(uint32_t x, int bits)
{
    return (x << bits) | (x >> (32 - bits));
}

/// floor(2^32 |sin(i + 1)|), as the standard defines its constants.
static const uint32_t *sines(void)
{
    static _Thread_local uint32_t table[64];
    if (table[0] == 0)
        for (int i = 0; i < 64; ++i)
            table[i] = (uint32_t)floor(fabs(sin(i + 1.0)) * 4294967296.0);
    return table;
}

static void add_block(uint32_t state[4], const uint8_t *bytes)
{
    static const int shifts[4][4] = {{7, 12, 17, 22}, {5, 9, 14, 20}, {4, 11, 16, 23}, {6, 10, 15, 21}};
    const uint32_t *table = sines();
    uint32_t words[16];
    for (int i = 0; i < 16; ++i)
        words[i] = (uint32_t)bytes[4 * i] | (uint32_t)bytes[4 * i + 1] << 8 | (uint32_t)bytes[4 * i + 2] << 16 |
                   (uint32_t)bytes[4 * i + 3] << 24;
    uint32_t a = state[0], b = state[1], c = state[2], d = state[3];
    for (int i = 0; i < 64; ++i)
    {
        int round = i / 16;
        uint32_t mixed = round == 0   ? (b & c) | (~b & d)
                         : round == 1 ? (d & b) | (~d & c)
                         : round == 2 ? b ^ c ^ d
                                      : c ^ (b | ~d);
        int word = round == 0 ? i : round == 1 ? 5 * i + 1 : round == 2 ? 3 * i + 5 : 7 * i;
        uint32_t next = b + rotate(a + mixed + table[i] + words[word % 16], shifts[round][i % 4]);
        a = d;
        d = c;
        c = b;
        b = next;
    }
    state[0] += a;
    state[1] += b;
    state[2] += c;
    state[3] += d;
}

void md5_begin(Md5 *md5)
{
    *md5 = (Md5){.state = {0x67452301u, 0xefcdab89u, 0x98badcfeu, 0x10325476u}};
}

void md5_add(Md5 *md5, const void *data, size_t size)
{
    const uint8_t *bytes = data;
    size_t held = md5->bytes % 64;
    md5->bytes += size;
    if (held > 0)
    {
        size_t part = size < 64 - held ? size : 64 - held;
        memcpy(md5->tail + held, bytes, part);
        bytes += part;
        size -= part;
        if (held + part < 64)
            return;
        add_block(md5->state, md5->tail);
    }
    for (; size >= 64; bytes += 64, size -= 64)
        add_block(md5->state, bytes);
    if (size > 0)
        memcpy(md5->tail, bytes, size);
}

void md5_end(Md5 *md5, char text[33])
{
    static const uint8_t padding[64] = {0x80};
    uint64_t bits = md5->bytes * 8;
    size_t held = md5->bytes % 64;
    md5_add(md5, padding, held < 56 ? 56 - held : 120 - held);
    uint8_t length[8];
    for (int i = 0; i < 8; ++i)
        length[i] = (uint8_t)(bits >> (8 * i));
    md5_add(md5, length, 8);
    for (int i = 0; i < 16; ++i)
        snprintf(text + 2 * i, 3, "%02x", (md5->state[i / 4] >> (8 * (i % 4))) & 255);
}
