// SPDX-License-Identifier: Apache-2.0
// The database: pictures are copied into a pool, with their margins where windows wrap, so that every window is some
// rows at a stride and none is stored. What is stored of a window is its place, its centre and its kept numbers.

#include "kernels/windows.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/result.h"

#include <string.h>

enum
{
    MAX_NUMBERS = 1 << 14,
    POOL_MARGIN = 16
};

RfWindowRows rf_window_rows(const RfWindowDatabase *d, int candidate)
{
    RfWindowPlace p = d->places[candidate];
    const RfWindowCopy *copy = &d->copy[p.copy];
    return (RfWindowRows){d->pixels + copy->pixels + p.y * copy->stride + (ptrdiff_t)p.x * d->channels, copy->stride};
}

// ---- pictures and places -----------------------------------------------------------------------------------------

static RfResult check_sources(const RfWindowSource *sources, int count, const RfWindowOptions *options)
{
    RF_REQUIRE(sources && options && count >= 1 && count <= RF_MAX_WINDOW_COPIES, "%d pictures: 1 to %d are possible",
               count, RF_MAX_WINDOW_COPIES);
    int side = options->side, channels = sources[0].image.channels;
    RF_REQUIRE(side >= 1 && side <= RF_MAX_WINDOW_SIDE, "windows of side %d: 1 to %d are possible", side,
               RF_MAX_WINDOW_SIDE);
    RF_REQUIRE(channels >= 1 && channels <= RF_MAX_WINDOW_CHANNELS && side * side * channels <= MAX_NUMBERS,
               "windows of %d x %d x %d numbers: at most %d channels and %d numbers are possible", side, side, channels,
               RF_MAX_WINDOW_CHANNELS, MAX_NUMBERS);
    RF_REQUIRE(options->components >= 0 && options->components <= RF_MAX_WINDOW_COMPONENTS,
               "%d principal components: at most %d are possible", options->components, RF_MAX_WINDOW_COMPONENTS);
    for (int k = 0; options->channel_weights && k < channels; ++k)
        RF_REQUIRE(options->channel_weights[k] >= 0 && options->channel_weights[k] <= RF_WINDOW_LARGEST_WEIGHT,
                   "weight %g of channel %d is not in 0 to %g", (double)options->channel_weights[k], k,
                   (double)RF_WINDOW_LARGEST_WEIGHT);
    for (int s = 0; s < count; ++s)
    {
        const RfImageView *image = &sources[s].image;
        RF_REQUIRE(image->pixels && image->channels == channels && image->width >= 1 && image->height >= 1 &&
                       image->width <= RF_MAX_SIZE && image->height <= RF_MAX_SIZE &&
                       image->row_stride >= (ptrdiff_t)image->width * channels,
                   "picture %d is not 1 to %d pixels wide and high, in %d channels", s, RF_MAX_SIZE, channels);
    }
    return RF_OK;
}

static int padded(const RfWindowDatabase *d, int size)
{
    return d->wraps ? size + d->side - 1 : size;
}

static RfResult lay_out_copies(RfWindowDatabase *d, const RfWindowSource *sources)
{
    static const float same_place[6] = {1, 0, 0, 0, 1, 0};
    size_t pixels = 0, rows = 0;
    for (int s = 0; s < d->copies; ++s)
    {
        int width = padded(d, sources[s].image.width), height = padded(d, sources[s].image.height);
        int places_x = rf_max_int(width - d->side + 1, 0), places_y = rf_max_int(height - d->side + 1, 0);
        bool any = places_x > 0 && places_y > 0;
        d->copy[s] = (RfWindowCopy){.places_x = any ? places_x : 0,
                                    .places_y = any ? places_y : 0,
                                    .stride = (ptrdiff_t)width * d->channels,
                                    .pixels = pixels,
                                    .rows = rows};
        const float *map = sources[s].to_exemplar ? sources[s].to_exemplar : same_place;
        memcpy(d->copy[s].to_exemplar, map, sizeof same_place);
        // At most 2^12 copies of 2^32 pixels in 2^4 channels.
        pixels += (size_t)width * (size_t)height * (size_t)d->channels;
        rows += (size_t)d->copy[s].places_y;
    }
    d->pixels = rf_allocate_zero(pixels + POOL_MARGIN, sizeof *d->pixels);
    d->row_starts = rf_allocate_zero(rows + 1, sizeof *d->row_starts);
    return d->pixels && d->row_starts ? RF_OK : RF_OUT_OF_MEMORY;
}

