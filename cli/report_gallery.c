// SPDX-License-Identifier: Apache-2.0
#include "report_gallery.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum
{
    /// Pictures of a page are made smaller, by a whole factor, until their longer side is no more than this.
    MAX_SIDE = 512,
    USE_CELLS = RF_MEASURE_USE_CELLS
};

static const WorstShot g_worst[GALLERY_WORST] = {
    {.quantity = "flow-error",
     .floor = "flow-floor",
     .map = RF_MEASURE_MAP_FLOW_ERROR,
     .title = "Flow error",
     .unit = "px",
     .sentence = "Distance between the motion seen in the frames and the flow's."},
    {.quantity = "flicker-block",
     .floor = "flicker-block-floor",
     .map = RF_MEASURE_MAP_BLOCKS,
     .title = "Flicker",
     .unit = "of the contrast",
     .sentence = "Change against the frame before, carried by the flow, in blocks of 32 x 32 pixels."},
    {.quantity = "patch",
     .floor = "patch-floor",
     .map = RF_MEASURE_MAP_PATCH,
     .title = "Patch residual",
     .unit = "grey levels",
     .sentence = "Difference from the most similar window of the exemplar."},
};

void gallery_begin(Gallery *gallery)
{
    *gallery = (Gallery){.wanted = true, .spectrum_distance = -1};
    memcpy(gallery->worst, g_worst, sizeof g_worst);
    for (int i = 0; i < GALLERY_WORST; ++i)
        gallery->worst[i].value = -1;
}

void gallery_free(Gallery *gallery)
{
    rf_image_destroy(gallery->exemplar);
    for (int i = 0; i < GALLERY_SHOTS; ++i)
        rf_image_destroy(gallery->shots[i].image);
    for (int i = 0; i < GALLERY_WORST; ++i)
    {
        rf_image_destroy(gallery->worst[i].shot.image);
        rf_image_destroy(gallery->worst[i].error);
    }
    *gallery = (Gallery){0};
}

/// Mean over the pixels that pixel (x, y) of the smaller picture stands for, those left out that are NaN.
static float mean_of_box(const RfImageView *from, int factor, int x, int y, int channel)
{
    double sum = 0;
    int count = 0;
    for (int j = y * factor; j < (y + 1) * factor && j < from->height; ++j)
        for (int i = x * factor; i < (x + 1) * factor && i < from->width; ++i)
        {
            double value = (double)from->pixels[j * from->row_stride + (ptrdiff_t)i * from->channels + channel];
            if (isnan(value))
                continue;
            sum += value;
            ++count;
        }
    return count ? (float)(sum / count) : NAN;
}

static int factor_of(const RfImageView *view)
{
    int longer = view->width > view->height ? view->width : view->height;
    return (longer + MAX_SIDE - 1) / MAX_SIDE;
}

