// SPDX-License-Identifier: Apache-2.0
// What Lagrangian texture advection takes from the heap: nothing once it runs steadily, no more after a thousand frames
// than after three hundred, and it survives being given nothing.
#include "core/random.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"

#include <execinfo.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#if TEST_SANITIZED || !defined(__GLIBC__)
#define NO_HEAP_COUNT
#endif

enum
{
    N = 128,
    PIXELS = N * N,
    MAX_FRAMES = 24
};

static float g_frame[3 * PIXELS], g_before[3 * PIXELS];

// ---- every call to the heap of this program, counted

static atomic_bool g_counting;
static atomic_int g_calls;
static void *g_culprit[MAX_FRAMES];
static int g_culprit_depth;

#ifndef NO_HEAP_COUNT
// Seen by shared libraries too, so that those of the thread library count.
#define EVERYWHERE __attribute__((visibility("default")))

extern void *__libc_malloc(size_t);
extern void *__libc_calloc(size_t, size_t);
extern void *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);
extern void __libc_free(void *);

// The first one keeps its call stack.
static void count_call(void)
{
    if (atomic_load(&g_counting) && atomic_fetch_add(&g_calls, 1) == 0)
        g_culprit_depth = backtrace(g_culprit, MAX_FRAMES);
}

EVERYWHERE void *malloc(size_t size)
{
    count_call();
    return __libc_malloc(size);
}

EVERYWHERE void *calloc(size_t count, size_t size)
{
    count_call();
    return __libc_calloc(count, size);
}

EVERYWHERE void *realloc(void *memory, size_t size)
{
    count_call();
    return __libc_realloc(memory, size);
}

EVERYWHERE void *memalign(size_t alignment, size_t size)
{
    count_call();
    return __libc_memalign(alignment, size);
}

EVERYWHERE void *aligned_alloc(size_t alignment, size_t size)
{
    count_call();
    return __libc_memalign(alignment, size);
}

EVERYWHERE int posix_memalign(void **memory, size_t alignment, size_t size)
{
    count_call();
    *memory = __libc_memalign(alignment, size);
    return *memory ? 0 : 12;
}

EVERYWHERE void free(void *memory)
{
    if (memory)
        count_call();
    __libc_free(memory);
}
#endif

static RfLagrangian *make(const RfExemplar *exemplar, float radius, RfBlend blend)
{
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.particle_radius = radius;
    options.blend = blend;
    RfLagrangian *lagrangian = NULL;
    assert_int_equal(rf_lagrangian_create(exemplar, &options, &lagrangian), RF_OK);
    return lagrangian;
}

// Steps to frame `last`; returns how many calls to the heap there were in frames after `first_counted`.
static int run_counting(RfLagrangian *lagrangian, SceneMoments *moments, int first, int last, int first_counted,
                        bool tell)
{
    RfImageView frame = {g_frame, N, N, 3, 3 * N};
    int calls = 0;
    for (int f = first; f <= last; ++f)
    {
        RfFlowView view = scene_step(moments, f);
        atomic_store(&g_calls, 0);
        atomic_store(&g_counting, f > first_counted);
        RfResult result = rf_lagrangian_step(lagrangian, &view, &frame);
        atomic_store(&g_counting, false);
        assert_int_equal(result, RF_OK);
        if (tell && calls == 0 && atomic_load(&g_calls) > 0)
        {
            fprintf(stderr, "frame %d: %d calls to the heap, the first from\n", f, atomic_load(&g_calls));
            backtrace_symbols_fd(g_culprit, g_culprit_depth, STDERR_FILENO);
        }
        calls += atomic_load(&g_calls);
    }
    return calls;
}

static void a_steady_step_takes_nothing_from_the_heap(void **state)
{
    (void)state;
#ifdef NO_HEAP_COUNT
    print_message("skipped: the heap belongs to a sanitizer, or is not the GNU one\n");
    skip();
#endif
    // Its first use loads a library.
    backtrace(g_culprit, MAX_FRAMES);
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    SceneMoments moments = scene_moments(scene_two_vortices, N, N);
    rf_set_threads(2);
    for (int blend = RF_BLEND_PLAIN; blend <= RF_BLEND_HISTOGRAM; ++blend)
    {
        RfLagrangian *lagrangian = make(exemplar, 16, (RfBlend)blend);
        // The count works: the first frames do take from it.
        assert_true(run_counting(lagrangian, &moments, 1, 2, 0, false) > 0);
        assert_int_equal(run_counting(lagrangian, &moments, 3, 300, 240, true), 0);
        rf_lagrangian_destroy(lagrangian);
    }
    rf_set_threads(0);
    scene_moments_free(&moments);
    rf_exemplar_destroy(exemplar);
}

