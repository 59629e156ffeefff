// SPDX-License-Identifier: Apache-2.0
// Wind and currents as web maps carry them: a PNG whose red is the eastward and whose green the northward speed, beside
// a JSON of its name with uMin, uMax, vMin and vMax, the speeds of 0 and of full. Rows run north to south.
#include "in/flow_format.h"
#include "in/image.h"
#include "in/json.h"

#include "core/result.h"
#include "in/file.h"

#include <stdio.h>
#include <string.h>

enum
{
    LONGEST_JSON = 1 << 20
};

typedef struct WindRange
{
    double low[2], high[2];
} WindRange;

static bool png_probe(const uint8_t *bytes, size_t size)
{
    return size >= 8 && memcmp(bytes, "\x89PNG\r\n\x1a\n", 8) == 0;
}

static RfResult read_range(const char *path, const RfBytes *bytes, WindRange *out)
{
    static const char *const names[4] = {"uMin", "uMax", "vMin", "vMax"};
    double *const places[4] = {&out->low[0], &out->high[0], &out->low[1], &out->high[1]};
    for (int i = 0; i < 4; ++i)
    {
        RF_TRY(rf_json_number(path, bytes->data, bytes->size, names[i], places[i]));
        if (!isfinite(*places[i]))
            return rf_fail(RF_BAD_INPUT, path, NULL, "%s is not a finite number", names[i]);
    }
    return RF_OK;
}

static RfResult open_range(const RfFlowSource *source, WindRange *out)
{
    char path[4096];
    const char *dot = strrchr(source->path, '.');
    size_t stem = dot ? (size_t)(dot - source->path) : strlen(source->path);
    if ((size_t)snprintf(path, sizeof path, "%.*s.json", (int)stem, source->path) >= sizeof path)
        return rf_fail(RF_BAD_INPUT, source->path, NULL, "the name is too long");
    RfBytes bytes;
    if (rf_bytes_read(path, LONGEST_JSON, &bytes) != RF_OK)
        return rf_fail(RF_BAD_INPUT, source->path, NULL,
                       "a PNG is a flow only beside a JSON of its name with uMin, uMax, vMin and vMax: %s is missing",
                       path);
    RfResult result = read_range(path, &bytes, out);
    rf_bytes_free(&bytes);
    return result;
}

static RfResult take_pixels(const RfFlowSource *source, const RfImageView *image, const WindRange *range,
                            RfFlowMoment *out)
{
    if (image->channels < 3)
        return rf_fail(RF_BAD_INPUT, source->path, NULL,
                       "a grey picture holds no flow: red is the eastward speed, green the northward");
    RF_TRY(rf_flow_moment_create(source, image->width, image->height, out));
    float *velocity = out->field.velocity;
    for (int y = 0; y < image->height; ++y)
        for (int x = 0; x < image->width; ++x, velocity += 2)
        {
            const float *pixel = image->pixels + y * image->row_stride + (ptrdiff_t)x * image->channels;
            velocity[0] = (float)(range->low[0] + (double)pixel[0] * (range->high[0] - range->low[0]));
            velocity[1] = -(float)(range->low[1] + (double)pixel[1] * (range->high[1] - range->low[1]));
        }
    out->moment_count = 1;
    snprintf(out->conventions, sizeof out->conventions,
             "the JSON's units taken as cells a frame (--velocity-scale sets the pace); rows run north to south, v is "
             "northward and was negated");
    return RF_OK;
}

static RfResult png_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    WindRange range;
    RfImage *image;
    RF_TRY(open_range(source, &range));
    RF_TRY(rf_image_decode(source->path, source->bytes, source->size, &image));
    RfImageView view = rf_image_view(image);
    RfResult result = take_pixels(source, &view, &range, out);
    rf_image_destroy(image);
    return result;
}

const RfFlowFormat rf_flow_format_png = {.name = "png", .extensions = "png", .probe = png_probe, .read = png_read};
