// SPDX-License-Identifier: Apache-2.0
#include "core/maths.h"
#include "fluids/builtin.h"
#include "riffle/riffle.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

static RfFlowScene *make_scene(const char *spec)
{
    RfFlowScene *scene = NULL;
    if (rf_flow_scene_create(spec, &scene) != RF_OK)
        fail_msg("%s: %s: %s", spec, rf_last_error()->place, rf_last_error()->message);
    return scene;
}

static RfFlowField moment_of(RfFlowScene *scene, int moment)
{
    RfFlowField field;
    assert_int_equal(rf_flow_scene_moment(scene, moment, &field), RF_OK);
    return field;
}

static RfFlowField field_of(const char *spec, int moment)
{
    RfFlowScene *scene = make_scene(spec);
    RfFlowField field = moment_of(scene, moment);
    rf_flow_scene_destroy(scene);
    return field;
}

static RfVec2 velocity_at(const RfFlowField *field, int i, int j)
{
    const float *v = field->velocity + 2 * ((size_t)j * (size_t)field->width + (size_t)i);
    return (RfVec2){v[0], v[1]};
}

static bool fluid_at(const RfFlowField *field, int i, int j)
{
    return !field->mask || field->mask[(size_t)j * (size_t)field->width + (size_t)i];
}

static size_t velocity_bytes(const RfFlowField *field)
{
    return 2 * sizeof(float) * (size_t)field->width * (size_t)field->height;
}

static float greatest_speed(const RfFlowField *field)
{
    float greatest = 0;
    for (int j = 0; j < field->height; ++j)
        for (int i = 0; i < field->width; ++i)
            greatest = fmaxf(greatest, rf_vec2_length(velocity_at(field, i, j)));
    return greatest;
}

/// Root mean square of the divergence over that of the gradient, away from land and borders.
static double relative_divergence(const RfFlowField *field)
{
    double divergence = 0, gradient = 1e-12;
    for (int j = 2; j < field->height - 2; ++j)
        for (int i = 2; i < field->width - 2; ++i)
        {
            bool inside = true;
            for (int b = -2; b <= 2; ++b)
                for (int a = -2; a <= 2; ++a)
                    inside = inside && fluid_at(field, i + a, j + b);
            if (!inside)
                continue;
            RfVec2 x = rf_vec2_sub(velocity_at(field, i + 1, j), velocity_at(field, i - 1, j));
            RfVec2 y = rf_vec2_sub(velocity_at(field, i, j + 1), velocity_at(field, i, j - 1));
            divergence += (double)((x.x + y.y) * (x.x + y.y));
            gradient += (double)(x.x * x.x + x.y * x.y + y.x * y.x + y.y * y.y);
        }
    return sqrt(divergence / gradient);
}

static void every_entry_of_the_table_is_finite_at_its_defaults(void **state)
{
    (void)state;
    int count;
    const RfBuiltin *table = rf_builtin_table(&count);
    for (int k = 0; k < count; ++k)
    {
        char spec[256];
        snprintf(spec, sizeof spec, "%s?%s", table[k].name, table[k].parameters);
        if (strcmp(table[k].kind, "flow") == 0)
        {
            RfFlowField field = field_of(spec, 0);
            RfFlowView view = rf_flow_field_view(&field, 0);
            assert_int_equal(rf_flow_view_check(&view), RF_OK);
            assert_true(greatest_speed(&field) > 0.5f && greatest_speed(&field) < 5);
            rf_flow_field_free(&field);
            continue;
        }
        RfImage *image;
        assert_int_equal(rf_exemplar_draw(spec, &image), RF_OK);
        RfImageView view = rf_image_view(image);
        for (size_t p = 0; p < (size_t)view.height * (size_t)view.row_stride; ++p)
            assert_true(view.pixels[p] >= 0 && view.pixels[p] <= 1);
        rf_image_destroy(image);
    }
}