// ---- the library's own blocks, counted and refused

typedef struct Heap
{
    atomic_size_t live_bytes;
    atomic_int live_blocks, calls;
    // The number of the call that fails, and whether all later ones do; 0: none.
    int fail_at;
    bool fail_after;
} Heap;

static void *heap_allocate(size_t bytes, size_t alignment, void *user)
{
    Heap *heap = user;
    int call = atomic_fetch_add(&heap->calls, 1) + 1;
    if (heap->fail_at > 0 && (call == heap->fail_at || (heap->fail_after && call > heap->fail_at)))
        return NULL;
    // The size lies before the block.
    uint8_t *memory = NULL;
    assert_true(alignment <= 64);
    if (posix_memalign((void **)&memory, 64, bytes + 64) != 0)
        return NULL;
    memcpy(memory, &bytes, sizeof bytes);
    atomic_fetch_add(&heap->live_bytes, bytes);
    atomic_fetch_add(&heap->live_blocks, 1);
    return memory + 64;
}

static void heap_release(void *memory, void *user)
{
    Heap *heap = user;
    size_t bytes;
    memcpy(&bytes, (uint8_t *)memory - 64, sizeof bytes);
    atomic_fetch_sub(&heap->live_bytes, bytes);
    atomic_fetch_sub(&heap->live_blocks, 1);
    free((uint8_t *)memory - 64);
}

static Heap g_heap;

static int use_heap(void **state)
{
    (void)state;
    g_heap = (Heap){0};
    rf_set_allocator(&(RfAllocator){heap_allocate, heap_release, &g_heap});
    return 0;
}

static int return_heap(void **state)
{
    (void)state;
    rf_set_allocator(NULL);
    return 0;
}

static void memory_after_a_thousand_frames_is_what_it_was_after_three_hundred(void **state)
{
    (void)state;
    enum
    {
        SMALL = 64,
        FRAMES = TEST_SANITIZED ? 500 : 1000
    };
    RfExemplar *exemplar = scene_noise_exemplar(64, 1);
    SceneMoments moments = scene_moments(scene_two_vortices, SMALL, SMALL);
    RfLagrangian *lagrangian = make(exemplar, 12, RF_BLEND_CONTRAST);
    RfImageView frame = {g_frame, SMALL, SMALL, 3, 3 * SMALL};
    size_t early = 0;
    for (int f = 1; f <= FRAMES; ++f)
    {
        RfFlowView view = scene_step(&moments, f);
        assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
        if (f == 300)
            early = atomic_load(&g_heap.live_bytes);
    }
    size_t late = atomic_load(&g_heap.live_bytes);
    print_message("%zu bytes after 300 frames, %zu after %d\n", early, late, FRAMES);
    assert_true(early > 0 && late <= early);
    rf_lagrangian_destroy(lagrangian);
    scene_moments_free(&moments);
    rf_exemplar_destroy(exemplar);
    assert_int_equal(atomic_load(&g_heap.live_blocks), 0);
}

// The n-th call fails from here on.
static void fail_at(int n, bool after)
{
    atomic_store(&g_heap.calls, 0);
    g_heap.fail_at = n;
    g_heap.fail_after = after;
}

static bool has_failed(void)
{
    return atomic_load(&g_heap.calls) >= g_heap.fail_at;
}

static RfExemplar *small_exemplar(void)
{
    static float pixels[16 * 16 * 3];
    for (size_t k = 0; k < sizeof pixels / sizeof *pixels; ++k)
        pixels[k] = rf_random_float(1, 0, k, 0);
    RfMapView map = {"colour", RF_MAP_COLOUR, {pixels, 16, 16, 3, 48}, 1};
    RfExemplar *exemplar = NULL;
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_YES, &exemplar), RF_OK);
    return exemplar;
}

static void creating_without_memory_fails_and_leaves_none_behind(void **state)
{
    (void)state;
    RfExemplar *exemplar = small_exemplar();
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.blend = RF_BLEND_HISTOGRAM;
    int before = atomic_load(&g_heap.live_blocks), n = 1;
    for (bool created = false; !created; ++n)
    {
        assert_true(n < 1000);
        RfLagrangian *lagrangian = (RfLagrangian *)1;
        fail_at(n, n % 2);
        RfResult result = rf_lagrangian_create(exemplar, &options, &lagrangian);
        created = !has_failed();
        g_heap.fail_at = 0;
        assert_int_equal(result, created ? RF_OK : RF_OUT_OF_MEMORY);
        if (created)
            rf_lagrangian_destroy(lagrangian);
        else
            assert_null(lagrangian);
        assert_int_equal(atomic_load(&g_heap.live_blocks), before);
    }
    assert_true(n > 5);
    rf_exemplar_destroy(exemplar);
}

