// SPDX-License-Identifier: Apache-2.0
#include "mask_input.h"
#include "errors.h"
#include "riffle/riffle.h"

#include <stdlib.h>

/// Mean over the mask's pixels that cell (i of n) covers, colours together, alpha left out.
static float mean_of_cell(const RfImageView *image, int colours, int i, int width, int j, int height)
{
    int x0 = (int)((int64_t)i * image->width / width), x1 = (int)((int64_t)(i + 1) * image->width / width);
    int y0 = (int)((int64_t)j * image->height / height), y1 = (int)((int64_t)(j + 1) * image->height / height);
    x1 = x1 > x0 ? x1 : x0 + 1;
    y1 = y1 > y0 ? y1 : y0 + 1;
    double sum = 0;
    for (int y = y0; y < y1; ++y)
        for (int x = x0; x < x1; ++x)
            for (int c = 0; c < colours; ++c)
                sum += (double)image->pixels[y * image->row_stride + (ptrdiff_t)x * image->channels + c];
    return (float)(sum / ((double)(x1 - x0) * (y1 - y0) * colours));
}

int mask_read(const char *path, int width, int height, uint8_t **out)
{
    RfImage *image = NULL;
    RfResult result = rf_image_read(path, &image);
    if (result != RF_OK)
        return fail_result(result, path);
    RfImageView view = rf_image_view(image);
    int colours = view.channels - (rf_image_has_alpha(image) ? 1 : 0);
    uint8_t *mask = malloc((size_t)width * (size_t)height);
    bool any = false;
    for (int j = 0; j < height && mask; ++j)
        for (int i = 0; i < width; ++i)
        {
            // Written so that NaN is land.
            bool fluid = mean_of_cell(&view, colours, i, width, j, height) >= 0.5f;
            mask[(size_t)j * (size_t)width + (size_t)i] = fluid;
            any = any || fluid;
        }
    rf_image_destroy(image);
    int code =
        !mask ? fail(CODE_FAILED, path, NULL, "out of memory")
        : any ? CODE_DONE
              : fail(CODE_BAD_INPUT, path, NULL, "the mask is black everywhere, so there is no fluid; white is fluid");
    if (code)
        free(mask);
    else
        *out = mask;
    return code;
}
