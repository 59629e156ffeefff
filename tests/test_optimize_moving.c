// SPDX-License-Identifier: Apache-2.0
// The moving form of texture optimisation.
#include "core/saved_state.h"
#include "kernels/nearest_known.h"
#include "methods/optimize/moving.h"
#include "riffle/riffle.h"
#include "support/scarce.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    SIDE = 64,
    NUMBERS = SIDE * SIDE * 3,
    FRAMES = 5
};

static RfExemplar *make_exemplar(void)
{
    return scene_noise_exemplar(48, 1);
}

static int channels_of(const RfExemplar *exemplar)
{
    return rf_optimize_channels(exemplar);
}

// One velocity everywhere, in pixels a frame.
static void uniform(float *velocity, float u, float v)
{
    for (int i = 0; i < SIDE * SIDE; ++i)
    {
        velocity[2 * i] = u;
        velocity[2 * i + 1] = v;
    }
}

static void rotation(float *velocity, float radians)
{
    for (int y = 0; y < SIDE; ++y)
        for (int x = 0; x < SIDE; ++x)
        {
            velocity[2 * (y * SIDE + x)] = -radians * ((float)y - 0.5f * (SIDE - 1));
            velocity[2 * (y * SIDE + x) + 1] = radians * ((float)x - 0.5f * (SIDE - 1));
        }
}

// Wears the texture out in two or three frames.
static void shear(float *velocity)
{
    for (int i = 0; i < SIDE * SIDE; ++i)
    {
        velocity[2 * i] = 0.3f * ((float)(i / SIDE) - 0.5f * (SIDE - 1));
        velocity[2 * i + 1] = 0;
    }
}

static void step(RfOptimize *o, const float *velocity, const uint8_t *mask, int time, int channels, float *pixels)
{
    RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity, .mask = mask, .time = time};
    RfImageView frame = {pixels, SIDE, SIDE, channels, (ptrdiff_t)SIDE * channels};
    assert_int_equal(rf_optimize_step(o, &flow, &frame), RF_OK);
}

static RfOptimize *make(const RfExemplar *exemplar)
{
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 2;
    RfOptimize *o = NULL;
    assert_int_equal(rf_optimize_create(exemplar, &options, &o), RF_OK);
    return o;
}

static void run(const RfExemplar *exemplar, const float *velocity, int frames, float *pixels)
{
    RfOptimize *o = make(exemplar);
    for (int f = 0; f < frames; ++f)
        step(o, velocity, NULL, f, channels_of(exemplar), pixels);
    rf_optimize_destroy(o);
}

static void a_flow_that_stands_still_leaves_the_texture_as_it_is(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], first[NUMBERS], later[NUMBERS];
    uniform(velocity, 0, 0);
    run(exemplar, velocity, 1, first);
    run(exemplar, velocity, 2, later);
    assert_memory_equal(first, later, (size_t)(SIDE * SIDE * channels_of(exemplar)) * sizeof *first);
    rf_exemplar_destroy(exemplar);
}

static void a_whole_shift_moves_the_texture_by_whole_pixels(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], first[NUMBERS], later[NUMBERS];
    uniform(velocity, 2, 0);
    run(exemplar, velocity, 1, first);
    run(exemplar, velocity, 4, later);
    int channels = channels_of(exemplar), same = 0, all = 0;
    for (int y = 8; y < SIDE - 8; ++y)
        for (int x = 20; x < SIDE - 8; ++x, ++all)
            same += memcmp(first + (y * SIDE + x - 6) * channels, later + (y * SIDE + x) * channels,
                           (size_t)channels * sizeof *first) == 0;
    if (same < all * 3 / 4)
        fail_msg("%d of %d pixels moved with the flow", same, all);
    rf_exemplar_destroy(exemplar);
}

static void the_bytes_do_not_depend_on_threads(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], one[NUMBERS], many[NUMBERS];
    shear(velocity);
    static const int threads[] = {2, 3, 8};
    rf_set_threads(1);
    run(exemplar, velocity, FRAMES, one);
    for (int i = 0; i < 3; ++i)
    {
        rf_set_threads(threads[i]);
        run(exemplar, velocity, FRAMES, many);
        assert_memory_equal(one, many, (size_t)(SIDE * SIDE * channels_of(exemplar)) * sizeof *one);
    }
    rf_set_threads(0);
    rf_exemplar_destroy(exemplar);
}

