// SPDX-License-Identifier: Apache-2.0
#include "flow_fuzz.h"

RF_FUZZ_FLOW(rf_flow_format_flo, false)
