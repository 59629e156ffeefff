// SPDX-License-Identifier: Apache-2.0
// What a patch is to agree with, and how it fades into its surroundings (Wang et al. 2005, equation 1; figure 5).
#include "methods/directional/directional.h"

#include <limits.h>

static const int FAR = INT_MAX;

// Squared distances to the hole, up to the mask's width.
static void measure_distances(const RfDirectional *d, RfCell cell, RfCell box, RfPatchScratch *s)
{
    int reach = d->options.mask_width;
    for (int i = 0; i < box.width * box.height; ++i)
        s->distance[i] = FAR;
    for (int y = cell.y; y < cell.y + cell.height; ++y)
        for (int x = cell.x; x < cell.x + cell.width; ++x)
        {
            if (!rf_directional_missing(d, y * d->width + x))
                continue;
            int x0 = rf_max_int(x - reach, box.x), x1 = rf_min_int(x + reach, box.x + box.width - 1);
            int y0 = rf_max_int(y - reach, box.y), y1 = rf_min_int(y + reach, box.y + box.height - 1);
            for (int j = y0; j <= y1; ++j)
                for (int i = x0; i <= x1; ++i)
                {
                    int *distance = &s->distance[(j - box.y) * box.width + i - box.x];
                    *distance = rf_min_int(*distance, (i - x) * (i - x) + (j - y) * (j - y));
                }
        }
}

// Equation 1: 1 in the hole, and less and less beyond it.
void rf_directional_mask_hole(const RfDirectional *d, RfCell cell, RfCell box, RfPatchScratch *s)
{
    int reach = d->options.mask_width;
    measure_distances(d, cell, box, s);
    for (int i = 0; i < box.width * box.height; ++i)
    {
        int pixel = (box.y + i / box.width) * d->width + box.x + i % box.width;
        bool near = s->distance[i] <= reach * reach, known = d->texels[pixel].copy >= 0;
        s->weights[i] = near && known ? 1 : 0;
        s->alpha[i] = near && d->inside[pixel] ? 1 - sqrtf((float)s->distance[i]) / (float)(reach + 1) : 0;
    }
    // Holes of other cells wait for their own patch.
    for (int i = 0; i < box.width * box.height; ++i)
    {
        int pixel = (box.y + i / box.width) * d->width + box.x + i % box.width;
        if (s->distance[i] > 0 && d->texels[pixel].copy < 0)
            s->alpha[i] = 0;
    }
}

// All of the cell; the patch fades in from the cell's border, unless that is the frame's.
void rf_directional_mask_cell(const RfDirectional *d, RfCell cell, RfPatchScratch *s)
{
    int reach = rf_min_int(d->options.mask_width, rf_min_int(cell.width, cell.height) / 4);
    for (int j = 0; j < cell.height; ++j)
        for (int i = 0; i < cell.width; ++i)
        {
            int pixel = (cell.y + j) * d->width + cell.x + i, most = cell.width + cell.height;
            int left = cell.x == 0 ? most : i + 1, right = cell.x + cell.width == d->width ? most : cell.width - i;
            int top = cell.y == 0 ? most : j + 1, bottom = cell.y + cell.height == d->height ? most : cell.height - j;
            int depth = rf_min_int(rf_min_int(left, right), rf_min_int(top, bottom));
            bool known = d->texels[pixel].copy >= 0;
            s->weights[j * cell.width + i] = known ? 1 : 0;
            s->alpha[j * cell.width + i] = known ? rf_min((float)depth / (float)(reach + 1), 1) : 0;
        }
}

// ---- cut instead of faded

// Where the line may run: on rectangles round the cell, `index` pixels outside it, from its middle at an angle.
static RfVec2 ring_point(RfCell cell, int angle, int index)
{
    float radians = 2 * RF_PI * (float)angle / RF_RING_ANGLES, x = cosf(radians), y = sinf(radians);
    float longer = rf_max(fabsf(x), fabsf(y));
    float half_width = 0.5f * (float)(cell.width - 1) + (float)index;
    float half_height = 0.5f * (float)(cell.height - 1) + (float)index;
    return (RfVec2){(float)cell.x + 0.5f * (float)(cell.width - 1) + half_width * x / longer,
                    (float)cell.y + 0.5f * (float)(cell.height - 1) + half_height * y / longer};
}

// How much patch and frame differ; 0 where there is nothing to be cut from.
static float error_at(const RfDirectional *d, RfCell box, RfVec2 source, RfJacobian j, RfVec2 point)
{
    int x = rf_nearest_int(point.x), y = rf_nearest_int(point.y), channels = d->comparison.channels;
    if (x < 0 || y < 0 || x >= d->width || y >= d->height || d->texels[y * d->width + x].copy < 0)
        return 0;
    float there[RF_SAMPLE_CHANNELS];
    const float *here = d->picture + ((ptrdiff_t)y * d->width + x) * d->exemplar->channels;
    RfVec2 step = {(float)(x - box.x), (float)(y - box.y)};
    rf_sampler_at(&d->sampler, rf_vec2_add(source, rf_jacobian_step(j, step)), j, there);
    float sum = 0;
    for (int c = 0; c < channels; ++c)
    {
        float off = rf_comparison_value(&d->comparison, c, there) - rf_comparison_value(&d->comparison, c, here);
        sum += off * off;
    }
    return sum;
}

// Of a pixel outside the cell: the ring it lies on, and at which angle.
static int ring_of(RfCell cell, int x, int y, int *angle)
{
    float dx = (float)(x - cell.x) - 0.5f * (float)(cell.width - 1),
          dy = (float)(y - cell.y) - 0.5f * (float)(cell.height - 1);
    float out_x = fabsf(dx) - 0.5f * (float)(cell.width - 1), out_y = fabsf(dy) - 0.5f * (float)(cell.height - 1);
    float index = rf_max(out_x, out_y);
    float half_width = 0.5f * (float)(cell.width - 1) + index, half_height = 0.5f * (float)(cell.height - 1) + index;
    float turns = atan2f(dy / half_height, dx / half_width) / (2 * RF_PI);
    *angle = rf_wrap_int(rf_nearest_int(turns * RF_RING_ANGLES), RF_RING_ANGLES);
    return rf_nearest_int(index);
}

void rf_directional_cut(const RfDirectional *d, RfCell cell, RfCell box, int copy, RfVec2 source, RfPatchScratch *s)
{
    int path[RF_RING_ANGLES];
    RfJacobian j = rf_turned_copy_jacobian(&d->copies, copy);
    s->ring.radii = d->options.mask_width;
    for (int a = 0; a < RF_RING_ANGLES; ++a)
        for (int r = 0; r < s->ring.radii; ++r)
            s->ring.errors[a][r] = error_at(d, box, source, j, ring_point(cell, a, r + 1));
    rf_ring_cut(&s->ring, path);
    for (int i = 0; i < box.width * box.height; ++i)
    {
        int x = box.x + i % box.width, y = box.y + i / box.width, angle;
        bool in_cell = x >= cell.x && y >= cell.y && x < cell.x + cell.width && y < cell.y + cell.height;
        if (in_cell || s->alpha[i] == 0)
            continue;
        int ring = ring_of(cell, x, y, &angle);
        s->alpha[i] = ring <= path[angle] ? 1 : 0; // the line itself lies on ring path + 1
    }
}
