// SPDX-License-Identifier: Apache-2.0
// One frame in the forms the outputs want it.
#pragma once

#include "layout.h"

/// The colour and alpha of a frame, sRGB-encoded, as PNG takes them. *out is NULL where the frame already is that; the
/// caller destroys it. A frame without colour is refused.
int frame_colour(const RfImage *pixels, const Layout *layout, const char *output, RfImage **out);
/// 1, 3 or 4 channels for a video; grey with alpha is laid over black.
int frame_picture(const RfImage *pixels, const Layout *layout, const char *output, RfImage **out);
/// Prints "md5  frame" on stdout, over the pixels as floats.
int frame_md5(const RfImage *pixels, int frame);
int flow_md5(const RfFlowView *flow, int frame);
/// Writes a PGM, a PPM or (with alpha) a PAM to stdout, 8 or 16 bit as the exemplar.
int frame_pnm(const RfImage *pixels, const Layout *layout);
