// SPDX-License-Identifier: Apache-2.0
#include "core/random.h"
#include "data/colour.h"
#include "in/image.h"
#include "riffle/riffle.h"
#include "support/files.h"
#include "support/image_files.h"

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

static TestFolder g_folder;

static int make_folder(void **state)
{
    (void)state;
    g_folder = test_folder_make();
    return 0;
}

static int remove_folder(void **state)
{
    (void)state;
    test_folder_remove(&g_folder);
    return 0;
}

static RfImage *make_image(int width, int height, int channels, RfSampleFormat format, RfEncoding encoding)
{
    RfImage *image;
    assert_int_equal(rf_image_create(width, height, channels, &image), RF_OK);
    rf_image_set_origin(image, format, encoding);
    return image;
}

// Random values that the sample format holds exactly.
static void fill(RfImage *image)
{
    RfImageView view = rf_image_view(image);
    for (int i = 0; i < view.width * view.height * view.channels; ++i)
    {
        uint64_t bits = rf_random_bits(1, 2, (uint64_t)i, 3);
        switch (rf_image_format(image))
        {
        case RF_SAMPLE_U8:
            view.pixels[i] = (float)(bits & 255) / 255.0f;
            break;
        case RF_SAMPLE_U16:
            view.pixels[i] = (float)(bits & 65535) / 65535.0f;
            break;
        case RF_SAMPLE_HALF:
            // 11 bits of mantissa, exponents from the smallest denormal number to the largest.
            view.pixels[i] =
                ldexpf((float)(1024 + (bits & 1023)), (int)(bits >> 20 & 15) - 24) * (bits >> 40 & 1 ? 1 : -1);
            break;
        default:
            view.pixels[i] = ldexpf((float)(bits & 0xffffff), (int)(bits >> 30 & 63) - 40) * (bits >> 40 & 1 ? 1 : -1);
        }
    }
}

static void assert_same_pixels(const RfImage *a, const RfImage *b)
{
    RfImageView va = rf_image_view(a), vb = rf_image_view(b);
    assert_int_equal(va.width, vb.width);
    assert_int_equal(va.height, vb.height);
    assert_int_equal(va.channels, vb.channels);
    assert_memory_equal(va.pixels, vb.pixels,
                        (size_t)va.width * (size_t)va.height * (size_t)va.channels * sizeof(float));
}

static RfImage *read_image(const char *path)
{
    RfImage *image;
    if (rf_image_read(path, &image) != RF_OK)
        fail_msg("%s: %s: %s", rf_last_error()->file, rf_last_error()->place, rf_last_error()->message);
    return image;
}

static void write_image(const char *path, const RfImage *image)
{
    if (rf_image_write(path, image) != RF_OK)
        fail_msg("%s: %s", rf_last_error()->file, rf_last_error()->message);
}

// ---- round trips ---------------------------------------------------------------------------------------------------

static void png_keeps_every_sample_of_8_and_16_bit_for_1_to_4_channels(void **state)
{
    (void)state;
    for (int channels = 1; channels <= 4; ++channels)
    {
        for (int deep = 0; deep < 2; ++deep)
        {
            RfImage *image = make_image(37, 23, channels, deep ? RF_SAMPLE_U16 : RF_SAMPLE_U8, RF_ENCODING_SRGB);
            fill(image);
            const char *path = test_folder_file(&g_folder, "trip.png");
            write_image(path, image);
            RfImage *again = read_image(path);
            assert_same_pixels(image, again);
            assert_int_equal(rf_image_format(again), rf_image_format(image));
            assert_int_equal(rf_image_has_alpha(again), channels == 2 || channels == 4);
            rf_image_destroy(again);
            rf_image_destroy(image);
        }
    }
}

