// SPDX-License-Identifier: Apache-2.0
// Plain comparison of windows, many places at once. Windows are a few hundred pixels and places a few thousand, at a
// coarse level, so the comparison runs from the first cache and needs no transform; the caller refines the best few
// places at finer levels.

#include "kernels/best_match.h"
#include "core/maths.h"
#include "core/random.h"
#include "core/simd.h"

#include <assert.h>

RF_WIDE_BODY void match_row_body(const float *restrict texels, const float *restrict target,
                                 const float *restrict weight, int count, float *restrict sum)
{
    float total = 0;
#pragma omp simd reduction(+ : total)
    for (int i = 0; i < count; ++i)
    {
        float d = texels[i] - target[i];
        total += weight[i] * d * d;
    }
    *sum += total;
}

RF_WIDE_BODY void rf_match_cost_body(const RfMatchWindow *window, int x, int y, float *cost)
{
    const RfTexture *texture = window->texture;
    const RfTextureLevel *level = &texture->levels[window->level];
    // A row of the window is one stretch of texels, or two where it wraps.
    int first = rf_min_int(window->width, level->width - x);
    float total = 0;
    for (int q = 0; q < texture->quads; ++q)
    {
        const float *plane = level->texels + (size_t)q * rf_texture_plane(level);
        size_t row_floats = (size_t)window->width * 4, base = (size_t)q * (size_t)window->height * row_floats;
        for (int j = 0; j < window->height; ++j)
        {
            const float *texels = plane + (size_t)rf_wrap_int(y + j, level->height) * (size_t)level->stride * 4;
            const float *target = window->target + base + (size_t)j * row_floats,
                        *weight = window->weight + base + (size_t)j * row_floats;
            match_row_body(texels + (size_t)x * 4, target, weight, first * 4, &total);
            for (int done = first; done < window->width; done += level->width)
                match_row_body(texels, target + (size_t)done * 4, weight + (size_t)done * 4,
                               rf_min_int(window->width - done, level->width) * 4, &total);
        }
    }
    *cost = total;
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
