// SPDX-License-Identifier: Apache-2.0
// Principal components of many vectors that are read in panels, never held all at once.
#pragma once

#include "kernels/nearest.h"
#include "riffle/base.h"

enum
{
    /// Components are found in blocks of what a tile holds.
    RF_BASIS_BLOCK = RF_TILE_CANDIDATES
};

/// Writes vectors item, item + 1, ... (12 of them; past the last: zeros) into panel[numbers][12].
typedef struct RfPanelReader
{
    void (*read)(const void *context, int item, float *panel);
    const void *context;
    int items, numbers;
} RfPanelReader;

/// An orthonormal basis of the `blocks` * 32 principal components: basis[blocks][numbers][32], strongest first;
/// variances[blocks * 32] holds the sums of squares along each, *total the vectors' own. Where the vectors span less,
/// the rest of the basis is 0 or anything orthogonal, and its variance next to 0. The mean is not taken off.
RfResult rf_principal_components(const RfPanelReader *reader, int blocks, float *basis, double *variances,
                                 double *total);

/// The principal axes of few numbers, at most 32: rows of axes[numbers][numbers], orthonormal, strongest first.
/// covariance[numbers][numbers]: symmetric; it is overwritten.
void rf_principal_axes(double *covariance, int numbers, float *axes);

/// Coordinates of a panel's 12 vectors: products[12][blocks * 32].
void rf_project_panel(const float *panel, int numbers, const float *basis, int blocks, float *products);
