// SPDX-License-Identifier: Apache-2.0
#include "kernels/coordinates.h"
#include "riffle/riffle.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    SMALL = 8,
    LARGE = 200
};

typedef struct Heap
{
    int calls, fail_at, blocks;
} Heap;

static void *take(size_t bytes, size_t alignment, void *user)
{
    Heap *heap = user;
    void *memory = NULL;
    if (++heap->calls == heap->fail_at || posix_memalign(&memory, alignment, bytes) != 0)
        return NULL;
    ++heap->blocks;
    return memory;
}

static void give(void *memory, void *user)
{
    Heap *heap = user;
    heap->blocks -= memory != NULL;
    free(memory);
}

// The left half is fluid, in cells, and moves right.
static RfFlowView half_land(double time)
{
    static const float velocity[2 * 4] = {1, 0, 1, 0, 1, 0, 1, 0};
    static const uint8_t mask[4] = {1, 0, 1, 0};
    return (RfFlowView){
        .width = 2, .height = 2, .velocity = velocity, .mask = mask, .velocity_time = 0, .next_time = 1, .time = time};
}

static void after_a_first_step_without_memory_one_of_another_size_goes_well(void **state)
{
    (void)state;
    for (int n = 1; n <= 3; ++n)
    {
        Heap heap = {.fail_at = n};
        rf_set_allocator(&(RfAllocator){take, give, &heap});
        RfCoordinates c = {.sets = 2};
        RfFlowView first = half_land(0), second = half_land(0.25);
        assert_int_equal(rf_coordinates_move(&c, "test", &first, SMALL, SMALL), RF_OUT_OF_MEMORY);
        assert_int_equal(rf_coordinates_move(&c, "test", &first, LARGE, LARGE), RF_OK);
        assert_int_equal(rf_coordinates_move(&c, "test", &second, LARGE, LARGE), RF_OK);
        // Land shows what the shore does, in the last row as in the first.
        for (int x = LARGE / 2; x < LARGE; ++x)
        {
            RfVec2 shore = rf_coordinates_offset(&c, 1, LARGE / 2 - 1, LARGE - 1);
            RfVec2 land = rf_coordinates_offset(&c, 1, x, LARGE - 1);
            assert_true(land.x == shore.x && land.y == shore.y);
        }
        rf_coordinates_free(&c);
        rf_set_allocator(NULL);
        assert_int_equal(heap.blocks, 0);
    }
}

static void a_saved_state_that_ends_before_it_starts_is_refused(void **state)
{
    (void)state;
    for (int late = 0; late < 2; ++late)
    {
        RfCoordinates c = {.sets = 1}, loaded = {.sets = 1};
        RfFlowView flow = half_land(0.5);
        assert_int_equal(rf_coordinates_move(&c, "test", &flow, SMALL, SMALL), RF_OK);
        c.start += late;
        void *block;
        size_t size;
        assert_int_equal(rf_coordinates_save(&c, "test", 7, &block, &size), RF_OK);
        assert_int_equal(rf_coordinates_load(&loaded, "test", 7, block, size), late ? RF_BAD_INPUT : RF_OK);
        rf_coordinates_free(&c);
        rf_coordinates_free(&loaded);
        rf_free(block);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(after_a_first_step_without_memory_one_of_another_size_goes_well),
        cmocka_unit_test(a_saved_state_that_ends_before_it_starts_is_refused),
    };
    rf_set_threads(1);
    return cmocka_run_group_tests_name("kernels_coordinates", tests, NULL, NULL);
}
