// SPDX-License-Identifier: Apache-2.0
#include "kernels/nearest_known.h"

#include <stddef.h>

// Takes neighbour (x + dx, y + dy)'s nearest known cell if that is nearer to (x, y).
static void pass_on(int32_t *nearest, int w, int h, int x, int y, int dx, int dy)
{
    if (x + dx < 0 || x + dx >= w || y + dy < 0 || y + dy >= h)
        return;
    int32_t *own = nearest + (size_t)y * (size_t)w + (size_t)x;
    int32_t other = own[(ptrdiff_t)dy * w + dx];
    if (other < 0)
        return;
    int64_t ox = other % w - x, oy = other / w - y;
    int64_t nx = *own % w - x, ny = *own / w - y;
    if (*own < 0 || ox * ox + oy * oy < nx * nx + ny * ny)
        *own = other;
}

void rf_spread_nearest(int32_t *nearest, int w, int h)
{
    for (int y = 0; y < h; ++y)
    {
        for (int x = 0; x < w; ++x)
            for (int dx = -1; dx <= 1; ++dx)
                pass_on(nearest, w, h, x, y, dx, dx < 0 ? 0 : -1);
        for (int x = w - 1; x >= 0; --x)
            pass_on(nearest, w, h, x, y, 1, 0);
    }
    for (int y = h - 1; y >= 0; --y)
    {
        for (int x = w - 1; x >= 0; --x)
            for (int dx = -1; dx <= 1; ++dx)
                pass_on(nearest, w, h, x, y, dx, dx > 0 ? 0 : 1);
        for (int x = 0; x < w; ++x)
            pass_on(nearest, w, h, x, y, -1, 0);
    }
}
