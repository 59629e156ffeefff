// SPDX-License-Identifier: Apache-2.0
// The assign step of texture optimisation, the prices that spread use, and the levels it works on.
#include "kernels/synthesis_material.h"
#include "support/sanitized.h"
#include "support/synthesis_check.h"

enum
{
    SIDE = 9,
    HALF = SIDE / 2,
    CHANNELS = 3,
    W = 32,
    H = 28,
    SPACING = 4
};

// The rule of the fall-off from a window's middle, and of the weight of a cost, written down once more.
static double fall(double d)
{
    double sigma = 0.4 * SIDE;
    return exp(-d * d / (2 * sigma * sigma));
}

typedef struct Scene
{
    RfSynthesisExemplar e;
    RfSynthesisFrame f;
} Scene;

// A frame of one colour that the exemplar does not have, without any window.
static Scene open_scene(bool tiles)
{
    Scene s = {.e = make_exemplar(40, 37, CHANNELS, tiles, 1)};
    s.f = make_piece(&s.e, W, H, tiles, 0, 0, SPACING);
    for (int i = 0; i < W * H; ++i)
    {
        s.f.sources[i] = (RfVec2){-1, -1};
        for (int c = 0; c < CHANNELS; ++c)
            rf_fixed_at(&s.f.picture, i % W, i / W)[c] = 601;
    }
    for (int i = 0; i < window_count(&s.f); ++i)
        s.f.windows[i].exists = false;
    return s;
}

static void close_scene(Scene *s)
{
    rf_synthesis_frame_free(&s->f);
    rf_synthesis_exemplar_free(&s->e);
}

static RfSynthesisWindow *put_window(Scene *s, int column, int row, float x, float y)
{
    RfSynthesisWindow *w = &s->f.windows[row * s->f.columns + column];
    w->exists = true;
    w->source = (RfVec2){x, y};
    return w;
}

static RfSynthesisAssign plain_assign(Scene *s)
{
    return (RfSynthesisAssign){.exemplar = &s->e, .frame = &s->f, .side = SIDE, .all = true};
}

// ---- assign

static void one_window_alone_is_copied_and_nothing_beside_it_is_touched(void **state)
{
    (void)state;
    for (int mean = 0; mean < 2; ++mean)
        for (int robust = 0; robust < 2; ++robust)
        {
            Scene s = open_scene(false);
            const RfSynthesisWindow *w = put_window(&s, 3, 3, 20, 11);
            RfSynthesisAssign assign = plain_assign(&s);
            assign.mean = mean;
            assign.robust = robust;
            assign_with(assign);
            static const int16_t untouched[CHANNELS] = {601, 601, 601};
            for (int y = 0; y < H; ++y)
                for (int x = 0; x < W; ++x)
                {
                    float dx = (float)x - w->at.x, dy = (float)y - w->at.y;
                    RfVec2 source = s.f.sources[y * W + x];
                    bool under = fabsf(dx) <= HALF && fabsf(dy) <= HALF;
                    // A cell over which one window lies alone is a piece of it, past its border too.
                    if (!under && source.x < 0)
                    {
                        assert_true(same_pixel(&s.f, x, y, untouched));
                        continue;
                    }
                    assert_true(source.x == 20 + dx && source.y == 11 + dy);
                    assert_true(same_pixel(&s.f, x, y, shown_at(&s.e, source.x, source.y)));
                    assert_true(fabsf(dx) <= HALF + SPACING && fabsf(dy) <= HALF + SPACING);
                }
            close_scene(&s);
        }
}

// Pixels that the window would take from beyond the exemplar stay.
static void nothing_is_taken_from_beyond_the_exemplar(void **state)
{
    (void)state;
    Scene s = open_scene(false);
    const RfSynthesisWindow *w = put_window(&s, 3, 3, 38, 1);
    assign_with(plain_assign(&s));
    for (int y = (int)w->at.y - HALF; y <= (int)w->at.y + HALF; ++y)
        for (int x = (int)w->at.x - HALF; x <= (int)w->at.x + HALF; ++x)
        {
            float u = 38 + (float)x - w->at.x, v = 1 + (float)y - w->at.y;
            bool inside = u < 40 && v >= 0;
            assert_true((s.f.sources[y * W + x].x >= 0) == inside);
            assert_true((*rf_fixed_at(&s.f.picture, x, y) != 601) == inside);
        }
    close_scene(&s);
}

