// SPDX-License-Identifier: Apache-2.0
#include "core/random.h"
#include "core/simd.h"
#include "kernels/neighbours.h"
#include "support/sanitized.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum
{
    MAX_COPIES = 4,
    QUERIES = 61,
    MAX_NUMBERS = 17 * 17 * 5
};

// One exemplar, its copies and what is asked of it, all from one description.
typedef struct Scene
{
    int width, height, channels, side, copies;
    bool tiles, masks, weights, known, penalties, excluded;
    // 0: smooth and noisy; 1: a few grey levels, many windows alike; 2: constant; 3: exact copies of candidates asked
    int kind;
    int components;
    // Of the numbers; 0: as they are.
    float size;
    float *pixels[MAX_COPIES], channel_weights[8], turns[MAX_COPIES][6], *penalty, *windows, *mask;
    uint8_t *valid[MAX_COPIES];
    RfWindowPlace exclusions[QUERIES];
    RfWindowSource sources[MAX_COPIES];
    RfWindowDatabase *database;
} Scene;

static float random_at(const Scene *s, int what, int a, int b, int c)
{
    return rf_random_float((uint64_t)(what + 100 * s->side + s->channels), (uint64_t)a, (uint64_t)b, (uint64_t)c);
}

static float value_at(const Scene *s, int copy, int x, int y, int k)
{
    if (s->kind == 2)
        return 0.3f;
    // Every copy is turned by a quarter more, if the picture is square; else it is another picture.
    for (int turn = 0; turn < copy && s->width == s->height; ++turn)
    {
        int old = x;
        x = y;
        y = s->width - 1 - old;
    }
    if (s->kind == 1)
        return (float)((x / 7 + y / 5) % 3 == 0);
    float smooth = sinf(0.31f * (float)(x + 3 * k)) + cosf(0.23f * (float)(y - x) + (float)k);
    float value = 100 + 20 * smooth + 10 * random_at(s, 1, k, y * s->width + x, s->width == s->height ? 0 : copy);
    return s->size > 0 ? value * s->size : value;
}

static void make_pictures(Scene *s)
{
    size_t pixels = (size_t)s->width * (size_t)s->height;
    for (int c = 0; c < s->copies; ++c)
    {
        s->pixels[c] = malloc(pixels * (size_t)s->channels * sizeof(float));
        s->valid[c] = malloc(pixels);
        for (int y = 0; y < s->height; ++y)
            for (int x = 0; x < s->width; ++x)
            {
                size_t p = (size_t)y * (size_t)s->width + (size_t)x;
                // A disk of valid pixels with a hole in it, another in every copy.
                float dx = (float)x - 0.5f * (float)s->width, dy = (float)y - 0.5f * (float)s->height;
                s->valid[c][p] = dx * dx + dy * dy < 0.24f * (float)(s->width * s->height) && !(x == 3 + c && y == 9);
                for (int k = 0; k < s->channels; ++k)
                    s->pixels[c][p * (size_t)s->channels + (size_t)k] = value_at(s, c, x, y, k);
            }
        // Not finite, so never valid, masks or not; it must not leak into windows beside it.
        if (s->masks)
            s->pixels[c][(pixels / 2 + (size_t)s->width / 2 - 4) * (size_t)s->channels] = c % 2 == 0 ? NAN : 1e20f;
        const float quarters[4][6] = {{1, 0, 0, 0, 1, 0},
                                      {0, 1, 0, -1, 0, (float)s->width - 1},
                                      {-1, 0, (float)s->width - 1, 0, -1, (float)s->width - 1},
                                      {0, -1, (float)s->width - 1, 1, 0, 0}};
        memcpy(s->turns[c], quarters[c], sizeof quarters[c]);
        s->sources[c] =
            (RfWindowSource){.image = {s->pixels[c], s->width, s->height, s->channels, s->width * s->channels},
                             .valid = s->masks ? s->valid[c] : NULL,
                             .to_exemplar = s->width == s->height && c > 0 ? s->turns[c] : NULL};
    }
}

