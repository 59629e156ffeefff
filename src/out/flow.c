// SPDX-License-Identifier: Apache-2.0
// Writers of 2D flows: one table entry a format. Rows go from the top as they are; only .vti, whose y runs up, is
// turned round. Where a format has no mask, cells outside the fluid are written with zero velocity.
#include "core/memory.h"
#include "core/result.h"
#include "data/flow_field.h"
#include "out/file.h"
#include "riffle/io.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

typedef struct RfFlowWriter
{
    const char *extension;
    RfResult (*write)(const char *path, const RfFlowView *view, float fps);
} RfFlowWriter;

static bool in_fluid(const RfFlowView *view, size_t cell)
{
    return !view->mask || view->mask[cell];
}

static void copy_row(const RfFlowView *view, int y, float *out)
{
    size_t width = (size_t)view->width, first = (size_t)y * width;
    for (size_t x = 0; x < width; ++x)
        for (size_t c = 0; c < 2; ++c)
            out[2 * x + c] = in_fluid(view, first + x) ? view->velocity[2 * (first + x) + c] : 0;
}

static void store_u32(uint8_t *p, uint32_t x)
{
    for (int i = 0; i < 4; ++i)
        p[i] = (uint8_t)(x >> 8 * i);
}

static void store_floats(uint8_t *p, const float *numbers, size_t count)
{
    for (size_t k = 0; k < count; ++k)
    {
        uint32_t bits;
        memcpy(&bits, &numbers[k], 4);
        store_u32(p + 4 * k, bits);
    }
}

// ---- .npy and .exr are images of two channels ----------------------------------------------------------------------

static RfResult write_image(const char *path, const RfFlowView *view, float fps)
{
    (void)fps;
    RfImage *image;
    RF_TRY(rf_image_create(view->width, view->height, 2, &image));
    rf_image_set_channel_name(image, 0, "R");
    rf_image_set_channel_name(image, 1, "G");
    rf_image_set_origin(image, RF_SAMPLE_FLOAT, RF_ENCODING_DATA);
    RfImageView pixels = rf_image_view(image);
    for (int y = 0; y < view->height; ++y)
        copy_row(view, y, pixels.pixels + y * pixels.row_stride);
    RfResult result = rf_image_write(path, image);
    rf_image_destroy(image);
    return result;
}

// ---- rows of little-endian floats --------------------------------------------------------------------------------

/// A row as numbers, and the same as bytes.
typedef struct RowBuffer
{
    float *numbers;
    uint8_t *bytes;
} RowBuffer;

static RfResult row_create(size_t count, RowBuffer *out)
{
    out->numbers = rf_allocate(count, sizeof(float));
    out->bytes = rf_allocate(count, sizeof(float));
    return out->numbers && out->bytes ? RF_OK : RF_OUT_OF_MEMORY;
}

static void row_free(RowBuffer *row)
{
    rf_release(row->numbers);
    rf_release(row->bytes);
}

static RfResult row_write(RfOutFile *file, const RowBuffer *row, size_t count)
{
    store_floats(row->bytes, row->numbers, count);
    return rf_out_write(file, row->bytes, count * sizeof(float));
}

typedef RfResult WriteRowsFn(RfOutFile *file, const RfFlowView *view, float fps, RowBuffer *row);

// Opens, lets `write` work with a row of `numbers` a cell, and keeps the file if all went well.
static RfResult write_rows(const char *path, const RfFlowView *view, float fps, size_t numbers, WriteRowsFn *write)
{
    RfOutFile file;
    RowBuffer row = {0};
    RF_TRY(rf_out_open(path, &file));
    RfResult result = row_create((size_t)view->width * numbers, &row);
    if (result == RF_OK)
        result = write(&file, view, fps, &row);
    RfResult closed = rf_out_close(&file, result == RF_OK);
    row_free(&row);
    return result == RF_OK ? closed : result;
}

// ---- .flo --------------------------------------------------------------------------------------------------------

static RfResult flo_rows(RfOutFile *file, const RfFlowView *view, float fps, RowBuffer *row)
{
    (void)fps;
    uint8_t header[12] = "PIEH";
    store_u32(header + 4, (uint32_t)view->width);
    store_u32(header + 8, (uint32_t)view->height);
    RF_TRY(rf_out_write(file, header, sizeof header));
    for (int y = 0; y < view->height; ++y)
    {
        copy_row(view, y, row->numbers);
        RF_TRY(row_write(file, row, 2 * (size_t)view->width));
    }
    return RF_OK;
}

static RfResult write_flo(const char *path, const RfFlowView *view, float fps)
{
    return write_rows(path, view, fps, 2, flo_rows);
}

