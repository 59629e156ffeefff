// SPDX-License-Identifier: Apache-2.0
// Two-dimensional Fourier transform of a complex field [height][width], in place, by KissFFT along rows and columns.
#pragma once

#include "riffle/base.h"

#include <kiss_fft.h>

typedef kiss_fft_cpx RfComplex;
typedef struct RfFourier RfFourier;

RfResult rf_fourier_create(int width, int height, RfFourier **out);
void rf_fourier_destroy(RfFourier *fourier);
/// Neither direction scales: there and back multiplies by width * height. Same bytes for any number of threads.
void rf_fourier_transform(RfFourier *fourier, RfComplex *field, bool inverse);
