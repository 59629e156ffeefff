// SPDX-License-Identifier: Apache-2.0
// Every long call tells its stage and how far it is, and can be stopped anywhere without leaving or losing anything.
#include "in/child.h"
#include "riffle/riffle.h"
#include "support/files.h"
#include "support/flow_files.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

/// A listener that says stop at its n-th report; 0: never.
typedef struct Listener
{
    int stop_at, reports, stages;
    char stage[64];
    double fraction;
    bool fell, left_range;
} Listener;

static bool listen_to(void *user, const char *stage, double fraction)
{
    Listener *listener = user;
    if (strcmp(stage, listener->stage) != 0)
        ++listener->stages;
    else if (fraction < listener->fraction)
        listener->fell = true;
    snprintf(listener->stage, sizeof listener->stage, "%s", stage);
    listener->fraction = fraction;
    listener->left_range |= !(fraction >= 0 && fraction <= 1);
    return ++listener->reports != listener->stop_at;
}

// ---- memory that is counted --------------------------------------------------------------------------------------

static int g_blocks;

static void *count_block(size_t bytes, size_t alignment, void *user)
{
    (void)user;
    __atomic_add_fetch(&g_blocks, 1, __ATOMIC_RELAXED);
    return aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
}

static void forget_block(void *memory, void *user)
{
    (void)user;
    __atomic_sub_fetch(&g_blocks, 1, __ATOMIC_RELAXED);
    free(memory);
}

// ---- the calls ---------------------------------------------------------------------------------------------------

static float g_velocity[2 * 32 * 32], g_pixels[3 * 64 * 64];

static RfFlowView turning(double time)
{
    for (int k = 0; k < 32 * 32; ++k)
    {
        g_velocity[2 * k] = (float)(16 - k / 32) / 16;
        g_velocity[2 * k + 1] = (float)(k % 32 - 16) / 16;
    }
    return (RfFlowView){.width = 32, .height = 32, .velocity = g_velocity, .time = time};
}

static RfImageView frame(void)
{
    return (RfImageView){.width = 64, .height = 64, .channels = 3, .row_stride = 192, .pixels = g_pixels};
}

static RfResult draw_exemplar(const char *name)
{
    RfImage *image = NULL;
    RfResult result = rf_image_read(name, &image);
    assert_int_equal(image != NULL, result == RF_OK);
    rf_image_destroy(image);
    return result;
}

static RfResult draw_lava(void)
{
    return draw_exemplar("builtin:lava?size=96");
}

static RfResult draw_noise(void)
{
    return draw_exemplar("builtin:noise?size=96");
}

static RfResult start_flow(const char *name, int frame_number)
{
    RfFlow *flow = NULL;
    RfResult result = rf_flow_open(name, NULL, &flow);
    assert_int_equal(flow != NULL, result == RF_OK);
    RfFlowView view;
    if (result == RF_OK)
        result = rf_flow_at(flow, frame_number, &view);
    rf_flow_close(flow);
    return result;
}

static RfResult start_river(void)
{
    return start_flow("builtin:river?size=128x64", 1);
}

static RfResult start_cylinder(void)
{
    return start_flow("builtin:cylinder?size=64x64&reynolds=100", 3);
}

static RfResult start_turbulence(void)
{
    return start_flow("builtin:turbulence?size=32", 5);
}

static RfResult draw_streamlines(void)
{
    RfFlowView view = turning(1);
    RfFlowPictureOptions options = rf_flow_picture_defaults();
    options.picture = RF_FLOW_LIC;
    RfImageView to = frame();
    return rf_flow_picture(&view, &options, &to);
}

static RfResult draw_relief(void)
{
    static float heights[48 * 48], colours[3 * 48 * 48];
    RfImageView height = {.width = 48, .height = 48, .channels = 1, .row_stride = 48, .pixels = heights};
    RfImageView colour = {.width = 48, .height = 48, .channels = 3, .row_stride = 144, .pixels = colours};
    RfImageView to = frame();
    return rf_render_relief(&height, &colour, 0.2f, &to);
}

typedef struct Call
{
    const char *stage;
    RfResult (*make)(void);
} Call;

static const Call g_calls[] = {
    {"drawing the exemplar", draw_lava},       {"drawing the exemplar", draw_noise},
    {"finding the river's flow", start_river}, {"running the flow", start_cylinder},
    {"running the flow", start_turbulence},    {"drawing streamlines", draw_streamlines},
    {"drawing the relief", draw_relief},
};

enum
{
    CALLS = sizeof g_calls / sizeof g_calls[0]
};

static RfResult listened(const Call *call, Listener *listener)
{
    RfProgress progress = {listen_to, listener};
    rf_set_progress(&progress);
    RfResult result = call->make();
    rf_set_progress(NULL);
    return result;
}

static void long_calls_name_their_stage_and_their_fractions_grow_from_0_to_1(void **state)
{
    (void)state;
    for (int i = 0; i < CALLS; ++i)
    {
        Listener listener = {0};
        assert_int_equal(listened(&g_calls[i], &listener), RF_OK);
        assert_true(listener.reports >= 3);
        assert_string_equal(listener.stage, g_calls[i].stage);
        assert_true(listener.stages <= 2);
        assert_false(listener.fell);
        assert_false(listener.left_range);
    }
}

