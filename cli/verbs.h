// SPDX-License-Identifier: Apache-2.0
// The verbs' bodies: each returns an exit code.
#pragma once

#include "options.h"

int run_texture(Settings *settings);
int run_synth(Settings *settings);
const RfOption *synth_option_table(int *count);
int run_render(Settings *settings);
int run_measure(Settings *settings);
int run_convert(Settings *settings);
int run_info(Settings *settings);
