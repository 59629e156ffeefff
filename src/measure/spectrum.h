// SPDX-License-Identifier: Apache-2.0
// Radially averaged power spectra of grey pictures, and how far those of frames are from the exemplar's.
#pragma once

#include "measure/judgement.h"

typedef struct RfRadialSpectrum
{
    /// Power spectral density, grey levels squared a unit of frequency; bin k is k cycles a crop.
    double power[RF_MEASURE_MAX_BINS + 1];
} RfRadialSpectrum;

typedef struct RfSpectrometer RfSpectrometer;

/// Analyses the exemplar (NULL: none; copied), for frames of the first one's size. crop: side of the crops, or 0 to
/// pick it: half the exemplar's side or the frame's, at most 128, halved until one fits into the mask. `first` is the
/// first bin that counts.
RfResult rf_spectrometer_create(const RfGrey *exemplar, const RfGrey *frame, const uint8_t *mask, int crop, int first,
                                uint64_t seed, RfSpectrometer **out);
void rf_spectrometer_destroy(RfSpectrometer *spectrometer);
int rf_spectrometer_crop(const RfSpectrometer *spectrometer);

/// Crops lie wholly in the mask (NULL: everywhere); NaN where none does.
RfResult rf_spectrometer_measure(RfSpectrometer *spectrometer, const RfGrey *frame, const uint8_t *mask,
                                 RfRadialSpectrum *spectrum, RfMeasureSpectrum *distance);

/// The exemplar's mean spectrum, and bin by bin the least and the most of 64 single crops of it. NaN without one.
void rf_spectrometer_exemplar(const RfSpectrometer *spectrometer, RfRadialSpectrum *mean, RfRadialSpectrum *low,
                              RfRadialSpectrum *high);