bool rf_pixel_is_valid(const RfWindowSource *source, int x, int y)
{
    const RfImageView *image = &source->image;
    if (source->valid && !source->valid[(size_t)y * (size_t)image->width + (size_t)x])
        return false;
    const float *pixel = image->pixels + y * image->row_stride + (ptrdiff_t)x * image->channels;
    bool valid = true;
    for (int k = 0; k < image->channels; ++k)
        valid &= fabsf(pixel[k]) <= RF_WINDOW_LARGEST;
    return valid;
}

// Copies row y of the padded picture; missing[x] counts the pixels that are not valid, up or down.
static void copy_row(const RfWindowDatabase *d, const RfWindowSource *source, int y, float *out)
{
    const RfImageView *image = &source->image;
    int width = padded(d, image->width);
    for (int x = 0; x < width; ++x)
    {
        int i = x % image->width, j = y % image->height;
        if (rf_pixel_is_valid(source, i, j))
            memcpy(out + (size_t)x * (size_t)d->channels,
                   image->pixels + j * image->row_stride + (ptrdiff_t)i * d->channels,
                   (size_t)d->channels * sizeof *out);
    }
}

static void count_missing(const RfWindowDatabase *d, const RfWindowSource *source, int y, int step, int *missing)
{
    int width = padded(d, source->image.width);
    for (int x = 0; x < width; ++x)
        missing[x] += rf_pixel_is_valid(source, x % source->image.width, y % source->image.height) ? 0 : step;
}

// Adds the places of one row to d->places, if there is room for them, and returns how many there are.
static int64_t place_row(const RfWindowDatabase *d, int copy, int y, const int *missing, int64_t before)
{
    int inside = 0;
    int64_t found = 0;
    for (int x = 0; x < d->side - 1; ++x)
        inside += missing[x];
    for (int x = 0; x < d->copy[copy].places_x; ++x)
    {
        inside += missing[x + d->side - 1];
        if (inside == 0)
        {
            if (d->places)
                d->places[before + found] = (RfWindowPlace){copy, x, y};
            ++found;
        }
        inside -= missing[x];
    }
    return found;
}

static int64_t place_copy(const RfWindowDatabase *d, const RfWindowSource *source, int s, int *missing, int64_t before)
{
    const RfWindowCopy *copy = &d->copy[s];
    int64_t found = 0;
    if (copy->places_y < 1)
        return 0;
    memset(missing, 0, (size_t)padded(d, source->image.width) * sizeof *missing);
    for (int y = 0; y < d->side - 1; ++y)
        count_missing(d, source, y, 1, missing);
    for (int y = 0; y < copy->places_y; ++y)
    {
        count_missing(d, source, y + d->side - 1, 1, missing);
        if (d->places)
            d->row_starts[copy->rows + (size_t)y] = (int)(before + found);
        found += place_row(d, s, y, missing, before + found);
        count_missing(d, source, y, -1, missing);
    }
    return found;
}

static int64_t place_all(const RfWindowDatabase *d, const RfWindowSource *sources, int *missing)
{
    int64_t found = 0;
    for (int s = 0; s < d->copies; ++s)
        found += place_copy(d, &sources[s], s, missing, found);
    return found;
}

