// SPDX-License-Identifier: Apache-2.0
// Many moments of a flow in one .npy, shape (moments, height, width, 2), one after the other.
#include "core/memory.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "out/npy.h"
#include "riffle/io.h"

#include <stdio.h>

struct RfFlowArray
{
    RfOutFile file;
    int width, height, moments, written;
    /// One row.
    float *row;
};

RfResult rf_flow_array_open(const char *path, int width, int height, int moments, RfFlowArray **out)
{
    RF_REQUIRE(path && out, "rf_flow_array_open: path and out are needed");
    *out = NULL;
    RF_REQUIRE(width >= 1 && width <= RF_MAX_SIZE && height >= 1 && height <= RF_MAX_SIZE && moments >= 1,
               "flow: %d moments of %d x %d cells: each side must be 1 to %d", moments, width, height, RF_MAX_SIZE);
    RfFlowArray *array = rf_allocate_zero(1, sizeof *array);
    float *row = rf_allocate((size_t)width, 2 * sizeof *row);
    RfResult result = array && row ? rf_out_open(path, &array->file) : RF_OUT_OF_MEMORY;
    if (result != RF_OK)
    {
        rf_release(row);
        rf_release(array);
        return result;
    }
    array->width = width;
    array->height = height;
    array->moments = moments;
    array->row = row;
    char shape[64];
    snprintf(shape, sizeof shape, "%d, %d, %d, 2", moments, height, width);
    result = rf_npy_header_write(&array->file, shape);
    if (result == RF_OK)
        *out = array;
    else
        rf_flow_array_close(array, false);
    return result;
}

RfResult rf_flow_array_write(RfFlowArray *array, const RfFlowView *view)
{
    RF_REQUIRE(array && view, "rf_flow_array_write: array and view are needed");
    RF_TRY(rf_flow_view_check(view));
    RF_REQUIRE(view->width == array->width && view->height == array->height && array->written < array->moments,
               "flow: moment %d of %d x %d cells: %d of %d x %d were announced", array->written + 1, view->width,
               view->height, array->moments, array->width, array->height);
    size_t width = (size_t)array->width;
    for (size_t k = 0; k < width * (size_t)array->height; k += width)
    {
        for (size_t x = 0; x < 2 * width; ++x)
            array->row[x] = !view->mask || view->mask[k + x / 2] ? view->velocity[2 * k + x] : 0;
        RF_TRY(rf_out_write(&array->file, array->row, 2 * width * sizeof *array->row));
    }
    ++array->written;
    return RF_OK;
}

RfResult rf_flow_array_close(RfFlowArray *array, bool keep)
{
    if (!array)
        return RF_OK;
    bool whole = array->written == array->moments;
    RfResult result = rf_out_close(&array->file, keep && whole);
    if (result == RF_OK && keep && !whole)
        result = rf_fail(RF_INVALID_ARGUMENT, array->file.path, NULL, "has %d of the %d moments announced",
                         array->written, array->moments);
    rf_release(array->row);
    rf_release(array);
    return result;
}
