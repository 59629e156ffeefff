// SPDX-License-Identifier: Apache-2.0
// Maximal Poisson-disk distributions that are mended, not made anew.
#pragma once

#include "core/memory.h"
#include "riffle/data.h"

/// Where the domain may still take a point: a lattice of square cells, 1 where some of a cell's fluid may lie farther
/// than the radius from every point.
typedef struct RfDiskField
{
    int columns, rows;
    float spacing, radius;
    uint8_t *open;
    /// Cells that were open when the list was made, in no order; closed ones leave it when they are met.
    int *list, list_count;
} RfDiskField;

/// All cells open, memory from the arena. `radius` is the Poisson-disk radius d, in pixels of the width x height
/// domain. NULL memory: RF_OUT_OF_MEMORY.
RfResult rf_disk_field_create(int width, int height, float radius, RfArena *arena, RfDiskField *out);

/// Closes the cells that lie within the radius of the point altogether.
void rf_disk_field_mark(RfDiskField *field, RfVec2 point);

/// Lists the open cells, after the old points are marked and before the first pick.
RfResult rf_disk_field_list(RfDiskField *field, RfArena *arena);

/// Picks an open cell at random: its index, or -1 when none is open: the distribution is then maximal. `draw` numbers
/// the picks of one filling. The caller places a point in the cell and marks it, or closes the cell.
int rf_disk_field_pick(RfDiskField *field, uint64_t seed, uint64_t frame, uint64_t draw);
RfVec2 rf_disk_field_centre(const RfDiskField *field, int cell);

typedef struct RfPair
{
    float distance;
    int a, b;
} RfPair;

/// All pairs a < b closer than limit, by distance, then a, then b. Memory from the arena; -1 if there is none.
int rf_close_pairs(const RfVec2 *points, int count, float limit, RfArena *arena, RfPair **pairs);
