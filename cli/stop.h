// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and termination: the first asks the run to stop, the second ends the program at once.
#pragma once

/// Also ignores SIGPIPE and SIGXFSZ, so that a closed pipe or a full quota comes back as a failed write.
void stop_install(void);
/// The signal that asked, 0 if none did.
int stop_asked(void);
