// SPDX-License-Identifier: Apache-2.0
// Flows and exemplars shared by tests and benchmarks: made from formulas, of any size, the same bytes every time.
#pragma once

#include "riffle/data.h"

/// Writes velocity[h][w][2], in cells a frame, y down.
typedef void SceneFlow(int w, int h, double frame, float *velocity);

/// Two wandering counter-rotating Lamb-Oseen vortices with shear: unsteady, incompressible, at most 3 cells a frame
/// whatever the size, with inflow and outflow at the borders.
void scene_two_vortices(int w, int h, double frame, float *velocity);
/// 2.25 cells right and 1.5 up a frame.
void scene_translation(int w, int h, double frame, float *velocity);
/// Clockwise on the screen about the middle, one turn in 120 frames.
void scene_rotation(int w, int h, double frame, float *velocity);

void scene_uniform(int w, int h, RfVec2 v, float *velocity);

/// Two moments of a scene, kept for a view.
typedef struct SceneMoments
{
    SceneFlow *flow;
    int w, h;
    float *before, *after;
} SceneMoments;

SceneMoments scene_moments(SceneFlow *flow, int w, int h);
/// The step from frame - 1 to frame, as rf_flow_at gives it. Borrowed until the next call.
RfFlowView scene_step(SceneMoments *moments, double frame);
void scene_moments_free(SceneMoments *moments);

/// grey[h][w], 0 to 1, mean 0.5: noise of random phase whose spectrum is flat between two frequencies in cycles a pixel
/// and empty elsewhere. Wraps. w and h even.
void scene_noise(int w, int h, float low, float high, uint64_t seed, float *grey);

/// How much longer along x than along y the features of pixels[][stride][3]'s first channel are, within [x0, x1) x
/// [y0, y1). The pixels around are read too.
double scene_elongation(const float *pixels, int stride, int x0, int y0, int x1, int y1);

/// A tiling exemplar of three channels of such noise, partly alike, 0 to 1.
RfExemplar *scene_noise_exemplar(int size, uint64_t seed);
