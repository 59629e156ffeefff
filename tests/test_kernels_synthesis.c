// SPDX-License-Identifier: Apache-2.0
// The search and assign steps of texture optimisation.
#include "support/sanitized.h"
#include "support/synthesis_check.h"

enum
{
    SIDE = 9,
    // All windows of an exemplar are costly to prepare where sanitizers watch.
    CHANNELS = TEST_SANITIZED ? 1 : 3
};

// ---- the search step

static float slow_cost(const RfSynthesisExemplar *e, const RfSynthesisFrame *f, RfVec2 at, RfVec2 place)
{
    double sum = 0;
    int half = SIDE / 2;
    for (int y = -half; y <= half; ++y)
        for (int x = -half; x <= half; ++x)
        {
            int u = rf_wrap_int((int)at.x + x, f->width), v = rf_wrap_int((int)at.y + y, f->height);
            const int16_t *a = rf_fixed_at(&f->picture, u, v);
            const int16_t *b = shown_at(e, place.x + (float)x, place.y + (float)y);
            for (int c = 0; c < e->channels; ++c)
                sum += (double)((a[c] - b[c]) * (a[c] - b[c]));
        }
    return (float)sum;
}

// Where a window of a frame is compared.
static RfVec2 compared_at(const RfSynthesisFrame *f, const RfSynthesisWindow *w)
{
    int half = f->tiles ? 0 : SIDE / 2;
    return (RfVec2){rf_clamp(w->at.x, (float)half, (float)(f->width - 1 - half)),
                    rf_clamp(w->at.y, (float)half, (float)(f->height - 1 - half))};
}

static RfVec2 match_of(const RfSynthesisFrame *f, const RfSynthesisWindow *w)
{
    return rf_vec2_add(w->source, rf_vec2_sub(compared_at(f, w), w->at));
}

// A copy of the frame's windows after a search from where they are; the frame keeps its own.
static RfSynthesisWindow *windows_after(RfSynthesisFrame *f, RfSynthesisSearch search, double *energy)
{
    size_t size = (size_t)window_count(f) * sizeof *f->windows;
    RfSynthesisWindow *before = malloc(size), *after = malloc(size);
    assert_true(before && after);
    memcpy(before, f->windows, size);
    *energy = search_with(search);
    memcpy(after, f->windows, size);
    memcpy(f->windows, before, size);
    free(before);
    return after;
}

static void every_cost_is_that_of_its_match_and_the_energy_is_their_mean(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
        for (int exact = 0; exact < 2; ++exact)
        {
            RfSynthesisExemplar e = make_exemplar(40, 33, CHANNELS, tiles, 1);
            RfSynthesisFrame f = make_muddle(&e, 31, 42, tiles, SIDE, 2);
            RfWindowDatabase *windows = all_windows(&e, SIDE);
            double sum = 0, energy = search_with((RfSynthesisSearch){.exemplar = &e,
                                                                     .frame = &f,
                                                                     .side = SIDE,
                                                                     .windows = exact ? windows : NULL,
                                                                     .plain = true,
                                                                     .all = true});
            for (int i = 0; i < window_count(&f); ++i)
            {
                const RfSynthesisWindow *w = &f.windows[i];
                float cost = slow_cost(&e, &f, compared_at(&f, w), match_of(&f, w));
                assert_true(fabsf(w->cost - cost) <= 1e-6f * cost);
                sum += (double)cost;
            }
            assert_true(fabs(energy - sum / window_count(&f)) < 1e-5 * energy);
            rf_windows_destroy(windows);
            rf_synthesis_frame_free(&f);
            rf_synthesis_exemplar_free(&e);
        }
}