static void flows_are_nearly_free_of_divergence(void **state)
{
    (void)state;
    const struct
    {
        const char *spec;
        double most;
    } scenes[] = {{"vortex", 0.002},
                  {"shear", 1e-6},
                  {"gyre", 0.002},
                  {"uniform", 1e-3},
                  {"rotation", 1e-3},
                  {"turbulence?size=128", 0.02},
                  {"river", 0.02},
                  {"river?stone=1&seed=3", 0.02},
                  {"cylinder?size=256x128", 0.05}};
    for (size_t k = 0; k < sizeof scenes / sizeof scenes[0]; ++k)
    {
        RfFlowField field = field_of(scenes[k].spec, 3);
        double divergence = relative_divergence(&field);
        if (!(divergence <= scenes[k].most))
            fail_msg("%s: divergence is %g of the gradient", scenes[k].spec, divergence);
        rf_flow_field_free(&field);
    }
}

static void land_stands_still_and_the_same_water_passes_every_column(void **state)
{
    (void)state;
    const char *specs[] = {"river", "river?seed=2&size=300x150", "river?stone=1", "cylinder?size=256x128"};
    for (size_t k = 0; k < sizeof specs / sizeof specs[0]; ++k)
    {
        RfFlowField field = field_of(specs[k], 0);
        assert_non_null(field.mask);
        double first = 0;
        int land = 0;
        for (int i = 0; i < field.width; ++i)
        {
            double flux = 0;
            for (int j = 0; j < field.height; ++j)
            {
                RfVec2 v = velocity_at(&field, i, j);
                flux += (double)v.x;
                land += !fluid_at(&field, i, j);
                if (!fluid_at(&field, i, j))
                    assert_true(v.x == 0 && v.y == 0);
            }
            first = i == 0 ? flux : first;
            assert_true(first > 0 && fabs(flux - first) < (k < 3 ? 1e-4 : 0.03) * first);
        }
        assert_true(land > 50);
        rf_flow_field_free(&field);
    }
}

static void the_stone_is_one_and_round(void **state)
{
    (void)state;
    RfFlowField field = field_of("river?stone=1", 0);
    double area = 0, x = 0, y = 0, spread = 0;
    for (int j = 0; j < field.height; ++j)
        for (int i = 0; i < field.width; ++i)
            if (!fluid_at(&field, i, j))
            {
                area += 1;
                x += i;
                y += j;
                spread += (double)i * i + (double)j * j;
            }
    x /= area;
    y /= area;
    // A disc's mean square distance from its middle is area / (2 pi); any other shape has more.
    assert_true(fabs((spread / area - x * x - y * y) / (area / (2 * M_PI)) - 1) < 0.005);
    rf_flow_field_free(&field);
}

static void the_cylinder_sheds_from_the_first_moment_on(void **state)
{
    (void)state;
    RfFlowScene *scene = make_scene("cylinder?size=128x64");
    int changes = 0, sign = 0, last_change = 0;
    float most = 0, least = 0;
    for (int moment = 0; moment < 160; ++moment)
    {
        RfFlowField field = moment_of(scene, moment);
        float v = velocity_at(&field, 50, 32).y;
        int now = v > 0.1f ? 1 : v < -0.1f ? -1 : sign;
        if (now != sign && sign)
        {
            ++changes;
            last_change = moment;
        }
        sign = now;
        most = fmaxf(most, v);
        least = fminf(least, v);
        rf_flow_field_free(&field);
    }
    rf_flow_scene_destroy(scene);
    // Some 26 frames a period (a Strouhal number near 0.2): about twelve changes.
    assert_in_range(changes, 9, 16);
    assert_true(last_change > 140);
    assert_true(most > 0.5f && least < -0.5f && most < -1.3f * least && least > -1.3f * most);
}

static void turbulence_keeps_its_energy_and_never_repeats(void **state)
{
    (void)state;
    RfFlowScene *scene = make_scene("turbulence?size=64&speed=1");
    double energy[2], difference = 0;
    RfFlowField fields[2] = {moment_of(scene, 0), moment_of(scene, 200)};
    size_t count = velocity_bytes(&fields[0]) / sizeof(float);
    for (int k = 0; k < 2; ++k)
    {
        energy[k] = 0;
        for (size_t p = 0; p < count; ++p)
            energy[k] += (double)(fields[k].velocity[p] * fields[k].velocity[p]);
    }
    for (size_t p = 0; p < count; ++p)
        difference += pow((double)fields[0].velocity[p] - (double)fields[1].velocity[p], 2);
    assert_true(fabs(energy[1] / energy[0] - 1) < 0.01);
    assert_true(difference > 0.3 * energy[0]);
    for (int k = 0; k < 2; ++k)
        rf_flow_field_free(&fields[k]);
    rf_flow_scene_destroy(scene);
}

