// SPDX-License-Identifier: Apache-2.0
// Still textures: what any of them is.
#include "support/optimize_check.h"
#include "support/sanitized.h"
#include "support/scarce.h"

// ---- bytes

static void bytes_are_the_same_for_any_number_of_threads(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, 3, 8};
    for (int k = 0; k < 2; ++k)
    {
        RfExemplar *exemplar = spotted_exemplar(44, 37, 3, k ? RF_TILING_YES : RF_TILING_NO);
        RfOptimizeOptions options = rf_optimize_defaults();
        options.form = k ? RF_FORM_MEAN : RF_FORM_DISCRETE;
        options.search = k ? RF_SEARCH_EXACT : RF_SEARCH_COHERENCE;
        options.tile = k;
        float *first = NULL;
        if (TEST_SANITIZED)
            options.windows[0] = 9, options.windows[1] = 0;
        for (int i = 0; i < 4; i += 1 + TEST_SANITIZED)
        {
            rf_set_threads(threads[i]);
            float *pixels = still_of(exemplar, &options, NULL, 61, 54);
            if (first)
                assert_memory_equal(pixels, first, 61 * 54 * 3 * sizeof *pixels);
            if (first)
                free(pixels);
            else
                first = pixels;
        }
        free(first);
        rf_exemplar_destroy(exemplar);
    }
    rf_set_threads(1);
}

static void another_seed_gives_another_picture_and_the_same_the_same(void **state)
{
    (void)state;
    RfExemplar *exemplar = spotted_exemplar(40, 40, 1, RF_TILING_NO);
    RfOptimizeOptions options = rf_optimize_defaults();
    float *a = still_of(exemplar, &options, NULL, 48, 48), *b = still_of(exemplar, &options, NULL, 48, 48);
    options.seed = 2;
    float *c = still_of(exemplar, &options, NULL, 48, 48);
    assert_memory_equal(a, b, 48 * 48 * sizeof *a);
    assert_memory_not_equal(a, c, 48 * 48 * sizeof *a);
    free(a);
    free(b);
    free(c);
    rf_exemplar_destroy(exemplar);
}

// ---- pixels

// The second map says where a pixel of the exemplar lies, and is not compared.
static void every_pixel_of_the_discrete_form_is_one_of_the_exemplar_all_maps_in_register(void **state)
{
    (void)state;
    enum
    {
        W = 45,
        H = 39
    };
    float *colour = spots(W, H, 3, 4), *place = numbers_of(W, H, 2);
    for (int i = 0; i < W * H; ++i)
        place[2 * i] = (float)(i % W), place[2 * i + 1] = (float)(i / W);
    RfMapView maps[] = {{"colour", RF_MAP_COLOUR, picture_of(colour, W, H, 3), 1},
                        {"place", RF_MAP_DATA, picture_of(place, W, H, 2), 0}};
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfExemplar *exemplar = exemplar_of(maps, 2, tiles ? RF_TILING_YES : RF_TILING_NO);
        RfOptimizeOptions options = rf_optimize_defaults();
        options.tile = tiles;
        float *pixels = still_of(exemplar, &options, NULL, 80, 50);
        static int used[W * H];
        int different = 0;
        memset(used, 0, sizeof used);
        for (int i = 0; i < 80 * 50; ++i)
        {
            const float *p = pixels + 5 * i;
            int x = (int)p[3], y = (int)p[4];
            assert_true(p[3] == (float)x && p[4] == (float)y && x >= 0 && x < W && y >= 0 && y < H);
            assert_memory_equal(p, colour + 3 * (y * W + x), 3 * sizeof *p);
            different += used[y * W + x]++ == 0;
        }
        // Not one piece over and over.
        assert_true(different > W * H / 3);
        free(pixels);
        rf_exemplar_destroy(exemplar);
    }
    free(colour);
    free(place);
}