// ---- .vti --------------------------------------------------------------------------------------------------------
//
// Cell data, appended raw: for each array its size in bytes as 64 bits, then the numbers, the bottom row first.

static RfResult vti_size(RfOutFile *file, uint64_t bytes)
{
    uint8_t word[8];
    store_u32(word, (uint32_t)bytes);
    store_u32(word + 4, (uint32_t)(bytes >> 32));
    return rf_out_write(file, word, sizeof word);
}

static RfResult vti_header(RfOutFile *file, const RfFlowView *view)
{
    char text[1024], mask[160] = "";
    unsigned long long cells = (unsigned long long)view->width * (unsigned long long)view->height;
    if (view->mask)
        snprintf(mask, sizeof mask,
                 "        <DataArray type=\"UInt8\" Name=\"mask\" format=\"appended\" offset=\"%llu\"/>\n",
                 8 + cells * 12);
    int length =
        snprintf(text, sizeof text,
                 "<?xml version=\"1.0\"?>\n"
                 "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
                 "  <ImageData WholeExtent=\"0 %d 0 %d 0 0\" Origin=\"0 0 0\" Spacing=\"1 1 1\">\n"
                 "    <Piece Extent=\"0 %d 0 %d 0 0\">\n"
                 "      <CellData Vectors=\"velocity\">\n"
                 "        <DataArray type=\"Float32\" Name=\"velocity\" NumberOfComponents=\"3\" format=\"appended\" "
                 "offset=\"0\"/>\n"
                 "%s"
                 "      </CellData>\n"
                 "    </Piece>\n"
                 "  </ImageData>\n"
                 "  <AppendedData encoding=\"raw\">\n"
                 "   _",
                 view->width, view->height, view->width, view->height, mask);
    assert(length > 0 && (size_t)length < sizeof text);
    return rf_out_write(file, text, (size_t)length);
}

static RfResult vti_velocity(RfOutFile *file, const RfFlowView *view, float fps, RowBuffer *row)
{
    size_t width = (size_t)view->width;
    RF_TRY(vti_size(file, (uint64_t)width * (uint64_t)view->height * 12));
    for (int y = view->height - 1; y >= 0; --y)
    {
        const float *velocity = view->velocity + 2 * (size_t)y * width;
        for (size_t x = 0; x < width; ++x)
        {
            row->numbers[3 * x] = velocity[2 * x] * fps;
            row->numbers[3 * x + 1] = -velocity[2 * x + 1] * fps;
            row->numbers[3 * x + 2] = 0;
        }
        RF_TRY(row_write(file, row, 3 * width));
    }
    return RF_OK;
}

static RfResult vti_mask(RfOutFile *file, const RfFlowView *view, RowBuffer *row)
{
    size_t width = (size_t)view->width;
    RF_TRY(vti_size(file, (uint64_t)width * (uint64_t)view->height));
    for (int y = view->height - 1; y >= 0; --y)
    {
        for (size_t x = 0; x < width; ++x)
            row->bytes[x] = view->mask[(size_t)y * width + x] != 0;
        RF_TRY(rf_out_write(file, row->bytes, width));
    }
    return RF_OK;
}

static RfResult vti_rows(RfOutFile *file, const RfFlowView *view, float fps, RowBuffer *row)
{
    static const char end[] = "\n  </AppendedData>\n</VTKFile>\n";
    RF_TRY(vti_header(file, view));
    RF_TRY(vti_velocity(file, view, fps, row));
    if (view->mask)
        RF_TRY(vti_mask(file, view, row));
    return rf_out_write(file, end, sizeof end - 1);
}

static RfResult write_vti(const char *path, const RfFlowView *view, float fps)
{
    return write_rows(path, view, fps, 3, vti_rows);
}

// ---- the table ---------------------------------------------------------------------------------------------------

static const RfFlowWriter writers[] = {
    {"flo", write_flo}, {"npy", write_image}, {"exr", write_image}, {"vti", write_vti}};

RfResult rf_flow_write(const char *path, const RfFlowView *view, float fps)
{
    RF_REQUIRE(path && view, "rf_flow_write: path and view are needed");
    RF_REQUIRE(fps > 0 && isfinite(fps), "fps %g: must be greater than 0", (double)fps);
    RF_TRY(rf_flow_view_check(view));
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < sizeof writers / sizeof writers[0]; ++i)
        if (strcasecmp(dot + 1, writers[i].extension) == 0)
            return writers[i].write(path, view, fps);
    return rf_fail(RF_UNSUPPORTED, path, NULL, "a 2D flow is written as .flo, .npy, .exr or .vti: name the file so");
}
