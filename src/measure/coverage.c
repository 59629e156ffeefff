// SPDX-License-Identifier: Apache-2.0
// Which pixels of the fluid have no texture.
#include "measure/judgement.h"

#include <math.h>

// Beyond it no number is a picture's, and squares would stop being finite.
static const float FARTHEST = 1e6f;

static bool is_hole(const float *pixel, int channels, RfMeasureHoles holes, bool alpha)
{
    int colours = channels < 3 ? 1 : 3;
    bool zero = true;
    for (int c = 0; c < channels; ++c)
    {
        if (!(fabsf(pixel[c]) < FARTHEST))
            return true;
        zero &= c >= colours || pixel[c] == 0;
    }
    if (alpha && (holes == RF_MEASURE_HOLES_AUTO || holes == RF_MEASURE_HOLES_ALPHA))
        return pixel[channels - 1] <= 0;
    return zero && (holes == RF_MEASURE_HOLES_ZERO || holes == RF_MEASURE_HOLES_AUTO);
}

void rf_measure_coverage(const RfImageView *frame, const uint8_t *fluid, RfMeasureHoles holes, bool alpha,
                         uint8_t *known, RfMeasureCoverage *out)
{
    *out = (RfMeasureCoverage){0};
    for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x)
        {
            size_t k = (size_t)y * (size_t)frame->width + (size_t)x;
            const float *p = frame->pixels + (ptrdiff_t)y * frame->row_stride + (ptrdiff_t)x * frame->channels;
            bool inside = !fluid || fluid[k], hole = inside && is_hole(p, frame->channels, holes, alpha);
            known[k] = inside && !hole;
            out->fluid += inside;
            out->holes += hole;
        }
    out->share = out->fluid > 0 ? out->holes / out->fluid : (double)NAN;
}