static void a_state_goes_on_with_the_same_bytes_and_a_damaged_one_is_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], whole[NUMBERS], resumed[NUMBERS];
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 2;
    shear(velocity);
    for (int cut = 0; cut < FRAMES; ++cut)
    {
        int channels = channels_of(exemplar);
        RfOptimize *o = make(exemplar), *loaded = NULL;
        for (int f = 0; f < cut; ++f)
            step(o, velocity, NULL, f, channels, whole);
        void *block = NULL;
        size_t size = 0;
        assert_int_equal(rf_optimize_save(o, &block, &size), RF_OK);
        assert_int_equal(rf_optimize_load(exemplar, &options, block, size, &loaded), RF_OK);
        for (int f = cut; f < FRAMES; ++f)
        {
            step(o, velocity, NULL, f, channels, whole);
            step(loaded, velocity, NULL, f, channels, resumed);
            assert_memory_equal(whole, resumed, (size_t)(SIDE * SIDE * channels) * sizeof *whole);
        }
        assert_true(rf_optimize_stats(o).patches > 0);
        // The same moment once more is drawn, and no more.
        step(o, velocity, NULL, FRAMES - 1, channels, resumed);
        assert_memory_equal(whole, resumed, (size_t)(SIDE * SIDE * channels) * sizeof *whole);
        assert_int_equal(rf_optimize_stats(o).patches, 0);
        rf_optimize_destroy(loaded);
        ((uint8_t *)block)[size - 1] ^= 1;
        assert_int_equal(rf_optimize_load(exemplar, &options, block, size, &loaded), RF_BAD_INPUT);
        assert_int_equal(rf_optimize_load(exemplar, &options, block, size / 2, &loaded), RF_BAD_INPUT);
        assert_null(loaded);
        rf_free(block);
        rf_optimize_destroy(o);
    }
    rf_exemplar_destroy(exemplar);
}

enum
{
    // Bytes of a state's header and of a marker in it, and where numbers lie in them.
    HEADER = 72,
    TIME = 56,
    DISTANCE = 64,
    RECORD = 44,
    AT = 0,
    SOURCE = 12,
    BEND = 16,
    SHARE = 32,
    CONTINUED = 36,
    PIXEL = 40
};

// As if it had been saved like this.
static void sign(uint8_t *block, size_t size)
{
    RfStateHead head;
    memcpy(&head, block, sizeof head);
    rf_state_seal(block, size, "optimize", head.version, head.inputs);
}

static RfResult load_changed(const RfExemplar *exemplar, const uint8_t *block, size_t size, size_t offset,
                             const void *value, size_t bytes)
{
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 2;
    uint8_t *copy = malloc(size);
    RfOptimize *loaded = NULL;
    assert_non_null(copy);
    memcpy(copy, block, size);
    memcpy(copy + offset, value, bytes);
    sign(copy, size);
    RfResult result = rf_optimize_load(exemplar, &options, copy, size, &loaded);
    rf_optimize_destroy(loaded);
    free(copy);
    return result;
}

static void a_state_with_a_true_hash_and_absurd_numbers_is_refused(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], pixels[NUMBERS];
    RfOptimize *o = make(exemplar);
    shear(velocity);
    for (int f = 0; f < FRAMES; ++f)
        step(o, velocity, NULL, f, channels_of(exemplar), pixels);
    void *block = NULL;
    size_t size = 0;
    assert_int_equal(rf_optimize_save(o, &block, &size), RF_OK);
    const size_t marker = HEADER + 100 * RECORD, fading = HEADER + (size_t)SIDE * SIDE * RECORD;
    assert_true(size > fading);
    assert_int_equal(load_changed(exemplar, block, size, marker + PIXEL, &(int32_t){100}, 4), RF_OK);
    static const double doubles[] = {NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; ++i)
    {
        const float number = (float)doubles[i];
        static const size_t places[] = {AT, SOURCE, BEND, SHARE, CONTINUED};
        assert_int_equal(load_changed(exemplar, block, size, TIME, &doubles[i], 8), RF_BAD_INPUT);
        assert_int_equal(load_changed(exemplar, block, size, DISTANCE, &doubles[i], 8), RF_BAD_INPUT);
        for (int k = 0; k < 5; ++k)
        {
            assert_int_equal(load_changed(exemplar, block, size, marker + places[k], &number, 4), RF_BAD_INPUT);
            assert_int_equal(load_changed(exemplar, block, size, fading + places[k], &number, 4), RF_BAD_INPUT);
        }
    }
    // Of a pixel that another marker lies in, nowhere, and seen not at all or more than that.
    static const int32_t foreign[] = {99, -1, SIDE * SIDE};
    for (int i = 0; i < 3; ++i)
        assert_int_equal(load_changed(exemplar, block, size, marker + PIXEL, &foreign[i], 4), RF_BAD_INPUT);
    assert_int_equal(load_changed(exemplar, block, size, marker + AT, &(float){1e5f}, 4), RF_BAD_INPUT);
    assert_int_equal(load_changed(exemplar, block, size, marker + SHARE, &(float){0}, 4), RF_BAD_INPUT);
    assert_int_equal(load_changed(exemplar, block, size, fading + SHARE, &(float){2}, 4), RF_BAD_INPUT);
    assert_int_equal(load_changed(exemplar, block, size, marker + CONTINUED, &(float){-1}, 4), RF_BAD_INPUT);
    assert_int_equal(load_changed(exemplar, block, size, DISTANCE, &(double){1e300}, 8), RF_BAD_INPUT);
    rf_free(block);
    rf_optimize_destroy(o);
    rf_exemplar_destroy(exemplar);
}

