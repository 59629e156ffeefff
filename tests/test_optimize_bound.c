// SPDX-License-Identifier: Apache-2.0
// Still textures that are bound: to their own other side, to given pixels, to a target, a guide, a direction, a scale.
#include "kernels/neighbours.h"
#include "support/optimize_check.h"
#include "support/sanitized.h"

enum
{
    SIDE = 9,
    MOST = 500,
    SEEDS = TEST_SANITIZED ? 1 : 3
};

// Mean distance of windows with these corners to their nearest in the exemplar.
static double distance_of(const RfExemplar *exemplar, const RfImageView *picture, const int (*corners)[2], int count)
{
    RfMapView map = rf_exemplar_map(exemplar, 0, NULL);
    RfWindowSource from = {.image = map.image}, to = {.image = *picture};
    RfWindowOptions options = {.side = SIDE};
    RfWindowDatabase *windows;
    float *queries = numbers_of(SIDE * SIDE * picture->channels, count, 1);
    RfWindowMatch *matches = malloc((size_t)count * sizeof *matches);
    assert_int_equal(rf_windows_create(&from, 1, &options, &windows), RF_OK);
    assert_int_equal(rf_windows_gather(&to, SIDE, true, corners, count, queries, NULL), RF_OK);
    RfWindowQueries asked = {.count = count, .windows = queries};
    assert_int_equal(rf_windows_search(windows, &asked, matches), RF_OK);
    double sum = 0;
    for (int i = 0; i < count; ++i)
        sum += (double)matches[i].distance;
    rf_windows_destroy(windows);
    free(queries);
    free(matches);
    return sum / count;
}

// ---- tiles

// Over the border and inside: how far windows are from the exemplar.
static void border_and_inside(bool tile, int width, int height, double *border, double *inside)
{
    RfExemplar *exemplar = spotted_exemplar(64, 64, 1, RF_TILING_NO);
    RfOptimizeOptions options = rf_optimize_defaults();
    options.tile = tile;
    *border = *inside = 0;
    for (options.seed = 1; options.seed <= SEEDS; ++options.seed)
    {
        float *pixels = still_of(exemplar, &options, NULL, width, height);
        RfImageView view = picture_of(pixels, width, height, 1);
        static int over[MOST][2], middle[MOST][2];
        int border_count = 0, inside_count = 0;
        for (int x = 0; x < width; x += 2, ++border_count)
            over[border_count][0] = x, over[border_count][1] = height - 1 - SIDE / 2;
        for (int y = 0; y < height; y += 2, ++border_count)
            over[border_count][0] = width - 1 - SIDE / 2, over[border_count][1] = y;
        for (int y = SIDE; y < height - 2 * SIDE; y += 5)
            for (int x = SIDE; x < width - 2 * SIDE; x += 5, ++inside_count)
                middle[inside_count][0] = x, middle[inside_count][1] = y;
        *inside += distance_of(exemplar, &view, (const int(*)[2])middle, inside_count);
        *border += distance_of(exemplar, &view, (const int(*)[2])over, border_count);
        free(pixels);
    }
    rf_exemplar_destroy(exemplar);
    print_message("%d x %d %s: over the border %.2f, inside %.2f\n", width, height, tile ? "tiles" : "does not tile",
                  *border / SEEDS, *inside / SEEDS);
}

// Sizes that halve without a rest on all levels; others meet themselves a pixel off, and are mended on the finest
// level only.
static void windows_over_the_border_of_a_tile_are_as_near_the_exemplar_as_others(void **state)
{
    (void)state;
    static const int sizes[][2] = {{72, 64}, {80, 72}};
    double border, inside, sum[2] = {0, 0};
    for (int i = 0; i < 2; ++i)
    {
        border_and_inside(true, sizes[i][0], sizes[i][1], &border, &inside);
        sum[0] += border;
        sum[1] += inside;
    }
    if (TEST_SANITIZED)
        return; // Too few to be judged.
    assert_true(sum[0] < 1.3 * sum[1]);
    double cut;
    border_and_inside(true, 70, 63, &border, &inside);
    border_and_inside(false, 70, 63, &cut, &inside);
    assert_true(cut > 3 * inside && border < 0.6 * cut);
}