// Windows of the first picture, blended in pairs and made noisy; some exact.
static void make_queries(Scene *s)
{
    int numbers = s->side * s->side * s->channels, count = rf_windows_count(s->database);
    s->windows = malloc((size_t)QUERIES * (size_t)numbers * sizeof(float));
    s->mask = malloc((size_t)QUERIES * (size_t)s->side * (size_t)s->side * sizeof(float));
    for (int q = 0; q < QUERIES; ++q)
    {
        static float a[MAX_NUMBERS], b[MAX_NUMBERS];
        int first = (int)(random_at(s, 2, q, 0, 0) * (float)count);
        rf_windows_read(s->database, first, a);
        rf_windows_read(s->database, (int)(random_at(s, 2, q, 1, 0) * (float)count), b);
        float share = q % 3 == 0 || s->kind == 3 ? 0 : 0.5f, noise = q % 4 == 0 || s->kind == 3 ? 0 : 8;
        for (int k = 0; k < numbers; ++k)
            s->windows[q * numbers + k] = a[k] + share * (b[k] - a[k]) + noise * (random_at(s, 3, q, k, 0) - 0.5f);
        for (int p = 0; p < s->side * s->side; ++p)
        {
            float u = random_at(s, 4, q, p, 0);
            // Halves, holes, all kinds of weights; query 7 knows nothing at all.
            s->mask[q * s->side * s->side + p] = q == 7       ? 0
                                                 : q % 2 == 0 ? (float)(p % s->side < 1 + s->side / 2)
                                                              : (u < 0.3f ? 0 : u);
            if (s->known && s->mask[q * s->side * s->side + p] == 0)
                s->windows[q * numbers + p * s->channels] = NAN;
        }
        s->exclusions[q] = q % 5 == 4 ? (RfWindowPlace){-1, 0, 0} : rf_windows_place(s->database, first);
    }
    s->penalty = malloc((size_t)count * sizeof(float));
    for (int i = 0; i < count; ++i)
        s->penalty[i] = (s->kind == 0 ? 3000.0f : 1.0f) * (random_at(s, 5, i, 0, 0) - 0.2f);
}

static void open_scene(Scene *s)
{
    make_pictures(s);
    for (int k = 0; k < s->channels; ++k)
        s->channel_weights[k] = k == 1 ? 0 : 0.25f + 1.5f * (float)k;
    RfWindowOptions options = {.side = s->side,
                               .tiles = s->tiles,
                               .channel_weights = s->weights ? s->channel_weights : NULL,
                               .components = s->components};
    assert_int_equal(rf_windows_create(s->sources, s->copies, &options, &s->database), RF_OK);
    make_queries(s);
}

static void close_scene(Scene *s)
{
    rf_windows_destroy(s->database);
    for (int c = 0; c < s->copies; ++c)
    {
        free(s->pixels[c]);
        free(s->valid[c]);
    }
    free(s->windows);
    free(s->mask);
    free(s->penalty);
}

static RfWindowQueries queries_of(const Scene *s)
{
    return (RfWindowQueries){.count = QUERIES,
                             .windows = s->windows,
                             .weights = s->known ? s->mask : NULL,
                             .penalties = s->penalties ? s->penalty : NULL,
                             .excluded = s->excluded ? s->exclusions : NULL};
}

// ---- the slow, obvious search --------------------------------------------------------------------------------------

static bool window_is_valid(const Scene *s, int copy, int x, int y)
{
    for (int j = y; j < y + s->side; ++j)
        for (int i = x; i < x + s->side; ++i)
        {
            size_t p = (size_t)(j % s->height) * (size_t)s->width + (size_t)(i % s->width);
            if (s->masks && !s->valid[copy][p])
                return false;
            for (int k = 0; k < s->channels; ++k)
                if (!(fabsf(s->pixels[copy][p * (size_t)s->channels + (size_t)k]) <= 1e12f))
                    return false;
        }
    return true;
}

