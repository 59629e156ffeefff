// SPDX-License-Identifier: Apache-2.0
// Files with one thing wrong: the reader says which, and where.
#include "in/image.h"
#include "riffle/riffle.h"
#include "support/files.h"
#include "support/image_files.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// How a sound file is spoilt: cut to `keep` bytes (0: not; negative: from the end), and `patch` written at `at`
// (negative: from the end).
typedef struct Damage
{
    const char *what;
    long keep, at;
    const char *patch;
    size_t patch_size;
    RfResult result;
    // Parts of the place and of the message.
    const char *place, *message;
} Damage;

static void check_damage(const char *name, TestBytes sound, const Damage *damage)
{
    size_t size = damage->keep > 0   ? (size_t)damage->keep
                  : damage->keep < 0 ? sound.size - (size_t)-damage->keep
                                     : sound.size;
    // An own block of just this size, so that the address sanitizer sees a read past the end.
    uint8_t *bytes = malloc(size);
    memcpy(bytes, sound.data, size);
    if (damage->patch)
        memcpy(bytes + (damage->at < 0 ? (long)size + damage->at : damage->at), damage->patch, damage->patch_size);
    RfImage *image = NULL;
    RfResult result = rf_image_decode(name, bytes, size, &image);
    const RfError *error = rf_last_error();
    assert_int_equal(result, damage->result);
    assert_null(image);
    assert_string_equal(error->file, name);
    assert_non_null(strstr(error->place, damage->place));
    assert_non_null(strstr(error->message, damage->message));
    free(bytes);
    test_bytes_free(sound);
}

static void a_broken_png_is_refused_with_the_place(void **state)
{
    (void)state;
    static const Damage damages[] = {
        {"cut in the header", 12, 0, NULL, 0, RF_BAD_INPUT, "", "the file ends inside the header (12 of 33 bytes)"},
        {"cut in the pixels", -200, 0, NULL, 0, RF_BAD_INPUT, "row", "the file ends"},
        {"a flipped bit in the pixels", 0, 300, "\x55\x55", 2, RF_BAD_INPUT, "row", "broken PNG"},
        {"the header's checksum", 0, 30, "\x01\x02", 2, RF_BAD_INPUT, "byte 33", "CRC"},
    };
    for (size_t i = 0; i < sizeof damages / sizeof damages[0]; ++i)
        check_damage("foam.png", test_png(&(TestPng){40, 40, 2, 8, false, false}), &damages[i]);
}

static void a_broken_jpeg_is_refused_with_the_place(void **state)
{
    (void)state;
    static const Damage damages[] = {
        {"cut in the header", 20, 0, NULL, 0, RF_BAD_INPUT, "header", "broken JPEG"},
        {"cut in the pixels", -60, 0, NULL, 0, RF_BAD_INPUT, "row", "broken JPEG"},
        {"a spoilt scan", 0, -60, "\xff\xd9", 2, RF_BAD_INPUT, "row", "broken JPEG"},
    };
    for (size_t i = 0; i < sizeof damages / sizeof damages[0]; ++i)
        check_damage("foam.jpg", test_jpeg(200, 120, 3, false), &damages[i]);
    static const Damage cmyk = {"CMYK", 0, 0, NULL, 0, RF_UNSUPPORTED, "header", "convert it to RGB"};
    check_damage("print.jpg", test_jpeg(16, 16, 4, false), &cmyk);
}

static void a_broken_exr_is_refused_with_the_place(void **state)
{
    (void)state;
    static const Damage damages[] = {
        {"cut in the header", 50, 0, NULL, 0, RF_BAD_INPUT, "header", "broken EXR"},
        {"cut in the pixels", -500, 0, NULL, 0, RF_BAD_INPUT, "row", "broken EXR"},
        {"a spoilt chunk", 0, -300, "\x55\x55\x55\x55", 4, RF_BAD_INPUT, "row", "broken EXR"},
        {"no signature", 0, 0, "exr", 3, RF_BAD_INPUT, "", "not an EXR"},
    };
    for (size_t i = 0; i < sizeof damages / sizeof damages[0]; ++i)
        check_damage("foam.exr", test_exr(&(TestExr){60, 50, 3, 1, 0, 0, 0}), &damages[i]);
}

static TestBytes text(const char *string)
{
    TestBytes bytes = {malloc(strlen(string) + 1), strlen(string)};
    memcpy(bytes.data, string, bytes.size + 1);
    return bytes;
}

static void a_broken_pgm_or_ppm_is_refused_with_the_place(void **state)
{
    (void)state;
    static const struct
    {
        const char *content;
        Damage damage;
    } files[] = {
        {"P5 4 4 255 abc", {"cut", 0, 0, NULL, 0, RF_BAD_INPUT, "byte 14", "(3 of 16 bytes)"}},
        {"P2 2 1 255 12 oh", {"a word", 0, 0, NULL, 0, RF_BAD_INPUT, "byte 14", "a number should be here"}},
        {"P2 2 1 100 12 101", {"too bright", 0, 0, NULL, 0, RF_BAD_INPUT, "byte 17", "greater than the header"}},
        {"P6 99999999999999999999 1 255 ", {"too wide", 0, 0, NULL, 0, RF_BAD_INPUT, "header", "1 to 32768"}},
    };
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
        check_damage("foam.ppm", text(files[i].content), &files[i].damage);
}