// ---- given pixels

enum
{
    N = 64,
    HOLE = 18,
    FIRST = 22
};

static bool in_hole(int i)
{
    int x = i % N, y = i / N;
    return x >= FIRST && x < FIRST + HOLE && y >= FIRST && y < FIRST + HOLE;
}

static double hole_error(const float *truth, const float *made)
{
    double sum = 0;
    for (int i = 0; i < N * N; ++i)
        if (in_hole(i))
            sum += pow((double)(truth[i] - made[i]), 2);
    return sqrt(sum / (HOLE * HOLE));
}

static double hole_deviation(const float *truth)
{
    double sum = 0, squares = 0;
    for (int i = 0; i < N * N; ++i)
        if (in_hole(i))
        {
            sum += (double)truth[i];
            squares += (double)(truth[i] * truth[i]);
        }
    return sqrt(squares / (HOLE * HOLE) - pow(sum / (HOLE * HOLE), 2));
}

static void fixed_pixels_stay_to_the_bit_and_a_hole_that_the_exemplar_knows_is_filled(void **state)
{
    (void)state;
    float *truth = spots(N, N, 1, 7), *fixed = numbers_of(N, N, 2);
    RfMapView map = {"spots", RF_MAP_DATA, picture_of(truth, N, N, 1), 1};
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
    for (int i = 0; i < N * N; ++i)
    {
        fixed[2 * i] = in_hole(i) ? 55 : truth[i];
        fixed[2 * i + 1] = in_hole(i) ? 0 : 1;
    }
    RfOptimizeConstraints constraints = {.fixed = picture_of(fixed, N, N, 2)};
    RfOptimizeOptions options = rf_optimize_defaults();
    float *made = still_of(exemplar, &options, &constraints, N, N);
    for (int i = 0; i < N * N; ++i)
        assert_true(in_hole(i) || made[i] == truth[i]);
    double error = hole_error(truth, made), mean = hole_deviation(truth);
    print_message("filled %.3f, with the mean %.3f\n", error, mean);
    assert_true(error < 0.8 * mean);
    // Nothing is fixed: as if nothing were given.
    for (int i = 0; i < N * N; ++i)
        fixed[2 * i + 1] = 0;
    float *loose = still_of(exemplar, &options, &constraints, N, N),
          *free_one = still_of(exemplar, &options, NULL, N, N);
    assert_true(hole_error(truth, loose) > error);
    assert_memory_equal(loose, free_one, N * N * sizeof *loose);
    free(made);
    free(loose);
    free(free_one);
    free(fixed);
    free(truth);
    rf_exemplar_destroy(exemplar);
}

typedef struct Fill
{
    /// Of windows over the hole's rim to the exemplar, and contrast in the hole: as made, and as it was.
    double rim, natural_rim, deviation, natural_deviation;
} Fill;

static int corners_of_rim(int (*corners)[2])
{
    int count = 0;
    for (int i = 0; i < HOLE; i += 2, count += 4)
    {
        const int at[4][2] = {{FIRST - 4, FIRST - 4 + i},
                              {FIRST + HOLE - 5, FIRST - 4 + i},
                              {FIRST - 4 + i, FIRST - 4},
                              {FIRST - 4 + i, FIRST + HOLE - 5}};
        memcpy(corners[count], at, sizeof at);
    }
    return count;
}