// Stops where it has passed the limit.
static double slow_distance(const Scene *s, int q, int copy, int x, int y, double limit)
{
    double sum = 0;
    for (int j = 0; j < s->side && sum <= limit; ++j)
        for (int i = 0; i < s->side; ++i)
        {
            double known = s->known ? (double)s->mask[(q * s->side + j) * s->side + i] : 1;
            size_t p = (size_t)((y + j) % s->height) * (size_t)s->width + (size_t)((x + i) % s->width);
            for (int k = 0; k < s->channels && known > 0; ++k)
            {
                double d = (double)s->windows[((q * s->side + j) * s->side + i) * s->channels + k] -
                           (double)s->pixels[copy][p * (size_t)s->channels + (size_t)k];
                sum += known * (s->weights ? (double)s->channel_weights[k] : 1) * d * d;
            }
        }
    return sum;
}

static double apart(double a, double b, int period, bool tiles)
{
    double d = fabs(a - b);
    if (!tiles)
        return d;
    d = fmod(d, period);
    return fmin(d, period - d);
}

static void show_place(const Scene *s, RfWindowPlace p, double *x, double *y)
{
    const float *m = s->sources[p.copy].to_exemplar;
    double u = p.x + 0.5 * (s->side - 1), v = p.y + 0.5 * (s->side - 1);
    *x = m ? (double)m[0] * u + (double)m[1] * v + (double)m[2] : u;
    *y = m ? (double)m[3] * u + (double)m[4] * v + (double)m[5] : v;
}

static bool is_excluded(const Scene *s, int q, int copy, int x, int y)
{
    if (!s->excluded || s->exclusions[q].copy < 0)
        return false;
    double u, v, u0, v0;
    show_place(s, (RfWindowPlace){copy, x, y}, &u, &v);
    show_place(s, s->exclusions[q], &u0, &v0);
    return apart(u, u0, s->width, s->tiles) < s->side && apart(v, v0, s->height, s->tiles) < s->side;
}

// The least distance + penalty for every query, and how many candidates there are in all.
static int slow_search(const Scene *s, double *least)
{
    int candidates = 0;
    for (int q = 0; q < QUERIES; ++q)
        least[q] = INFINITY;
    for (int c = 0; c < s->copies; ++c)
        for (int y = 0; y < (s->tiles ? s->height : s->height - s->side + 1); ++y)
            for (int x = 0; x < (s->tiles ? s->width : s->width - s->side + 1); ++x)
            {
                if (!window_is_valid(s, c, x, y))
                    continue;
                for (int q = 0; q < QUERIES; ++q)
                {
                    double penalty = s->penalties ? (double)s->penalty[candidates] : 0;
                    if (!is_excluded(s, q, c, x, y))
                        least[q] = fmin(least[q], slow_distance(s, q, c, x, y, least[q] - penalty) + penalty);
                }
                ++candidates;
            }
    return candidates;
}

// The nearest by rounded arithmetic is the nearest in double, but for distances that differ by their rounding alone.
static void expect_nearest_in(const Scene *s)
{
    static double least[QUERIES];
    RfWindowMatch matches[QUERIES];
    assert_int_equal(slow_search(s, least), rf_windows_count(s->database));
    RfWindowQueries queries = queries_of(s);
    assert_int_equal(rf_windows_search(s->database, &queries, matches), RF_OK);
    for (int q = 0; q < QUERIES; ++q)
    {
        const RfWindowMatch *m = &matches[q];
        if (least[q] == INFINITY)
        {
            assert_int_equal(m->candidate, -1);
            assert_true(m->distance == INFINITY);
            continue;
        }
        assert_int_equal(rf_windows_at(s->database, m->place), m->candidate);
        assert_false(is_excluded(s, q, m->place.copy, m->place.x, m->place.y));
        double distance = slow_distance(s, q, m->place.copy, m->place.x, m->place.y, INFINITY),
               score = distance + (s->penalties ? (double)s->penalty[m->candidate] : 0);
        assert_true(fabs((double)m->distance - distance) <= 2e-6 * distance);
        if (score > least[q] + 2e-6 * (fabs(least[q]) + distance))
            fail_msg("query %d: %.9g at candidate %d, but there is %.9g", q, score, m->candidate, least[q]);
    }
}

