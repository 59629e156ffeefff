// SPDX-License-Identifier: Apache-2.0
// Every run forks, as in use: what the NetCDF library does to its own process cannot be seen here, only that we
// survive.
#include "flow_fuzz.h"

RF_FUZZ_FLOW(rf_flow_format_netcdf, true)
