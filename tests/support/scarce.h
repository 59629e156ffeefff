// SPDX-License-Identifier: Apache-2.0
// Memory that runs out.
#pragma once

/// From now on the library has so many allocations, then none.
void scarce_begin(int allocations);
void scarce_allow(int allocations);
/// Blocks that are held.
int scarce_live(void);
/// The library's own allocator again.
void scarce_end(void);

enum
{
    SCARCE_PLENTY = 1 << 30
};