static void expect_nearest(Scene *s)
{
    open_scene(s);
    expect_nearest_in(s);
    close_scene(s);
}

static void expect_nearest_in_all_sizes(Scene s)
{
    const int sides[] = {5, 9, 17, 2}, channels[] = {1, 2, 3, 5};
    for (int i = 0; i < 4; ++i)
        // Sanitizers see every side twice and every number of channels, the largest windows among them.
        for (int k = TEST_SANITIZED ? (i + 1) % 2 : 0; k < 4; k += TEST_SANITIZED ? 2 : 1)
        {
            Scene scene = s;
            scene.side = sides[i];
            scene.channels = channels[k];
            expect_nearest(&scene);
        }
}

// ---- tests -------------------------------------------------------------------------------------------------------

static void the_match_is_the_nearest_window(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 41, .height = 37, .copies = 1});
}

static void so_it_is_where_windows_wrap(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 29, .height = 23, .copies = 1, .tiles = true});
    // A window may be larger than what it wraps round.
    expect_nearest(&(Scene){.width = 7, .height = 5, .channels = 2, .side = 17, .copies = 1, .tiles = true});
}

static void so_it_is_with_few_and_with_many_components(void **state)
{
    (void)state;
    for (int components = 1; components <= RF_MAX_WINDOW_COMPONENTS; components += 21)
        expect_nearest(
            &(Scene){.width = 41, .height = 37, .channels = 2, .side = 9, .copies = 1, .components = components});
}

static void so_it_is_where_a_second_bound_sieves(void **state)
{
    (void)state;
    // More than 32 components: those beyond are there for a second bound.
    for (int components = 33; components <= 63; components += 10)
        for (int side = 9; side <= 17; side += 8)
            expect_nearest(&(Scene){.width = 37,
                                    .height = 37,
                                    .channels = side == 9 ? 3 : 1,
                                    .side = side,
                                    .copies = 2,
                                    .components = components,
                                    .penalties = components % 20 == 3,
                                    .excluded = components > 50});
}

static void queries_may_be_larger_than_any_candidate(void **state)
{
    (void)state;
    for (int components = 0; components <= 40; components += 40)
    {
        Scene s = {.width = 41, .height = 37, .channels = 2, .side = 9, .copies = 1, .components = components};
        open_scene(&s);
        // Some in a panel of 12, all in another, none in a third.
        for (int q = 0; q < QUERIES; ++q)
            for (int k = 0; k < 162 && q < 24 && (q >= 12 || q % 5 == 0); ++k)
                s.windows[q * 162 + k] = (q % 2 ? 1000.0f : -3.0f) * s.windows[q * 162 + k];
        expect_nearest_in(&s);
        close_scene(&s);
    }
}

static void penalties_may_be_out_of_proportion(void **state)
{
    (void)state;
    const float sizes[] = {1e6f, 1e12f, 1e25f};
    for (int i = 0; i < 3; ++i)
    {
        Scene s = {.width = 41, .height = 37, .channels = 2, .side = 9, .copies = 1, .penalties = true};
        open_scene(&s);
        for (int c = 0; c < rf_windows_count(s.database); ++c)
            s.penalty[c] = c % 7 == 3 ? s.penalty[c] : sizes[i] * (random_at(&s, 6, c, 0, 0) - (i == 1));
        expect_nearest_in(&s);
        close_scene(&s);
    }
}

static void pictures_may_be_tiny_or_huge(void **state)
{
    (void)state;
    const float sizes[] = {1e-15f, 1e-9f, 1e9f};
    for (int i = 0; i < 3; ++i)
    {
        Scene s = {.width = 41, .height = 37, .channels = 2, .side = 9, .copies = 1, .size = sizes[i]};
        open_scene(&s);
        for (int k = 0; k < QUERIES * 162; ++k)
            s.windows[k] = s.windows[k] < 40 * sizes[i] ? 40 * sizes[i] : s.windows[k];
        expect_nearest_in(&s);
        close_scene(&s);
    }
}

