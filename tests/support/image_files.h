// SPDX-License-Identifier: Apache-2.0
// Image files in memory, of the kinds that the library reads but does not write: palettes, few bits, interlaced PNG,
// JPEG, tiled EXR. For tests, and as seeds of the fuzzers.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct TestBytes
{
    uint8_t *data;
    size_t size;
} TestBytes;

/// From malloc, as the data of all these.
void test_bytes_free(TestBytes bytes);

/// The integer sample of channel c at (x, y) that every PNG and EXR here has, below `limit`.
unsigned test_sample(int x, int y, int c, unsigned limit);

typedef struct TestPng
{
    int width, height;
    /// PNG_COLOR_TYPE_...: 0 grey, 2 RGB, 3 palette, 4 grey and alpha, 6 RGBA.
    int colour_type, depth;
    bool interlaced;
    /// Palette entry 0 is half transparent; in grey and RGB the sample of (0, 0) is transparent.
    bool transparent;
} TestPng;

/// Palette entry i is (80 i, 255 - 60 i, 20 i) for i = 0 .. 3; samples of a palette image are below 4.
TestBytes test_png(const TestPng *png);

/// 1, 3 or 4 (CMYK) components: a smooth ramp from black at the left to bright at the right.
TestBytes test_jpeg(int width, int height, int components, bool progressive);

typedef struct TestExr
{
    int width, height;
    /// exr_compression_t: 0 none, 1 RLE, 2 ZIPS, 3 ZIP, 4 PIZ, 5 PXR24, 6 B44, 7 B44A, 8 DWAA, 9 DWAB.
    int compression;
    /// exr_pixel_type_t: 0 unsigned, 1 half, 2 float.
    int type;
    /// 0: scanlines; else the side of the tiles.
    int tile;
    /// Of the data window's corner.
    int x, y;
} TestExr;

/// Channels A, B, G, R, each test_sample(x, y, c, 2048) with c = 3, 2, 1, 0.
TestBytes test_exr(const TestExr *exr);