/// A smaller copy.
static RfResult shrink(const RfImageView *from, int factor, RfImage **out)
{
    RfResult result =
        rf_image_create((from->width + factor - 1) / factor, (from->height + factor - 1) / factor, from->channels, out);
    if (result != RF_OK)
        return result;
    rf_image_set_origin(*out, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImageView to = rf_image_view(*out);
    for (int y = 0; y < to.height; ++y)
        for (int x = 0; x < to.width; ++x)
            for (int c = 0; c < to.channels; ++c)
                to.pixels[y * to.row_stride + (ptrdiff_t)x * to.channels + c] = mean_of_box(from, factor, x, y, c);
    return RF_OK;
}

static RfResult take_shot(Shot *shot, int number, const RfImage *frame)
{
    rf_image_destroy(shot->image);
    *shot = (Shot){.number = number};
    RfImageView view = rf_image_view(frame);
    return shrink(&view, factor_of(&view), &shot->image);
}

RfResult gallery_take_exemplar(Gallery *gallery, const RfImage *exemplar, const RfImageView *frame)
{
    RfImageView view = rf_image_view(exemplar);
    int own = factor_of(&view), frames = factor_of(frame);
    return shrink(&view, own > frames ? own : frames, &gallery->exemplar);
}

static double value_named(const RfMeasureFrame *values, const char *name)
{
    int count = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    double value = (double)NAN;
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
            memcpy(&value, (const char *)values + table[i].offset, sizeof value);
    return value;
}

static RfResult take_worst(WorstShot *worst, const RfMeasure *measure, const RfMeasureFrame *values, int number,
                           const RfImage *frame)
{
    double value = value_named(values, worst->quantity);
    // Written so that NaN is never the worst.
    if (!(value > worst->value) || !rf_measure_has_map(measure, worst->map))
        return RF_OK;
    RfImage *map = NULL;
    RfImageView size = rf_image_view(frame);
    RfResult result = take_shot(&worst->shot, number, frame);
    if (result == RF_OK)
        result = rf_image_create(size.width, size.height, 1, &map);
    if (result != RF_OK)
        return result;
    RfImageView view = rf_image_view(map);
    result = rf_measure_map(measure, worst->map, &view);
    rf_image_destroy(worst->error);
    worst->error = NULL;
    if (result == RF_OK)
        result = shrink(&view, factor_of(&view), &worst->error);
    rf_image_destroy(map);
    worst->value = value;
    worst->floor_value = value_named(values, worst->floor);
    return result;
}

static void take_spectra(Gallery *gallery, const RfMeasure *measure, const RfMeasureFrame *values, int number)
{
    if (!(values->spectrum.distance > gallery->spectrum_distance))
        return;
    gallery->spectrum_distance = values->spectrum.distance;
    gallery->spectrum_number = number;
    rf_measure_spectra(measure, &gallery->spectra);
}

static void take_use(Gallery *gallery, const RfMeasure *measure)
{
    if (!rf_measure_has_map(measure, RF_MEASURE_MAP_SOURCE))
        return;
    int64_t counts[USE_CELLS * USE_CELLS];
    rf_measure_use(measure, counts);
    for (int i = 0; i < USE_CELLS * USE_CELLS; ++i)
        gallery->use[i] += counts[i];
    gallery->used = true;
}

RfResult gallery_take(Gallery *gallery, const RfMeasure *measure, const RfMeasureFrame *values, int index, int count,
                      int number, const RfImage *frame)
{
    const int shots[GALLERY_SHOTS] = {0, count / 2, count - 1};
    RfResult result = RF_OK;
    for (int i = 0; i < GALLERY_SHOTS && result == RF_OK; ++i)
        if (index == shots[i] && (i == 0 || shots[i] != shots[i - 1]))
            result = take_shot(&gallery->shots[i], number, frame);
    for (int i = 0; i < GALLERY_WORST && result == RF_OK; ++i)
        result = take_worst(&gallery->worst[i], measure, values, number, frame);
    take_spectra(gallery, measure, values, number);
    take_use(gallery, measure);
    return result;
}

// ---- colours of errors -------------------------------------------------------------------------------------------

void gallery_colour(double part, float rgb[3])
{
    // Lightness rises evenly, so that it reads in grey too; hue goes from blue over red to yellow.
    static const float stops[][3] = {{0.05f, 0.06f, 0.16f}, {0.24f, 0.14f, 0.44f}, {0.57f, 0.17f, 0.48f},
                                     {0.85f, 0.31f, 0.34f}, {0.97f, 0.58f, 0.27f}, {0.99f, 0.94f, 0.70f}};
    const int last = sizeof stops / sizeof stops[0] - 1;
    double at = fmin(fmax(part, 0), 1) * last;
    int i = at < last ? (int)at : last - 1;
    float t = (float)(at - i);
    for (int c = 0; c < 3; ++c)
        rgb[c] = stops[i][c] + t * (stops[i + 1][c] - stops[i][c]);
}

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double round_up(double value)
{
    static const double steps[] = {1, 1.5, 2, 3, 4, 5, 6, 8, 10};
    if (!(value > 0))
        return 1;
    double decade = pow(10, floor(log10(value)));
    for (size_t i = 0; i < sizeof steps / sizeof steps[0]; ++i)
        if (value <= steps[i] * decade * (1 + 1e-9))
            return steps[i] * decade;
    return 10 * decade;
}

double gallery_full_scale(const RfImage *error)
{
    // Outliers would leave all else dark.
    const double kept = 0.995;
    RfImageView view = rf_image_view(error);
    size_t total = (size_t)view.width * (size_t)view.height, count = 0;
    float *values = malloc(total * sizeof *values);
    for (size_t k = 0; k < total && values; ++k)
        if (isfinite(view.pixels[k]))
            values[count++] = view.pixels[k];
    double full = 0;
    if (count > 0)
    {
        qsort(values, count, sizeof *values, compare_floats);
        full = (double)values[(size_t)(kept * (double)(count - 1))];
    }
    free(values);
    return round_up(full);
}

RfResult gallery_paint(const RfImage *error, double full, RfImage **out)
{
    RfImageView from = rf_image_view(error);
    RfResult result = rf_image_create(from.width, from.height, 4, out);
    if (result != RF_OK)
        return result;
    rf_image_set_origin(*out, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImageView to = rf_image_view(*out);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
        {
            float value = from.pixels[y * from.row_stride + x];
            float *pixel = to.pixels + y * to.row_stride + (ptrdiff_t)x * 4;
            if (isnan(value))
                continue;
            gallery_colour((double)value / full, pixel);
            pixel[3] = 1;
        }
    return RF_OK;
}

static float luma(const float *pixel, int channels)
{
    return channels < 3 ? pixel[0] : 0.2126f * pixel[0] + 0.7152f * pixel[1] + 0.0722f * pixel[2];
}

RfResult gallery_paint_use(const Gallery *gallery, double *full, RfImage **out)
{
    RfImageView from = rf_image_view(gallery->exemplar);
    int64_t sum = 0, most = 0;
    for (int i = 0; i < USE_CELLS * USE_CELLS; ++i)
    {
        sum += gallery->use[i];
        most = gallery->use[i] > most ? gallery->use[i] : most;
    }
    *full = sum > 0 ? round_up((double)most * USE_CELLS * USE_CELLS / (double)sum) : 1;
    double scale = sum > 0 ? USE_CELLS * USE_CELLS / (double)sum / *full : 0;
    RfResult result = rf_image_create(from.width, from.height, 3, out);
    if (result != RF_OK)
        return result;
    rf_image_set_origin(*out, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImageView to = rf_image_view(*out);
    for (int y = 0; y < from.height; ++y)
        for (int x = 0; x < from.width; ++x)
        {
            int cell = y * USE_CELLS / from.height * USE_CELLS + x * USE_CELLS / from.width;
            float grey = luma(from.pixels + y * from.row_stride + (ptrdiff_t)x * from.channels, from.channels);
            float *pixel = to.pixels + y * to.row_stride + (ptrdiff_t)x * 3;
            gallery_colour((double)gallery->use[cell] * scale, pixel);
            // The texture shows through without changing the colour's reading much.
            for (int c = 0; c < 3; ++c)
                pixel[c] = 0.75f * pixel[c] + 0.25f * grey;
        }
    return RF_OK;
}