static void png_in_memory_is_the_same_picture_and_refuses_what_png_cannot_hold(void **state)
{
    (void)state;
    // Larger than any buffer of the encoder's, and noise, so that the block grows.
    RfImage *image = make_image(300, 200, 3, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImage *wide = make_image(8, 8, 5, RF_SAMPLE_U8, RF_ENCODING_DATA);
    fill(image);
    void *block = NULL;
    size_t size = 0;
    assert_int_equal(rf_image_encode_png(image, &block, &size), RF_OK);
    const char *path = test_folder_file(&g_folder, "memory.png");
    assert_true(test_file_write(path, block, size));
    RfImage *again = read_image(path);
    assert_same_pixels(image, again);
    rf_free(block);
    assert_int_equal(rf_image_encode_png(wide, &block, &size), RF_UNSUPPORTED);
    assert_null(block);
    rf_image_destroy(again);
    rf_image_destroy(image);
    rf_image_destroy(wide);
}

static void exr_keeps_every_half_and_float_and_every_channel_name(void **state)
{
    (void)state;
    static const char *const names[] = {"R", "G", "B", "A", "height", "uv.x", "zone"};
    for (int trip = 0; trip < 14; ++trip)
    {
        // 37 rows are three chunks, the last one short.
        int channels = trip / 2 + 1, format = trip % 2 ? RF_SAMPLE_HALF : RF_SAMPLE_FLOAT;
        RfImage *image = make_image(29, 37, channels, (RfSampleFormat)format, RF_ENCODING_LINEAR);
        for (int c = 0; c < channels; ++c)
            rf_image_set_channel_name(image, c, names[c]);
        fill(image);
        const char *path = test_folder_file(&g_folder, "trip.exr");
        write_image(path, image);
        RfImage *again = read_image(path);
        assert_same_pixels(image, again);
        assert_int_equal(rf_image_format(again), format);
        assert_int_equal(rf_image_encoding(again), RF_ENCODING_LINEAR);
        for (int c = 0; c < channels; ++c)
            assert_string_equal(rf_image_channel_name(again, c), names[c]);
        rf_image_destroy(again);
        rf_image_destroy(image);
    }
}

static void exr_channels_come_back_in_the_order_colour_alpha_and_the_rest_by_name(void **state)
{
    (void)state;
    static const char *const given[] = {"zone", "A", "B", "depth", "R", "G"};
    static const char *const wanted[] = {"R", "G", "B", "A", "depth", "zone"};
    static const int from[] = {4, 5, 2, 1, 3, 0};
    RfImage *image = make_image(5, 4, 6, RF_SAMPLE_FLOAT, RF_ENCODING_DATA);
    for (int c = 0; c < 6; ++c)
        rf_image_set_channel_name(image, c, given[c]);
    fill(image);
    const char *path = test_folder_file(&g_folder, "order.exr");
    write_image(path, image);
    RfImage *again = read_image(path);
    for (int c = 0; c < 6; ++c)
    {
        assert_string_equal(rf_image_channel_name(again, c), wanted[c]);
        for (int i = 0; i < 20; ++i)
            assert_float_equal(rf_image_view(again).pixels[6 * i + c], rf_image_view(image).pixels[6 * i + from[c]], 0);
    }
    rf_image_destroy(again);
    rf_image_destroy(image);
}

static void exr_makes_encoded_colour_linear_and_leaves_data_alone(void **state)
{
    (void)state;
    static const char *const names[] = {"R", "G", "B", "A", "height"};
    RfImage *image = make_image(3, 3, 5, RF_SAMPLE_FLOAT, RF_ENCODING_SRGB);
    for (int c = 0; c < 5; ++c)
        rf_image_set_channel_name(image, c, names[c]);
    for (int i = 0; i < 45; ++i)
        rf_image_view(image).pixels[i] = 0.5f;
    const char *path = test_folder_file(&g_folder, "linear.exr");
    write_image(path, image);
    RfImage *again = read_image(path);
    const float *pixel = rf_image_view(again).pixels;
    assert_float_equal(pixel[0], rf_srgb_to_linear(0.5f), 1e-7);
    assert_float_equal(pixel[2], 0.21404, 1e-4);
    assert_float_equal(pixel[3], 0.5f, 0);
    assert_float_equal(pixel[4], 0.5f, 0);
    assert_float_equal(rf_image_view(image).pixels[0], 0.5f, 0);
    rf_image_destroy(again);
    rf_image_destroy(image);
}

static void an_exr_without_colour_is_data(void **state)
{
    (void)state;
    RfImage *image = make_image(4, 4, 2, RF_SAMPLE_FLOAT, RF_ENCODING_DATA);
    rf_image_set_channel_name(image, 0, "u");
    rf_image_set_channel_name(image, 1, "v");
    fill(image);
    const char *path = test_folder_file(&g_folder, "data.exr");
    write_image(path, image);
    RfImage *again = read_image(path);
    assert_int_equal(rf_image_encoding(again), RF_ENCODING_DATA);
    assert_same_pixels(image, again);
    rf_image_destroy(again);
    rf_image_destroy(image);
}

static void npy_holds_the_floats_behind_an_aligned_header(void **state)
{
    (void)state;
    RfImage *image = make_image(7, 5, 3, RF_SAMPLE_FLOAT, RF_ENCODING_SRGB);
    fill(image);
    const char *path = test_folder_file(&g_folder, "trip.npy");
    write_image(path, image);
    size_t size;
    unsigned char *bytes = test_file_read(path, &size);
    assert_int_equal(size, 128 + 7 * 5 * 3 * 4);
    assert_memory_equal(bytes, "\x93NUMPY\x01\x00\x76\x00", 10);
    assert_non_null(strstr((const char *)bytes + 10, "'descr': '<f4', 'fortran_order': False, 'shape': (5, 7, 3)"));
    assert_int_equal(bytes[127], '\n');
    assert_memory_equal(bytes + 128, rf_image_view(image).pixels, 7 * 5 * 3 * 4);
    free(bytes);
    rf_image_destroy(image);
}

static void the_same_image_gives_the_same_bytes_for_any_number_of_threads(void **state)
{
    (void)state;
    static const char *const kinds[] = {"png", "exr", "npy"};
    RfImage *image = make_image(64, 700, 3, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    fill(image);
    for (int k = 0; k < 3; ++k)
    {
        unsigned char *bytes[2];
        size_t sizes[2];
        for (int i = 0; i < 2; ++i)
        {
            char name[32];
            snprintf(name, sizeof name, "same%d.%s", i, kinds[k]);
            rf_set_threads(i == 0 ? 1 : 3);
            write_image(test_folder_file(&g_folder, name), image);
            bytes[i] = test_file_read(test_folder_file(&g_folder, name), &sizes[i]);
        }
        assert_int_equal(sizes[0], sizes[1]);
        assert_memory_equal(bytes[0], bytes[1], sizes[0]);
        free(bytes[0]);
        free(bytes[1]);
    }
    rf_set_threads(0);
    rf_image_destroy(image);
}

// ---- reading -------------------------------------------------------------------------------------------------------

static RfImage *decode_text(const char *text)
{
    RfImage *image;
    if (rf_image_decode("text.ppm", (const uint8_t *)text, strlen(text), &image) != RF_OK)
        fail_msg("%s", rf_last_error()->message);
    return image;
}

static void pgm_and_ppm_are_read_as_text_and_binary_with_comments_and_any_maximum(void **state)
{
    (void)state;
    RfImage *image = decode_text("P2 # made by hand\n3 1\n#\n10\n0 5\n10");
    const float *p = rf_image_view(image).pixels;
    assert_int_equal(rf_image_view(image).width, 3);
    assert_float_equal(p[0], 0, 0);
    assert_float_equal(p[1], 0.5f, 0);
    assert_float_equal(p[2], 1, 0);
    rf_image_destroy(image);

    image = decode_text("P3\n1 2 255\n255 0 51 1 2 3\n");
    assert_int_equal(rf_image_view(image).channels, 3);
    assert_float_equal(rf_image_view(image).pixels[2], 0.2f, 1e-7);
    rf_image_destroy(image);

    image = decode_text("P5 2 1 65535 \x80\x01\x01\xff");
    assert_int_equal(rf_image_format(image), RF_SAMPLE_U16);
    assert_float_equal(rf_image_view(image).pixels[0], 0x8001 / 65535.0f, 0);
    assert_float_equal(rf_image_view(image).pixels[1], 0x01ff / 65535.0f, 0);
    rf_image_destroy(image);

    // The first byte of the pixels is a line feed, which is no part of the header.
    image = decode_text("P6 1 1 255\n\n\x33\xff");
    assert_int_equal(rf_image_format(image), RF_SAMPLE_U8);
    assert_float_equal(rf_image_view(image).pixels[0], 10 / 255.0f, 0);
    assert_float_equal(rf_image_view(image).pixels[1], 0.2f, 1e-7);
    rf_image_destroy(image);
}

static RfImage *decode(const char *name, TestBytes bytes)
{
    RfImage *image;
    if (rf_image_decode(name, bytes.data, bytes.size, &image) != RF_OK)
        fail_msg("%s: %s: %s", name, rf_last_error()->place, rf_last_error()->message);
    test_bytes_free(bytes);
    return image;
}

static void every_png_colour_type_and_depth_is_read_interlaced_or_not(void **state)
{
    (void)state;
    static const int types[][2] = {{0, 1},  {0, 2}, {0, 4},  {0, 8}, {0, 16}, {2, 8},
                                   {2, 16}, {4, 8}, {4, 16}, {6, 8}, {6, 16}};
    static const int channels[] = {1, 0, 3, 0, 2, 0, 4};
    for (int t = 0; t < 22; ++t)
    {
        TestPng png = {19, 13, types[t / 2][0], types[t / 2][1], t % 2 == 1, false};
        RfImage *image = decode("kind.png", test_png(&png));
        RfImageView view = rf_image_view(image);
        unsigned limit = 1u << png.depth;
        assert_int_equal(view.channels, channels[png.colour_type]);
        assert_int_equal(rf_image_format(image), png.depth == 16 ? RF_SAMPLE_U16 : RF_SAMPLE_U8);
        for (int i = 0; i < 19 * 13 * view.channels; ++i)
        {
            int pixel = i / view.channels;
            float wanted = (float)test_sample(pixel % 19, pixel / 19, i % view.channels, limit) / (float)(limit - 1);
            assert_float_equal(view.pixels[i], wanted, 1e-6);
        }
        rf_image_destroy(image);
    }
}

static void png_palettes_and_transparent_colours_are_expanded(void **state)
{
    (void)state;
    for (int depth = 1; depth <= 8; depth *= 2)
    {
        TestPng png = {11, 6, 3, depth, depth == 4, true};
        RfImage *image = decode("palette.png", test_png(&png));
        RfImageView view = rf_image_view(image);
        assert_int_equal(view.channels, 4);
        for (int i = 0; i < 66; ++i)
        {
            unsigned entry = test_sample(i % 11, i / 11, 0, depth == 1 ? 2 : 4);
            const float *pixel = view.pixels + 4 * i;
            assert_float_equal(pixel[0], (float)(80 * entry) / 255.0f, 1e-6);
            assert_float_equal(pixel[1], (float)(255 - 60 * entry) / 255.0f, 1e-6);
            assert_float_equal(pixel[3], entry == 0 ? 128 / 255.0f : 1.0f, 1e-6);
        }
        rf_image_destroy(image);
    }
    static const int kinds[][2] = {{0, 2}, {0, 16}, {2, 8}};
    for (int k = 0; k < 3; ++k)
    {
        TestPng png = {5, 5, kinds[k][0], kinds[k][1], false, true};
        RfImage *image = decode("transparent.png", test_png(&png));
        RfImageView view = rf_image_view(image);
        assert_true(rf_image_has_alpha(image));
        assert_float_equal(view.pixels[view.channels - 1], 0, 0);
        assert_float_equal(view.pixels[2 * view.channels - 1], 1, 0);
        rf_image_destroy(image);
    }
}

static void jpeg_is_read_in_grey_and_colour_baseline_and_progressive(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; ++kind)
    {
        RfImage *image = decode("ramp.jpg", test_jpeg(52, 21, kind & 1 ? 3 : 1, kind & 2));
        RfImageView view = rf_image_view(image);
        assert_int_equal(view.width, 52);
        assert_int_equal(view.height, 21);
        assert_int_equal(view.channels, kind & 1 ? 3 : 1);
        for (int i = 0; i < 52 * 21 * view.channels; ++i)
            assert_float_equal(view.pixels[i], (float)(i / view.channels % 52) / 51.0f, 0.04);
        rf_image_destroy(image);
    }
}

static void what_is_too_large_for_a_half_becomes_the_largest_half(void **state)
{
    (void)state;
    static const float numbers[] = {65504, 65519, 65520, 70000, 1e30f, -65505, -1e30f, 1};
    static const float halves[] = {65504, 65504, 65504, 65504, 65504, -65504, -65504, 1};
    const char *path = test_folder_file(&g_folder, "large.exr");
    RfImage *image = make_image(8, 1, 1, RF_SAMPLE_HALF, RF_ENCODING_LINEAR), *back;
    memcpy(rf_image_view(image).pixels, numbers, sizeof numbers);
    assert_int_equal(rf_image_write(path, image), RF_OK);
    assert_int_equal(rf_image_read(path, &back), RF_OK);
    assert_memory_equal(rf_image_view(back).pixels, halves, sizeof halves);
    rf_image_destroy(back);
    // Floats hold them.
    rf_image_set_origin(image, RF_SAMPLE_FLOAT, RF_ENCODING_LINEAR);
    assert_int_equal(rf_image_write(path, image), RF_OK);
    assert_int_equal(rf_image_read(path, &back), RF_OK);
    assert_memory_equal(rf_image_view(back).pixels, numbers, sizeof numbers);
    rf_image_destroy(back);
    rf_image_destroy(image);
}

static void exr_is_read_in_every_compression_as_scanlines_and_tiles_with_a_window_anywhere(void **state)
{
    (void)state;
    for (int kind = 0; kind < 8 * 3 * 2; ++kind)
    {
        TestExr exr = {41, 35, kind / 6, kind / 2 % 3, kind % 2 * 16, -7, 1000};
        // B44 keeps all but halfs exactly; DWA is not in the library at hand.
        if (exr.compression >= 6 && exr.type == 1)
            continue;
        RfImage *image = decode("kind.exr", test_exr(&exr));
        RfImageView view = rf_image_view(image);
        assert_int_equal(view.channels, 4);
        assert_int_equal(rf_image_format(image), exr.type == 1 ? RF_SAMPLE_HALF : RF_SAMPLE_FLOAT);
        for (int i = 0; i < 41 * 35 * 4; ++i)
            assert_float_equal(view.pixels[i], (float)test_sample(i / 4 % 41, i / 4 / 41, i % 4, 2048), 0);
        rf_image_destroy(image);
    }
}

static void real_exemplars_are_read(void **state)
{
    (void)state;
    static const struct
    {
        const char *name;
        int width, height, channels;
    } files[] = {{"exemplars/stk_lava.png", 256, 256, 3},
                 {"exemplars/aframe_water_512.jpg", 512, 512, 1},
                 {"exemplars/ps_nuts.pgm", 256, 256, 1},
                 {"exemplars/wei_161.jpg", 131, 119, 3}};
    for (size_t i = 0; i < sizeof files / sizeof files[0]; ++i)
    {
        const char *path = test_data_file(files[i].name);
        if (!path)
        {
            print_message("skipped: no %s\n", files[i].name);
            skip();
        }
        RfImage *image = read_image(path);
        RfImageView view = rf_image_view(image);
        assert_int_equal(view.width, files[i].width);
        assert_int_equal(view.height, files[i].height);
        assert_int_equal(view.channels, files[i].channels);
        assert_int_equal(rf_image_format(image), RF_SAMPLE_U8);
        float low = 1, high = 0;
        for (int k = 0; k < view.width * view.height * view.channels; ++k)
        {
            low = fminf(low, view.pixels[k]);
            high = fmaxf(high, view.pixels[k]);
        }
        assert_true(low >= 0 && high <= 1 && high - low > 0.2f);
        rf_image_destroy(image);
    }
}

static void a_builtin_exemplar_is_an_image(void **state)
{
    (void)state;
    RfImage *image = read_image("builtin:checker?size=32");
    assert_int_equal(rf_image_view(image).width, 32);
    assert_int_equal(rf_image_view(image).height, 32);
    rf_image_destroy(image);
}

// ---- writing that fails --------------------------------------------------------------------------------------------

static void places_that_cannot_be_written_are_named_and_nothing_stays(void **state)
{
    (void)state;
    RfImage *image = make_image(8, 8, 3, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImage *wide = make_image(8, 8, 5, RF_SAMPLE_U8, RF_ENCODING_DATA);
    TestFolder folder = test_folder_make();
    const char *missing = test_folder_file(&folder, "missing/a.png");
    assert_int_equal(rf_image_write(missing, image), RF_WRITE_FAILED);
    assert_string_equal(rf_last_error()->file, missing);
    assert_int_equal(rf_image_write(test_folder_file(&folder, "a.jpg"), image), RF_UNSUPPORTED);
    assert_non_null(strstr(rf_last_error()->message, ".png"));
    assert_int_equal(rf_image_write(test_folder_file(&folder, "a.png"), wide), RF_UNSUPPORTED);
    rf_image_set_channel_name(wide, 1, "same");
    rf_image_set_channel_name(wide, 3, "same");
    assert_int_equal(rf_image_write(test_folder_file(&folder, "a.exr"), wide), RF_INVALID_ARGUMENT);
    // A folder in the place of the file.
    mkdir(test_folder_file(&folder, "b.png"), 0777);
    assert_int_equal(rf_image_write(test_folder_file(&folder, "b.png"), image), RF_WRITE_FAILED);
    assert_int_equal(test_folder_count(&folder), 1);
    test_folder_remove(&folder);
    rf_image_destroy(image);
    rf_image_destroy(wide);
}

// In a process of its own, whose files may have `limit` bytes.
static int write_with_limit(const char *path, const RfImage *image, rlim_t limit)
{
    pid_t child = fork();
    if (child == 0)
    {
        // OpenMP's threads do not survive a fork.
        rf_set_threads(1);
        signal(SIGXFSZ, SIG_IGN);
        struct rlimit small = {limit, limit};
        setrlimit(RLIMIT_FSIZE, &small);
        _exit((int)rf_image_write(path, image));
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void a_full_disk_fails_and_keeps_what_was_there(void **state)
{
    (void)state;
    static const char *const names[] = {"full.png", "full.exr", "full.npy"};
    RfImage *image = make_image(256, 256, 3, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    fill(image);
    TestFolder folder = test_folder_make();
    for (int i = 0; i < 3; ++i)
    {
        const char *path = test_folder_file(&folder, names[i]);
        test_file_write(path, "old", 3);
        // In the middle, and one byte before the end, which only the last flush finds out.
        assert_int_equal(write_with_limit(path, image, 20000), RF_WRITE_FAILED);
        size_t size;
        unsigned char *bytes = test_file_read(path, &size);
        assert_int_equal(size, 3);
        free(bytes);
        assert_int_equal(write_with_limit(path, image, RLIM_INFINITY), RF_OK);
        free(test_file_read(path, &size));
        assert_int_equal(write_with_limit(path, image, size - 1), RF_WRITE_FAILED);
    }
    assert_int_equal(test_folder_count(&folder), 3);
    test_folder_remove(&folder);
    rf_image_destroy(image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(png_keeps_every_sample_of_8_and_16_bit_for_1_to_4_channels),
        cmocka_unit_test(png_in_memory_is_the_same_picture_and_refuses_what_png_cannot_hold),
        cmocka_unit_test(exr_keeps_every_half_and_float_and_every_channel_name),
        cmocka_unit_test(exr_channels_come_back_in_the_order_colour_alpha_and_the_rest_by_name),
        cmocka_unit_test(exr_makes_encoded_colour_linear_and_leaves_data_alone),
        cmocka_unit_test(an_exr_without_colour_is_data),
        cmocka_unit_test(npy_holds_the_floats_behind_an_aligned_header),
        cmocka_unit_test(the_same_image_gives_the_same_bytes_for_any_number_of_threads),
        cmocka_unit_test(pgm_and_ppm_are_read_as_text_and_binary_with_comments_and_any_maximum),
        cmocka_unit_test(every_png_colour_type_and_depth_is_read_interlaced_or_not),
        cmocka_unit_test(png_palettes_and_transparent_colours_are_expanded),
        cmocka_unit_test(jpeg_is_read_in_grey_and_colour_baseline_and_progressive),
        cmocka_unit_test(what_is_too_large_for_a_half_becomes_the_largest_half),
        cmocka_unit_test(exr_is_read_in_every_compression_as_scanlines_and_tiles_with_a_window_anywhere),
        cmocka_unit_test(real_exemplars_are_read),
        cmocka_unit_test(a_builtin_exemplar_is_an_image),
        cmocka_unit_test(places_that_cannot_be_written_are_named_and_nothing_stays),
        cmocka_unit_test(a_full_disk_fails_and_keeps_what_was_there),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
