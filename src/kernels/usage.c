// SPDX-License-Identifier: Apache-2.0
#include "kernels/usage.h"
#include "core/maths.h"

#include <string.h>

enum
{
    N = RF_USAGE_CELLS
};

// Of the price, where a cell is used twice as much as the mean. Windows answer prices all at once, so larger steps swing:
// with 0.5 two of eight exemplars crowd into one corner for good; smaller ones spread less.
static const float STEP = 0.2f;
// A cell that is used more than four times as much as the mean rises no faster.
static const float MAX_EXCESS = 3;
static const float MIN_PRICE = -1;

// (1 2 1) / 4 in both directions: windows overlap several cells.
static void blur(const float *from, float *to)
{
    for (int y = 0; y < N; ++y)
        for (int x = 0; x < N; ++x)
        {
            float sum = 0, weights = 0;
            for (int j = rf_max_int(y - 1, 0); j <= rf_min_int(y + 1, N - 1); ++j)
                for (int i = rf_max_int(x - 1, 0); i <= rf_min_int(x + 1, N - 1); ++i)
                {
                    float weight = (j == y ? 2.0f : 1.0f) * (i == x ? 2.0f : 1.0f);
                    sum += weight * from[j * N + i];
                    weights += weight;
                }
            to[y * N + x] = sum / weights;
        }
}

void rf_usage_settle(RfUsage *usage)
{
    float used[N * N], total = 0;
    for (int i = 0; i < N * N; ++i)
        total += usage->count[i];
    blur(usage->count, used);
    for (int i = 0; i < N * N && total > 0; ++i)
    {
        float excess = rf_min(used[i] * (N * N) / total - 1, MAX_EXCESS);
        usage->price[i] = rf_max(usage->price[i] + STEP * excess, MIN_PRICE);
    }
    memset(usage->count, 0, sizeof usage->count);
}

static float position(float at, int n, int margin)
{
    return (at - (float)margin + 0.5f) / (float)(n - 2 * margin);
}

void rf_usage_add(RfUsage *usage, int width, int height, int margin, float x, float y)
{
    int column = rf_clamp_int((int)(position(x, width, margin) * N), 0, N - 1);
    int row = rf_clamp_int((int)(position(y, height, margin) * N), 0, N - 1);
    usage->count[row * N + column] += 1;
}

void rf_usage_prices(const RfUsage *usage, int width, int height, int margin, float scale, float *prices)
{
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            float fx = rf_clamp(position((float)x, width, margin), 0, 1) * N - 0.5f;
            float fy = rf_clamp(position((float)y, height, margin), 0, 1) * N - 0.5f;
            int i = (int)floorf(fx), j = (int)floorf(fy);
            int left = rf_max_int(i, 0), right = rf_min_int(i + 1, N - 1);
            const float *above = usage->price + rf_max_int(j, 0) * N;
            const float *below = usage->price + rf_min_int(j + 1, N - 1) * N;
            float u = fx - (float)i, v = fy - (float)j;
            prices[(ptrdiff_t)y * width + x] =
                scale * rf_lerp(rf_lerp(above[left], above[right], u), rf_lerp(below[left], below[right], u), v);
        }
}
