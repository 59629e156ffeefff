// SPDX-License-Identifier: Apache-2.0
// Image readers: one constant table entry a format, known by content and decoding from memory, so that a fuzzer can
// hand any of them any bytes.
#pragma once

#include "riffle/io.h"

/// Most samples (pixels times channels) of an image that is read: 2 GiB as floats.
#define RF_MAX_IMAGE_SAMPLES ((int64_t)1 << 29)

typedef struct RfImageReader
{
    /// For messages: "PNG".
    const char *name;
    /// "jpg,jpeg"
    const char *extensions;
    /// True if the content is of this kind, or is the beginning of a file of this kind.
    bool (*probe)(const uint8_t *bytes, size_t size);
    /// `file` is for messages only. Samples come as the file has them: NaN and infinity included.
    RfResult (*decode)(const char *file, const uint8_t *bytes, size_t size, RfImage **out);
} RfImageReader;

extern const RfImageReader rf_png_reader, rf_jpeg_reader, rf_exr_reader, rf_pnm_reader;

/// Decodes by content. `name` is for messages, and to say what its extension promised.
RfResult rf_image_decode(const char *name, const uint8_t *bytes, size_t size, RfImage **out);

/// RF_BAD_INPUT for sides outside 1 .. RF_MAX_SIZE and for more samples than RF_MAX_IMAGE_SAMPLES. To be called before
/// any memory is asked for.
RfResult rf_image_check_size(const char *file, int64_t width, int64_t height, int64_t channels);

/// RF_BAD_INPUT if an image of `needed` bytes, uncompressed, cannot come out of `size` bytes that expand at most
/// `ratio` times.
RfResult rf_image_check_plausible(const char *file, int64_t needed, size_t size, int64_t ratio);

/// True if the bytes begin with the signature, or, being fewer but at least two, are its beginning.
bool rf_image_has_signature(const uint8_t *bytes, size_t size, const char *signature, size_t length);
