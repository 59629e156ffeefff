// SPDX-License-Identifier: Apache-2.0
// Tamura et al. take the gradient by Prewitt's 3 x 3 operators, count the directions of all that are strong enough, and
// find the peak of the counts, phi_p. Their directionality is
//
//     F = 1 - r n_p sum over phi (phi - phi_p)^2 H(phi)
//
// with H the counts over their sum, n_p the number of peaks and r a scale. Here there is one peak, the main one, phi -
// phi_p is the angle between two lines (at most pi / 2), and r = 12 / pi^2 makes F 0 where all directions are alike.
//
// Deviations: Scharr's weights in place of Prewitt's, whose angles are up to 2 degrees off; 90 bins in place of 16,
// smoothed before the peak is looked for, and the peak's angle is the mean of those near it, so that it is known to a
// part of a bin.
#include "kernels/directionality.h"
#include "core/maths.h"

#include <math.h>
#include <stdlib.h>

enum
{
    BINS = 90,
    /// Bins on each side that the counts are smoothed over, and that a peak's angle is the mean of.
    SMOOTH = 3,
    NEAR = 8
};

typedef struct Counts
{
    double of[BINS], sum;
} Counts;

static float value_at(const float *grey, int width, int height, bool tiles, int x, int y)
{
    return grey[(ptrdiff_t)rf_border_int(y, height, tiles) * width + rf_border_int(x, width, tiles)];
}

static RfVec2 gradient(const float *grey, int width, int height, bool tiles, int x, int y)
{
    static const float weights[3] = {3.0f / 16, 10.0f / 16, 3.0f / 16};
    RfVec2 g = {0, 0};
    for (int k = -1; k <= 1; ++k)
    {
        float weight = weights[k + 1];
        g.x += weight * (value_at(grey, width, height, tiles, x + 1, y + k) -
                         value_at(grey, width, height, tiles, x - 1, y + k));
        g.y += weight * (value_at(grey, width, height, tiles, x + k, y + 1) -
                         value_at(grey, width, height, tiles, x + k, y - 1));
    }
    return g;
}

// A line runs across the gradient. Bins are centred on their angles, the first on 0: most pictures have edges there.
static void count(Counts *counts, RfVec2 g)
{
    double angle = atan2((double)g.y, (double)g.x) + M_PI / 2;
    counts->of[rf_wrap_int((int)floor(angle / M_PI * BINS + 0.5), BINS)] += 1;
    counts->sum += 1;
}

static int peak_of(const Counts *counts)
{
    double most = -1;
    int peak = 0;
    for (int i = 0; i < BINS; ++i)
    {
        double sum = 0;
        for (int k = -SMOOTH; k <= SMOOTH; ++k)
            sum += (SMOOTH + 1 - abs(k)) * counts->of[rf_wrap_int(i + k, BINS)];
        if (sum > most)
        {
            most = sum;
            peak = i;
        }
    }
    return peak;
}

// In bins.
static double angle_of(const Counts *counts, int peak)
{
    double sum = 0, weight = 0;
    for (int k = -NEAR; k <= NEAR; ++k)
    {
        sum += k * counts->of[rf_wrap_int(peak + k, BINS)];
        weight += counts->of[rf_wrap_int(peak + k, BINS)];
    }
    return peak + sum / fmax(weight, 1);
}

// The mean square of the angle between the peak's line and the others', in radians.
static double spread_of(const Counts *counts, double angle)
{
    double sum = 0;
    for (int i = 0; i < BINS; ++i)
    {
        double off = fabs(i - angle);
        off = fmin(off, fabs(BINS - off)) * M_PI / BINS;
        sum += counts->of[i] / counts->sum * off * off;
    }
    return sum;
}

RfDirectionality rf_directionality(const float *grey, int width, int height, bool tiles, float threshold)
{
    Counts counts = {0};
    // Of a picture that does not tile the border has no gradient.
    int margin = tiles ? 0 : 1;
    for (int y = margin; y < height - margin; ++y)
        for (int x = margin; x < width - margin; ++x)
        {
            RfVec2 g = gradient(grey, width, height, tiles, x, y);
            if (0.5f * (fabsf(g.x) + fabsf(g.y)) >= threshold)
                count(&counts, g);
        }
    if (counts.sum == 0)
        return (RfDirectionality){0, 0};
    double angle = angle_of(&counts, peak_of(&counts)), strength = 1 - 12 / (M_PI * M_PI) * spread_of(&counts, angle);
    double turns = angle / BINS;
    float radians = (float)((turns - floor(turns)) * M_PI);
    return (RfDirectionality){radians < RF_PI ? radians : 0, (float)fmax(strength, 0)};
}
