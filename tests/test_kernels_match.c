// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "core/random.h"
#include "kernels/best_match.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    WIDTH = 24,
    HEIGHT = 20,
    QUADS = 2,
    // Wider than the coarsest level used here, 12 x 10 texels.
    SIDE = 13,
    NUMBERS = QUADS * SIDE * SIDE * 4
};

static float g_target[NUMBERS], g_weight[NUMBERS];

static RfTexture make_texture(bool tiles)
{
    static float pixels[WIDTH * HEIGHT * QUADS * 4];
    for (size_t k = 0; k < WIDTH * HEIGHT * QUADS * 4; ++k)
        pixels[k] = rf_random_float(1, 0, k, 0) - 0.5f;
    RfTexture texture;
    assert_int_equal(rf_texture_create(pixels, WIDTH, HEIGHT, QUADS, tiles, &texture), RF_OK);
    return texture;
}

static RfMatchWindow make_window(const RfTexture *texture, int level, int margin)
{
    float energy = 0;
    for (size_t k = 0; k < NUMBERS; ++k)
    {
        g_target[k] = rf_random_float(2, 0, k, 0) - 0.5f;
        g_weight[k] = k % 5 == 0 ? 0 : rf_random_float(2, 0, k, 1);
        energy += g_weight[k] * g_target[k] * g_target[k];
    }
    return (RfMatchWindow){.texture = texture,
                           .level = level,
                           .width = SIDE,
                           .height = SIDE,
                           .margin = margin,
                           .target = g_target,
                           .weight = g_weight,
                           .energy = energy,
                           .mean_energy = energy};
}

// The texel under number k of a window on (x, y).
static float texel_under(const RfMatchWindow *window, int x, int y, size_t k)
{
    const RfTextureLevel *level = &window->texture->levels[window->level];
    int i = x + (int)(k / 4) % SIDE, j = y + (int)(k / 4 / SIDE) % SIDE, q = (int)(k / 4 / (SIDE * SIDE));
    i = rf_wrap_int(i, level->width);
    j = rf_wrap_int(j, level->height);
    return level->texels[(size_t)q * rf_texture_plane(level) + (size_t)(j * level->stride + i) * 4 + k % 4];
}

typedef struct SlowCost
{
    double difference, energy, correlation;
} SlowCost;

static SlowCost slow_cost(const RfMatchWindow *window, int x, int y)
{
    double difference = 0, energy = 0, target = 0, cross = 0;
    for (size_t k = 0; k < NUMBERS; ++k)
    {
        double e = (double)texel_under(window, x, y, k), t = (double)g_target[k], w = (double)g_weight[k];
        difference += w * (e - t) * (e - t);
        energy += w * e * e;
        target += w * t * t;
        cross += w * e * t;
    }
    return (SlowCost){difference, energy, cross / sqrt(energy * target)};
}

static void check_costs(RfMatchWindow *window, int x, int y)
{
    SlowCost expected = slow_cost(window, x, y);
    float cost, penalised;
    window->mean_energy = (float)expected.energy;
    rf_match_cost(window, x, y, &cost);
    assert_true(fabs((double)cost - (2 - 2 * expected.correlation)) < 1e-4);
    for (int sign = -1; sign <= 1; sign += 2)
    {
        window->mean_energy = (float)expected.energy * (1 + 0.3f * (float)sign);
        rf_match_cost(window, x, y, &penalised);
        assert_true(penalised > cost + 1e-3f);
    }
    window->mean_energy = 0;
    rf_match_cost(window, x, y, &cost);
    assert_true(fabs((double)cost - expected.difference) < 1e-5 * (1 + expected.difference));
}

static void costs_are_two_minus_twice_the_correlation_at_every_place_where_the_energy_is_right(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
        for (int level = 0; level < 3; ++level)
        {
            RfTexture texture = make_texture(tiles);
            RfMatchWindow window = make_window(&texture, level, 1);
            int places[2], margin = tiles ? 0 : 1;
            rf_match_places(&window, places);
            if (tiles)
                assert_true(places[0] == texture.levels[level].width && places[1] == texture.levels[level].height);
            else
                assert_true(places[0] == rf_max_int(texture.levels[level].width - SIDE - 1, 0) &&
                            places[1] == rf_max_int(texture.levels[level].height - SIDE - 1, 0));
            for (int y = 0; y < places[1]; ++y)
                for (int x = 0; x < places[0]; ++x)
                    check_costs(&window, x + margin, y + margin);
            rf_texture_free(&texture);
        }
}