static void a_constant_exemplar_gives_a_constant_picture(void **state)
{
    (void)state;
    for (int form = 0; form < 2; ++form)
    {
        float *grey = numbers_of(32, 32, 3);
        for (int i = 0; i < 32 * 32 * 3; ++i)
            grey[i] = 0.2f + 0.3f * (float)(i % 3);
        RfMapView map = {"colour", RF_MAP_COLOUR, picture_of(grey, 32, 32, 3), 1};
        RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_AUTO);
        RfOptimizeOptions options = rf_optimize_defaults();
        options.form = form;
        float *pixels = still_of(exemplar, &options, NULL, 50, 41);
        for (int i = 0; i < 50 * 41 * 3; ++i)
            assert_true(fabsf(pixels[i] - grey[i % 3]) < 1e-6f);
        free(pixels);
        free(grey);
        rf_exemplar_destroy(exemplar);
    }
}

// Powers of two change no rounding.
static void a_picture_goes_with_the_unit_of_its_exemplar(void **state)
{
    (void)state;
    static const float factors[] = {1, 0x1p-40f, 0x1p+36f, -0x1p+3f};
    float *pixels = spots(32, 32, 2, 3), *scaled = numbers_of(32, 32, 2), *first = NULL;
    for (int k = 0; k < 4; ++k)
    {
        for (int i = 0; i < 32 * 32 * 2; ++i)
            scaled[i] = pixels[i] * factors[k];
        RfMapView map = {"data", RF_MAP_DATA, picture_of(scaled, 32, 32, 2), 1};
        RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
        RfOptimizeOptions options = rf_optimize_defaults();
        float *made = still_of(exemplar, &options, NULL, 40, 40);
        for (int i = 0; i < 40 * 40 * 2 && first; ++i)
            assert_true(made[i] == first[i] * factors[k]);
        if (first)
            free(made);
        else
            first = made;
        rf_exemplar_destroy(exemplar);
    }
    free(first);
    free(scaled);
    free(pixels);
}

// ---- sizes

static void check_size(int width, int height, int channels, int to_width, int to_height)
{
    RfExemplar *exemplar = spotted_exemplar(width, height, channels, RF_TILING_NO);
    RfOptimizeOptions options = rf_optimize_defaults();
    float *pixels = still_of(exemplar, &options, NULL, to_width, to_height);
    RfMapView map = rf_exemplar_map(exemplar, 0, NULL);
    for (int i = 0; i < to_width * to_height; i += to_width * to_height / 50 + 1)
    {
        bool found = false;
        for (int k = 0; k < width * height && !found; ++k)
            found =
                memcmp(pixels + i * channels, map.image.pixels + k * channels, (size_t)channels * sizeof *pixels) == 0;
        assert_true(found);
    }
    free(pixels);
    rf_exemplar_destroy(exemplar);
}

static void any_exemplar_makes_pictures_of_any_size(void **state)
{
    (void)state;
    static const int sizes[][5] = {{16, 16, 1, 64, 64}, {17, 33, 3, 40, 50}, {33, 17, 2, 8, 8},   {8, 8, 1, 33, 20},
                                   {9, 70, 3, 70, 9},   {64, 64, 3, 8, 8},   {64, 64, 1, 9, 100}, {40, 40, 16, 48, 48}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; ++i)
        check_size(sizes[i][0], sizes[i][1], sizes[i][2], sizes[i][3], sizes[i][4]);
}

static void a_large_exemplar_makes_a_small_picture(void **state)
{
    (void)state;
    check_size(TEST_SANITIZED ? 300 : 1024, TEST_SANITIZED ? 300 : 1024, 1, 32, 24);
}

// ---- options

static void refuse(const RfExemplar *exemplar, const RfOptimizeOptions *options, const char *message)
{
    static float pixels[32 * 32];
    RfImageView view = picture_of(pixels, 32, 32, 1);
    memset(pixels, 7, sizeof pixels);
    static float before[32 * 32];
    memcpy(before, pixels, sizeof before);
    assert_int_equal(rf_optimize_still(exemplar, options, NULL, &view), RF_INVALID_ARGUMENT);
    if (!strstr(rf_last_error()->message, message))
        fail_msg("\"%s\" does not say \"%s\"", rf_last_error()->message, message);
    assert_memory_equal(before, pixels, sizeof before);
}