// Matches of an exact search lie wholly in the exemplar, and no place costs less.
static void the_exact_search_finds_what_a_slow_one_finds(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(26, 23, CHANNELS, false, 1);
    RfSynthesisFrame f = make_muddle(&e, 30, 21, false, SIDE, 2);
    RfWindowDatabase *windows = all_windows(&e, SIDE);
    float *prices = malloc(26 * 23 * sizeof *prices);
    for (int i = 0; i < 26 * 23; ++i)
        prices[i] = 3e6f * rf_random_float(7, 0, (uint64_t)i, 0);
    for (int priced = 0; priced < 2; ++priced)
    {
        search_with((RfSynthesisSearch){.exemplar = &e,
                                        .frame = &f,
                                        .side = SIDE,
                                        .windows = windows,
                                        .prices = priced ? prices : NULL,
                                        .plain = true,
                                        .all = true});
        for (int i = 0; i < window_count(&f); i += TEST_SANITIZED ? 7 : 2)
        {
            const RfSynthesisWindow *w = &f.windows[i];
            RfVec2 best = {-1, -1};
            double least = INFINITY;
            for (int y = SIDE / 2; y < e.height - SIDE / 2; ++y)
                for (int x = SIDE / 2; x < e.width - SIDE / 2; ++x)
                {
                    double cost = (double)slow_cost(&e, &f, compared_at(&f, w), (RfVec2){(float)x, (float)y}) +
                                  (priced ? (double)prices[y * e.width + x] : 0);
                    if (cost < least)
                    {
                        least = cost;
                        best = (RfVec2){(float)x, (float)y};
                    }
                }
            assert_true(match_of(&f, w).x == best.x && match_of(&f, w).y == best.y);
        }
    }
    free(prices);
    rf_windows_destroy(windows);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

static void the_exact_search_is_that_of_all_windows(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfSynthesisExemplar e = make_exemplar(48, 41, CHANNELS, tiles, 3);
        RfSynthesisFrame f = make_muddle(&e, 40, 36, tiles, SIDE, 4);
        RfWindowDatabase *windows = all_windows(&e, SIDE);
        int count = window_count(&f), numbers = SIDE * SIDE * CHANNELS;
        float *queries = malloc((size_t)count * (size_t)numbers * sizeof *queries), *out = queries;
        RfWindowMatch *matches = malloc((size_t)count * sizeof *matches);
        for (int i = 0; i < count; ++i)
        {
            RfVec2 at = compared_at(&f, &f.windows[i]);
            for (int k = 0; k < SIDE * SIDE; ++k)
                for (int c = 0; c < CHANNELS; ++c)
                    *out++ = rf_fixed_at(&f.picture, rf_wrap_int((int)at.x + k % SIDE - SIDE / 2, f.width),
                                         rf_wrap_int((int)at.y + k / SIDE - SIDE / 2, f.height))[c];
        }
        RfWindowQueries asked = {.count = count, .windows = queries};
        assert_int_equal(rf_windows_search(windows, &asked, matches), RF_OK);
        search_with((RfSynthesisSearch){
            .exemplar = &e, .frame = &f, .side = SIDE, .windows = windows, .plain = true, .all = true});
        for (int i = 0; i < count; ++i)
        {
            RfVec2 match = match_of(&f, &f.windows[i]);
            assert_true(match.x == (float)(matches[i].place.x + SIDE / 2));
            assert_true(match.y == (float)(matches[i].place.y + SIDE / 2));
            assert_true(f.windows[i].cost == matches[i].distance);
        }
        free(queries);
        free(matches);
        rf_windows_destroy(windows);
        rf_synthesis_frame_free(&f);
        rf_synthesis_exemplar_free(&e);
    }
}

static void k_coherent_candidates_are_never_better_than_all(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfSynthesisExemplar e = make_exemplar(60, 52, CHANNELS, tiles, 5);
        RfSynthesisFrame f = make_muddle(&e, 64, 50, tiles, SIDE, 6);
        RfWindowDatabase *windows = all_windows(&e, SIDE);
        RfSynthesisSearch search = {.exemplar = &e, .frame = &f, .side = SIDE, .plain = true, .all = true};
        double coherent_energy, exact_energy;
        RfSynthesisWindow *coherent = windows_after(&f, search, &coherent_energy);
        search.windows = windows;
        RfSynthesisWindow *exact = windows_after(&f, search, &exact_energy);
        int equal = 0;
        for (int i = 0; i < window_count(&f); ++i)
        {
            assert_true(coherent[i].cost >= exact[i].cost);
            equal += coherent[i].cost == exact[i].cost;
        }
        print_message("%d of %d find the best of all; energy %.3f times that of the exact search\n", equal,
                      window_count(&f), coherent_energy / exact_energy);
        // Else nothing would have been tried here.
        assert_true(equal > (TEST_SANITIZED ? 0 : window_count(&f) / 10) && equal < window_count(&f));
        free(coherent);
        free(exact);
        rf_windows_destroy(windows);
        rf_synthesis_frame_free(&f);
        rf_synthesis_exemplar_free(&e);
    }
}

