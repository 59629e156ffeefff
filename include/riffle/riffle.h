// SPDX-License-Identifier: Apache-2.0
// Riffle textures things that flow, by example. This header brings all the others.
#pragma once

#include "base.h"
#include "data.h"
#include "directional.h"
#include "dual.h"
#include "eulerian.h"
#include "io.h"
#include "lagrangian.h"
#include "measure.h"
#include "optimize.h"
#include "render.h"
#include "sprites.h"
#include "warp.h"
