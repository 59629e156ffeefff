// SPDX-License-Identifier: Apache-2.0
// Lays pictures out on one sheet, to be looked at side by side:
//
//     contact_sheet SHEET.png [--columns N] [--cell PIXELS] PICTURE...
//
// All pictures are shrunk by one factor (never enlarged), so that an exemplar and the frames made from it are seen at
// the same scale; the widest becomes --cell pixels wide. "-" leaves a cell empty.
#include <riffle/riffle.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MARGIN 6
#define BACKGROUND 0.11f

typedef struct Sheet
{
    const char *output;
    int columns, cell;
    int count;
    /// One a picture; NULL where the cell stays empty.
    RfImage **pictures;
} Sheet;

static int complain(void)
{
    const RfError *error = rf_last_error();
    fprintf(stderr, "contact_sheet: %s%s%s%s%s\n", error->file, *error->file ? ": " : "", error->place,
            *error->place ? ": " : "", error->message);
    return 3;
}

static int usage(void)
{
    fprintf(stderr, "usage: contact_sheet SHEET.png [--columns N] [--cell PIXELS] PICTURE...\n");
    return 2;
}

/// The colour of a pixel over the background, grey spread over all three channels.
static void colour_of(const RfImage *picture, const float *pixel, float colour[3])
{
    int channels = rf_image_view(picture).channels;
    bool has_alpha = rf_image_has_alpha(picture);
    float alpha = has_alpha ? pixel[channels - 1] : 1;
    bool grey = channels - has_alpha < 3;
    for (int c = 0; c < 3; ++c)
        colour[c] = alpha * pixel[grey ? 0 : c] + (1 - alpha) * BACKGROUND;
}

/// Mean of the picture over [x0, x1) x [y0, y1), which may cut pixels.
static void area_mean(const RfImage *picture, double x0, double x1, double y0, double y1, float mean[3])
{
    RfImageView view = rf_image_view(picture);
    double sum[3] = {0}, total = 0;
    for (int y = (int)y0; y < view.height && y < y1; ++y)
    {
        double height = fmin(y1, y + 1) - fmax(y0, y);
        for (int x = (int)x0; x < view.width && x < x1; ++x)
        {
            double area = height * (fmin(x1, x + 1) - fmax(x0, x));
            float colour[3];
            colour_of(picture, view.pixels + y * view.row_stride + (ptrdiff_t)x * view.channels, colour);
            for (int c = 0; c < 3; ++c)
                sum[c] += area * colour[c];
            total += area;
        }
    }
    for (int c = 0; c < 3; ++c)
        mean[c] = total > 0 ? (float)(sum[c] / total) : BACKGROUND;
}

static int shrunk(int pixels, double step)
{
    int size = (int)(pixels / step + 0.5);
    return size > 0 ? size : 1;
}

/// Draws a picture with its top left corner at (left, top); `step` is the width of a pixel of the sheet in it.
static void draw(const RfImage *picture, RfImageView sheet, int left, int top, double step)
{
    RfImageView view = rf_image_view(picture);
    int width = shrunk(view.width, step), height = shrunk(view.height, step);
    for (int y = 0; y < height; ++y)
    {
        float *row = sheet.pixels + (top + y) * sheet.row_stride + (ptrdiff_t)left * 3;
        for (int x = 0; x < width; ++x)
            area_mean(picture, x * step, (x + 1) * step, y * step, (y + 1) * step, row + (ptrdiff_t)x * 3);
    }
}

static double common_step(const Sheet *sheet)
{
    int widest = sheet->cell;
    for (int i = 0; i < sheet->count; ++i)
        if (sheet->pictures[i] && rf_image_view(sheet->pictures[i]).width > widest)
            widest = rf_image_view(sheet->pictures[i]).width;
    return (double)widest / sheet->cell;
}

/// The widest picture of a column, or the highest of a row.
static int extent(const Sheet *sheet, bool of_column, int index, double step)
{
    int most = 1;
    for (int i = 0; i < sheet->count; ++i)
    {
        if (!sheet->pictures[i] || (of_column ? i % sheet->columns : i / sheet->columns) != index)
            continue;
        RfImageView view = rf_image_view(sheet->pictures[i]);
        int own = shrunk(of_column ? view.width : view.height, step);
        most = own > most ? own : most;
    }
    return most;
}

/// Where column or row `index` begins; for the number of them, where the sheet ends.
static int start(const Sheet *sheet, bool of_column, int index, double step)
{
    int at = MARGIN;
    for (int i = 0; i < index; ++i)
        at += extent(sheet, of_column, i, step) + MARGIN;
    return at;
}

static RfResult lay_out(const Sheet *sheet)
{
    double step = common_step(sheet);
    int columns = sheet->columns < sheet->count ? sheet->columns : sheet->count;
    int rows = (sheet->count + columns - 1) / columns;
    RfImage *image = NULL;
    RfResult result = rf_image_create(start(sheet, true, columns, step), start(sheet, false, rows, step), 3, &image);
    if (result != RF_OK)
        return result;
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImageView view = rf_image_view(image);
    for (int y = 0; y < view.height; ++y)
        for (int x = 0; x < view.width * 3; ++x)
            view.pixels[y * view.row_stride + x] = BACKGROUND;

    for (int i = 0; i < sheet->count; ++i)
        if (sheet->pictures[i])
            draw(sheet->pictures[i], view, start(sheet, true, i % sheet->columns, step),
                 start(sheet, false, i / sheet->columns, step), step);
    result = rf_image_write(sheet->output, image);
    rf_image_destroy(image);
    return result;
}

static int read_pictures(Sheet *sheet, char **names)
{
    for (int i = 0; i < sheet->count; ++i)
    {
        if (strcmp(names[i], "-") == 0)
            continue;
        if (rf_image_read(names[i], &sheet->pictures[i]) != RF_OK)
            return complain();
        rf_image_convert(sheet->pictures[i], RF_ENCODING_SRGB);
    }
    return 0;
}

int main(int argc, char **argv)
{
    Sheet sheet = {.columns = 4, .cell = 320};
    int first = 2;
    for (; first + 1 < argc && strncmp(argv[first], "--", 2) == 0; first += 2)
    {
        int *number = strcmp(argv[first], "--columns") == 0 ? &sheet.columns
                      : strcmp(argv[first], "--cell") == 0  ? &sheet.cell
                                                            : NULL;
        if (!number)
            return usage();
        *number = atoi(argv[first + 1]);
    }
    sheet.count = argc - first;
    if (sheet.count < 1 || sheet.columns < 1 || sheet.columns > 100 || sheet.cell < 8 || sheet.cell > 4096)
        return usage();
    sheet.output = argv[1];
    sheet.pictures = calloc((size_t)sheet.count, sizeof *sheet.pictures);
    int status = sheet.pictures ? read_pictures(&sheet, argv + first) : 1;
    if (status == 0 && lay_out(&sheet) != RF_OK)
        status = complain();
    for (int i = 0; sheet.pictures && i < sheet.count; ++i)
        rf_image_destroy(sheet.pictures[i]);
    free(sheet.pictures);
    return status;
}