static void options_out_of_range_are_refused_by_name(void **state)
{
    (void)state;
#ifdef RF_STOP_ON_MISUSE
    skip();
#else
    RfExemplar *exemplar = spotted_exemplar(32, 32, 1, RF_TILING_NO);
    const RfOptimizeOptions good = rf_optimize_defaults();
    RfOptimizeOptions options = good;
    options.struct_size = 0;
    refuse(exemplar, &options, "rf_optimize_defaults");
    options = good, options.levels = 11;
    refuse(exemplar, &options, "levels");
    options = good, options.levels = -1;
    refuse(exemplar, &options, "levels");
    options = good, options.iterations = 0;
    refuse(exemplar, &options, "iterations");
    options = good, options.iterations = 101;
    refuse(exemplar, &options, "iterations");
    options = good, options.spread = NAN;
    refuse(exemplar, &options, "spread");
    options = good, options.spread = -0.1f;
    refuse(exemplar, &options, "spread");
    options = good, options.similar = 9;
    refuse(exemplar, &options, "similar");
    options = good, options.similar = 0;
    refuse(exemplar, &options, "similar");
    options = good, options.form = (RfOptimizeForm)2;
    refuse(exemplar, &options, "form");
    options = good, options.search = (RfOptimizeSearch)7;
    refuse(exemplar, &options, "search");
    static const int windows[][RF_MAX_OPTIMIZE_WINDOWS] = {{0}, {8}, {3}, {35}, {17, 9, 7, 10}, {-5}};
    for (size_t i = 0; i < sizeof windows / sizeof *windows; ++i)
    {
        options = good;
        memcpy(options.windows, windows[i], sizeof windows[i]);
        refuse(exemplar, &options, "windows");
    }
    refuse(exemplar, NULL, "NULL");
    refuse(NULL, &good, "NULL");
    rf_exemplar_destroy(exemplar);
#endif
}

static void every_edge_of_every_option_makes_a_picture(void **state)
{
    (void)state;
    RfExemplar *exemplar = spotted_exemplar(32, 30, 1, RF_TILING_NO);
    int count;
    const RfOption *table = rf_optimize_option_table(&count);
    for (int i = 0; i < 2 * count; ++i)
    {
        RfOptimizeOptions options = rf_optimize_defaults();
        const RfOption *o = &table[i / 2];
        void *field = (uint8_t *)&options + o->offset;
        double value = i % 2 ? o->maximum : o->minimum;
        if (o->kind == RF_OPTION_FLOAT)
            *(float *)field = (float)value;
        else if (o->kind == RF_OPTION_UINT64)
            *(uint64_t *)field = i % 2 ? UINT64_MAX : 0;
        else if (o->kind == RF_OPTION_BOOL)
            *(bool *)field = value != 0;
        else
            *(int *)field = TEST_SANITIZED ? rf_min_int((int)value, 35) : (int)value;
        free(still_of(exemplar, &options, NULL, 36, 33));
    }
    static const int windows[][RF_MAX_OPTIMIZE_WINDOWS] = {{5}, {33}, {33, 17, 9, 5}, {5, 33}, {7, 7, 7, 7}};
    for (size_t i = 0; i < sizeof windows / sizeof *windows; ++i)
    {
        RfOptimizeOptions options = rf_optimize_defaults();
        memcpy(options.windows, windows[i], sizeof windows[i]);
        free(still_of(exemplar, &options, NULL, 36, 33));
    }
    rf_exemplar_destroy(exemplar);
}

// A map of weight 0 alone leaves nothing to compare.
static void what_cannot_be_compared_is_bad_input(void **state)
{
    (void)state;
    float *pixels = spots(32, 32, 1, 2), out[32 * 32] = {0};
    RfMapView map = {"spots", RF_MAP_DATA, picture_of(pixels, 32, 32, 1), 0};
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
    RfOptimizeOptions options = rf_optimize_defaults();
    RfImageView view = picture_of(out, 32, 32, 1);
    assert_int_equal(rf_optimize_still(exemplar, &options, NULL, &view), RF_BAD_INPUT);
    rf_exemplar_destroy(exemplar);
    free(pixels);
}

// ---- stopping

typedef struct Reports
{
    int count, last;
    double fraction;
    bool falls;
} Reports;

static bool count_reports(void *user, const char *stage, double fraction)
{
    Reports *r = user;
    assert_true(stage[0] != '\0');
    r->falls |= fraction < r->fraction;
    r->fraction = fraction;
    return ++r->count <= r->last;
}