static void a_search_without_prices_never_makes_a_window_dearer(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(50, 50, CHANNELS, false, 5);
    RfSynthesisFrame f = make_muddle(&e, 60, 60, false, SIDE, 6);
    RfSynthesisSearch search = {.exemplar = &e, .frame = &f, .side = SIDE, .plain = true, .all = true};
    double before = search_with(search);
    RfSynthesisWindow *windows = malloc((size_t)window_count(&f) * sizeof *windows);
    for (search.round = 1; search.round < 5; ++search.round)
    {
        memcpy(windows, f.windows, (size_t)window_count(&f) * sizeof *windows);
        double after = search_with(search);
        assert_true(after <= before);
        before = after;
        for (int i = 0; i < window_count(&f); ++i)
        {
            bool same = f.windows[i].source.x == windows[i].source.x && f.windows[i].source.y == windows[i].source.y;
            assert_true(f.windows[i].cost <= windows[i].cost);
            assert_true(f.windows[i].changed == !same);
        }
    }
    free(windows);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

// Its own match stays unless another costs less than that part of it.
// ---- pieces

static void check_piece(const RfSynthesisExemplar *e, RfSynthesisFrame *f, const RfVec2 *sources)
{
    for (int i = 0; i < f->width * f->height; ++i)
    {
        assert_true(f->sources[i].x == sources[i].x && f->sources[i].y == sources[i].y);
        assert_true(same_pixel(f, i % f->width, i / f->width, shown_at(e, sources[i].x, sources[i].y)));
    }
    for (int i = 0; i < window_count(f); ++i)
        assert_true(f->windows[i].cost == 0);
}

static void keep_as_it_is(const RfSynthesisExemplar *e, const RfWindowDatabase *windows, bool mean, bool robust)
{
    // One that tiles is its own frame, shifted round its borders.
    RfSynthesisFrame f = e->tiles ? make_piece(e, 44, 39, true, 13, 30, 2) : make_piece(e, 33, 29, false, 8, 5, 2);
    RfVec2 sources[44 * 39];
    int pixels = f.width * f.height;
    for (int i = 0; i < pixels; ++i)
        f.sources[i] =
            (RfVec2){(float)rf_wrap_int((int)f.sources[i].x, 44), (float)rf_wrap_int((int)f.sources[i].y, 39)};
    memcpy(sources, f.sources, (size_t)pixels * sizeof *sources);
    for (uint64_t round = 0; round < 2; ++round)
    {
        double energy = search_with((RfSynthesisSearch){
            .exemplar = e, .frame = &f, .side = SIDE, .windows = windows, .plain = true, .all = true, .round = round});
        assert_true(energy == 0);
        assign_with(
            (RfSynthesisAssign){.exemplar = e, .frame = &f, .side = SIDE, .mean = mean, .robust = robust, .all = true});
        for (int i = 0; i < window_count(&f) && !e->tiles; ++i)
            assert_false(f.stirred[i]);
        for (int i = 0; i < pixels; ++i)
            f.sources[i] = (RfVec2){(float)rf_wrap_int((int)lrintf(f.sources[i].x), 44),
                                    (float)rf_wrap_int((int)lrintf(f.sources[i].y), 39)};
        check_piece(e, &f, sources);
    }
    rf_synthesis_frame_free(&f);
}

// Whatever the search and the form: nothing can be better, so nothing changes.
static void a_piece_of_the_exemplar_is_a_fixed_point(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfSynthesisExemplar e = make_exemplar(44, 39, CHANNELS, tiles, 5);
        RfWindowDatabase *windows = all_windows(&e, SIDE);
        for (int i = 0; i < 8; ++i)
            keep_as_it_is(&e, i & 1 ? windows : NULL, i & 2, i & 4);
        rf_windows_destroy(windows);
        rf_synthesis_exemplar_free(&e);
    }
}

