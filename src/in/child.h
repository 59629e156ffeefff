// SPDX-License-Identifier: Apache-2.0
// Runs a reader in a process of its own, for libraries that may crash, hang or eat the memory on a damaged file.
#pragma once

#include "in/flow_format.h"

typedef RfResult RfChildReadFn(const RfFlowSource *source, int moment, RfFlowMoment *out);

/// As calling `read` here, but a crash, more than a minute of processor time or several GiB of memory come back as
/// RF_BAD_INPUT. `library` names the culprit in the message.
RfResult rf_child_read(RfChildReadFn *read, const char *library, const RfFlowSource *source, int moment,
                       RfFlowMoment *out);