static void threads_and_going_back_do_not_change_a_byte(void **state)
{
    (void)state;
    const char *specs[] = {"gyre?size=64x32", "turbulence?size=96x64", "cylinder?size=64x32", "river?size=96x64"};
    for (size_t k = 0; k < sizeof specs / sizeof specs[0]; ++k)
    {
        rf_set_threads(1);
        RfFlowScene *scene = make_scene(specs[k]);
        RfFlowField forward[2] = {moment_of(scene, 2), moment_of(scene, 7)};
        RfFlowField back = moment_of(scene, 2);
        rf_set_threads(3);
        RfFlowField other = field_of(specs[k], 7);
        assert_memory_equal(forward[0].velocity, back.velocity, velocity_bytes(&back));
        assert_memory_equal(forward[1].velocity, other.velocity, velocity_bytes(&other));
        RfFlowField *fields[] = {&forward[0], &forward[1], &back, &other};
        for (int f = 0; f < 4; ++f)
            rf_flow_field_free(fields[f]);
        rf_flow_scene_destroy(scene);
    }
    const char *exemplars[] = {"noise?size=48x32", "foam?size=32", "canes?size=32", "lava?size=32"};
    for (size_t k = 0; k < sizeof exemplars / sizeof exemplars[0]; ++k)
    {
        RfImage *images[2];
        for (int n = 0; n < 2; ++n)
        {
            rf_set_threads(n ? 3 : 1);
            assert_int_equal(rf_exemplar_draw(exemplars[k], &images[n]), RF_OK);
        }
        RfImageView a = rf_image_view(images[0]), b = rf_image_view(images[1]);
        assert_memory_equal(a.pixels, b.pixels, (size_t)a.height * (size_t)a.row_stride * sizeof(float));
        rf_image_destroy(images[0]);
        rf_image_destroy(images[1]);
    }
    rf_set_threads(0);
}

/// Mean absolute difference between two columns (or rows).
static double line_difference(const RfImageView *view, bool columns, int a, int b)
{
    double sum = 0;
    int length = columns ? view->height : view->width;
    for (int k = 0; k < length; ++k)
        for (int c = 0; c < view->channels; ++c)
        {
            ptrdiff_t p =
                columns ? k * view->row_stride + a * view->channels : a * view->row_stride + k * view->channels;
            ptrdiff_t q =
                columns ? k * view->row_stride + b * view->channels : b * view->row_stride + k * view->channels;
            sum += fabs((double)view->pixels[p + c] - (double)view->pixels[q + c]);
        }
    return sum / length / view->channels;
}

static void exemplars_go_on_across_their_borders(void **state)
{
    (void)state;
    int count;
    const RfBuiltin *table = rf_builtin_table(&count);
    for (int k = 0; k < count; ++k)
    {
        if (strcmp(table[k].kind, "exemplar") != 0 || strcmp(table[k].name, "checker") == 0)
            continue;
        char spec[64];
        snprintf(spec, sizeof spec, "%s?size=160x128&seed=5", table[k].name);
        RfImage *image;
        assert_int_equal(rf_exemplar_draw(spec, &image), RF_OK);
        RfImageView view = rf_image_view(image);
        for (int columns = 0; columns < 2; ++columns)
        {
            int lines = columns ? view.width : view.height;
            double most = 0;
            for (int line = 1; line < lines; ++line)
                most = fmax(most, line_difference(&view, columns, line - 1, line));
            double border = line_difference(&view, columns, lines - 1, 0);
            if (border > most)
                fail_msg("%s: %g across the border, at most %g inside", spec, border, most);
        }
        rf_image_destroy(image);
    }
}