// The pixels round a window know where they come from: all of them say where its centre should.
static void a_window_that_has_lost_its_place_is_told_it_by_its_pixels(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(44, 39, CHANNELS, false, 5);
    RfSynthesisFrame f = make_piece(&e, 36, 36, false, 2, 1, 12);
    for (int i = 0; i < window_count(&f); ++i)
    {
        RfSynthesisWindow *w = &f.windows[i];
        // Neither the window nor its middle pixel.
        f.sources[(int)w->at.y * 36 + (int)w->at.x] = w->source = (RfVec2){5, 5};
    }
    double energy =
        search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE, .plain = true, .all = true});
    assert_true(energy == 0);
    for (int i = 0; i < window_count(&f); ++i)
        assert_true(f.windows[i].source.x == f.windows[i].at.x + 2 && f.windows[i].source.y == f.windows[i].at.y + 1);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

// Turned by a quarter, the exemplar lies in the frame so that windows that know of the turn find it.
static void a_turned_piece_is_found_by_windows_that_are_turned_alike(void **state)
{
    (void)state;
    enum
    {
        N = 40
    };
    RfSynthesisExemplar e = make_exemplar(N, N, CHANNELS, false, 5);
    RfSynthesisFrame f = make_piece(&e, N, N, false, 0, 0, 2);
    static RfVec2 turns[N * N];
    // A step to the right in the frame is a step down in the exemplar.
    const RfVec2 turn = {0, 1};
    for (int i = 0; i < N * N; ++i)
    {
        RfVec2 step = rf_turn(turn, (RfVec2){(float)(i % N), (float)(i / N)});
        assert_true(fabsf(rf_turn_back(turn, step).x - (float)(i % N)) < 1e-4f);
        f.sources[i] = (RfVec2){step.x + N - 1, step.y};
        turns[i] = turn;
    }
    rf_synthesis_show(&f, &e, 0, (RfSynthesisHeld){0});
    assert_true(same_pixel(&f, 3, 5, shown_at(&e, N - 1 - 5, 3)));
    rf_synthesis_place(&f, turns);
    assert_true(search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE, .all = true}) == 0);
    assign_with((RfSynthesisAssign){.exemplar = &e, .frame = &f, .side = SIDE, .together = 0.75f, .all = true});
    for (int i = 0; i < N * N; ++i)
        assert_true(same_pixel(&f, i % N, i / N, shown_at(&e, (float)(N - 1 - i / N), (float)(i % N))));
    // Windows that do not know of it find nothing like it.
    rf_synthesis_place(&f, NULL);
    assert_true(
        search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE, .plain = true, .all = true}) > 1000);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

// Turned by what is no quarter, and at another scale, a piece is still seen as it is, between pixels too.
static void a_piece_at_any_angle_costs_nothing(void **state)
{
    (void)state;
    enum
    {
        N = 40,
        EXEMPLAR = 120
    };
    RfSynthesisExemplar e = make_exemplar(EXEMPLAR, EXEMPLAR, CHANNELS, false, 5);
    static RfVec2 turns[4 * N * N];
    for (int k = 1; k < 8; ++k)
    {
        float angle = 0.4f * (float)k, scale = k % 2 ? 1 : 0.6f;
        RfVec2 turn = {scale * cosf(angle), scale * sinf(angle)}, middle = {0.5f * N, 0.5f * N};
        RfSynthesisFrame f = make_piece(&e, N, N, false, 0, 0, 2), fine;
        for (int i = 0; i < N * N; ++i)
        {
            RfVec2 step = rf_vec2_sub((RfVec2){(float)(i % N), (float)(i / N)}, middle);
            f.sources[i] = rf_vec2_add((RfVec2){60.3f, 59.8f}, rf_turn(turn, step));
        }
        for (int i = 0; i < 4 * N * N; ++i)
            turns[i] = turn;
        rf_synthesis_show(&f, &e, 0, (RfSynthesisHeld){0});
        rf_synthesis_place(&f, turns);
        assert_true(search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE, .all = true}) == 0);
        // And its doubled places are one piece.
        assert_int_equal(rf_synthesis_frame_create(2 * N, 2 * N, CHANNELS, false, &fine), RF_OK);
        rf_synthesis_refine(&f, turns, &fine);
        for (int i = 0; i < 4 * N * N; ++i)
        {
            RfVec2 step =
                rf_vec2_sub((RfVec2){(float)(i % (2 * N)), (float)(i / (2 * N))}, (RfVec2){N + 0.5f, N + 0.5f});
            RfVec2 place = rf_vec2_add((RfVec2){2 * 60.3f + 0.5f, 2 * 59.8f + 0.5f}, rf_turn(turn, step));
            assert_true(rf_vec2_length(rf_vec2_sub(place, fine.sources[i])) < 1e-3f);
        }
        rf_synthesis_frame_free(&f);
        rf_synthesis_frame_free(&fine);
    }
    rf_synthesis_exemplar_free(&e);
}

