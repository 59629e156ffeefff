// SPDX-License-Identifier: Apache-2.0
#include "frame_files.h"
#include "errors.h"
#include "md5.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/// The first `count` channels, sRGB-encoded.
static int copy_colour(const RfImage *pixels, const Layout *layout, int count, const char *output, RfImage **out)
{
    if (layout->colours == 0)
        return fail(CODE_BAD_INPUT, output, NULL, "there is no colour to write (R G B or Y), only %s; write exr or npy",
                    layout->maps[0].name);
    RfImageView view = rf_image_view(pixels);
    RfResult result = layout_channels(&view, layout, 0, count, out);
    if (result != RF_OK)
        return fail_result(result, output);
    rf_image_convert(*out, RF_ENCODING_SRGB);
    return CODE_DONE;
}

int frame_colour(const RfImage *pixels, const Layout *layout, const char *output, RfImage **out)
{
    *out = NULL;
    bool ready = layout->encoding != RF_ENCODING_LINEAR && layout->colours == layout->channels;
    return ready ? CODE_DONE : copy_colour(pixels, layout, layout->colours, output, out);
}

int frame_picture(const RfImage *pixels, const Layout *layout, const char *output, RfImage **out)
{
    *out = NULL;
    bool grey_alpha = layout->colours == 2;
    int code = copy_colour(pixels, layout, grey_alpha ? 1 : layout->colours, output, out);
    if (code)
        return code;
    RfImageView view = rf_image_view(pixels), to = rf_image_view(*out);
    for (int y = 0; grey_alpha && y < to.height; ++y)
        for (int x = 0; x < to.width; ++x)
            to.pixels[y * to.row_stride + x] *= view.pixels[y * view.row_stride + (ptrdiff_t)x * view.channels + 1];
    return CODE_DONE;
}

static int stdout_failed(void)
{
    return fail(CODE_FAILED, NULL, NULL, "stdout cannot be written: %s", strerror(errno));
}

static int print_md5(Md5 *md5, int frame)
{
    char text[33];
    md5_end(md5, text);
    return printf("%s  %d\n", text, frame) < 0 || fflush(stdout) != 0 ? stdout_failed() : CODE_DONE;
}

int frame_md5(const RfImage *pixels, int frame)
{
    Md5 md5;
    md5_begin(&md5);
    RfImageView view = rf_image_view(pixels);
    for (int y = 0; y < view.height; ++y)
        md5_add(&md5, view.pixels + y * view.row_stride, (size_t)view.width * (size_t)view.channels * sizeof(float));
    return print_md5(&md5, frame);
}

int flow_md5(const RfFlowView *flow, int frame)
{
    Md5 md5;
    md5_begin(&md5);
    md5_add(&md5, flow->velocity, (size_t)flow->width * (size_t)flow->height * 2 * sizeof(float));
    return print_md5(&md5, frame);
}

static void print_header(const RfImageView *view, const Layout *layout, int levels)
{
    int channels = layout->colours;
    if (layout->alpha)
        printf("P7\nWIDTH %d\nHEIGHT %d\nDEPTH %d\nMAXVAL %d\nTUPLTYPE %s_ALPHA\nENDHDR\n", view->width, view->height,
               channels, levels, channels == 2 ? "GRAYSCALE" : "RGB");
    else
        printf("P%d\n%d %d\n%d\n", channels == 1 ? 5 : 6, view->width, view->height, levels);
}

static void pack_row(const float *from, size_t count, bool wide, uint8_t *to)
{
    float levels = wide ? 65535 : 255;
    for (size_t i = 0; i < count; ++i)
    {
        int level = (int)lrintf(fminf(fmaxf(from[i], 0), 1) * levels);
        if (wide)
            *to++ = (uint8_t)(level >> 8);
        *to++ = (uint8_t)level;
    }
}

int frame_pnm(const RfImage *pixels, const Layout *layout)
{
    RfImage *colour = NULL;
    int code = copy_colour(pixels, layout, layout->colours, "-", &colour);
    if (code)
        return code;
    RfImageView view = rf_image_view(colour);
    bool wide = layout->format != RF_SAMPLE_U8;
    size_t samples = (size_t)view.width * (size_t)view.channels, bytes = samples * (wide ? 2 : 1);
    uint8_t *row = malloc(bytes);
    bool good = row != NULL;
    if (good)
        print_header(&view, layout, wide ? 65535 : 255);
    for (int y = 0; y < view.height && good; ++y)
    {
        pack_row(view.pixels + y * view.row_stride, samples, wide, row);
        good = fwrite(row, bytes, 1, stdout) == 1;
    }
    good = good && fflush(stdout) == 0;
    free(row);
    rf_image_destroy(colour);
    return good ? CODE_DONE : stdout_failed();
}