// The step of frame `failing` meets a heap that fails at its n-th call; later ones have memory again.
static bool survive_step(const RfExemplar *exemplar, SceneMoments *moments, int failing, int n)
{
    int side = moments->w;
    RfLagrangian *lagrangian = make(exemplar, 12, RF_BLEND_CONTRAST);
    RfImageView frame = {g_frame, side, side, 3, 3 * side};
    bool failed = false;
    for (int f = 1; f <= failing + 1; ++f)
    {
        RfFlowView view = scene_step(moments, f);
        for (int k = 0; k < 3 * side * side; ++k)
            g_frame[k] = g_before[k] = -(float)f;
        if (f == failing)
            fail_at(n, n % 2);
        RfResult result = rf_lagrangian_step(lagrangian, &view, &frame);
        failed = failed || (f == failing && has_failed());
        g_heap.fail_at = 0;
        // A scratch arena that could not grow goes to the heap again: slower, not wrong.
        assert_true(result == RF_OK || (f == failing && failed && result == RF_OUT_OF_MEMORY));
        if (result != RF_OK)
            assert_memory_equal(g_frame, g_before, (size_t)(3 * side * side) * sizeof(float));
        else
            for (int k = 0; k < 3 * side * side; ++k)
                assert_true(g_frame[k] >= 0 && g_frame[k] <= 1);
    }
    assert_int_equal(rf_lagrangian_stats(lagrangian).holes, 0);
    rf_lagrangian_destroy(lagrangian);
    return failed;
}

static void a_step_without_memory_fails_keeps_the_frame_and_can_be_followed_by_others(void **state)
{
    (void)state;
    RfExemplar *exemplar = small_exemplar();
    SceneMoments moments = scene_moments(scene_two_vortices, 40, 40);
    int before = atomic_load(&g_heap.live_blocks);
    rf_set_threads(2);
    for (int failing = 1; failing <= 4; failing += 3)
        for (int n = 1; survive_step(exemplar, &moments, failing, n); ++n)
        {
            assert_true(n < 3000);
            assert_int_equal(atomic_load(&g_heap.live_blocks), before);
        }
    rf_set_threads(0);
    scene_moments_free(&moments);
    rf_exemplar_destroy(exemplar);
}

static void saving_and_loading_without_memory_fail_alike(void **state)
{
    (void)state;
    RfExemplar *exemplar = small_exemplar();
    RfLagrangianOptions options = rf_lagrangian_defaults();
    options.particle_radius = 12;
    RfLagrangian *lagrangian = make(exemplar, 12, RF_BLEND_CONTRAST), *loaded = NULL;
    SceneMoments moments = scene_moments(scene_two_vortices, 40, 40);
    RfImageView frame = {g_frame, 40, 40, 3, 120};
    RfFlowView view = scene_step(&moments, 1);
    assert_int_equal(rf_lagrangian_step(lagrangian, &view, &frame), RF_OK);
    void *block = NULL;
    size_t size = 0;
    fail_at(1, true);
    assert_int_equal(rf_lagrangian_save(lagrangian, &block, &size), RF_OUT_OF_MEMORY);
    g_heap.fail_at = 0;
    assert_null(block);
    assert_int_equal(rf_lagrangian_save(lagrangian, &block, &size), RF_OK);
    int before = atomic_load(&g_heap.live_blocks);
    bool failed = true;
    for (int n = 1; failed; ++n)
    {
        fail_at(n, false);
        RfResult result = rf_lagrangian_load(exemplar, &options, block, size, &loaded);
        failed = has_failed();
        g_heap.fail_at = 0;
        assert_int_equal(result, failed ? RF_OUT_OF_MEMORY : RF_OK);
        if (!failed)
            rf_lagrangian_destroy(loaded);
        assert_int_equal(atomic_load(&g_heap.live_blocks), before);
    }
    rf_free(block);
    scene_moments_free(&moments);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_steady_step_takes_nothing_from_the_heap),
        cmocka_unit_test_setup_teardown(memory_after_a_thousand_frames_is_what_it_was_after_three_hundred, use_heap,
                                        return_heap),
        cmocka_unit_test_setup_teardown(creating_without_memory_fails_and_leaves_none_behind, use_heap, return_heap),
        cmocka_unit_test_setup_teardown(a_step_without_memory_fails_keeps_the_frame_and_can_be_followed_by_others,
                                        use_heap, return_heap),
        cmocka_unit_test_setup_teardown(saving_and_loading_without_memory_fail_alike, use_heap, return_heap),
    };
    return cmocka_run_group_tests_name("lagrangian memory", tests, NULL, NULL);
}
