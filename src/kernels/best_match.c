// SPDX-License-Identifier: Apache-2.0
// Plain comparison of windows. They are some thousand numbers, at a coarse level, so the comparison runs from the first
// caches and needs no transform; the caller refines the best few places at finer levels.
//
// The sum of squared differences alone, |e - t|^2, is least where e is a *fainter* t: with correlation c and r = |e| /
// |t| it is |t|^2 (1 + r^2 - 2 r c), least at r = c < 1. Chosen again and again, calm areas win and the texture loses
// contrast and its spectrum. So likeness counts as correlation alone, and the window's energy is judged for itself
// against the exemplar's mean m^2:
//
//     cost = 2 - 2 c + 3 (|e|^2 / m^2 - 1)^2
//
// The penalty is even in the energy itself, not in its root or logarithm, so that the mean energy of what is chosen
// stays the exemplar's. A like penalty on the mean squared gradient of the full texture was tried; it moved no measure
// by more than another seed does.

#include "kernels/best_match.h"
#include "core/maths.h"
#include "core/random.h"
#include "core/simd.h"

#include <assert.h>

// Found on foam, bubbles, lava and noise: weaker lets the contrast of noise drift.
#define ENERGY_WEIGHT 3.0f

// sums[0] += weight (e - t)^2, sums[1] += weight e^2
RF_WIDE_BODY void match_row(const float *restrict texels, const float *restrict target, const float *restrict weight,
                            int count, float sums[2])
{
    float difference = 0, energy = 0;
#pragma omp simd reduction(+ : difference, energy)
    for (int i = 0; i < count; ++i)
    {
        float e = texels[i], d = e - target[i];
        difference += weight[i] * d * d;
        energy += weight[i] * e * e;
    }
    sums[0] += difference;
    sums[1] += energy;
}

RF_WIDE_BODY void rf_match_cost_body(const RfMatchWindow *window, int x, int y, float *cost)
{
    const RfTexture *texture = window->texture;
    const RfTextureLevel *level = &texture->levels[window->level];
    // A row of the window is one stretch of texels, or more where it wraps.
    int first = rf_min_int(window->width, level->width - x);
    float sums[2] = {0, 0};
    for (int q = 0; q < texture->quads; ++q)
    {
        const float *plane = level->texels + (size_t)q * rf_texture_plane(level);
        size_t row_floats = (size_t)window->width * 4, base = (size_t)q * (size_t)window->height * row_floats;
        for (int j = 0; j < window->height; ++j)
        {
            const float *texels = plane + (size_t)rf_wrap_int(y + j, level->height) * (size_t)level->stride * 4;
            const float *target = window->target + base + (size_t)j * row_floats,
                        *weight = window->weight + base + (size_t)j * row_floats;
            match_row(texels + (size_t)x * 4, target, weight, first * 4, sums);
            for (int done = first; done < window->width; done += level->width)
                match_row(texels, target + (size_t)done * 4, weight + (size_t)done * 4,
                          rf_min_int(window->width - done, level->width) * 4, sums);
        }
    }
    // sums[0] = |e|^2 + |t|^2 - 2 e.t
    float e2 = sums[1], t2 = window->energy, m2 = window->mean_energy, product = sqrtf(e2 * t2);
    if (!(product > 0) || !(m2 > 0))
    {
        *cost = sums[0];
        return;
    }
    float excess = e2 / m2 - 1;
    *cost = 2 + ENERGY_WEIGHT * excess * excess - (e2 + t2 - sums[0]) / product;
}

RF_WIDE(rf_match_cost, (const RfMatchWindow *window, int x, int y, float *cost), (window, x, y, cost))

void rf_match_places(const RfMatchWindow *window, int places[2])
{
    const RfTextureLevel *level = &window->texture->levels[window->level];
    places[0] =
        window->texture->tiles ? level->width : rf_max_int(level->width - window->width - 2 * window->margin + 1, 0);
    places[1] =
        window->texture->tiles ? level->height : rf_max_int(level->height - window->height - 2 * window->margin + 1, 0);
}

static void insert_match(RfMatch *best, int keep, RfMatch match)
{
    if (!(match.cost < best[keep - 1].cost))
        return;
    int slot = keep - 1;
    for (; slot > 0 && match.cost < best[slot - 1].cost; --slot)
        best[slot] = best[slot - 1];
    best[slot] = match;
}

int rf_match_search(const RfMatchWindow *window, int tries, int keep, uint64_t seed, uint64_t frame, uint64_t item,
                    RfMatch *best)
{
    assert(keep >= 1);
    int places[2], margin = window->texture->tiles ? 0 : window->margin;
    rf_match_places(window, places);
    int64_t all = (int64_t)places[0] * places[1];
    bool every = tries >= all;
    if (every)
        tries = (int)all;
    for (int k = 0; k < keep; ++k)
        best[k] = (RfMatch){0, 0, INFINITY};
    for (int i = 0; i < tries; ++i)
    {
        uint32_t place = every ? (uint32_t)i : rf_random_below((uint32_t)all, seed, frame, item, (uint64_t)i + 16);
        RfMatch match = {(int)place % places[0] + margin, (int)place / places[0] + margin, 0};
        rf_match_cost(window, match.x, match.y, &match.cost);
        insert_match(best, keep, match);
    }
    int count = 0;
    while (count < keep && best[count].cost < INFINITY)
        ++count;
    return count;
}