// From the left half of a texture, a hole in its right half.
static void fill_hole(uint64_t seed, Fill *fill)
{
    float *wide = spots(2 * N, N, 1, seed), *truth = numbers_of(N, N, 1), *fixed = numbers_of(N, N, 2);
    RfMapView map = {"spots", RF_MAP_DATA, {wide, N, N, 1, 2 * N}, 1};
    RfExemplar *exemplar = exemplar_of(&map, 1, RF_TILING_NO);
    for (int i = 0; i < N * N; ++i)
    {
        truth[i] = wide[i / N * 2 * N + N + i % N];
        fixed[2 * i] = truth[i];
        fixed[2 * i + 1] = !in_hole(i);
    }
    RfOptimizeConstraints constraints = {.fixed = picture_of(fixed, N, N, 2)};
    RfOptimizeOptions options = rf_optimize_defaults();
    float *made = still_of(exemplar, &options, &constraints, N, N);
    int corners[4 * HOLE][2], count = corners_of_rim(corners);
    RfImageView view = picture_of(made, N, N, 1), before = picture_of(truth, N, N, 1);
    fill->rim += distance_of(exemplar, &view, (const int(*)[2])corners, count);
    fill->natural_rim += distance_of(exemplar, &before, (const int(*)[2])corners, count);
    fill->deviation += hole_deviation(made);
    fill->natural_deviation += hole_deviation(truth);
    free(made);
    free(truth);
    free(wide);
    free(fixed);
    rf_exemplar_destroy(exemplar);
}

// Nearer to the exemplar than what was cut out, and no flat patch.
static void a_hole_that_the_exemplar_does_not_know_is_filled_with_its_texture(void **state)
{
    (void)state;
    Fill fill = {0, 0, 0, 0};
    for (uint64_t seed = 8; seed < 12; seed += 1 + 2 * TEST_SANITIZED)
        fill_hole(seed, &fill);
    print_message("rims: %.2f from the exemplar, %.2f as it was; deviation %.2f, %.2f as it was\n", fill.rim,
                  fill.natural_rim, fill.deviation, fill.natural_deviation);
    assert_true(fill.rim < 0.9 * fill.natural_rim && fill.deviation > 0.45 * fill.natural_deviation);
}

// ---- targets and guides

// Grey noise, darker to the left; a second map may say so.
static RfExemplar *graded_exemplar(bool guided)
{
    float *grey = spots(N, N, 1, 9), *guide = numbers_of(N, N, 1);
    for (int i = 0; i < N * N; ++i)
    {
        guide[i] = (float)(i % N) / (N - 1);
        grey[i] = 0.4f * grey[i] + 0.6f * guide[i];
    }
    RfMapView maps[] = {{"grey", RF_MAP_DATA, picture_of(grey, N, N, 1), 1},
                        {"guide", RF_MAP_DATA, picture_of(guide, N, N, 1), 4}};
    RfExemplar *exemplar = exemplar_of(maps, guided ? 2 : 1, RF_TILING_NO);
    free(grey);
    free(guide);
    return exemplar;
}

// Mean of the lower half minus that of the upper one.
static double contrast_of(const float *pixels, int width, int height)
{
    double sum = 0;
    for (int i = 0; i < width * height; ++i)
        sum += (double)pixels[i] * (i / width < height / 2 ? -1 : 1);
    return sum / (width * height / 2);
}

static float *halves(int width, int height, float upper, float lower)
{
    float *pixels = numbers_of(width, height, 1);
    for (int i = 0; i < width * height; ++i)
        pixels[i] = i / width < height / 2 ? upper : lower;
    return pixels;
}

