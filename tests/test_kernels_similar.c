// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/pyramid.h"
#include "kernels/similar.h"
#include "riffle/riffle.h"
#include "support/sanitized.h"
#include "support/scenes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    APRON = RF_FIXED_SIDE,
    HALF = RF_SIMILAR_SIDE / 2,
    // What places of a list keep between each other, along x or y.
    APART = HALF + 1,
    LEVELS = 3,
    MOST_SIDE = 128
};

typedef struct Pyramid
{
    bool tiles;
    int levels;
    RfFixedPicture picture[LEVELS];
    RfSimilar similar[LEVELS];
} Pyramid;

static float g_pixels[LEVELS][MOST_SIDE * MOST_SIDE];

// From g_pixels[0], a grey picture.
static void open_pyramid(Pyramid *p, int width, int height, bool tiles, int levels, int count)
{
    *p = (Pyramid){.tiles = tiles, .levels = levels};
    for (int l = 0; l < levels; ++l)
    {
        assert_int_equal(rf_fixed_create(width, height, 1, APRON, &p->picture[l]), RF_OK);
        rf_fixed_set(&p->picture[l], g_pixels[l], 500);
        rf_fixed_extend(&p->picture[l], tiles);
        if (l + 1 < levels)
            rf_halve(g_pixels[l], width, height, 1, tiles, g_pixels[l + 1]);
        width = (width + 1) / 2, height = (height + 1) / 2;
    }
    for (int l = levels - 1; l >= 0; --l)
        assert_int_equal(
            rf_similar_create(&p->picture[l], tiles, count, l + 1 < levels ? &p->similar[l + 1] : NULL, &p->similar[l]),
            RF_OK);
}

static void close_pyramid(Pyramid *p)
{
    for (int l = 0; l < p->levels; ++l)
    {
        rf_fixed_free(&p->picture[l]);
        rf_similar_free(&p->similar[l]);
    }
}

static void fill_noise(int width, int height, uint64_t seed)
{
    for (int i = 0; i < width * height; ++i)
        g_pixels[0][i] = rf_random_float(seed, 0, (uint64_t)i, 0) - 0.5f;
}

static int along(const Pyramid *p, int a, int b, int n)
{
    int d = abs(a - b);
    return p->tiles && n - d < d ? n - d : d;
}

static bool near(const Pyramid *p, int level, RfPlace a, RfPlace b)
{
    return along(p, a.x, b.x, p->picture[level].width) < APART && along(p, a.y, b.y, p->picture[level].height) < APART;
}

static double slow_distance(const RfFixedPicture *p, RfPlace a, RfPlace b)
{
    double sum = 0;
    for (int y = -HALF; y <= HALF; ++y)
        for (int x = -HALF; x <= HALF; ++x)
        {
            double d = *rf_fixed_at(p, a.x + x, a.y + y) - *rf_fixed_at(p, b.x + x, b.y + y);
            sum += d * d;
        }
    return sum;
}

// The nearest place to (x, y) whose window is whole.
static RfPlace place_of(const Pyramid *p, int level, int x, int y)
{
    const RfFixedPicture *picture = &p->picture[level];
    if (!p->tiles)
    {
        x = rf_clamp_int(x, HALF, picture->width - 1 - HALF);
        y = rf_clamp_int(y, HALF, picture->height - 1 - HALF);
    }
    return (RfPlace){(int16_t)x, (int16_t)y};
}

// The first of the best among all that are near neither the place itself nor any of the list.
static RfPlace slow_next(const Pyramid *p, int level, RfPlace own, const RfPlace *list, int count)
{
    const RfFixedPicture *picture = &p->picture[level];
    int margin = p->tiles ? 0 : HALF;
    double least = INFINITY;
    RfPlace best = own;
    for (int y = margin; y < picture->height - margin; ++y)
        for (int x = margin; x < picture->width - margin; ++x)
        {
            RfPlace place = {(int16_t)x, (int16_t)y};
            bool apart = !near(p, level, place, own);
            for (int i = 0; i < count; ++i)
                apart &= !near(p, level, place, list[i]);
            double distance = apart ? slow_distance(picture, own, place) : INFINITY;
            if (distance < least)
            {
                least = distance;
                best = place;
            }
        }
    return best;
}