static void so_it_is_with_channel_weights(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 37, .height = 41, .copies = 1, .weights = true});
}

static void so_it_is_among_turned_copies_with_masks(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 37, .height = 37, .copies = 4, .masks = true});
}

static void so_it_is_where_masked_copies_wrap(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 33, .height = 33, .copies = 2, .masks = true, .tiles = true});
}

static void masked_queries_compare_known_pixels_only(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 33, .height = 29, .copies = 1, .known = true});
    expect_nearest_in_all_sizes((Scene){
        .width = 31, .height = 31, .copies = 3, .known = true, .weights = true, .penalties = true, .excluded = true});
}

static void penalties_move_the_choice(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 39, .height = 35, .copies = 1, .penalties = true});
}

static void what_is_excluded_is_not_found(void **state)
{
    (void)state;
    expect_nearest_in_all_sizes((Scene){.width = 39, .height = 39, .copies = 1, .excluded = true});
    expect_nearest_in_all_sizes((Scene){.width = 39, .height = 39, .copies = 1, .excluded = true, .tiles = true});
    // What a turned copy shows is excluded with it.
    expect_nearest_in_all_sizes(
        (Scene){.width = 37, .height = 37, .copies = 4, .excluded = true, .masks = true, .penalties = true});
    expect_nearest_in_all_sizes((Scene){.width = 35, .height = 35, .copies = 3, .excluded = true, .tiles = true});
}

static void chunks_and_groups_have_no_seams(void **state)
{
    (void)state;
    // 5041 candidates: more than a chunk, and no multiple of a tile; queries are exact windows of any of them.
    expect_nearest(&(Scene){.width = 79, .height = 79, .channels = 1, .side = 9, .copies = 1, .kind = 3});
    expect_nearest(&(Scene){.width = 79, .height = 79, .channels = 1, .side = 9, .copies = 1, .excluded = true});
    expect_nearest(&(Scene){.width = 79, .height = 79, .channels = 1, .side = 9, .copies = 1, .known = true});
}

static void a_copy_of_a_window_is_found_at_distance_zero(void **state)
{
    (void)state;
    Scene s = {.width = 45, .height = 37, .channels = 3, .side = 9, .copies = 1, .kind = 3};
    open_scene(&s);
    RfWindowMatch matches[QUERIES];
    RfWindowQueries queries = queries_of(&s);
    assert_int_equal(rf_windows_search(s.database, &queries, matches), RF_OK);
    for (int q = 0; q < QUERIES; ++q)
    {
        assert_true(matches[q].distance == 0);
        assert_int_equal(matches[q].candidate, (int)(random_at(&s, 2, q, 0, 0) * (float)rf_windows_count(s.database)));
    }
    close_scene(&s);
}

// Whether two windows of one channel are the same wherever the query knows its pixels.
static bool looks_alike(const Scene *s, int q, const float *a, const float *b)
{
    int pixels = s->side * s->side;
    for (int p = 0; p < pixels; ++p)
        if ((!s->known || s->mask[q * pixels + p] > 0) && a[p] != b[p])
            return false;
    return true;
}

static void of_equal_candidates_the_lower_wins(void **state)
{
    (void)state;
    // Windows of a periodic picture: every one has its like 35 rows and 21 columns on.
    for (int known = 0; known < 2; ++known)
    {
        Scene s = {.width = 60, .height = 50, .channels = 1, .side = 9, .copies = 1, .kind = 1, .known = known};
        open_scene(&s);
        RfWindowMatch matches[QUERIES];
        RfWindowQueries queries = queries_of(&s);
        assert_int_equal(rf_windows_search(s.database, &queries, matches), RF_OK);
        for (int q = 0; q < QUERIES; ++q)
            for (int i = 0; i < matches[q].candidate; ++i)
            {
                RfWindowPlace p = rf_windows_place(s.database, i);
                double distance = slow_distance(&s, q, p.copy, p.x, p.y, INFINITY);
                assert_true(distance > 0 && distance * (1 + 2e-6) > (double)matches[q].distance);
                float own[81], best[81];
                rf_windows_read(s.database, i, own);
                rf_windows_read(s.database, matches[q].candidate, best);
                assert_false(looks_alike(&s, q, own, best));
            }
        close_scene(&s);
    }
}