static void a_target_pulls_as_strongly_as_it_weighs(void **state)
{
    (void)state;
    RfExemplar *exemplar = graded_exemplar(false);
    float *target = halves(60, 60, 0.2f, 0.8f), *weight = numbers_of(60, 60, 1);
    RfOptimizeOptions options = rf_optimize_defaults();
    RfOptimizeConstraints constraints = {.target = picture_of(target, 60, 60, 1),
                                         .target_weight = picture_of(weight, 60, 60, 1)};
    static const float weights[] = {0, 0.3f, 3};
    double contrast[3];
    for (int k = 0; k < 3; ++k)
    {
        for (int i = 0; i < 60 * 60; ++i)
            weight[i] = weights[k];
        float *made = still_of(exemplar, &options, &constraints, 60, 60);
        contrast[k] = contrast_of(made, 60, 60);
        free(made);
    }
    print_message("lower minus upper half: %.2f %.2f %.2f, asked for 0.6\n", contrast[0], contrast[1], contrast[2]);
    assert_true(fabs(contrast[0]) < 0.25 && contrast[1] > contrast[0] + 0.15 && contrast[2] >= contrast[1] - 0.02);
    assert_true(fabs(contrast[2] - 0.6) < 0.12);
    free(target);
    free(weight);
    rf_exemplar_destroy(exemplar);
}

static void a_guide_says_which_part_of_the_exemplar_goes_where(void **state)
{
    (void)state;
    RfExemplar *exemplar = graded_exemplar(true);
    assert_int_equal(rf_optimize_channels(exemplar), 1);
    float *guide = halves(60, 60, 0.8f, 0.2f);
    RfOptimizeOptions options = rf_optimize_defaults();
    RfOptimizeConstraints constraints = {.guide = picture_of(guide, 60, 60, 1)};
    float *made = still_of(exemplar, &options, &constraints, 60, 60);
    double contrast = contrast_of(made, 60, 60);
    print_message("lower minus upper half: %.2f, guided to -0.36\n", contrast);
    assert_true(fabs(contrast + 0.36) < 0.15);
    free(made);
    free(guide);
    rf_exemplar_destroy(exemplar);
}

// ---- directions and scales

// Level stripes, somewhat uneven; a vector and a normal that point right and up lie with them.
static RfExemplar *striped_exemplar(int period)
{
    float *grey = numbers_of(N, N, 1), *vector = numbers_of(N, N, 2), *normal = numbers_of(N, N, 3);
    for (int i = 0; i < N * N; ++i)
    {
        grey[i] = 0.5f + 0.4f * sinf(2 * RF_PI * (float)(i / N) / (float)period) +
                  0.1f * rf_random_float(5, 0, (uint64_t)(i / 3), 0);
        vector[2 * i] = 2;
        normal[3 * i] = 0.5f;
        normal[3 * i + 1] = 1;
        normal[3 * i + 2] = 0.5f;
    }
    RfMapView maps[] = {{"grey", RF_MAP_DATA, picture_of(grey, N, N, 1), 1},
                        {"vector", RF_MAP_VECTOR, picture_of(vector, N, N, 2), 0},
                        {"normal", RF_MAP_NORMAL, picture_of(normal, N, N, 3), 0}};
    RfExemplar *exemplar = exemplar_of(maps, 3, RF_TILING_NO);
    free(grey);
    free(vector);
    free(normal);
    return exemplar;
}

// Rms differences of pixels that lie (dx, dy) apart, first channel of six.
static double roughness(const float *made, int size, int dx, int dy)
{
    double sum = 0;
    for (int y = 0; y + dy < size; ++y)
        for (int x = 0; x + dx < size; ++x)
            sum += pow((double)(made[6 * ((y + dy) * size + x + dx)] - made[6 * (y * size + x)]), 2);
    return sqrt(sum / ((size - dx) * (size - dy)));
}

static void fill_with(float *numbers, int count, float value)
{
    for (int i = 0; i < count; ++i)
        numbers[i] = value;
}