static void sizes_that_the_file_cannot_hold_are_refused_before_memory_is_taken(void **state)
{
    (void)state;
    // The head of a sound file of 32768 x 3000 grey pixels.
    TestBytes png = test_png(&(TestPng){32768, 3000, 0, 8, false, false});
    static const Damage cut = {"a bomb's head", 200, 0, NULL, 0, RF_BAD_INPUT, "header", "cannot hold them"};
    check_damage("bomb.png", png, &cut);
    // SOF0 of a 64 x 64 picture, set to 20000 x 20000.
    TestBytes jpeg = test_jpeg(64, 64, 1, false);
    long at = 0;
    while (!(jpeg.data[at] == 0xff && jpeg.data[at + 1] == 0xc0))
        ++at;
    Damage huge = {"a huge JPEG", 0, at + 5, "\x4e\x20\x4e\x20", 4, RF_BAD_INPUT, "header", "cannot hold them"};
    check_damage("bomb.jpg", jpeg, &huge);
    // The data window's right and lower border.
    TestBytes exr = test_exr(&(TestExr){16, 16, 3, 1, 0, 0, 0});
    at = 0;
    while (memcmp(exr.data + at, "dataWindow", 10) != 0)
        ++at;
    Damage window = {"a huge EXR", 0,  at + 10 + 1 + 6 + 4 + 8, "\xff\x3f\0\0\xff\x03\0\0", 8,
                     RF_BAD_INPUT, "", "cannot hold them"};
    check_damage("bomb.exr", exr, &window);
}

static void what_is_no_image_is_named_for_what_it_is(void **state)
{
    (void)state;
    static const struct
    {
        const char *name, *content;
        Damage damage;
    } files[] = {
        {"a.png", "", {"empty", 0, 0, NULL, 0, RF_BAD_INPUT, "", "not a PNG: the file is empty"}},
        {"a.exr", "hello", {"text", 0, 0, NULL, 0, RF_BAD_INPUT, "", "not an EXR"}},
        {"a.gif", "GIF89a", {"GIF", 0, 0, NULL, 0, RF_UNSUPPORTED, "", "is a GIF"}},
        {"a.pbm", "P4 8 1 x", {"bitmap", 0, 0, NULL, 0, RF_UNSUPPORTED, "header", "convert it"}},
    };
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
        check_damage(files[i].name, text(files[i].content), &files[i].damage);
}

static void a_wrong_extension_does_not_matter(void **state)
{
    (void)state;
    TestBytes bytes = test_jpeg(16, 16, 1, false);
    RfImage *image;
    assert_int_equal(rf_image_decode("really_a.png", bytes.data, bytes.size, &image), RF_OK);
    rf_image_destroy(image);
    test_bytes_free(bytes);
}

static void nan_and_infinity_are_refused_with_their_pixel(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    const char *path = test_folder_file(&folder, "nan.exr");
    static const float bad[] = {NAN, INFINITY};
    for (int i = 0; i < 2; ++i)
    {
        RfImage *image;
        assert_int_equal(rf_image_create(6, 5, 3, &image), RF_OK);
        rf_image_set_origin(image, RF_SAMPLE_HALF, RF_ENCODING_LINEAR);
        rf_image_view(image).pixels[3 * (6 * 3 + 4) + 1] = bad[i];
        assert_int_equal(rf_image_write(path, image), RF_OK);
        rf_image_destroy(image);
        assert_int_equal(rf_image_read(path, &image), RF_BAD_INPUT);
        assert_null(image);
        assert_string_equal(rf_last_error()->place, "pixel (4, 3), channel G");
        assert_non_null(strstr(rf_last_error()->message, i == 0 ? "NaN" : "infinite"));
    }
    test_folder_remove(&folder);
}

static void a_missing_file_and_a_folder_are_unreadable(void **state)
{
    (void)state;
    TestFolder folder = test_folder_make();
    RfImage *image;
    assert_int_equal(rf_image_read(test_folder_file(&folder, "none.png"), &image), RF_UNREADABLE);
    assert_int_equal(rf_image_read(folder.path, &image), RF_UNREADABLE);
    assert_string_equal(rf_last_error()->file, folder.path);
    test_folder_remove(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_broken_png_is_refused_with_the_place),
        cmocka_unit_test(a_broken_jpeg_is_refused_with_the_place),
        cmocka_unit_test(a_broken_exr_is_refused_with_the_place),
        cmocka_unit_test(a_broken_pgm_or_ppm_is_refused_with_the_place),
        cmocka_unit_test(sizes_that_the_file_cannot_hold_are_refused_before_memory_is_taken),
        cmocka_unit_test(what_is_no_image_is_named_for_what_it_is),
        cmocka_unit_test(a_wrong_extension_does_not_matter),
        cmocka_unit_test(nan_and_infinity_are_refused_with_their_pixel),
        cmocka_unit_test(a_missing_file_and_a_folder_are_unreadable),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
