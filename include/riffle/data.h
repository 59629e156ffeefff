// SPDX-License-Identifier: Apache-2.0
// Images, exemplars and flows: what goes into the methods and comes out of them.
//
// Views borrow and never free. Objects (RfImage, RfExemplar) own, and their destroy functions accept NULL.
#pragma once

#include "base.h"

/// Largest width and height of an image or a flow; larger ones are refused at the door.
#define RF_MAX_SIZE 32768
/// Most channels of an image.
#define RF_MAX_CHANNELS 64
/// Most maps, and most channels over all maps, of an exemplar.
#define RF_MAX_MAPS 8
#define RF_MAX_EXEMPLAR_CHANNELS 16

typedef struct RfVec2
{
    float x, y;
} RfVec2;

/// Borrowed pixels. Shape [height][width][channels], row 0 at the top, channels interleaved; colour first, alpha last
/// and not premultiplied. A C-ordered float32 NumPy array of that shape fits without a copy.
typedef struct RfImageView
{
    float *pixels;
    int width, height, channels;
    /// Floats from one row to the next; at least width * channels.
    ptrdiff_t row_stride;
} RfImageView;

/// How a sample was stored in its file, and is to be stored again.
typedef enum RfSampleFormat
{
    RF_SAMPLE_U8,
    RF_SAMPLE_U16,
    RF_SAMPLE_HALF,
    RF_SAMPLE_FLOAT
} RfSampleFormat;

/// What the numbers mean. Matching and blending of colour run on sRGB-encoded values; data is never converted.
typedef enum RfEncoding
{
    RF_ENCODING_SRGB,
    RF_ENCODING_LINEAR,
    RF_ENCODING_DATA
} RfEncoding;

/// An owned image, with what is known of its origin.
typedef struct RfImage RfImage;

/// All pixels 0; channels are named R G B A, Y or Y A by their number until rf_image_set_channel_name.
/// Format RF_SAMPLE_FLOAT and encoding RF_ENCODING_SRGB until set.
RF_API RF_MUST_USE RfResult rf_image_create(int width, int height, int channels, RfImage **out);
RF_API void rf_image_destroy(RfImage *image);
RF_API RfImageView rf_image_view(const RfImage *image);
RF_API RfSampleFormat rf_image_format(const RfImage *image);
RF_API RfEncoding rf_image_encoding(const RfImage *image);
RF_API void rf_image_set_origin(RfImage *image, RfSampleFormat format, RfEncoding encoding);
/// Up to 31 characters are kept. The pointer that rf_image_channel_name returns lives as long as the image.
RF_API void rf_image_set_channel_name(RfImage *image, int channel, const char *name);
RF_API const char *rf_image_channel_name(const RfImage *image, int channel);
/// True if the last channel is alpha: named "A", or the 2nd or 4th channel of an image with standard names.
RF_API bool rf_image_has_alpha(const RfImage *image);
/// Converts the colour channels (named R, G, B or Y) in place between sRGB-encoded and linear. Alpha and all others are
/// data and stay; so does an image of RF_ENCODING_DATA.
RF_API void rf_image_convert(RfImage *image, RfEncoding encoding);

/// One map of a material.
typedef enum RfMapKind
{
    /// 1 (grey) or 3 channels (RGB, sRGB-encoded), 0 to 1.
    RF_MAP_COLOUR,
    /// Any channels: height, roughness, temperature. Never converted.
    RF_MAP_DATA,
    /// 1 channel of opacity, 0 to 1. Blended without contrast preservation.
    RF_MAP_ALPHA,
    /// 3 channels in 0 to 1 standing for -1 to 1; x right, y up (as OpenGL normal maps), z out. Turned with the
    /// texture, normalised after blending.
    RF_MAP_NORMAL,
    /// 2 channels, x right and y down, any range. Turned with the texture.
    RF_MAP_VECTOR
} RfMapKind;

typedef struct RfMapView
{
    /// "colour", "height", "normal", ...: letters, digits and _; unique in the exemplar.
    const char *name;
    RfMapKind kind;
    /// All maps of one exemplar have one size. Borrowed: the exemplar copies what it needs.
    RfImageView image;
    /// Of the map's squared differences when areas are compared, >= 0. 1 is right for colour.
    float weight;
} RfMapView;

typedef enum RfTiling
{
    /// Yes if rows and columns continue across opposite borders as smoothly as inside.
    RF_TILING_AUTO,
    RF_TILING_NO,
    RF_TILING_YES
} RfTiling;

/// A material to texture with: registered maps of one size, kept together through every method. Immutable once made;
/// may be shared by any number of methods and threads, and must outlive them.
typedef struct RfExemplar RfExemplar;

/// Copies the maps. Refuses sizes under 8 x 8, NaN and infinity (with the place).
RF_API RF_MUST_USE RfResult rf_exemplar_create(const RfMapView *maps, int map_count, RfTiling tiling, RfExemplar **out);
RF_API void rf_exemplar_destroy(RfExemplar *exemplar);
/// Channels are those of all maps, in the order given: a frame made from the exemplar has as many.
RF_API int rf_exemplar_width(const RfExemplar *exemplar);
RF_API int rf_exemplar_height(const RfExemplar *exemplar);
RF_API int rf_exemplar_channels(const RfExemplar *exemplar);
RF_API bool rf_exemplar_tiles(const RfExemplar *exemplar);
/// How rough the borders are where opposite ones meet, over the inside: the mean square of second differences, of the
/// rougher pair of borders. About 1 where the exemplar continues; RF_TILING_AUTO takes up to 1.5 as tiling.
RF_API float rf_exemplar_border_roughness(const RfExemplar *exemplar);
RF_API int rf_exemplar_map_count(const RfExemplar *exemplar);
/// The map as it was given; `image` is a view into the exemplar's own pixels, and first_channel (may be NULL) its place
/// in a frame.
RF_API RfMapView rf_exemplar_map(const RfExemplar *exemplar, int index, int *first_channel);

/// How pictures that overlap are summed. Not every method has every form.
typedef enum RfBlend
{
    /// Weighted mean: loses contrast where pictures overlap (equation 2 of Yu and others 2009).
    RF_BLEND_PLAIN,
    /// Keeps mean and variance (equation 3 with its root and mean put back).
    RF_BLEND_CONTRAST,
    /// Keeps the whole histogram: blends Gaussianised colours and maps them back (Heitz and Neyret 2018).
    RF_BLEND_HISTOGRAM
} RfBlend;

/// A flow round one moment. Velocity in flow cells a frame, x right and y DOWN; sample (i, j) sits at the centre of
/// cell (i, j). Frame and flow cover the same domain whatever their sizes.
///
/// Between two moments the velocity changes linearly; before the first and after the second it stays as it is.
typedef struct RfFlowView
{
    int width, height;
    /// Shape [height][width][2], C order: the velocity at time `velocity_time`.
    const float *velocity;
    /// The same at `next_time`. NULL: the flow does not change.
    const float *next_velocity;
    /// In frames.
    double velocity_time, next_time;
    /// Shape [height][width]; 0 is outside the fluid, anything else inside. NULL: fluid everywhere.
    const uint8_t *mask;
    /// The moment to move to, in frames.
    double time;
} RfFlowView;