static void a_call_stopped_at_any_report_is_cancelled_loses_no_memory_and_works_again(void **state)
{
    (void)state;
    const RfAllocator counting = {count_block, forget_block, NULL};
    rf_set_allocator(&counting);
    for (int i = 0; i < CALLS; ++i)
    {
        Listener all = {0};
        assert_int_equal(listened(&g_calls[i], &all), RF_OK);
        int before = g_blocks;
        for (int n = 1; n <= all.reports; n += 1 + all.reports / 12)
        {
            Listener listener = {.stop_at = n};
            assert_int_equal(listened(&g_calls[i], &listener), RF_CANCELLED);
            assert_int_equal(listener.reports, n);
            assert_int_equal(rf_last_error()->result, RF_CANCELLED);
            assert_non_null(strstr(rf_last_error()->message, listener.stage));
            assert_int_equal(g_blocks, before);
        }
        assert_int_equal(g_calls[i].make(), RF_OK);
    }
    rf_set_allocator(NULL);
}

static void a_stopped_picture_leaves_the_frame_as_it_was(void **state)
{
    (void)state;
    for (int i = CALLS - 2; i < CALLS; ++i)
    {
        Listener all = {0}, listener = {0};
        assert_int_equal(listened(&g_calls[i], &all), RF_OK);
        listener.stop_at = all.reports;
        for (int k = 0; k < 3 * 64 * 64; ++k)
            g_pixels[k] = 7;
        assert_int_equal(listened(&g_calls[i], &listener), RF_CANCELLED);
        for (int k = 0; k < 3 * 64 * 64; ++k)
            assert_true(g_pixels[k] == 7);
    }
}

static void a_flow_stopped_on_its_way_goes_on_with_the_same_bytes(void **state)
{
    (void)state;
    static float wanted[2 * 32 * 32];
    RfFlow *flow = NULL;
    RfFlowView view;
    assert_int_equal(rf_flow_open("builtin:turbulence?size=32", NULL, &flow), RF_OK);
    assert_int_equal(rf_flow_at(flow, 30, &view), RF_OK);
    memcpy(wanted, view.velocity, sizeof wanted);
    assert_int_equal(rf_flow_at(flow, 1, &view), RF_OK);
    Listener listener = {.stop_at = 11};
    RfProgress progress = {listen_to, &listener};
    rf_set_progress(&progress);
    assert_int_equal(rf_flow_at(flow, 30, &view), RF_CANCELLED);
    rf_set_progress(NULL);
    assert_int_equal(rf_flow_at(flow, 30, &view), RF_OK);
    assert_memory_equal(wanted, view.velocity, sizeof wanted);
    rf_flow_close(flow);
}

static void a_stopped_warp_step_changes_nothing(void **state)
{
    (void)state;
    static float wanted[3 * 64 * 64];
    RfImage *image = NULL;
    RfExemplar *exemplar = NULL;
    RfWarp *warps[2];
    RfWarpOptions options = rf_warp_defaults();
    assert_int_equal(rf_image_read("builtin:checker?size=64", &image), RF_OK);
    RfMapView map = {.name = "colour", .image = rf_image_view(image), .kind = RF_MAP_COLOUR, .weight = 1};
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar), RF_OK);
    RfImageView to = frame();
    for (int i = 0; i < 2; ++i)
    {
        assert_int_equal(rf_warp_create(exemplar, &options, &warps[i]), RF_OK);
        for (int time = 1; time <= 3; ++time)
        {
            RfFlowView view = turning(time);
            Listener listener = {.stop_at = 1};
            RfProgress progress = {listen_to, &listener};
            rf_set_progress(&progress);
            if (i == 1)
                assert_int_equal(rf_warp_step(warps[i], &view, &to), RF_CANCELLED);
            rf_set_progress(NULL);
            assert_int_equal(rf_warp_step(warps[i], &view, &to), RF_OK);
        }
        if (i == 0)
            memcpy(wanted, g_pixels, sizeof wanted);
        rf_warp_destroy(warps[i]);
    }
    assert_memory_equal(wanted, g_pixels, sizeof wanted);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
}

static RfResult never_ends(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)source, (void)moment, (void)out;
    while (getppid() > 0)
        pause();
    return RF_OK;
}

static void a_reader_that_hangs_in_its_process_is_stopped_within_a_second(void **state)
{
    (void)state;
    RfFlowSource source = {.path = "hangs.nc"};
    RfFlowMoment moment = {0};
    Listener listener = {.stop_at = 3};
    RfProgress progress = {listen_to, &listener};
    struct timespec start, end;
    clock_gettime(CLOCK_MONOTONIC, &start);
    rf_set_progress(&progress);
    assert_int_equal(rf_child_read(never_ends, "a library", &source, 0, &moment), RF_CANCELLED);
    rf_set_progress(NULL);
    clock_gettime(CLOCK_MONOTONIC, &end);
    assert_true((double)(end.tv_sec - start.tv_sec) + 1e-9 * (double)(end.tv_nsec - start.tv_nsec) < 1);
    assert_string_equal(listener.stage, "reading the flow");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(long_calls_name_their_stage_and_their_fractions_grow_from_0_to_1),
        cmocka_unit_test(a_call_stopped_at_any_report_is_cancelled_loses_no_memory_and_works_again),
        cmocka_unit_test(a_stopped_picture_leaves_the_frame_as_it_was),
        cmocka_unit_test(a_flow_stopped_on_its_way_goes_on_with_the_same_bytes),
        cmocka_unit_test(a_stopped_warp_step_changes_nothing),
        cmocka_unit_test(a_reader_that_hangs_in_its_process_is_stopped_within_a_second),
    };
    return cmocka_run_group_tests_name("progress", tests, NULL, NULL);
}
