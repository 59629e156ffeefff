// SPDX-License-Identifier: Apache-2.0
// What `riffle info` says of files.
#include "riffle/riffle.h"
#include "support/cli_check.h"

#include <math.h>

static void expect_out(const TestFolder *folder, const char *line, const char *fragment)
{
    CommandResult result = run_in(folder, line);
    if (!strstr(result.out, fragment))
        print_error("riffle %s: %s%s\n", line, result.out, result.err);
    assert_int_equal(result.code, 0);
    assert_non_null(strstr(result.out, fragment));
    command_free(&result);
}

/// A slope along x: smooth inside, a jump where its borders meet.
static void put_slope(const TestFolder *folder, const char *name, int width, int height)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_create(width, height, 3, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int k = 0; k < width * height; ++k)
        for (int c = 0; c < 3; ++c)
            view.pixels[3 * k + c] = (float)(k % width + (k * 7919 + c) % 5) / (float)(width + 5);
    rf_image_set_origin(image, RF_SAMPLE_U16, RF_ENCODING_SRGB);
    assert_int_equal(rf_image_write(test_folder_file(folder, name), image), RF_OK);
    rf_image_destroy(image);
}

static void an_exemplars_borders_and_room_are_told(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    put_slope(&folder, "slope.png", 120, 100);
    expect_out(&folder, "info builtin:foam", "\n  tiles: seems so (borders 0.");
    expect_out(&folder, "info builtin:foam?size=64", "\n  particle radius: 24.6 unless given, any fits\n");
    expect_out(&folder, "info slope.png", "\n  tiles: seems not (borders ");
    expect_out(&folder, "info slope.png", "\n  particle radius: 25.6 unless given, 25.6 at most\n");
    expect_out(&folder, "info slope.png --json", "\"exemplar\":{\"tiles\":false,\"border_roughness\":");
    expect_out(&folder, "info slope.png --json", "\"particle_radius\":25.6,\"largest_particle_radius\":25.6");
    // The method takes what was said, and no more.
    expect(&folder, "texture builtin:vortex?size=64x64 slope.png null: --frames 1 --particle-radius 25.6", 0);
    expect(&folder, "texture builtin:vortex?size=64x64 slope.png null: --frames 1 --particle-radius 25.7", 2);
    test_folder_remove(&folder);
}

static void the_radius_told_is_the_one_that_is_used(void **state)
{
    (void)state;
    static const char *const names[] = {"builtin:foam?size=64", "builtin:foam?size=400", "builtin:checker?size=64",
                                        "builtin:checker?size=300"};
    for (int i = 0; i < 4; ++i)
    {
        RfImage *image = NULL;
        RfExemplar *exemplar = NULL;
        RfLagrangian *lagrangian = NULL;
        RfLagrangianOptions options = rf_lagrangian_defaults();
        assert_int_equal(rf_image_read(names[i], &image), RF_OK);
        RfMapView map = {.name = "colour", .kind = RF_MAP_COLOUR, .image = rf_image_view(image), .weight = 1};
        assert_int_equal(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar), RF_OK);
        assert_int_equal(rf_lagrangian_create(exemplar, &options, &lagrangian), RF_OK);
        char line[96], told[64];
        snprintf(line, sizeof line, "info %s", names[i]);
        snprintf(told, sizeof told, "\n  particle radius: %g unless given",
                 floor(10 * (double)rf_lagrangian_radius(lagrangian)) / 10);
        expect_out(&(TestFolder){"/"}, line, told);
        rf_lagrangian_destroy(lagrangian);
        rf_exemplar_destroy(exemplar);
        rf_image_destroy(image);
    }
}

static void an_image_of_two_components_can_be_a_flow(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    expect(&folder, "convert " TEST_FLOW " f.exr", 0);
    expect_out(&folder, "info f.exr", "\n  can be a flow: --variables R,G reads it as one\n");
    expect_out(&folder, "info f.exr --json", "\"flow_variables\":\"R,G\"");
    expect_out(&folder, "info f.exr --variables R,G", "2D flow (exr), 96 x 64 cells");
    expect(&folder, "convert builtin:foam?size=32 foam.exr", 0);
    CommandResult result = run_in(&folder, "info foam.exr f.exr");
    const char *first = strstr(result.out, "flow");
    assert_non_null(first);
    assert_true(first > strstr(result.out, "f.exr: image"));
    // Two numbers are no colour, so it is no exemplar.
    assert_null(strstr(strstr(result.out, "\nf.exr: image"), "tiles"));
    command_free(&result);
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_exemplars_borders_and_room_are_told),
        cmocka_unit_test(the_radius_told_is_the_one_that_is_used),
        cmocka_unit_test(an_image_of_two_components_can_be_a_flow),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
