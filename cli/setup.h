// SPDX-License-Identifier: Apache-2.0
// What goes on before the first frame: opening inputs, drawing exemplars. Told where it lasts, ended by a signal.
#pragma once

#include "options.h"

/// From here on the library reports to the user.
void setup_begin(const Settings *settings);
/// Before the first frame, and again at the program's end: does nothing the second time. True: it had not ended yet.
bool setup_end(void);
