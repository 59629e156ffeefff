// SPDX-License-Identifier: Apache-2.0
// Windows as plain blocks of numbers: read from a database, or gathered from any picture to make queries.

#include "core/maths.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/windows.h"

#include <string.h>

enum
{
    WINDOWS_AN_ITEM = 256,
    FARTHEST = 1 << 30
};

void rf_windows_read(const RfWindowDatabase *d, int candidate, float *window)
{
    RfWindowRows rows = rf_window_rows(d, candidate);
    size_t row = (size_t)d->side * (size_t)d->channels;
    for (int j = 0; j < d->side; ++j)
        memcpy(window + (size_t)j * row, rows.numbers + j * rows.stride, row * sizeof *window);
}

typedef struct Variations
{
    const RfWindowDatabase *database;
    int channels;
    float *out;
} Variations;

static void vary(void *context, int candidate, int worker)
{
    (void)worker;
    const Variations *v = context;
    const RfWindowDatabase *d = v->database;
    RfWindowRows rows = rf_window_rows(d, candidate);
    double sums[RF_MAX_WINDOW_CHANNELS] = {0}, squares = 0;
    for (int j = 0; j < d->side; ++j)
    {
        const float *row = rows.numbers + j * rows.stride;
        for (int i = 0; i < d->side; ++i)
            for (int c = 0; c < v->channels; ++c)
            {
                double value = (double)row[i * d->channels + c];
                sums[c] += value;
                squares += value * value;
            }
    }
    for (int c = 0; c < v->channels; ++c)
        squares -= sums[c] * sums[c] / (d->side * d->side);
    v->out[candidate] = (float)squares;
}

void rf_windows_vary(const RfWindowDatabase *database, int channels, float *variations)
{
    Variations v = {database, channels, variations};
    rf_parallel_for(database->candidates, vary, &v);
}

typedef struct Gathering
{
    const RfWindowSource *source;
    int side, count;
    bool tiles;
    const int (*corners)[2];
    float *windows, *weights;
} Gathering;

// One row of a window that may stick out, with its weights.
static void gather_row(const Gathering *g, int x, int y, float *row, float *weights)
{
    const RfImageView *image = &g->source->image;
    for (int i = 0; i < g->side; ++i, ++x, row += image->channels)
    {
        bool inside = g->tiles || (x >= 0 && x < image->width && y >= 0 && y < image->height);
        int u = g->tiles ? rf_wrap_int(x, image->width) : x, v = g->tiles ? rf_wrap_int(y, image->height) : y;
        bool known = inside && (!weights || rf_pixel_is_valid(g->source, u, v));
        if (known)
            memcpy(row, image->pixels + v * image->row_stride + (ptrdiff_t)u * image->channels,
                   (size_t)image->channels * sizeof *row);
        else
            memset(row, 0, (size_t)image->channels * sizeof *row);
        if (weights)
            weights[i] = known ? 1 : 0;
    }
}

static void gather_item(void *context, int item, int worker)
{
    (void)worker;
    const Gathering *g = context;
    const RfImageView *image = &g->source->image;
    size_t side = (size_t)g->side, row = side * (size_t)image->channels;
    for (int n = item * WINDOWS_AN_ITEM; n < rf_min_int((item + 1) * WINDOWS_AN_ITEM, g->count); ++n)
    {
        float *window = g->windows + (size_t)n * side * row,
              *weights = g->weights ? g->weights + (size_t)n * side * side : NULL;
        int x = g->corners[n][0], y = g->corners[n][1];
        bool plain = !weights && x >= 0 && y >= 0 && x <= image->width - g->side && y <= image->height - g->side;
        for (size_t j = 0; j < side; ++j)
            if (plain)
                memcpy(window + j * row,
                       image->pixels + (y + (ptrdiff_t)j) * image->row_stride + (ptrdiff_t)x * image->channels,
                       row * sizeof *window);
            else
                gather_row(g, x, y + (int)j, window + j * row, weights ? weights + j * side : NULL);
    }
}

RfResult rf_windows_gather(const RfWindowSource *source, int side, bool tiles, const int (*corners)[2], int count,
                           float *windows, float *weights)
{
    RF_REQUIRE(source && source->image.pixels && count >= 0 && (count == 0 || (corners && windows)),
               "no picture, no corners or no room for windows");
    const RfImageView *image = &source->image;
    RF_REQUIRE(side >= 1 && side <= RF_MAX_WINDOW_SIDE, "windows of side %d: 1 to %d are possible", side,
               RF_MAX_WINDOW_SIDE);
    for (int n = 0; n < count; ++n)
    {
        int x = corners[n][0], y = corners[n][1];
        RF_REQUIRE(x >= -FARTHEST && x <= FARTHEST && y >= -FARTHEST && y <= FARTHEST,
                   "window %d at (%d, %d) is too far out", n, x, y);
        RF_REQUIRE(tiles || weights || (x >= 0 && y >= 0 && x <= image->width - side && y <= image->height - side),
                   "window %d at (%d, %d) sticks out of a picture of %d x %d: ask for weights", n, x, y, image->width,
                   image->height);
    }
    Gathering gathering = {source, side, count, tiles, corners, windows, weights};
    rf_parallel_for((count + WINDOWS_AN_ITEM - 1) / WINDOWS_AN_ITEM, gather_item, &gathering);
    return RF_OK;
}