static void a_window_cut_from_the_exemplar_is_found_where_it_was_across_borders_too(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfTexture texture = make_texture(tiles);
        RfMatchWindow window = make_window(&texture, 1, 2);
        const RfTextureLevel *level = &texture.levels[1];
        int x = tiles ? level->width - 3 : 9, y = tiles ? level->height - 2 : 4;
        window.energy = 0;
        for (size_t k = 0; k < NUMBERS; ++k)
        {
            g_target[k] = texel_under(&window, x, y, k);
            window.energy += g_weight[k] * g_target[k] * g_target[k];
        }
        window.mean_energy = window.energy;
        RfMatch best[3];
        assert_int_equal(rf_match_search(&window, 1000000, 3, 1, 2, 3, best), 3);
        assert_true(best[0].x == x && best[0].y == y && fabsf(best[0].cost) < 1e-5f && best[1].cost > 0.01f);
        rf_texture_free(&texture);
    }
}

static int compare(const void *left, const void *right)
{
    const RfMatch *p = left, *q = right;
    return p->cost < q->cost ? -1 : p->cost > q->cost;
}

static void a_search_of_all_places_gives_the_best_of_all_best_first(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        static RfMatch all[WIDTH * HEIGHT];
        RfTexture texture = make_texture(tiles);
        RfMatchWindow window = make_window(&texture, 1, 3);
        int places[2], margin = tiles ? 0 : 3, count = 0;
        rf_match_places(&window, places);
        for (int y = 0; y < places[1]; ++y)
            for (int x = 0; x < places[0]; ++x, ++count)
            {
                all[count] = (RfMatch){x + margin, y + margin, 0};
                rf_match_cost(&window, x + margin, y + margin, &all[count].cost);
            }
        qsort(all, (size_t)count, sizeof *all, compare);
        RfMatch best[10];
        assert_int_equal(rf_match_search(&window, 1000000, 10, 1, 2, 3, best), 10);
        for (int k = 0; k < 10; ++k)
            assert_true(best[k].x == all[k].x && best[k].y == all[k].y && best[k].cost == all[k].cost);
        rf_texture_free(&texture);
    }
}

static void margins_stay_free_and_a_window_too_large_is_not_found(void **state)
{
    (void)state;
    RfTexture texture = make_texture(false);
    RfMatchWindow window = make_window(&texture, 1, 3);
    RfMatch best[WIDTH * HEIGHT];
    int places[2];
    rf_match_places(&window, places);
    assert_int_equal(places[0], WIDTH - SIDE - 6 + 1);
    int found = rf_match_search(&window, 60, 30, 1, 2, 3, best);
    assert_int_equal(found, 12);
    for (int k = 0; k < found; ++k)
    {
        assert_in_range(best[k].x, 3, WIDTH - SIDE - 3);
        assert_in_range(best[k].y, 3, HEIGHT - SIDE - 3);
    }
    window.margin = 7;
    rf_match_places(&window, places);
    assert_int_equal(places[1], 0);
    assert_int_equal(rf_match_search(&window, 60, 5, 1, 2, 3, best), 0);
    rf_texture_free(&texture);
}

static void equal_costs_go_to_the_earlier_try(void **state)
{
    (void)state;
    static float pixels[16 * 16 * 4];
    for (int k = 0; k < 16 * 16 * 4; ++k)
        pixels[k] = k / 64 % 2 ? 1.0f : -1.0f;
    RfTexture texture;
    assert_int_equal(rf_texture_create(pixels, 16, 16, 1, true, &texture), RF_OK);
    RfMatchWindow window = make_window(&texture, 1, 0);
    // Nothing is wanted anywhere: all places cost the same.
    memset(g_weight, 0, sizeof g_weight);
    window.energy = window.mean_energy = 0;
    RfMatch best[5];
    assert_int_equal(rf_match_search(&window, 1000, 5, 1, 2, 3, best), 5);
    for (int k = 0; k < 5; ++k)
        assert_true(best[k].x == k && best[k].y == 0 && best[k].cost == 0);
    rf_texture_free(&texture);
}

static void tries_are_a_function_of_seed_frame_and_item(void **state)
{
    (void)state;
    RfTexture texture = make_texture(true);
    RfMatchWindow window = make_window(&texture, 0, 0);
    RfMatch first[4], again[4], others[4];
    rf_match_search(&window, 20, 4, 1, 2, 3, first);
    rf_match_search(&window, 20, 4, 1, 2, 3, again);
    assert_memory_equal(first, again, sizeof first);
    for (uint64_t k = 0; k < 3; ++k)
    {
        rf_match_search(&window, 20, 4, 1 + (k == 0), 2 + (k == 1), 3 + (k == 2), others);
        assert_memory_not_equal(first, others, sizeof first);
    }
    rf_texture_free(&texture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(costs_are_two_minus_twice_the_correlation_at_every_place_where_the_energy_is_right),
        cmocka_unit_test(a_window_cut_from_the_exemplar_is_found_where_it_was_across_borders_too),
        cmocka_unit_test(a_search_of_all_places_gives_the_best_of_all_best_first),
        cmocka_unit_test(margins_stay_free_and_a_window_too_large_is_not_found),
        cmocka_unit_test(equal_costs_go_to_the_earlier_try),
        cmocka_unit_test(tries_are_a_function_of_seed_frame_and_item),
    };
    return cmocka_run_group_tests_name("best match", tests, NULL, NULL);
}