static void a_constant_picture_gives_its_first_window(void **state)
{
    (void)state;
    for (int known = 0; known < 2; ++known)
    {
        Scene s = {.width = 30, .height = 30, .channels = 3, .side = 9, .copies = 2, .kind = 2, .known = known};
        open_scene(&s);
        RfWindowMatch matches[QUERIES];
        RfWindowQueries queries = queries_of(&s);
        assert_int_equal(rf_windows_search(s.database, &queries, matches), RF_OK);
        for (int q = 0; q < QUERIES; ++q)
            assert_int_equal(matches[q].candidate, 0);
        close_scene(&s);
    }
}

static void one_window_is_enough(void **state)
{
    (void)state;
    expect_nearest(&(Scene){.width = 9, .height = 9, .channels = 2, .side = 9, .copies = 1});
    expect_nearest(&(Scene){.width = 9, .height = 9, .channels = 2, .side = 9, .copies = 1, .excluded = true});
    expect_nearest(&(Scene){.width = 1, .height = 1, .channels = 1, .side = 1, .copies = 1, .tiles = true});
}

static void a_query_that_is_not_finite_has_no_match_and_harms_no_other(void **state)
{
    (void)state;
    Scene s = {.width = 41, .height = 37, .channels = 2, .side = 9, .copies = 1};
    open_scene(&s);
    RfWindowMatch before[QUERIES], after[QUERIES];
    RfWindowQueries queries = queries_of(&s);
    assert_int_equal(rf_windows_search(s.database, &queries, before), RF_OK);
    s.windows[5 * 162 + 161] = NAN;
    s.windows[6 * 162] = INFINITY;
    s.windows[7 * 162 + 30] = 1e30f;
    assert_int_equal(rf_windows_search(s.database, &queries, after), RF_OK);
    for (int q = 0; q < QUERIES; ++q)
        if (q >= 5 && q <= 7)
        {
            assert_int_equal(after[q].candidate, -1);
            assert_true(after[q].distance == INFINITY);
        }
        else
            assert_memory_equal(&after[q], &before[q], sizeof after[q]);
    close_scene(&s);
}

static void large_numbers_stay_in_range(void **state)
{
    (void)state;
    float pixels[20 * 20], window[81];
    for (int i = 0; i < 400; ++i)
        pixels[i] = 1e12f * (2 * rf_random_float(9, 0, (uint64_t)i, 0) - 1);
    RfWindowSource source = {.image = {pixels, 20, 20, 1, 20}};
    float weight = 1e4f;
    RfWindowOptions options = {.side = 9, .channel_weights = &weight};
    RfWindowDatabase *database;
    assert_int_equal(rf_windows_create(&source, 1, &options, &database), RF_OK);
    rf_windows_read(database, 77, window);
    RfWindowQueries queries = {.count = 1, .windows = window};
    RfWindowMatch match;
    assert_int_equal(rf_windows_search(database, &queries, &match), RF_OK);
    assert_int_equal(match.candidate, 77);
    assert_true(match.distance == 0);
    rf_windows_destroy(database);
}

static void the_bytes_do_not_depend_on_threads(void **state)
{
    (void)state;
    Scene s = {.width = 60, .height = 50, .channels = 2, .side = 9, .copies = 1, .penalties = true};
    RfWindowMatch matches[2][QUERIES];
    for (int run = 0; run < 2; ++run)
    {
        rf_set_threads(run == 0 ? 1 : 5);
        open_scene(&s);
        RfWindowQueries queries = queries_of(&s);
        assert_int_equal(rf_windows_search(s.database, &queries, matches[run]), RF_OK);
        close_scene(&s);
    }
    rf_set_threads(0);
    assert_memory_equal(matches[0], matches[1], sizeof matches[0]);
}

// This program, run again with RF_SIMD set, prints what it found.
static const char *g_program;

