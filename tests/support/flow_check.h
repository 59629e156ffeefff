// SPDX-License-Identifier: Apache-2.0
// What tests of the readers of flows share: a folder, the bytes of the file at hand, and checks of what was read.
// Header only, since the support library does without cmocka.
#pragma once

#include "riffle/riffle.h"
#include "support/files.h"
#include "support/flow_files.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static TestFolder folder;
static TestBytes file;

static inline int make_folder(void **state)
{
    (void)state;
    folder = test_folder_make();
    return 0;
}

static inline int remove_folder(void **state)
{
    (void)state;
    test_folder_remove(&folder);
    return 0;
}

static inline const char *save(const char *name)
{
    const char *path = test_folder_file(&folder, name);
    assert_true(test_file_write(path, file.data, file.size));
    return path;
}

static inline RfFlow *open_flow(const char *path, const RfFlowReadOptions *options)
{
    RfFlow *flow = NULL;
    if (rf_flow_open(path, options, &flow) != RF_OK)
        fail_msg("%s: %s: %s", path, rf_last_error()->place, rf_last_error()->message);
    return flow;
}

// The first moment of a file with everything at its default.
static inline RfFlow *open_first(const char *path, RfFlowView *view)
{
    RfFlow *flow = open_flow(path, NULL);
    assert_int_equal(rf_flow_at(flow, rf_flow_info(flow).first_frame, view), RF_OK);
    return flow;
}

static inline void assert_velocity(const RfFlowView *view, int x, int y, double u, double v)
{
    const float *cell = view->velocity + 2 * (y * view->width + x);
    if (fabs((double)cell[0] - u) > 1e-5 * (fabs(u) + 1e-3) || fabs((double)cell[1] - v) > 1e-5 * (fabs(v) + 1e-3))
        fail_msg("velocity at %d, %d is %g, %g instead of %g, %g", x, y, (double)cell[0], (double)cell[1], u, v);
}

static inline void assert_refused(const char *path, const RfFlowReadOptions *options, RfResult result,
                                  const char *message)
{
    RfFlow *flow = (RfFlow *)1;
    assert_int_equal(rf_flow_open(path, options, &flow), result);
    assert_null(flow);
    assert_string_equal(rf_last_error()->file, path);
    if (!strstr(rf_last_error()->message, message))
        fail_msg("\"%s\" does not say \"%s\"", rf_last_error()->message, message);
}

static inline bool no_netcdf(void)
{
    RfFlow *flow;
    file.size = 0;
    test_bytes_add(&file, "CDF\1", 4);
    return rf_flow_open(save("probe.nc"), NULL, &flow) == RF_UNSUPPORTED;
}

// [2 moments][2 rows][3 columns][2], every number different and exact as a half.
static double numbers[24];

static inline void fill_numbers(void)
{
    for (int k = 0; k < 24; ++k)
        numbers[k] = 0.5 * k - 4;
}

static const char *const grid_names[] = {"time", "lat", "lon"};