void rf_window_centre(const RfWindowDatabase *d, RfWindowPlace place, float *x, float *y)
{
    float half = 0.5f * (float)(d->side - 1), u = (float)place.x + half, v = (float)place.y + half;
    const float *m = d->copy[place.copy].to_exemplar;
    *x = m[0] * u + m[1] * v + m[2];
    *y = m[3] * u + m[4] * v + m[5];
    if (!d->wraps)
        return;
    *x -= d->period_x * floorf(*x / d->period_x);
    *y -= d->period_y * floorf(*y / d->period_y);
}

static RfResult find_places(RfWindowDatabase *d, const RfWindowSource *sources)
{
    int *missing = rf_allocate(RF_MAX_SIZE + RF_MAX_WINDOW_SIDE, sizeof *missing);
    if (!missing)
        return RF_OUT_OF_MEMORY;
    int64_t found = place_all(d, sources, missing);
    RfResult result = RF_OK;
    if (found < 1)
        result = rf_fail(RF_BAD_INPUT, NULL, NULL,
                         "the exemplar holds no whole window of %d x %d valid pixels; take smaller windows", d->side,
                         d->side);
    else if (found > RF_MAX_WINDOW_CANDIDATES)
        result = rf_fail(RF_BAD_INPUT, NULL, NULL,
                         "the exemplar holds %lld windows, more than %d; take a smaller exemplar or fewer copies",
                         (long long)found, RF_MAX_WINDOW_CANDIDATES);
    else if (!(d->places = rf_allocate((size_t)found, sizeof *d->places)))
        result = RF_OUT_OF_MEMORY;
    else
    {
        d->candidates = (int)place_all(d, sources, missing);
        size_t rows = d->copy[d->copies - 1].rows + (size_t)d->copy[d->copies - 1].places_y;
        d->row_starts[rows] = d->candidates;
    }
    rf_release(missing);
    return result;
}

static void copy_pixels(RfWindowDatabase *d, const RfWindowSource *sources)
{
    double sums[RF_MAX_WINDOW_CHANNELS] = {0}, pixels = 0;
    for (int s = 0; s < d->copies; ++s)
    {
        int width = padded(d, sources[s].image.width), height = padded(d, sources[s].image.height);
        for (int y = 0; y < height; ++y)
        {
            float *row = d->pixels + d->copy[s].pixels + y * d->copy[s].stride;
            copy_row(d, &sources[s], y, row);
            for (int x = 0; x < width; ++x)
                for (int k = 0; k < d->channels; ++k)
                    sums[k] += (double)row[x * d->channels + k];
        }
        pixels += (double)width * (double)height;
    }
    // Pixels that are not valid count as 0 here: any mean would do, a good one keeps sums short.
    for (int k = 0; k < d->channels; ++k)
        d->mean[k] = (float)(sums[k] / pixels);
}

// ---- everything -------------------------------------------------------------------------------------------------

static RfResult allocate_candidates(RfWindowDatabase *d)
{
    d->tiles_of_candidates = (d->candidates - 1) / RF_TILE_CANDIDATES + 1;
    size_t room = (size_t)d->tiles_of_candidates * RF_TILE_CANDIDATES;
    d->centre_x = rf_allocate_zero(room, sizeof *d->centre_x);
    d->centre_y = rf_allocate_zero(room, sizeof *d->centre_y);
    d->half_norms = rf_allocate(room, sizeof *d->half_norms);
    d->kept_numbers = rf_allocate_zero(room, (size_t)d->kept * sizeof *d->kept_numbers);
    if (!d->centre_x || !d->centre_y || !d->half_norms || !d->kept_numbers)
        return RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < room; ++i)
        d->half_norms[i] = INFINITY;
    return RF_OK;
}