static void print_matches(void)
{
    for (int kind = 0; kind < 4; ++kind)
        for (int variant = 0; variant < 5; ++variant)
        {
            Scene s = {.width = 47,
                       .height = 43,
                       .channels = 3,
                       .side = variant == 4 ? 17 : 9,
                       .copies = 2,
                       .kind = kind,
                       .known = variant == 1,
                       .components = variant == 2 ? 40 : 0,
                       .penalties = variant == 3,
                       .excluded = variant == 3};
            open_scene(&s);
            RfWindowMatch matches[QUERIES];
            RfWindowQueries queries = queries_of(&s);
            if (rf_windows_search(s.database, &queries, matches) == RF_OK)
                for (int q = 0; q < QUERIES; ++q)
                    printf("%d %a\n", matches[q].candidate, (double)matches[q].distance);
            close_scene(&s);
        }
}

static char *matches_with(const char *set)
{
    const size_t room = 1 << 17;
    char command[4096], *text = calloc(room, 1);
    snprintf(command, sizeof command, "RF_SIMD=%s '%s' print", set, g_program);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    size_t length = fread(text, 1, room - 1, pipe);
    assert_int_equal(pclose(pipe), 0);
    assert_true(length > QUERIES * 20 * 4 && length < room - 1);
    return text;
}

static void every_instruction_set_finds_the_same(void **state)
{
    (void)state;
    static const struct
    {
        RfSimdLevel level;
        const char *name;
    } sets[] = {{RF_SIMD_AVX2, "avx2"}, {RF_SIMD_AVX512, "avx512"}, {RF_SIMD_AVX512, "all"}}; // all: short integers too
    if (rf_simd_level() == RF_SIMD_PLAIN)
    {
        print_message("skipped: this machine has the plain instruction set only\n");
        skip();
    }
    char *plain = matches_with("plain");
    for (int i = 0; i < 3; ++i)
    {
        if (rf_simd_level() < sets[i].level)
        {
            print_message("%s skipped: this machine does not have it\n", sets[i].name);
            continue;
        }
        char *wide = matches_with(sets[i].name);
        assert_string_equal(plain, wide);
        free(wide);
    }
    free(plain);
}

static void windows_are_read_and_gathered_alike(void **state)
{
    (void)state;
    Scene s = {.width = 21, .height = 17, .channels = 3, .side = 6, .copies = 1, .tiles = true};
    open_scene(&s);
    float read[108], gathered[2 * 108], weights[2 * 36];
    int corners[2][2] = {{18, 14}, {-3, -3}};
    rf_windows_read(s.database, rf_windows_at(s.database, (RfWindowPlace){0, 18, 14}), read);
    assert_int_equal(rf_windows_gather(s.sources, 6, true, (const int(*)[2])corners, 2, gathered, NULL), RF_OK);
    assert_memory_equal(read, gathered, sizeof read);
    assert_memory_equal(read, gathered + 108, sizeof read);
    // Without tiling, what sticks out is not known.
    s.valid[0][2] = 0;
    s.valid[0][0] = s.valid[0][1] = s.valid[0][s.width] = 1;
    s.sources[0].valid = s.valid[0];
    assert_int_equal(rf_windows_gather(s.sources, 6, false, (const int(*)[2])corners, 2, gathered, weights), RF_OK);
    for (int i = 0; i < 6; ++i)
        assert_true(weights[36 + 3 * 6 + i] == (float)(i == 3 || i == 4) && weights[36 + i] == 0);
    assert_true(gathered[108 + (3 * 6 + 3) * 3] == s.pixels[0][0] && gathered[108 + (3 * 6 + 5) * 3] == 0);
#ifndef RF_STOP_ON_MISUSE
    assert_int_equal(rf_windows_gather(s.sources, 6, false, (const int(*)[2])corners, 2, gathered, NULL),
                     RF_INVALID_ARGUMENT);
#endif
    close_scene(&s);
}