static double weight_of(const RfSynthesisWindow *w, int x, int y, bool robust)
{
    double dx = fabs((double)x - (double)w->at.x), dy = fabs((double)y - (double)w->at.y);
    double level = 4, least = SIDE * SIDE * CHANNELS * level * level;
    if (dx > HALF || dy > HALF)
        return 0;
    return fall(dx) * fall(dy) * (robust ? pow((double)w->cost + least, (0.8 - 2) / 2) : 1);
}

static const int16_t *says(const Scene *s, const RfSynthesisWindow *w, int x, int y)
{
    return shown_at(&s->e, w->source.x + (float)x - w->at.x, w->source.y + (float)y - w->at.y);
}

static void the_mean_form_of_two_windows_is_their_weighted_mean(void **state)
{
    (void)state;
    for (int robust = 0; robust < 2; ++robust)
    {
        Scene s = open_scene(false);
        RfSynthesisWindow *a = put_window(&s, 3, 3, 20, 11), *b = put_window(&s, 4, 3, 12, 25);
        a->cost = 9000;
        b->cost = 2000;
        RfSynthesisAssign assign = plain_assign(&s);
        assign.mean = true;
        assign.robust = robust;
        assign_with(assign);
        int mixed = 0;
        for (int y = 0; y < H; ++y)
            for (int x = 0; x < W; ++x)
            {
                double wa = weight_of(a, x, y, robust), wb = weight_of(b, x, y, robust);
                mixed += wa > 0 && wb > 0;
                for (int c = 0; c < CHANNELS && wa > 0 && wb > 0; ++c)
                {
                    double mean = (wa * says(&s, a, x, y)[c] + wb * says(&s, b, x, y)[c]) / (wa + wb);
                    // Rounded to whole numbers.
                    assert_true(fabs(mean - rf_fixed_at(&s.f.picture, x, y)[c]) < 0.51);
                }
            }
        assert_int_equal(mixed, (SIDE - SPACING) * SIDE);
        close_scene(&s);
    }
}

static double distance_of(const int16_t *a, const double *b)
{
    double sum = 0;
    for (int c = 0; c < CHANNELS; ++c)
        sum += (a[c] - b[c]) * (a[c] - b[c]);
    return sum;
}

static void a_pixel_of_the_discrete_form_is_what_the_window_nearest_to_the_mean_says(void **state)
{
    (void)state;
    Scene s = open_scene(false);
    RfSynthesisWindow *w[4] = {put_window(&s, 3, 3, 20, 11), put_window(&s, 4, 3, 12, 25), put_window(&s, 3, 4, 30, 30),
                               put_window(&s, 4, 4, 9, 9)};
    int chosen[4] = {0};
    assign_with(plain_assign(&s));
    for (int y = 0; y < H; ++y)
        for (int x = 0; x < W; ++x)
        {
            double mean[CHANNELS] = {0}, total = 0;
            for (int i = 0; i < 4; ++i)
                total += weight_of(w[i], x, y, false);
            for (int i = 0; i < 4 && total > 0; ++i)
                for (int c = 0; c < CHANNELS; ++c)
                    mean[c] += weight_of(w[i], x, y, false) / total * says(&s, w[i], x, y)[c];
            int best = -1;
            for (int i = 0; i < 4; ++i)
                if (weight_of(w[i], x, y, false) > 0 &&
                    (best < 0 || distance_of(says(&s, w[i], x, y), mean) < distance_of(says(&s, w[best], x, y), mean)))
                    best = i;
            if (best < 0)
                continue;
            ++chosen[best];
            assert_true(same_pixel(&s.f, x, y, says(&s, w[best], x, y)));
            assert_true(s.f.sources[y * W + x].x == w[best]->source.x + (float)x - w[best]->at.x);
            assert_true(s.f.sources[y * W + x].y == w[best]->source.y + (float)y - w[best]->at.y);
        }
    for (int i = 0; i < 4; ++i)
        assert_true(chosen[i] > 10);
    close_scene(&s);
}