static RfResult fill_database(RfWindowDatabase *d, const RfWindowSource *sources, const RfWindowOptions *options)
{
    d->copy = rf_allocate((size_t)d->copies, sizeof *d->copy);
    d->row_weights = rf_allocate_zero((size_t)d->row_numbers, sizeof *d->row_weights);
    d->means = rf_allocate_zero((size_t)rf_block_numbers(d), sizeof *d->means);
    d->scales = rf_allocate_zero((size_t)rf_block_numbers(d), sizeof *d->scales);
    if (!d->copy || !d->row_weights || !d->means || !d->scales)
        return RF_OUT_OF_MEMORY;
    d->bare = true;
    for (int i = 0; i < d->side * d->channels; ++i)
    {
        float weight = options->channel_weights ? options->channel_weights[i % d->channels] : 1;
        d->row_weights[i] = weight;
        d->bare &= weight == 1;
        d->scale[i % d->channels] = sqrtf(weight);
    }
    RF_TRY(lay_out_copies(d, sources));
    copy_pixels(d, sources);
    for (int k = 0; k < d->numbers; ++k)
    {
        d->means[k] = d->mean[k % d->channels];
        d->scales[k] = d->scale[k % d->channels];
    }
    RF_TRY(find_places(d, sources));
    RF_TRY(rf_find_components(d, options->components));
    RF_TRY(allocate_candidates(d));
    RF_TRY(rf_allocate_shorts(d));
    for (int i = 0; i < d->candidates; ++i)
        rf_window_centre(d, d->places[i], &d->centre_x[i], &d->centre_y[i]);
    return rf_project_candidates(d);
}

RfResult rf_windows_create(const RfWindowSource *sources, int count, const RfWindowOptions *options,
                           RfWindowDatabase **out)
{
    RF_TRY(check_sources(sources, count, options));
    RfWindowDatabase *d = rf_allocate_zero(1, sizeof *d);
    if (!d)
        return RF_OUT_OF_MEMORY;
    d->side = options->side;
    d->channels = sources[0].image.channels;
    d->numbers = d->side * d->side * d->channels;
    d->row_numbers = (d->side * d->channels + RF_GROUP_LANES - 1) / RF_GROUP_LANES * RF_GROUP_LANES;
    d->copies = count;
    d->wraps = options->tiles;
    d->period_x = d->wraps ? (float)sources[0].image.width : 0;
    d->period_y = d->wraps ? (float)sources[0].image.height : 0;
    RfResult result = fill_database(d, sources, options);
    if (result != RF_OK)
    {
        rf_windows_destroy(d);
        return result;
    }
    *out = d;
    return RF_OK;
}

void rf_windows_destroy(RfWindowDatabase *d)
{
    if (!d)
        return;
    rf_release(d->copy);
    rf_release(d->pixels);
    rf_release(d->row_starts);
    rf_release(d->places);
    rf_release(d->centre_x);
    rf_release(d->centre_y);
    rf_release(d->row_weights);
    rf_release(d->means);
    rf_release(d->scales);
    rf_release(d->basis);
    rf_release(d->kept_numbers);
    rf_release(d->half_norms);
    rf_release(d->shorts.numbers);
    rf_release(d->shorts.starts);
    rf_release(d->shorts.rests);
    rf_release(d);
}

int rf_windows_count(const RfWindowDatabase *d)
{
    return d->candidates;
}

int rf_windows_numbers(const RfWindowDatabase *d)
{
    return d->numbers;
}

int rf_windows_components(const RfWindowDatabase *d, float *variance_kept)
{
    if (variance_kept)
        *variance_kept = d->variance_kept;
    return d->components;
}

RfWindowPlace rf_windows_place(const RfWindowDatabase *d, int candidate)
{
    assert(candidate >= 0 && candidate < d->candidates);
    return d->places[candidate];
}

int rf_windows_at(const RfWindowDatabase *d, RfWindowPlace place)
{
    if (place.copy < 0 || place.copy >= d->copies || place.x < 0 || place.y < 0 ||
        place.y >= d->copy[place.copy].places_y)
        return -1;
    size_t row = d->copy[place.copy].rows + (size_t)place.y;
    int low = d->row_starts[row], end = d->row_starts[row + 1], high = end;
    while (low < high)
    {
        int middle = low + (high - low) / 2;
        if (d->places[middle].x < place.x)
            low = middle + 1;
        else
            high = middle;
    }
    return low < end && d->places[low].x == place.x ? low : -1;
}
