// SPDX-License-Identifier: Apache-2.0
// The best-fit patch under a mask, against trying all places one by one.
#include "core/random.h"
#include "kernels/patch_search.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    W = 53,
    H = 41,
    MOST_CHANNELS = 4
};

static float g_picture[W * H * MOST_CHANNELS], g_box[RF_PATCH_BOX * RF_PATCH_BOX * MOST_CHANNELS];
static float g_weights[RF_PATCH_BOX * RF_PATCH_BOX];
static uint8_t g_valid[W * H], g_groups[W * H];
static float g_prices[RF_PATCH_GROUPS];
static RfPatchTerms g_terms;

static bool has_room(const RfPatchQuery *q, RfPatchRoom room, int x, int y)
{
    if (room == RF_ROOM_OF_MIDDLE)
        return g_valid[(y + q->height / 2) * W + x + q->width / 2];
    for (int j = 0; j < q->height; ++j)
        for (int i = 0; i < q->width; ++i)
            if (!g_valid[(y + j) * W + x + i])
                return false;
    return true;
}

static RfPatchMatch plain_scan(const RfPatchQuery *q, int channels, RfPatchRoom room)
{
    RfPatchMatch best = {-1, -1, INFINITY};
    for (int y = 0; y <= H - q->height; ++y)
        for (int x = 0; x <= W - q->width; ++x)
        {
            double sum = q->prices ? (double)g_prices[g_groups[(y + q->height / 2) * W + x + q->width / 2]] : 0;
            for (int j = 0; j < q->height; ++j)
                for (int i = 0; i < q->width; ++i)
                    for (int c = 0; c < channels; ++c)
                    {
                        int k = j * q->width + i;
                        double d = (double)g_picture[((y + j) * W + x + i) * channels + c] -
                                   (double)q->pixels[k * channels + c];
                        sum += (double)q->weights[k] * d * d;
                    }
            if (has_room(q, room, x, y) && (best.x < 0 || sum < best.distance))
                best = (RfPatchMatch){x, y, sum};
        }
    return best;
}

// Smooth or rough, or of a few values only, so that many places are equal.
static void draw(int channels, uint64_t seed, int levels)
{
    for (int i = 0; i < W * H * channels; ++i)
        g_picture[i] = floorf(rf_random_float(seed, 1, (uint64_t)i, 0) * (float)levels) / (float)levels;
    for (int i = 0; i < RF_PATCH_BOX * RF_PATCH_BOX * channels; ++i)
        g_box[i] = floorf(rf_random_float(seed, 2, (uint64_t)i, 0) * (float)levels) / (float)levels;
    for (int i = 0; i < RF_PATCH_BOX * RF_PATCH_BOX; ++i)
        g_weights[i] = rf_random_below(3, seed, 3, (uint64_t)i, 0) ? 0 : rf_random_float(seed, 4, (uint64_t)i, 0);
    for (int i = 0; i < W * H; ++i)
        g_groups[i] = (uint8_t)rf_random_below(RF_PATCH_GROUPS, seed, 7, (uint64_t)i, 0);
    for (int i = 0; i < RF_PATCH_GROUPS; ++i)
        g_prices[i] = floorf(4 * rf_random_float(seed, 8, (uint64_t)i, 0));
    memset(g_valid, 1, sizeof g_valid);
    for (int k = 0; k < 6; ++k)
        g_valid[rf_random_below(W * H, seed, 5, (uint64_t)k, 0)] = k == 0 || seed % 2;
}

static void every_answer_is_that_of_a_plain_scan(void **state)
{
    (void)state;
    static const int levels[] = {1, 2, 1000};
    for (uint64_t seed = 0; seed < 60; ++seed)
    {
        int channels = 1 + (int)(seed % MOST_CHANNELS);
        draw(channels, seed, levels[seed % 3]);
        RfPatchRoom room = seed / 2 % 2 ? RF_ROOM_OF_MIDDLE : RF_ROOM_OF_ALL;
        RfPatchPicture picture;
        assert_int_equal(rf_patch_picture_create(g_picture, W, H, channels, g_valid, g_groups, room, &picture), RF_OK);
        RfPatchQuery query = {.width = 1 + (int)rf_random_below(40, seed, 6, 0, 0),
                              .height = 1 + (int)rf_random_below(40, seed, 6, 1, 0),
                              .pixels = g_box,
                              .weights = g_weights,
                              .prices = seed / 4 % 2 ? g_prices : NULL,
                              .guess_x = (int)rf_random_below(80, seed, 6, 2, 0) - 20,
                              .guess_y = (int)rf_random_below(80, seed, 6, 3, 0) - 20};
        RfPatchMatch wanted = plain_scan(&query, channels, room), found = rf_patch_search(&picture, &query, &g_terms);
        if (found.x != wanted.x || found.y != wanted.y || (wanted.x >= 0 && found.distance != wanted.distance))
            fail_msg("seed %d, %d x %d: (%d, %d) %g, not (%d, %d) %g", (int)seed, query.width, query.height, found.x,
                     found.y, found.distance, wanted.x, wanted.y, wanted.distance);
        rf_patch_picture_free(&picture);
    }
}

static void a_piece_of_the_picture_is_found(void **state)
{
    (void)state;
    draw(3, 7, 1000);
    memset(g_valid, 1, sizeof g_valid);
    RfPatchPicture picture;
    assert_int_equal(rf_patch_picture_create(g_picture, W, H, 3, NULL, NULL, RF_ROOM_OF_ALL, &picture), RF_OK);
    for (int j = 0; j < 12; ++j)
        memcpy(g_box + (ptrdiff_t)j * 15 * 3, g_picture + ((ptrdiff_t)(20 + j) * W + 37) * 3, 15 * 3 * sizeof *g_box);
    RfPatchQuery query = {.width = 15, .height = 12, .pixels = g_box, .weights = g_weights};
    RfPatchMatch found = rf_patch_search(&picture, &query, &g_terms);
    assert_true(found.x == 37 && found.y == 20 && found.distance == 0);
    rf_patch_picture_free(&picture);
}

static void where_nothing_has_room_nothing_is_found(void **state)
{
    (void)state;
    draw(1, 1, 5);
    memset(g_valid, 0, sizeof g_valid);
    RfPatchPicture picture;
    assert_int_equal(rf_patch_picture_create(g_picture, W, H, 1, g_valid, NULL, RF_ROOM_OF_ALL, &picture), RF_OK);
    RfPatchQuery query = {.width = 2, .height = 2, .pixels = g_box, .weights = g_weights};
    assert_int_equal(rf_patch_search(&picture, &query, &g_terms).x, -1);
    query.width = W + 1;
    assert_int_equal(rf_patch_search(&picture, &query, &g_terms).x, -1);
    // A query that knows nothing fits anywhere: the first place.
    rf_patch_picture_free(&picture);
    memset(g_weights, 0, sizeof g_weights);
    assert_int_equal(rf_patch_picture_create(g_picture, W, H, 1, NULL, NULL, RF_ROOM_OF_ALL, &picture), RF_OK);
    query.width = 3;
    query.guess_x = 9;
    RfPatchMatch found = rf_patch_search(&picture, &query, &g_terms);
    assert_true(found.x == 0 && found.y == 0 && found.distance == 0);
    rf_patch_picture_free(&picture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_answer_is_that_of_a_plain_scan),
        cmocka_unit_test(a_piece_of_the_picture_is_found),
        cmocka_unit_test(where_nothing_has_room_nothing_is_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