static double list_distance(const Pyramid *p, int level, RfPlace own, const RfPlace *list, int count)
{
    double sum = 0;
    for (int k = 0; k < count; ++k)
        sum += slow_distance(&p->picture[level], own, list[k]);
    return sum;
}

// The best is the best of all. The others come from one walk over the picture, which may forget a place near one that
// is itself displaced later: they are as good as those of a search from the start for each, all but exactly.
static void on_the_coarsest_level_the_best_of_all_places_leads_its_list(void **state)
{
    (void)state;
    enum
    {
        W = 40,
        H = 37,
        COUNT = 4
    };
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        Pyramid p;
        double found_sum = 0, slow_sum = 0;
        scene_noise(W, H + 1, 0.03f, 0.2f, 11, g_pixels[0]);
        open_pyramid(&p, W, H, tiles, 1, COUNT);
        for (int y = 0; y < H; y += TEST_SANITIZED ? 12 : 4)
            for (int x = 0; x < W; x += 4)
            {
                RfPlace own = place_of(&p, 0, x, y), list[COUNT];
                const RfPlace *found = rf_similar_at(&p.similar[0], x, y);
                for (int k = 0; k < COUNT; ++k)
                    list[k] = slow_next(&p, 0, own, list, k);
                assert_true(list[0].x == found[0].x && list[0].y == found[0].y);
                found_sum += list_distance(&p, 0, own, found, COUNT);
                slow_sum += list_distance(&p, 0, own, list, COUNT);
            }
        print_message("%s: %.3f %% above the slow search\n", tiles ? "tiles" : "does not tile",
                      100 * (found_sum / slow_sum - 1));
        assert_true(found_sum < 1.005 * slow_sum);
        close_pyramid(&p);
    }
}