static void a_call_stopped_anywhere_leaves_the_picture_as_it_was(void **state)
{
    (void)state;
    RfExemplar *exemplar = spotted_exemplar(40, 40, 1, RF_TILING_NO);
    RfOptimizeOptions options = rf_optimize_defaults();
    float *whole = still_of(exemplar, &options, NULL, 40, 40), *pixels = numbers_of(40, 40, 1);
    RfImageView view = picture_of(pixels, 40, 40, 1);
    int stop = 0;
    for (RfResult result = RF_CANCELLED; result == RF_CANCELLED; ++stop)
    {
        Reports reports = {.last = stop};
        RfProgress progress = {count_reports, &reports};
        for (int i = 0; i < 40 * 40; ++i)
            pixels[i] = -3;
        rf_set_progress(&progress);
        result = rf_optimize_still(exemplar, &options, NULL, &view);
        rf_set_progress(NULL);
        assert_true(result == RF_OK || result == RF_CANCELLED);
        assert_false(reports.falls);
        for (int i = 0; i < 40 * 40 && result == RF_CANCELLED; ++i)
            assert_true(pixels[i] == -3);
        if (result == RF_OK)
            assert_true(fabs(reports.fraction - 1) < 1e-9);
    }
    // One that went through is as if nobody had asked.
    assert_memory_equal(whole, pixels, 40 * 40 * sizeof *pixels);
    assert_true(stop > 8);
    free(whole);
    free(pixels);
    rf_exemplar_destroy(exemplar);
}

static void any_allocation_may_fail_and_nothing_leaks_or_is_drawn(void **state)
{
    (void)state;
    float pixels[24 * 20], turns[24 * 20] = {0};
    RfImageView view = picture_of(pixels, 24, 20, 1);
    RfOptimizeOptions options = rf_optimize_defaults();
    options.iterations = 1;
    for (int turned = 0; turned < 2; ++turned)
    {
        scarce_begin(SCARCE_PLENTY);
        RfExemplar *exemplar = spotted_exemplar(24, 24, 1, RF_TILING_NO);
        int before = scarce_live(), needed = 0;
        RfOptimizeConstraints constraints = {.target = picture_of(turns, 24, 20, 1)};
        if (turned)
            constraints.orientation = picture_of(turns, 24, 20, 1);
        RfResult result = RF_OUT_OF_MEMORY;
        for (; needed < 4000 && result != RF_OK; ++needed)
        {
            pixels[0] = pixels[24 * 20 - 1] = -3;
            scarce_allow(needed);
            result = rf_optimize_still(exemplar, &options, &constraints, &view);
            assert_true(result == RF_OK || result == RF_OUT_OF_MEMORY);
            assert_int_equal(scarce_live(), before);
            if (result != RF_OK)
                assert_true(pixels[0] == -3 && pixels[24 * 20 - 1] == -3);
        }
        rf_exemplar_destroy(exemplar);
        scarce_end();
        print_message("%d allocations\n", needed);
        assert_true(needed > 20 && needed < 4000);
    }
}

// Many threads on few pictures of a few thousand pixels wait for each other most of the time.
static int one_thread(void **state)
{
    (void)state;
    rf_set_threads(1);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bytes_are_the_same_for_any_number_of_threads),
        cmocka_unit_test(another_seed_gives_another_picture_and_the_same_the_same),
        cmocka_unit_test(every_pixel_of_the_discrete_form_is_one_of_the_exemplar_all_maps_in_register),
        cmocka_unit_test(a_constant_exemplar_gives_a_constant_picture),
        cmocka_unit_test(a_picture_goes_with_the_unit_of_its_exemplar),
        cmocka_unit_test(any_exemplar_makes_pictures_of_any_size),
        cmocka_unit_test(a_large_exemplar_makes_a_small_picture),
        cmocka_unit_test(options_out_of_range_are_refused_by_name),
        cmocka_unit_test(every_edge_of_every_option_makes_a_picture),
        cmocka_unit_test(what_cannot_be_compared_is_bad_input),
        cmocka_unit_test(a_call_stopped_anywhere_leaves_the_picture_as_it_was),
        cmocka_unit_test(any_allocation_may_fail_and_nothing_leaks_or_is_drawn),
    };
    return cmocka_run_group_tests_name("optimize", tests, one_thread, NULL);
}