// Three windows that say the same outweigh one that says something else.
static void windows_that_agree_are_counted_together(void **state)
{
    (void)state;
    Scene s = open_scene(false);
    put_window(&s, 3, 3, 12, 12);
    put_window(&s, 4, 3, 16, 12);
    put_window(&s, 3, 4, 12, 16);
    const RfSynthesisWindow *other = put_window(&s, 4, 4, 30, 20);
    assign_with(plain_assign(&s));
    // The middle of the four, which counts least for the one that disagrees.
    int x = (int)other->at.x - SPACING / 2, y = (int)other->at.y - SPACING / 2;
    assert_true(s.f.sources[y * W + x].x == 16 - SPACING / 2 && s.f.sources[y * W + x].y == 16 - SPACING / 2);
    close_scene(&s);
}

static void windows_of_a_frame_that_tiles_reach_round_its_borders(void **state)
{
    (void)state;
    Scene s = open_scene(true);
    const RfSynthesisWindow *w = put_window(&s, 0, 0, 20, 11);
    assign_with(plain_assign(&s));
    for (int dy = -HALF; dy <= HALF; ++dy)
        for (int dx = -HALF; dx <= HALF; ++dx)
        {
            int x = rf_wrap_int((int)w->at.x + dx, W), y = rf_wrap_int((int)w->at.y + dy, H);
            assert_true(same_pixel(&s.f, x, y, shown_at(&s.e, (float)(20 + dx), (float)(11 + dy))));
        }
    close_scene(&s);
}

// ---- held pixels

static void pixels_are_held_as_strongly_as_they_are_told(void **state)
{
    (void)state;
    static const float strengths[] = {0, 1, 3, 1e6f};
    for (size_t k = 0; k < 4; ++k)
        for (int mean = 0; mean < 2; ++mean)
        {
            Scene s = open_scene(false);
            RfFixedPicture held;
            static float hold[W * H];
            assert_int_equal(rf_fixed_create(W, H, CHANNELS, 0, &held), RF_OK);
            for (int i = 0; i < W * H; ++i)
            {
                hold[i] = i % 3 ? strengths[k] : 0;
                for (int c = 0; c < CHANNELS; ++c)
                    rf_fixed_at(&held, i % W, i / W)[c] = (int16_t)(100 * c - i % 7);
            }
            const RfSynthesisWindow *w = put_window(&s, 3, 3, 20, 11);
            RfSynthesisAssign assign = plain_assign(&s);
            assign.mean = mean;
            assign.held = (RfSynthesisHeld){&held, hold};
            assign_with(assign);
            for (int y = (int)w->at.y - HALF; y <= (int)w->at.y + HALF; ++y)
                for (int x = (int)w->at.x - HALF; x <= (int)w->at.x + HALF; ++x)
                    for (int c = 0; c < CHANNELS; ++c)
                    {
                        double h = (double)hold[y * W + x];
                        double expected = (says(&s, w, x, y)[c] + h * rf_fixed_at(&held, x, y)[c]) / (1 + h);
                        assert_true(fabs(expected - rf_fixed_at(&s.f.picture, x, y)[c]) < 0.51);
                    }
            rf_fixed_free(&held);
            close_scene(&s);
        }
}

// The last channels of a picture may be a guide: they are given.
static void guides_are_not_made(void **state)
{
    (void)state;
    Scene s = open_scene(false);
    const RfSynthesisWindow *w = put_window(&s, 3, 3, 20, 11);
    RfSynthesisAssign assign = plain_assign(&s);
    assign.guides = 1;
    assign_with(assign);
    const int16_t *pixel = rf_fixed_at(&s.f.picture, (int)w->at.x, (int)w->at.y);
    assert_true(pixel[0] == shown_at(&s.e, 20, 11)[0] && pixel[1] == shown_at(&s.e, 20, 11)[1] && pixel[2] == 601);
    close_scene(&s);
}

// ---- prices