// The exact search knows whole pixels only: what its match means between pixels is told by the window and its pixels.
static void an_exact_search_keeps_a_turned_piece_one_to_a_part_of_a_pixel(void **state)
{
    (void)state;
    enum
    {
        N = 40
    };
    RfSynthesisExemplar e = make_exemplar(120, 120, CHANNELS, false, 5);
    RfWindowDatabase *windows = all_windows(&e, SIDE);
    RfSynthesisFrame f = make_piece(&e, N, N, false, 0, 0, 2);
    static RfVec2 turns[N * N];
    const RfVec2 turn = {cosf(0.7f), sinf(0.7f)};
    for (int i = 0; i < N * N; ++i)
    {
        f.sources[i] = rf_vec2_add((RfVec2){60.3f, 29.8f}, rf_turn(turn, (RfVec2){(float)(i % N), (float)(i / N)}));
        turns[i] = turn;
    }
    rf_synthesis_show(&f, &e, 0, (RfSynthesisHeld){0});
    rf_synthesis_place(&f, turns);
    // One that has lost its place is told it by its pixels.
    f.windows[window_count(&f) / 2 + 9].source = (RfVec2){5.4f, 5.4f};
    search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE, .windows = windows, .all = true});
    for (int i = 0; i < window_count(&f); ++i)
    {
        RfVec2 place = f.sources[(int)f.windows[i].at.y * N + (int)f.windows[i].at.x];
        assert_true(rf_vec2_length(rf_vec2_sub(f.windows[i].source, place)) < 1e-3f);
    }
    rf_windows_destroy(windows);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

enum
{
    /// Channels that are no guide.
    MADE = 2
};

// The cost of the middle window, of a frame whose places are one piece turned by half a right angle, which shows a
// constant wherever it is held and whose last channel is a guide.
static double cost_of_what_is_given(const RfSynthesisExemplar *e, float hold, int16_t held, int16_t guide)
{
    enum
    {
        N = 24
    };
    RfSynthesisFrame f = make_piece(e, N, N, false, 0, 0, 2);
    RfFixedPicture to;
    static float holds[N * N];
    static RfVec2 turns[N * N];
    assert_int_equal(rf_fixed_create(N, N, MADE, 0, &to), RF_OK);
    for (int i = 0; i < N * N; ++i)
    {
        turns[i] = (RfVec2){0.70710678f, 0.70710678f};
        f.sources[i] = rf_vec2_add((RfVec2){30, 30}, rf_turn(turns[i], (RfVec2){(float)(i % N), (float)(i / N)}));
        holds[i] = hold;
        for (int c = 0; c < MADE; ++c)
            rf_fixed_at(&to, i % N, i / N)[c] = held;
        rf_fixed_at(&f.picture, i % N, i / N)[MADE] = guide;
    }
    rf_synthesis_show(&f, e, 1, (RfSynthesisHeld){&to, holds});
    for (int i = 0; i < N * N && hold > 1e5f; ++i)
        assert_int_equal(rf_fixed_at(&f.picture, i % N, i / N)[0], held);
    rf_synthesis_place(&f, turns);
    RfSynthesisSearch search = {
        .exemplar = e, .frame = &f, .side = SIDE, .guides = 1, .held = {&to, holds}, .all = true};
    search_with(search);
    double cost = f.windows[window_count(&f) / 2 + f.columns / 2].cost;
    rf_fixed_free(&to);
    rf_synthesis_frame_free(&f);
    return cost;
}

