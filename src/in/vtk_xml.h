// SPDX-License-Identifier: Apache-2.0
// VTK XML image data (.vti): what stands in the file, and one array of it as doubles.
#pragma once

#include "in/samples.h"
#include "riffle/base.h"

enum
{
    RF_VTK_MAX_ARRAYS = 64,
    RF_VTK_NAME = 64
};

typedef enum RfVtkPlace
{
    RF_VTK_NOWHERE,
    RF_VTK_POINTS,
    RF_VTK_CELLS
} RfVtkPlace;

typedef enum RfVtkCoding
{
    RF_VTK_ASCII,
    RF_VTK_BASE64,
    RF_VTK_APPENDED
} RfVtkCoding;

typedef struct RfVtkArray
{
    char name[RF_VTK_NAME];
    RfVtkPlace place;
    RfVtkCoding coding;
    RfNumberKind kind;
    int components;
    /// Inline: where its text stands in the file. Appended: `begin` is the offset behind the underscore.
    size_t begin, end;
} RfVtkArray;

typedef struct RfVtkImage
{
    const char *path;
    const uint8_t *bytes;
    size_t size;
    /// First and last point along x, y, z.
    int64_t extent[6];
    double origin[3], spacing[3];
    bool big_endian, wide_headers, compressed, appended_base64;
    /// Behind the underscore of AppendedData; 0 without.
    size_t appended;
    int array_count;
    RfVtkArray arrays[RF_VTK_MAX_ARRAYS];
} RfVtkImage;

/// `bytes` must outlive *out.
RfResult rf_vtk_image_parse(const char *path, const uint8_t *bytes, size_t size, RfVtkImage *out);

/// Points or cells along an axis: a flat axis has one layer of cells.
int64_t rf_vtk_image_count(const RfVtkImage *image, RfVtkPlace place, int axis);

/// NULL if there is no such array; names are compared without case.
const RfVtkArray *rf_vtk_image_find(const RfVtkImage *image, const char *name, int least_components,
                                    int most_components);

/// The array's `count` numbers (tuples times components) in a block for rf_release. `count` has been checked against
/// limits by the caller; whether the file can hold so many is checked here before memory is asked for.
RfResult rf_vtk_array_read(const RfVtkImage *image, const RfVtkArray *array, size_t count, float **out);
