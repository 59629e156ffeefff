// SPDX-License-Identifier: Apache-2.0
// Small files of every flow format, byte by byte: for tests that need them odd, and as seeds for the fuzzers.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct TestBytes
{
    size_t size;
    uint8_t data[1 << 16];
} TestBytes;

/// Stops the program when the buffer is full.
void test_bytes_add(TestBytes *bytes, const void *data, size_t size);
void test_bytes_text(TestBytes *bytes, const char *format, ...) __attribute__((format(printf, 2, 3)));

/// uv: [height][width][2].
void test_flo(TestBytes *out, int width, int height, const float *uv);

/// descr as "<f4", ">f8", "<f2" (f2 holds small whole numbers and halves only); shape as "3, 4, 2"; numbers in the
/// order of the file.
void test_npy(TestBytes *out, const char *descr, bool fortran, const char *shape, const double *numbers, int count);

typedef struct TestZipEntry
{
    const char *name;
    const TestBytes *content;
} TestZipEntry;

void test_zip(TestBytes *out, const TestZipEntry *entries, int count, bool deflated);

typedef struct TestNcVariable
{
    const char *name;
    int dimension_count, dimensions[4];
    const char *units, *standard_name;
    /// Stored as shorts: value = stored * scale + offset; else as floats.
    bool packed, has_fill;
    double scale, offset, fill;
    /// As stored.
    const double *values;
} TestNcVariable;

/// A classic NetCDF file.
void test_nc(TestBytes *out, const char *const *dimension_names, const int *dimension_sizes, int dimension_count,
             const TestNcVariable *variables, int variable_count);

typedef struct TestVti
{
    /// Of cells, or of points if `points`.
    int width, height, depth;
    double spacing[2];
    const char *name;
    /// Numbers a cell.
    int components;
    const double *values;
    /// "ascii", "binary", "raw" or "base64" (the last two appended)
    const char *coding;
    /// "Float32" or "Float64"
    const char *type;
    bool points, big_endian, wide, compressed;
} TestVti;

void test_vti(TestBytes *out, const TestVti *vti);

/// An Insight .vec of 3 x 2 vectors, 32 pixels apart, y up, the top row first; u = 32, v = 16 everywhere, but the
/// middle vector of the top row is invalid and 999.
void test_vec(TestBytes *out);