static void land_is_zero_and_every_fluid_pixel_is_drawn(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], pixels[NUMBERS];
    static uint8_t mask[SIDE * SIDE];
    int channels = channels_of(exemplar);
    shear(velocity);
    for (int i = 0; i < SIDE * SIDE; ++i)
        mask[i] = i % SIDE < 24;
    RfOptimize *o = make(exemplar);
    for (int f = 0; f < FRAMES; ++f)
    {
        memset(pixels, 0xff, sizeof pixels);
        step(o, velocity, mask, f, channels, pixels);
        for (int i = 0; i < SIDE * SIDE * channels; ++i)
            if (i / channels % SIDE >= 25)
                assert_true(pixels[i] == 0);
            else
                assert_true(isfinite(pixels[i]));
    }
    rf_optimize_destroy(o);
    rf_exemplar_destroy(exemplar);
}

static void a_frame_swept_empty_in_one_step_is_full_again(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], first[NUMBERS], later[NUMBERS];
    int channels = channels_of(exemplar);
    uniform(velocity, 1e5f, 0);
    run(exemplar, velocity, 1, first);
    run(exemplar, velocity, 2, later);
    // With nothing to continue the texture stays.
    int same = 0;
    for (int i = 0; i < SIDE * SIDE; ++i)
        same += memcmp(first + i * channels, later + i * channels, (size_t)channels * sizeof *first) == 0;
    assert_true(same > SIDE * SIDE * 9 / 10);
    rf_exemplar_destroy(exemplar);
}

// What flows in is laid anew before it was continued far: lines where pieces meet at the border stay short.
static void what_flows_in_is_renewed(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], pixels[NUMBERS];
    uniform(velocity, 3, 1);
    RfOptimize *o = make(exemplar);
    float farthest = 0;
    for (int f = 0; f < 60; ++f)
    {
        step(o, velocity, NULL, f, channels_of(exemplar), pixels);
        for (int i = 0; i < SIDE * SIDE; ++i)
            farthest = fmaxf(farthest, o->markers.pixels[i].continued);
    }
    // 180 pixels flowed in. The limit is 0.3 to 0.7 of a patch's reach; what is three times as worn cannot wait.
    assert_true(farthest > 3 && farthest < 3 * 0.7f * (float)o->outer + 4);
    rf_optimize_destroy(o);
    rf_exemplar_destroy(exemplar);
}

static bool same_place(const RfMarker *a, const RfMarker *b)
{
    return memcmp(&a->source, &b->source, sizeof a->source) == 0 && memcmp(&a->bend, &b->bend, sizeof a->bend) == 0;
}

