// SPDX-License-Identifier: Apache-2.0
#include "kernels/ring_cut.h"

#include <math.h>

// Least sums over lines that begin at `start`; the least of those that can close.
static float run_from(RfRing *ring, int start, int *end)
{
    for (int r = 0; r < ring->radii; ++r)
        ring->sums[0][r] = r == start ? ring->errors[0][r] : INFINITY;
    for (int a = 1; a < RF_RING_ANGLES; ++a)
        for (int r = 0; r < ring->radii; ++r)
        {
            const float *before = ring->sums[a - 1];
            int best = r;
            if (r > 0 && before[r - 1] < before[best])
                best = r - 1;
            if (r + 1 < ring->radii && before[r + 1] < before[best])
                best = r + 1;
            ring->from[a][r] = (int8_t)best;
            ring->sums[a][r] = before[best] + ring->errors[a][r];
        }
    const float *last = ring->sums[RF_RING_ANGLES - 1];
    *end = start;
    for (int r = start - 1; r <= start + 1; ++r)
        if (r >= 0 && r < ring->radii && last[r] < last[*end])
            *end = r;
    return last[*end];
}

float rf_ring_cut(RfRing *ring, int path[RF_RING_ANGLES])
{
    float least = INFINITY;
    for (int a = 0; a < RF_RING_ANGLES; ++a)
        path[a] = 0;
    for (int start = 0; start < ring->radii; ++start)
    {
        int end;
        float sum = run_from(ring, start, &end);
        if (!(sum < least))
            continue;
        least = sum;
        for (int a = RF_RING_ANGLES - 1, r = end; a >= 0; --a)
        {
            path[a] = r;
            r = a > 0 ? ring->from[a][r] : r;
        }
    }
    return least;
}