static void the_exemplar_is_turned_clockwise_and_what_points_with_it(void **state)
{
    (void)state;
    enum
    {
        SIZE = 48
    };
    RfExemplar *exemplar = striped_exemplar(8);
    float *angle = numbers_of(SIZE, SIZE, 1);
    static const float angles[] = {0, 90, -90, 180, 45};
    for (int k = 0; k < 5; ++k)
    {
        fill_with(angle, SIZE * SIZE, angles[k]);
        RfOptimizeOptions options = rf_optimize_defaults();
        RfOptimizeConstraints constraints = {.orientation = picture_of(angle, SIZE, SIZE, 1)};
        float *made = still_of(exemplar, &options, &constraints, SIZE, SIZE);
        double along = roughness(made, SIZE, 4, 0), down = roughness(made, SIZE, 0, 4), diagonal = 0, other = 0;
        diagonal = roughness(made, SIZE, 3, 3);
        for (int i = 0; i < SIZE - 3; ++i)
            for (int x = 3; x < SIZE; ++x)
                other += pow((double)(made[6 * ((i + 3) * SIZE + x - 3)] - made[6 * (i * SIZE + x)]), 2);
        other = sqrt(other / ((SIZE - 3) * (SIZE - 3)));
        print_message("%g degrees: rough by %.2f to the right, %.2f down, %.2f and %.2f across\n", (double)angles[k],
                      along, down, diagonal, other);
        if (k == 4) // stripes run right and down
            assert_true(diagonal < 0.6 * other);
        else if (k == 1 || k == 2)
            assert_true(along > 3 * down);
        else
            assert_true(down > 3 * along);
        // Right turns down, up turns right; y of a vector is down, of a normal up.
        float c = cosf(angles[k] * RF_PI / 180), s = sinf(angles[k] * RF_PI / 180);
        for (int i = 0; i < SIZE * SIZE; ++i)
        {
            const float *p = made + 6 * i;
            assert_true(fabsf(p[1] - 2 * c) < 1e-4f && fabsf(p[2] - 2 * s) < 1e-4f);
            assert_true(fabsf(p[3] - (0.5f + 0.5f * s)) < 1e-4f && fabsf(p[4] - (0.5f + 0.5f * c)) < 1e-4f);
            assert_true(fabsf(p[5] - 0.5f) < 1e-4f);
        }
        free(made);
    }
    free(angle);
    rf_exemplar_destroy(exemplar);
}

static void at_twice_the_scale_stripes_are_twice_as_wide(void **state)
{
    (void)state;
    enum
    {
        SIZE = 64
    };
    RfExemplar *exemplar = striped_exemplar(8);
    float *scale = numbers_of(SIZE, SIZE, 1);
    static const float scales[] = {0.5f, 1, 2};
    for (int k = 0; k < 3; ++k)
    {
        fill_with(scale, SIZE * SIZE, scales[k]);
        RfOptimizeOptions options = rf_optimize_defaults();
        RfOptimizeConstraints constraints = {.scale = picture_of(scale, SIZE, SIZE, 1)};
        float *made = still_of(exemplar, &options, &constraints, SIZE, SIZE);
        int period = (int)(8 * scales[k]);
        double half = roughness(made, SIZE, 0, period / 2), whole = roughness(made, SIZE, 0, period);
        print_message("scale %g: half a stripe away %.2f, a whole one %.2f\n", (double)scales[k], half, whole);
        assert_true(half > 2 * whole);
        free(made);
    }
    free(scale);
    rf_exemplar_destroy(exemplar);
}

static int one_thread(void **state)
{
    (void)state;
    rf_set_threads(1);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(windows_over_the_border_of_a_tile_are_as_near_the_exemplar_as_others),
        cmocka_unit_test(fixed_pixels_stay_to_the_bit_and_a_hole_that_the_exemplar_knows_is_filled),
        cmocka_unit_test(a_hole_that_the_exemplar_does_not_know_is_filled_with_its_texture),
        cmocka_unit_test(a_target_pulls_as_strongly_as_it_weighs),
        cmocka_unit_test(a_guide_says_which_part_of_the_exemplar_goes_where),
        cmocka_unit_test(the_exemplar_is_turned_clockwise_and_what_points_with_it),
        cmocka_unit_test(at_twice_the_scale_stripes_are_twice_as_wide),
    };
    return cmocka_run_group_tests_name("bound stills", tests, one_thread, NULL);
}