// However often a pixel is laid over in one step.
static void what_fades_is_what_was_carried_there(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], pixels[NUMBERS];
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 2;
    options.orient = RF_ORIENT_NONE;
    RfOptimize *o = NULL, *carried = NULL;
    assert_int_equal(rf_optimize_create(exemplar, &options, &o), RF_OK);
    rotation(velocity, 0.3f);
    int fresh = 0;
    for (int f = 0; f < FRAMES; ++f)
    {
        void *block = NULL;
        size_t size = 0;
        assert_int_equal(rf_optimize_save(o, &block, &size), RF_OK);
        assert_int_equal(rf_optimize_load(exemplar, &options, block, size, &carried), RF_OK);
        step(o, velocity, NULL, f, channels_of(exemplar), pixels);
        RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity, .time = f};
        if (f > 0)
        {
            rf_markers_carry(&carried->markers, &flow, f - 1);
            rf_markers_fill(&carried->markers);
        }
        for (int i = 0; i < SIDE * SIDE && f > 0; ++i)
            if (o->fading.pixels[i].share > 0.6f) // of this step
            {
                assert_true(same_place(&o->fading.pixels[i], &carried->markers.pixels[i]));
                ++fresh;
            }
        rf_optimize_destroy(carried);
        rf_free(block);
    }
    assert_true(fresh > SIDE * SIDE / 2);
    rf_optimize_destroy(o);
    rf_exemplar_destroy(exemplar);
}

static bool stop(void *user, const char *stage, double fraction)
{
    (void)user, (void)stage, (void)fraction;
    return false;
}

static void a_stopped_step_changes_nothing(void **state)
{
    (void)state;
    RfExemplar *exemplar = make_exemplar();
    static float velocity[2 * SIDE * SIDE], wanted[NUMBERS], pixels[NUMBERS];
    const RfProgress stopping = {stop, NULL};
    int channels = channels_of(exemplar);
    shear(velocity);
    run(exemplar, velocity, FRAMES, wanted);
    RfOptimize *o = make(exemplar);
    for (int f = 0; f < FRAMES; ++f)
    {
        RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity, .time = f};
        rf_set_progress(&stopping);
        assert_int_equal(rf_optimize_advance(o, &flow, SIDE, SIDE), RF_CANCELLED);
        rf_set_progress(NULL);
        step(o, velocity, NULL, f, channels, pixels);
    }
    assert_memory_equal(wanted, pixels, (size_t)(SIDE * SIDE * channels) * sizeof *wanted);
    rf_optimize_destroy(o);
    rf_exemplar_destroy(exemplar);
}

// Created, moved, saved and loaded, until something fails.
static RfResult live(const RfExemplar *exemplar, const float *velocity, float *pixels)
{
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 1;
    options.windows[0] = 9;
    options.windows[1] = 0;
    options.orient = RF_ORIENT_FLOW;
    RfOptimize *o = NULL, *loaded = NULL;
    RfImageView frame = {pixels, 16, 16, 3, 16 * 3};
    void *block = NULL;
    size_t size = 0;
    int patches = 0;
    RfResult result = rf_optimize_create(exemplar, &options, &o);
    for (int f = 0; f < 7 && result == RF_OK; ++f)
    {
        RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity, .time = f};
        pixels[0] = -3;
        result = rf_optimize_step(o, &flow, &frame);
        assert_true((result == RF_OK) == (pixels[0] != -3));
        patches += rf_optimize_stats(o).patches;
    }
    if (result == RF_OK)
        result = rf_optimize_save(o, &block, &size);
    if (result == RF_OK)
        result = rf_optimize_load(exemplar, &options, block, size, &loaded);
    assert_true((result == RF_OK) == (loaded != NULL));
    rf_optimize_destroy(o);
    rf_optimize_destroy(loaded);
    rf_free(block);
    assert_true(patches > 0 || result != RF_OK);
    return result;
}

static void any_allocation_may_fail_and_nothing_leaks_or_is_drawn(void **state)
{
    (void)state;
    static float velocity[2 * SIDE * SIDE], pixels[16 * 16 * 3];
    shear(velocity);
    rf_set_threads(1);
    scarce_begin(SCARCE_PLENTY);
    RfExemplar *exemplar = scene_noise_exemplar(16, 1);
    int before = scarce_live(), needed = 0;
    RfResult result = RF_OUT_OF_MEMORY;
    for (; needed < 2000 && result != RF_OK; ++needed)
    {
        scarce_allow(needed);
        result = live(exemplar, velocity, pixels);
        assert_true(result == RF_OK || result == RF_OUT_OF_MEMORY);
        assert_int_equal(scarce_live(), before);
    }
    rf_exemplar_destroy(exemplar);
    scarce_end();
    rf_set_threads(0);
    assert_int_equal(result, RF_OK);
    assert_true(needed > 20);
}