static void even_use_leaves_prices_alone(void **state)
{
    (void)state;
    RfUsage usage = {{0}, {0}};
    for (int round = 0; round < 5; ++round)
    {
        for (int y = 4; y < 60; ++y)
            for (int x = 4; x < 36; ++x)
                rf_usage_add(&usage, 40, 64, 4, (float)x, (float)y);
        for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
            assert_true(usage.count[i] == 4 * 7);
        rf_usage_settle(&usage);
        for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
            assert_true(usage.count[i] == 0 && fabsf(usage.price[i]) < 1e-6f);
    }
    // No use at all says nothing.
    rf_usage_settle(&usage);
    for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
        assert_true(fabsf(usage.price[i]) < 1e-6f);
}

static void prices_rise_where_it_is_crowded_and_fall_elsewhere(void **state)
{
    (void)state;
    RfUsage usage = {{0}, {0}};
    const int crowded = 2 * RF_USAGE_CELLS + 5;
    float before = 0;
    for (int round = 0; round < 4; ++round)
    {
        for (int i = 0; i < 1000; ++i)
            rf_usage_add(&usage, 80, 80, 0, 55, 25);
        rf_usage_settle(&usage);
        assert_true(usage.price[crowded] > before);
        before = usage.price[crowded];
        for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
        {
            int dx = abs(i % RF_USAGE_CELLS - 5), dy = abs(i / RF_USAGE_CELLS - 2);
            assert_true(i == crowded || usage.price[i] <= usage.price[crowded]);
            if (dx > 1 || dy > 1)
                assert_true(usage.price[i] < 0);
        }
    }
    // Once all crowd elsewhere, it falls again.
    for (int i = 0; i < 1000; ++i)
        rf_usage_add(&usage, 80, 80, 0, 5, 75);
    rf_usage_settle(&usage);
    assert_true(usage.price[crowded] < before);
}

static void prices_between_cells_lie_between_theirs(void **state)
{
    (void)state;
    RfUsage usage = {{0}, {0}};
    static float prices[64 * 64];
    for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
        usage.price[i] = 0.25f;
    rf_usage_prices(&usage, 64, 64, 8, 4, prices);
    for (int i = 0; i < 64 * 64; ++i)
        assert_true(fabsf(prices[i] - 1) < 1e-6f);
    // A ramp is a ramp between the middles of the first and the last cell, and level beyond.
    for (int i = 0; i < RF_USAGE_CELLS * RF_USAGE_CELLS; ++i)
        usage.price[i] = (float)(i % RF_USAGE_CELLS);
    rf_usage_prices(&usage, 64, 64, 0, 1, prices);
    for (int x = 0; x < 64; ++x)
        assert_true(fabsf(prices[30 * 64 + x] - rf_clamp(((float)x + 0.5f) / 8 - 0.5f, 0, 7)) < 1e-5f);
}

// ---- levels

static RfExemplar *noise_exemplar(int width, int height, bool pairs)
{
    float *pixels = malloc((size_t)(width * height * 4) * sizeof *pixels);
    for (int i = 0; i < 4 * width * height; ++i)
        pixels[i] = rf_random_float(3, 0, (uint64_t)(pairs ? i / 2 : i), 0);
    RfMapView map = {"all", RF_MAP_DATA, {pixels, width, height, 4, 4 * width}, 2};
    RfExemplar *e = NULL;
    assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_NO, &e), RF_OK);
    free(pixels);
    return e;
}

