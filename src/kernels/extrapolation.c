// SPDX-License-Identifier: Apache-2.0
// Sander, Snyder, Gortler, Hoppe. Texture mapping progressive meshes. SIGGRAPH 2001 (the pull-push step); used for
// velocities by Yu, Neyret, Bruneton, Holzschuch. Spectrum-preserving texture advection for animated fluids. 2009,
// figure 2.
//
// Push: a coarse node is the mean of the known ones among its 2 x 2 children, until a level has no unknown node. Pull:
// an unknown node takes its parent's value. Sides that are odd have a last coarse node with fewer children.

#include "kernels/extrapolation.h"

#include <assert.h>
#include <string.h>

enum
{
    LEVELS = 6, // 32 16 8 4 2 1
    NODES = 32 * 32 + 16 * 16 + 8 * 8 + 4 * 4 + 2 * 2 + 1
};

typedef struct Level
{
    RfVec2 *values;
    bool *known;
    int n, known_count;
} Level;

static void push(const Level *fine, Level *coarse)
{
    coarse->known_count = 0;
    for (int j = 0; j < coarse->n; ++j)
        for (int i = 0; i < coarse->n; ++i)
        {
            RfVec2 sum = {0, 0};
            int count = 0;
            for (int y = 2 * j; y < 2 * j + 2 && y < fine->n; ++y)
                for (int x = 2 * i; x < 2 * i + 2 && x < fine->n; ++x)
                    if (fine->known[y * fine->n + x])
                    {
                        sum.x += fine->values[y * fine->n + x].x;
                        sum.y += fine->values[y * fine->n + x].y;
                        ++count;
                    }
            coarse->known[j * coarse->n + i] = count > 0;
            if (count > 0)
                coarse->values[j * coarse->n + i] = (RfVec2){sum.x / (float)count, sum.y / (float)count};
            coarse->known_count += count > 0;
        }
}

static void pull(const Level *coarse, Level *fine)
{
    for (int y = 0; y < fine->n; ++y)
        for (int x = 0; x < fine->n; ++x)
            if (!fine->known[y * fine->n + x])
                fine->values[y * fine->n + x] = coarse->values[y / 2 * coarse->n + x / 2];
}

int rf_push_pull(RfVec2 *values, const bool *known, int n)
{
    assert(n >= 1 && n <= RF_MAX_GRID_VERTICES);
    RfVec2 value_store[NODES];
    bool known_store[NODES];
    Level levels[LEVELS] = {{values, known_store, n, 0}};
    memcpy(known_store, known, (size_t)(n * n) * sizeof *known);
    for (int i = 0; i < n * n; ++i)
        levels[0].known_count += known[i];
    int known_count = levels[0].known_count;
    if (known_count == 0)
        memset(values, 0, (size_t)(n * n) * sizeof *values);
    if (known_count == 0 || known_count == n * n)
        return known_count;

    int top = 0, used = n * n;
    while (levels[top].known_count < levels[top].n * levels[top].n)
    {
        int side = (levels[top].n + 1) / 2;
        levels[top + 1] = (Level){value_store + used, known_store + used, side, 0};
        used += side * side;
        assert(used <= NODES && top + 1 < LEVELS);
        push(&levels[top], &levels[top + 1]);
        ++top;
    }
    for (; top > 0; --top)
        pull(&levels[top], &levels[top - 1]);
    return known_count;
}