static void read_builtin(const char *name, int size)
{
    RfImage *image;
    assert_int_equal(rf_image_read(name, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x)
            g_pixels[0][y * size + x] = view.pixels[y * view.row_stride + x * view.channels] - 0.5f;
    rf_image_destroy(image);
}

typedef struct Loss
{
    /// Mean squared distances of what is listed first, of the true best, and of any place.
    double found, best, any;
} Loss;

static Loss loss_of(const char *name, int size, bool tiles, int count)
{
    Pyramid p;
    Loss loss = {0, 0, 0};
    read_builtin(name, size);
    open_pyramid(&p, size, size, tiles, LEVELS, count);
    for (uint64_t i = 0; i < 25; ++i)
    {
        int x = (int)rf_random_below((uint32_t)size, 3, 0, i, 0), y = (int)rf_random_below((uint32_t)size, 3, 0, i, 1);
        int u = (int)rf_random_below((uint32_t)size, 3, 0, i, 2), v = (int)rf_random_below((uint32_t)size, 3, 0, i, 3);
        RfPlace own = place_of(&p, 0, x, y);
        loss.found += slow_distance(&p.picture[0], own, *rf_similar_at(&p.similar[0], x, y));
        loss.best += slow_distance(&p.picture[0], own, slow_next(&p, 0, own, NULL, 0));
        loss.any += slow_distance(&p.picture[0], own, place_of(&p, 0, u, v));
    }
    close_pyramid(&p);
    print_message("%s, %s, lists of %d: %.2f times the true best; any place %.2f\n", name,
                  tiles ? "tiling" : "not tiling", count, loss.found / loss.best, loss.any / loss.best);
    return loss;
}

// Two levels above the coarsest. Lists of two lose a factor of two to three to a search through everything, lists of
// eight about two; a place at random would lose five to seven.
static void on_fine_levels_the_best_is_much_nearer_the_true_best_than_any_place(void **state)
{
    (void)state;
    static const char *const names[] = {"builtin:pebbles?size=96", "builtin:lava?size=96"};
    for (int i = 0; i < 4; ++i)
    {
        Loss two = loss_of(names[i / 2], 96, i % 2, 2), eight = loss_of(names[i / 2], 96, i % 2, 8);
        assert_true(two.found < 0.65 * two.any && two.found < 3.5 * two.best);
        assert_true(eight.found < 0.45 * eight.any && eight.found < 2.5 * eight.best);
    }
}

static void check_lists(const Pyramid *p, int level)
{
    const RfSimilar *similar = &p->similar[level];
    int w = similar->width, h = similar->height, whole = rf_min_int(RF_SIMILAR_SIDE, rf_min_int(w, h)), listed = 0;
    int margin = p->tiles ? 0 : (whole - 1) / 2;
    for (int y = 0; y < h; ++y)
        for (int x = 0; x < w; ++x)
        {
            const RfPlace *list = rf_similar_at(similar, x, y);
            RfPlace own = {(int16_t)x, (int16_t)y};
            if (!p->tiles)
                own = (RfPlace){(int16_t)rf_clamp_int(x, margin, w - 1 - margin),
                                (int16_t)rf_clamp_int(y, margin, h - 1 - margin)};
            for (int i = 0; i < similar->count; ++i)
            {
                assert_true(list[i].x >= margin && list[i].x < w - margin);
                assert_true(list[i].y >= margin && list[i].y < h - margin);
                if (list[i].x == own.x && list[i].y == own.y)
                    continue; // Nothing else was found.
                ++listed;
                assert_false(near(p, level, list[i], own));
                for (int j = 0; j < i; ++j)
                {
                    assert_false(near(p, level, list[i], list[j]));
                    // An end of the list, once there, stays.
                    assert_false(list[j].x == own.x && list[j].y == own.y);
                    if (whole == RF_SIMILAR_SIDE)
                        assert_true(slow_distance(&p->picture[level], own, list[j]) <=
                                    slow_distance(&p->picture[level], own, list[i]));
                }
            }
        }
    assert_true(listed > 0 || (w < 3 * APART && h < 3 * APART));
}

static void places_of_a_list_keep_apart_lie_inside_and_get_no_better(void **state)
{
    (void)state;
    static const int sizes[][2] = {{51, 34}, {33, 32}};
    for (size_t s = 0; s < 2; ++s)
        for (int tiles = 0; tiles < 2; ++tiles)
        {
            Pyramid p;
            fill_noise(sizes[s][0], sizes[s][1], 4);
            open_pyramid(&p, sizes[s][0], sizes[s][1], tiles, LEVELS - 1, RF_MAX_SIMILAR);
            for (int l = 0; l < p.levels; ++l)
                check_lists(&p, l);
            close_pyramid(&p);
        }
}

// No room for anything but the pixel itself, or for a whole window.
static void tiny_pictures_have_lists_too(void **state)
{
    (void)state;
    for (int w = 1; w <= 12; ++w)
        for (int h = 1; h <= 12; h += 3)
            for (int tiles = 0; tiles < 2; ++tiles)
            {
                Pyramid p;
                fill_noise(w, h, 5);
                open_pyramid(&p, w, h, tiles, w > 2 && h > 2 ? 2 : 1, 3);
                for (int l = 0; l < p.levels; ++l)
                    check_lists(&p, l);
                close_pyramid(&p);
            }
}

static void the_best_places_go_with_a_picture_that_is_shifted_round_its_borders(void **state)
{
    (void)state;
    enum
    {
        W = 31,
        H = 27,
        DX = 9,
        DY = 14
    };
    static float shifted[W * H];
    Pyramid a, b;
    fill_noise(W, H, 6);
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
            shifted[(y + DY) % H * W + (x + DX) % W] = g_pixels[0][y * W + x];
    open_pyramid(&a, W, H, true, 1, 1);
    memcpy(g_pixels[0], shifted, sizeof shifted);
    open_pyramid(&b, W, H, true, 1, 1);
    int same = 0;
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
        {
            RfPlace here = *rf_similar_at(&a.similar[0], x, y);
            RfPlace there = *rf_similar_at(&b.similar[0], (x + DX) % W, (y + DY) % H);
            same += (here.x + DX) % W == there.x && (here.y + DY) % H == there.y;
        }
    assert_int_equal(same, W * H);
    close_pyramid(&a);
    close_pyramid(&b);
}

// Many threads on small pictures wait for each other most of the time; bytes for any number are test_optimize's.
static int one_thread(void **state)
{
    (void)state;
    rf_set_threads(1);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(on_the_coarsest_level_the_best_of_all_places_leads_its_list),
        cmocka_unit_test(on_fine_levels_the_best_is_much_nearer_the_true_best_than_any_place),
        cmocka_unit_test(places_of_a_list_keep_apart_lie_inside_and_get_no_better),
        cmocka_unit_test(tiny_pictures_have_lists_too),
        cmocka_unit_test(the_best_places_go_with_a_picture_that_is_shifted_round_its_borders),
    };
    return cmocka_run_group_tests_name("similar", tests, one_thread, NULL);
}