static void candidates_are_numbered_by_copy_row_and_column(void **state)
{
    (void)state;
    Scene s = {.width = 33, .height = 33, .channels = 1, .side = 5, .copies = 3, .masks = true};
    open_scene(&s);
    int next = 0;
    for (int c = 0; c < 3; ++c)
        for (int y = 0; y < 33; ++y)
            for (int x = 0; x < 33; ++x)
            {
                bool is = x <= 28 && y <= 28 && window_is_valid(&s, c, x, y);
                assert_int_equal(rf_windows_at(s.database, (RfWindowPlace){c, x, y}), is ? next : -1);
                next += is;
            }
    assert_int_equal(next, rf_windows_count(s.database));
    assert_int_equal(rf_windows_at(s.database, (RfWindowPlace){3, 0, 0}), -1);
    assert_int_equal(rf_windows_at(s.database, (RfWindowPlace){0, -1, 0}), -1);
    close_scene(&s);
}

static void what_holds_no_window_is_bad_input(void **state)
{
    (void)state;
    float pixels[64] = {0};
    uint8_t nothing[64] = {0};
    RfWindowSource small = {.image = {pixels, 8, 8, 1, 8}}, masked = {.image = {pixels, 8, 8, 1, 8}, .valid = nothing};
    RfWindowOptions options = {.side = 9}, fits = {.side = 5};
    RfWindowDatabase *database;
    assert_int_equal(rf_windows_create(&small, 1, &options, &database), RF_BAD_INPUT);
    assert_int_equal(rf_windows_create(&masked, 1, &fits, &database), RF_BAD_INPUT);
    // A small picture beside a large one has no windows, and does no harm.
    float large[400] = {0};
    RfWindowSource both[3] = {small, {.image = {large, 20, 20, 1, 20}}, small};
    assert_int_equal(rf_windows_create(both, 3, &options, &database), RF_OK);
    assert_int_equal(rf_windows_count(database), 144);
    assert_int_equal(rf_windows_at(database, (RfWindowPlace){1, 11, 11}), 143);
    assert_int_equal(rf_windows_at(database, (RfWindowPlace){0, 0, 0}), -1);
    rf_windows_destroy(database);
}

int main(int argc, char **argv)
{
    g_program = argv[0];
    if (argc > 1 && strcmp(argv[1], "print") == 0)
    {
        print_matches();
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_match_is_the_nearest_window),
        cmocka_unit_test(so_it_is_where_windows_wrap),
        cmocka_unit_test(so_it_is_with_few_and_with_many_components),
        cmocka_unit_test(so_it_is_where_a_second_bound_sieves),
        cmocka_unit_test(queries_may_be_larger_than_any_candidate),
        cmocka_unit_test(penalties_may_be_out_of_proportion),
        cmocka_unit_test(pictures_may_be_tiny_or_huge),
        cmocka_unit_test(so_it_is_with_channel_weights),
        cmocka_unit_test(so_it_is_among_turned_copies_with_masks),
        cmocka_unit_test(so_it_is_where_masked_copies_wrap),
        cmocka_unit_test(masked_queries_compare_known_pixels_only),
        cmocka_unit_test(penalties_move_the_choice),
        cmocka_unit_test(what_is_excluded_is_not_found),
        cmocka_unit_test(chunks_and_groups_have_no_seams),
        cmocka_unit_test(a_copy_of_a_window_is_found_at_distance_zero),
        cmocka_unit_test(of_equal_candidates_the_lower_wins),
        cmocka_unit_test(a_constant_picture_gives_its_first_window),
        cmocka_unit_test(one_window_is_enough),
        cmocka_unit_test(a_query_that_is_not_finite_has_no_match_and_harms_no_other),
        cmocka_unit_test(large_numbers_stay_in_range),
        cmocka_unit_test(the_bytes_do_not_depend_on_threads),
        cmocka_unit_test(every_instruction_set_finds_the_same),
        cmocka_unit_test(windows_are_read_and_gathered_alike),
        cmocka_unit_test(candidates_are_numbered_by_copy_row_and_column),
        cmocka_unit_test(what_holds_no_window_is_bad_input),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