// What is given is compared as it is, also between pixels: no part of the exemplar is added to it.
static void what_is_given_is_seen_as_it_is_by_turned_windows(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(90, 90, MADE + 1, false, 5);
    for (int y = 0; y < 90; ++y)
        for (int x = 0; x < 90; ++x)
            rf_fixed_at(&e.fixed, x, y)[MADE] = 50;
    assert_true(cost_of_what_is_given(&e, 0, 0, 50) == 0);
    assert_true(cost_of_what_is_given(&e, 0, 0, 53) == 9 * SIDE * SIDE);
    for (int y = 0; y < 90; ++y)
        for (int x = 0; x < 90; ++x)
            for (int c = 0; c < MADE; ++c)
                rf_fixed_at(&e.fixed, x, y)[c] = (int16_t)((x + y) % 2 ? 10 : 0);
    // A chequered window is compared with a constant one, not with what the chequers under it would add.
    const int more = (SIDE * SIDE + 1) / 2, fewer = SIDE * SIDE / 2;
    assert_true(cost_of_what_is_given(&e, 1e6f, 70, 50) == MADE * (more * 60 * 60 + fewer * 70 * 70));
    rf_synthesis_exemplar_free(&e);
}

// Its corners reach farther than those of one that is not, and one of half the scale sees twice as far.
static void turned_windows_are_searched_again_when_their_corners_change(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(120, 120, CHANNELS, false, 5);
    for (int k = 0; k < 3; ++k)
    {
        const RfVec2 turn = k == 0 ? (RfVec2){1, 0} : k == 1 ? (RfVec2){0.70710678f, 0.70710678f} : (RfVec2){0.5f, 0};
        const int reach = k == 0 ? SIDE / 2 : k == 1 ? (int)(1.4142f * (SIDE / 2)) : SIDE;
        static RfVec2 turns[60 * 60];
        for (int i = 0; i < 60 * 60; ++i)
            turns[i] = turn;
        RfSynthesisFrame f = make_piece(&e, 60, 60, false, 20, 20, 1);
        rf_synthesis_place(&f, turns);
        memset(f.stirred, 0, (size_t)window_count(&f));
        f.stirred[30 * 60 + 30 + reach] = 1;
        f.windows[30 * 60 + 30].cost = -1;
        search_with((RfSynthesisSearch){.exemplar = &e, .frame = &f, .side = SIDE});
        assert_true(f.windows[30 * 60 + 30].cost >= 0);
        rf_synthesis_frame_free(&f);
    }
    rf_synthesis_exemplar_free(&e);
}

// What has not been touched is not searched, and what has not changed is not made anew.
static void only_what_is_stirred_is_searched_and_only_what_has_changed_is_made(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(44, 39, CHANNELS, false, 5);
    RfSynthesisFrame f = make_piece(&e, 36, 36, false, 2, 1, 4);
    RfSynthesisSearch search = {.exemplar = &e, .frame = &f, .side = SIDE, .plain = true};
    memset(f.stirred, 0, (size_t)window_count(&f));
    f.windows[0].source.x += 3;
    f.windows[80].source.x += 3;
    f.stirred[80] = 1;
    search_with(search);
    assert_true(f.windows[0].source.x == f.windows[0].at.x + 2 + 3 && !f.windows[0].changed);
    assert_true(f.windows[80].source.x == f.windows[80].at.x + 2 && f.windows[80].changed);
    for (int i = 0; i < window_count(&f); ++i)
        f.windows[i].changed = false;
    int16_t *pixel = rf_fixed_at(&f.picture, 18, 18), before = *pixel;
    *pixel = (int16_t)(before + 1);
    assign_with((RfSynthesisAssign){.exemplar = &e, .frame = &f, .side = SIDE});
    assert_int_equal(*pixel, before + 1);
    f.windows[4 * 9 + 4].changed = true;
    assign_with((RfSynthesisAssign){.exemplar = &e, .frame = &f, .side = SIDE});
    assert_int_equal(*pixel, before);
    rf_synthesis_frame_free(&f);
    rf_synthesis_exemplar_free(&e);
}