static void a_picture_is_the_same_material_at_another_size(void **state)
{
    (void)state;
    RfImage *images[2];
    assert_int_equal(rf_exemplar_draw("pebbles?size=256", &images[0]), RF_OK);
    assert_int_equal(rf_exemplar_draw("pebbles?size=64", &images[1]), RF_OK);
    RfImageView large = rf_image_view(images[0]), small = rf_image_view(images[1]);
    double difference = 0;
    for (int j = 0; j < 64; ++j)
        for (int i = 0; i < 64; ++i)
        {
            double mean = 0;
            for (int s = 0; s < 16; ++s)
                mean += (double)large.pixels[(4 * j + s / 4) * large.row_stride + 3 * (4 * i + s % 4)] / 16;
            difference += fabs(mean - (double)small.pixels[j * small.row_stride + 3 * i]) / (64 * 64);
        }
    assert_true(difference < 0.06);
    rf_image_destroy(images[0]);
    rf_image_destroy(images[1]);
}

static void chocolate_brings_its_height(void **state)
{
    (void)state;
    RfImage *image;
    assert_int_equal(rf_exemplar_draw("chocolate?size=32", &image), RF_OK);
    assert_int_equal(rf_image_view(image).channels, 4);
    assert_string_equal(rf_image_channel_name(image, 3), "height");
    assert_false(rf_image_has_alpha(image));
    rf_image_destroy(image);
}

static void wrong_names_and_values_are_refused_with_the_place(void **state)
{
    (void)state;
    const struct
    {
        const char *spec, *place, *part;
    } cases[] = {
        {"vortex?speed=-1", "speed", "0 to 1000"},
        {"vortex?speed=fast", "speed", "\"fast\""},
        {"vortex?speed=nan", "speed", "nan"},
        {"vortex?speed=2e", "speed", "2e"},
        {"vortex?speed", "speed", "no value"},
        {"vortex?speed=", "speed", "must be"},
        {"vortex?sped=1", "sped", "size, speed, core"},
        {"vortex?size=0x512", "size", "4 to"},
        {"vortex?size=12.5", "size", "12.5"},
        {"vortex?size=12x", "size", "12x"},
        {"vortex?size=1x2x3", "size", "1x2x3"},
        {"river?stone=0.5", "stone", "whole"},
        {"cylinder?size=4096x32", "size", "8 times"},
        {"whirl?size=3", "", "vortex, shear"},
        {"", "", "vortex, shear"},
        {"foam", "", "vortex, shear"},
    };
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; ++k)
    {
        RfFlowScene *scene;
        assert_int_equal(rf_flow_scene_create(cases[k].spec, &scene), RF_BAD_INPUT);
        assert_null(scene);
        const RfError *error = rf_last_error();
        assert_string_equal(error->place, cases[k].place);
        if (!strstr(error->message, cases[k].part))
            fail_msg("%s: \"%s\" does not say \"%s\"", cases[k].spec, error->message, cases[k].part);
        assert_memory_equal(error->file, "builtin:", 8);
        assert_string_equal(error->file + 8, cases[k].spec);
    }
    RfImage *image;
    assert_int_equal(rf_exemplar_draw("foam?size=4", &image), RF_BAD_INPUT);
    assert_int_equal(rf_exemplar_draw("foam?size=8x4000", &image), RF_BAD_INPUT);
    assert_int_equal(rf_exemplar_draw("vortex", &image), RF_BAD_INPUT);
    assert_non_null(strstr(rf_last_error()->message, "foam, bubbles"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_entry_of_the_table_is_finite_at_its_defaults),
        cmocka_unit_test(flows_are_nearly_free_of_divergence),
        cmocka_unit_test(land_stands_still_and_the_same_water_passes_every_column),
        cmocka_unit_test(the_stone_is_one_and_round),
        cmocka_unit_test(the_cylinder_sheds_from_the_first_moment_on),
        cmocka_unit_test(turbulence_keeps_its_energy_and_never_repeats),
        cmocka_unit_test(threads_and_going_back_do_not_change_a_byte),
        cmocka_unit_test(exemplars_go_on_across_their_borders),
        cmocka_unit_test(a_picture_is_the_same_material_at_another_size),
        cmocka_unit_test(chocolate_brings_its_height),
        cmocka_unit_test(wrong_names_and_values_are_refused_with_the_place),
    };
    return cmocka_run_group_tests_name("builtin", tests, NULL, NULL);
}