static void levels_halve_down_to_what_still_holds_windows(void **state)
{
    (void)state;
    static const int cases[][4] = {// width, height, asked, levels at least
                                   {96, 97, 0, 3}, {100, 66, 0, 3}, {64, 64, 0, 3},  {20, 20, 0, 2},  {8, 8, 0, 1},
                                   {40, 40, 1, 1}, {40, 48, 2, 2},  {64, 64, 10, 4}, {192, 200, 0, 4}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases - TEST_SANITIZED; ++i)
    {
        RfExemplar *e = noise_exemplar(cases[i][0], cases[i][1], false);
        RfSynthesisMaterial m;
        assert_int_equal(rf_synthesis_material_create(e, cases[i][2], 1, &m), RF_OK);
        // As many as asked for; more where nothing was asked for, as long as 8 pixels are left.
        assert_true(cases[i][2] ? m.level_count == cases[i][3] : m.level_count >= cases[i][3]);
        const RfSynthesisExemplar *coarsest = &m.levels[m.level_count - 1];
        assert_true(rf_min_int(coarsest->width, coarsest->height) >= 8);
        for (int l = 1; l < m.level_count; ++l)
        {
            assert_int_equal(m.levels[l].width, (m.levels[l - 1].width + 1) / 2);
            assert_int_equal(m.levels[l].height, (m.levels[l - 1].height + 1) / 2);
        }
        for (int l = 0; l < m.level_count; ++l)
            for (int side = 5; side <= 33; side += 4)
            {
                int s = rf_synthesis_side(&m, l, side, 40, 20);
                int least = rf_min_int(m.levels[l].width, m.levels[l].height);
                assert_true(s == 0 || (s % 2 == 1 && s >= 5 && s <= side && s <= 20 && s <= least * 2 / 3));
                // None only where none fits.
                assert_true(s > 0 || least * 2 / 3 < 5);
            }
        rf_synthesis_material_free(&m);
        rf_exemplar_destroy(e);
    }
}

// Squared differences of compared channels are those of all, with their weights: equal channels are compared once.
static void equal_channels_are_compared_once_with_their_weights_sum(void **state)
{
    (void)state;
    for (int pairs = 0; pairs < 2; ++pairs)
    {
        RfExemplar *e = noise_exemplar(16, 16, pairs);
        RfSynthesisMaterial m;
        assert_int_equal(rf_synthesis_material_create(e, 1, 1, &m), RF_OK);
        assert_int_equal(m.comparison.channels, pairs ? 2 : 4);
        const RfMapView map = rf_exemplar_map(e, 0, NULL);
        for (int i = 0; i < 255; ++i)
        {
            double compared = 0, all = 0;
            for (int c = 0; c < m.comparison.channels; ++c)
                compared += pow((double)(m.levels[0].pixels[(i + 1) * m.comparison.channels + c] -
                                         m.levels[0].pixels[i * m.comparison.channels + c]),
                                2);
            for (int c = 0; c < 4; ++c)
                all += 2 * pow((double)(map.image.pixels[(i + 1) * 4 + c] - map.image.pixels[i * 4 + c]), 2);
            assert_true(fabs(compared - all) < 1e-5 * all);
        }
        // Room is left for what goes beyond the exemplar's range.
        for (int i = 0; i < 16 * 16; ++i)
            for (int c = 0; c < m.comparison.channels; ++c)
                assert_true(abs(rf_fixed_at(&m.levels[0].fixed, i % 16, i / 16)[c]) < RF_FIXED_RANGE / 2);
        rf_synthesis_material_free(&m);
        rf_exemplar_destroy(e);
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
        cmocka_unit_test(one_window_alone_is_copied_and_nothing_beside_it_is_touched),
        cmocka_unit_test(nothing_is_taken_from_beyond_the_exemplar),
        cmocka_unit_test(the_mean_form_of_two_windows_is_their_weighted_mean),
        cmocka_unit_test(a_pixel_of_the_discrete_form_is_what_the_window_nearest_to_the_mean_says),
        cmocka_unit_test(windows_that_agree_are_counted_together),
        cmocka_unit_test(windows_of_a_frame_that_tiles_reach_round_its_borders),
        cmocka_unit_test(pixels_are_held_as_strongly_as_they_are_told),
        cmocka_unit_test(guides_are_not_made),
        cmocka_unit_test(even_use_leaves_prices_alone),
        cmocka_unit_test(prices_rise_where_it_is_crowded_and_fall_elsewhere),
        cmocka_unit_test(prices_between_cells_lie_between_theirs),
        cmocka_unit_test(levels_halve_down_to_what_still_holds_windows),
        cmocka_unit_test(equal_channels_are_compared_once_with_their_weights_sum),
    };
    return cmocka_run_group_tests_name("assign", tests, one_thread, NULL);
}