// ---- levels

static void doubled_places_of_a_piece_are_a_piece(void **state)
{
    (void)state;
    RfSynthesisExemplar e = make_exemplar(60, 60, 1, false, 5);
    RfSynthesisFrame coarse = make_piece(&e, 14, 11, false, 3, 5, 2), fine;
    assert_int_equal(rf_synthesis_frame_create(27, 22, 1, false, &fine), RF_OK);
    rf_synthesis_refine(&coarse, NULL, &fine);
    for (int i = 0; i < 27 * 22; ++i)
        assert_true(fine.sources[i].x == (float)(6 + i % 27) && fine.sources[i].y == (float)(10 + i / 27));
    rf_synthesis_frame_free(&coarse);
    rf_synthesis_frame_free(&fine);
    rf_synthesis_exemplar_free(&e);
}

static void scattered_windows_lie_inside_everywhere_and_by_their_seed(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles)
    {
        RfSynthesisExemplar e = make_exemplar(20, 17, 1, tiles, 5);
        RfSynthesisFrame a = make_piece(&e, 128, 128, false, 0, 0, 2), b = make_piece(&e, 128, 128, false, 0, 0, 2);
        int seen[20 * 17] = {0}, margin = tiles ? 0 : SIDE / 2, places = (20 - 2 * margin) * (17 - 2 * margin);
        rf_synthesis_scatter(&a, &e, SIDE, 1);
        rf_synthesis_scatter(&b, &e, SIDE, 2);
        int alike = 0, different = 0;
        for (int i = 0; i < window_count(&a); ++i)
        {
            RfVec2 s = a.windows[i].source;
            assert_true(s.x >= (float)margin && s.x <= (float)(19 - margin));
            assert_true(s.y >= (float)margin && s.y <= (float)(16 - margin));
            different += seen[(int)s.y * 20 + (int)s.x]++ == 0;
            alike += s.x == b.windows[i].source.x && s.y == b.windows[i].source.y;
        }
        assert_int_equal(different, places);
        assert_true(alike < window_count(&a) / 20);
        rf_synthesis_frame_free(&a);
        rf_synthesis_frame_free(&b);
        rf_synthesis_exemplar_free(&e);
    }
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
        cmocka_unit_test(every_cost_is_that_of_its_match_and_the_energy_is_their_mean),
        cmocka_unit_test(the_exact_search_finds_what_a_slow_one_finds),
        cmocka_unit_test(the_exact_search_is_that_of_all_windows),
        cmocka_unit_test(k_coherent_candidates_are_never_better_than_all),
        cmocka_unit_test(a_search_without_prices_never_makes_a_window_dearer),
        cmocka_unit_test(a_piece_of_the_exemplar_is_a_fixed_point),
        cmocka_unit_test(a_window_that_has_lost_its_place_is_told_it_by_its_pixels),
        cmocka_unit_test(a_turned_piece_is_found_by_windows_that_are_turned_alike),
        cmocka_unit_test(a_piece_at_any_angle_costs_nothing),
        cmocka_unit_test(an_exact_search_keeps_a_turned_piece_one_to_a_part_of_a_pixel),
        cmocka_unit_test(what_is_given_is_seen_as_it_is_by_turned_windows),
        cmocka_unit_test(turned_windows_are_searched_again_when_their_corners_change),
        cmocka_unit_test(only_what_is_stirred_is_searched_and_only_what_has_changed_is_made),
        cmocka_unit_test(doubled_places_of_a_piece_are_a_piece),
        cmocka_unit_test(scattered_windows_lie_inside_everywhere_and_by_their_seed),
    };
    return cmocka_run_group_tests_name("synthesis", tests, one_thread, NULL);
}
