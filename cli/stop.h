// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and termination: the first asks the run to stop, the second ends the program at once.
#pragma once

#include <stdbool.h>

/// Also ignores SIGPIPE and SIGXFSZ, so that a closed pipe or a full quota comes back as a failed write.
void stop_install(void);
/// The signal that asked, 0 if none did.
int stop_asked(void);
/// Seconds since it asked.
double stop_age(void);
/// While nothing is written yet, a signal ends the program within a second whatever it is doing.
void stop_is_harmless(bool harmless);