static void an_absurd_flow_has_a_direction(void **state)
{
    (void)state;
    static float velocity[2 * SIDE * SIDE];
    static const float speeds[] = {1e-3f, 1, 1e20f, 3e38f};
    RfFlowView flow = {.width = SIDE, .height = SIDE, .velocity = velocity};
    for (int i = 0; i < 4; ++i)
    {
        // Twice as wide a frame as the flow: what it shows lies flatter.
        uniform(velocity, speeds[i], -speeds[i]);
        RfVec2 turn = rf_optimize_downstream(&flow, 2 * SIDE, SIDE, (RfVec2){7, 9});
        assert_true(fabsf(turn.x - 2 / sqrtf(5)) < 1e-6f && fabsf(turn.y - 1 / sqrtf(5)) < 1e-6f);
    }
    uniform(velocity, 0, 0);
    RfVec2 turn = rf_optimize_downstream(&flow, SIDE, SIDE, (RfVec2){7, 9});
    assert_true(turn.x == 1 && turn.y == 0);
}

static void an_exemplar_with_a_guide_is_refused(void **state)
{
    (void)state;
    static float pixels[32 * 32 * 3];
    RfMapView maps[] = {{"colour", RF_MAP_COLOUR, {pixels, 32, 32, 3, 96}, 1},
                        {"guide", RF_MAP_DATA, {pixels, 32, 32, 3, 96}, 1}};
    RfExemplar *exemplar = NULL;
    RfOptimize *o = NULL;
    RfOptimizeOptions options = rf_optimize_defaults();
    assert_int_equal(rf_exemplar_create(maps, 2, RF_TILING_NO, &exemplar), RF_OK);
    assert_int_equal(rf_optimize_create(exemplar, &options, &o), RF_BAD_INPUT);
    assert_null(o);
    rf_exemplar_destroy(exemplar);
}

static void every_cell_finds_its_nearest_known_one(void **state)
{
    (void)state;
    enum
    {
        W = 37,
        H = 23
    };
    int32_t nearest[W * H];
    for (int known = 0; known <= 40; known += 5)
    {
        bool is_known[W * H] = {false};
        for (int i = 0; i < known; ++i)
            is_known[(i * 7919 + 31) % (W * H)] = true;
        for (int i = 0; i < W * H; ++i)
            nearest[i] = is_known[i] ? i : -1;
        rf_spread_nearest(nearest, W, H);
        int farther = 0;
        for (int i = 0; i < W * H; ++i)
        {
            int least = INT32_MAX;
            for (int k = 0; k < W * H; ++k)
                if (is_known[k])
                {
                    int dx = k % W - i % W, dy = k / W - i / W;
                    least = dx * dx + dy * dy < least ? dx * dx + dy * dy : least;
                }
            assert_true(known == 0 ? nearest[i] == -1 : is_known[nearest[i]]);
            int dx = known ? nearest[i] % W - i % W : 0, dy = known ? nearest[i] / W - i / W : 0;
            farther += known && dx * dx + dy * dy > least;
        }
        assert_true(farther <= W * H / 100);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_flow_that_stands_still_leaves_the_texture_as_it_is),
        cmocka_unit_test(a_whole_shift_moves_the_texture_by_whole_pixels),
        cmocka_unit_test(the_bytes_do_not_depend_on_threads),
        cmocka_unit_test(a_state_goes_on_with_the_same_bytes_and_a_damaged_one_is_refused),
        cmocka_unit_test(a_state_with_a_true_hash_and_absurd_numbers_is_refused),
        cmocka_unit_test(a_frame_swept_empty_in_one_step_is_full_again),
        cmocka_unit_test(what_flows_in_is_renewed),
        cmocka_unit_test(what_fades_is_what_was_carried_there),
        cmocka_unit_test(a_stopped_step_changes_nothing),
        cmocka_unit_test(any_allocation_may_fail_and_nothing_leaks_or_is_drawn),
        cmocka_unit_test(an_absurd_flow_has_a_direction),
        cmocka_unit_test(an_exemplar_with_a_guide_is_refused),
        cmocka_unit_test(every_cell_finds_its_nearest_known_one),
        cmocka_unit_test(land_is_zero_and_every_fluid_pixel_is_drawn),
    };
    return cmocka_run_group_tests_name("optimize moving", tests, NULL, NULL);
}
