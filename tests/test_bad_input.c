// SPDX-License-Identifier: Apache-2.0
// Broken files and wrong command lines: each gives its exit code and one line that says what and where, and leaves
// nothing half-written.
#include "riffle/riffle.h"
#include "support/cli_check.h"
#include "support/flow_files.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cmocka.h>

typedef struct Case
{
    const char *line;
    int code;
    /// Is in the one line on stderr.
    const char *fragment;
} Case;

// ---- the files ---------------------------------------------------------------------------------------------------

static TestFolder g_folder;

static void put(const char *name, const void *data, size_t size)
{
    assert_true(test_file_write(test_folder_file(&g_folder, name), data, size));
}

static void put_text(const char *name, const char *text)
{
    put(name, text, strlen(text));
}

static void put_bytes(const char *name, const TestBytes *bytes)
{
    put(name, bytes->data, bytes->size);
}

/// The first `size` bytes of another file; minus: all but so many.
static void put_part(const char *name, const char *whole, long size)
{
    size_t length = 0;
    unsigned char *data = test_file_read(test_folder_file(&g_folder, whole), &length);
    assert_non_null(data);
    put(name, data, size < 0 ? length - (size_t)-size : (size_t)size);
    free(data);
}

static void put_image(const char *name, int width, int height, int channels, float value)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_create(width, height, channels, &image), RF_OK);
    RfImageView view = rf_image_view(image);
    for (int i = 0; i < width * height * channels; ++i)
        view.pixels[i] = 0.5f;
    view.pixels[channels * (width * (height / 2) + width / 4)] = value;
    rf_image_set_origin(image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    assert_int_equal(rf_image_write(test_folder_file(&g_folder, name), image), RF_OK);
    rf_image_destroy(image);
}

static void put_named_exr(const char *name, const char *first, const char *second)
{
    RfImage *image = NULL;
    assert_int_equal(rf_image_create(16, 16, 2, &image), RF_OK);
    rf_image_set_channel_name(image, 0, first);
    rf_image_set_channel_name(image, 1, second);
    rf_image_set_origin(image, RF_SAMPLE_FLOAT, RF_ENCODING_DATA);
    assert_int_equal(rf_image_write(test_folder_file(&g_folder, name), image), RF_OK);
    rf_image_destroy(image);
}

/// A PNG's signature and header, right to the last bit but for the size it claims.
static void put_huge_png(const char *name, uint32_t width, uint32_t height)
{
    uint8_t bytes[33] = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n', 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
    for (int i = 0; i < 4; ++i)
    {
        bytes[16 + i] = (uint8_t)(width >> (24 - 8 * i));
        bytes[20 + i] = (uint8_t)(height >> (24 - 8 * i));
    }
    bytes[24] = 8;
    bytes[25] = 2;
    uint32_t sum = (uint32_t)crc32(0, bytes + 12, 17);
    for (int i = 0; i < 4; ++i)
        bytes[29 + i] = (uint8_t)(sum >> (24 - 8 * i));
    put(name, bytes, sizeof bytes);
}

static void make_images(void)
{
    put_image("good.png", 32, 32, 3, 0.2f);
    put_image("good.exr", 32, 32, 3, 0.2f);
    put_image("tiny.png", 4, 4, 3, 0.2f);
    put_image("nan.exr", 32, 32, 3, NAN);
    put_image("small.png", 16, 16, 1, 0.2f);
    put_image("hole.png", 32, 32, 4, 0.2f);
    put_image("guide.png", 32, 32, 1, 0.2f);
    put_image("wide.png", 24, 16, 4, 0.5f);
    put_image("scale.exr", 32, 32, 1, 99);
    put_image("size.1.png", 32, 32, 3, 0.2f);
    put_image("size.2.png", 16, 16, 3, 0.2f);
    put_image("kind.1.png", 16, 16, 3, 0.2f);
    put_image("kind.2.png", 16, 16, 1, 0.2f);
    put_image("gap.1.png", 32, 32, 3, 0.2f);
    put_image("gap.3.png", 32, 32, 3, 0.2f);
    put_named_exr("height.exr", "height", "rough");
    put("empty.png", "", 0);
    put_part("cut12.png", "good.png", 12);
    put_part("cut.png", "good.png", -20);
    put_huge_png("huge.png", 1u << 30, 1u << 30);
    put_text("text.png", "this is no picture\n");
    put("cut.jpg", "\xff\xd8\xff\xe0\0\x10JFIF", 10);
    put("empty.jpg", "", 0);
    put_part("cut.exr", "good.exr", -200);
    put_part("cut8.exr", "good.exr", 8);
    put_text("huge.ppm", "P6\n99999999 99999999\n255\n");
    put_text("cut.pgm", "P5\n16 16\n255\n0123456789");
    put_text("zero.pgm", "P5\n16 16\n0\n");
    put_text("black.pgm", "P2\n2 2\n1\n0 0 0 0\n");
    put_text("word.pgm", "P2\n2 2\n1\n0 0 zero 0\n");
}

static void make_flo(void)
{
    float uv[2 * 16 * 16];
    for (int i = 0; i < 512; ++i)
        uv[i] = 0.5f;
    static TestBytes bytes;
    test_flo(&bytes, 16, 16, uv);
    put_bytes("good.flo", &bytes);
    put_bytes("s.0001.flo", &bytes);
    put_bytes("q.1.flo", &bytes);
    put("magic.flo", "PIEG", 4);
    put("empty.flo", "", 0);
    put_part("cut.flo", "good.flo", 1000);
    put_part("cut.0002.flo", "good.flo", 1000);
    put_part("cut.0001.flo", "good.flo", 2060);
    bytes.data[4 + 2] = 0x10;
    put_bytes("huge.flo", &bytes);
    uv[100] = NAN;
    bytes = (TestBytes){0};
    test_flo(&bytes, 16, 16, uv);
    put_bytes("nan.flo", &bytes);
    uv[100] = 0.5f;
    bytes = (TestBytes){0};
    test_flo(&bytes, 8, 16, uv);
    put_bytes("s.0002.flo", &bytes);
}

static void make_npy(void)
{
    static TestBytes bytes, zip;
    const double numbers[48] = {0};
    test_npy(&bytes, "<f4", false, "4, 4, 2", numbers, 32);
    put_bytes("good.npy", &bytes);
    TestZipEntry entry = {"velocity.npy", &bytes};
    test_zip(&zip, &entry, 1, true);
    put_bytes("good.npz", &zip);
    put_part("cut.npz", "good.npz", -30);
    put_part("cut.npy", "good.npy", -10);
    put_text("magic.npy", "NUMPY? no.");
    bytes = (TestBytes){0};
    test_npy(&bytes, "<f4", false, "4, 4, 3", numbers, 48);
    put_bytes("three.npy", &bytes);
    bytes = (TestBytes){0};
    test_npy(&bytes, "<f4", false, "900000, 900000, 2", numbers, 32);
    put_bytes("huge.npy", &bytes);
    put_text("text.npz", "PK? no.");
}

static void make_vtk_and_netcdf(void)
{
    static TestBytes bytes;
    const double values[32] = {0};
    TestVti vti = {.width = 4,
                   .height = 4,
                   .depth = 1,
                   .spacing = {1, 1},
                   .name = "temp",
                   .components = 1,
                   .values = values,
                   .coding = "ascii",
                   .type = "Float32"};
    test_vti(&bytes, &vti);
    put_bytes("scalar.vti", &bytes);
    put_text("text.vti", "no XML\n");
    put_text("large.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 32768 0 32768 0 0\"><Piece><CellData>"
                          "<DataArray Name=\"velocity\" type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">"
                          "1 2 3</DataArray></CellData></Piece></ImageData></VTKFile>");
    put_text("open.vti", "<VTKFile type=\"ImageData\"><ImageData WholeExtent=\"0 4 0 4 0 1\">");
    bytes = (TestBytes){0};
    static const char *const names[] = {"y", "x"};
    static const int sizes[] = {4, 4};
    TestNcVariable variable = {.name = "salt", .dimension_count = 2, .dimensions = {0, 1}, .values = values};
    test_nc(&bytes, names, sizes, 2, &variable, 1);
    put_bytes("salt.nc", &bytes);
    put_part("cut.nc", "salt.nc", 20);
    put_text("text.nc", "no NetCDF\n");
}

static void make_tables(void)
{
    put_text("text.vec", "no header here\n1 2 3\n");
    put("empty.vec", "", 0);
    put_text("empty.txt", "");
    put_text("words.txt", "x y u v\none two three four\n");
    put_part("alone.png", "good.png", 60);
    put_image("ranges.png", 16, 16, 3, 0.2f);
    put_text("ranges.json", "{\"uMin\": -1, \"uMax\": 1, \"vMin\": -1}");
    put_image("broken.png", 16, 16, 3, 0.2f);
    put_text("broken.json", "{\"uMin\": -1, ");
}

static int make_files(void **state)
{
    (void)state;
    g_folder = test_folder_make();
    mkdir(test_folder_file(&g_folder, "folder"), 0777);
    mkdir(test_folder_file(&g_folder, "outputs"), 0777);
    make_images();
    make_flo();
    make_npy();
    make_vtk_and_netcdf();
    make_tables();
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    test_folder_remove(&g_folder);
    return 0;
}

// ---- the check ---------------------------------------------------------------------------------------------------

static bool good_line(const CommandResult *result, const Case *wanted)
{
    return result->code == wanted->code && count_lines(result->err) == 1 && strncmp(result->err, "riffle: ", 8) == 0 &&
           strstr(result->err, wanted->fragment);
}

/// Nothing may stand in "outputs" afterwards, and no new file beside the inputs.
static void check(const Case *cases, size_t count, size_t file_limit)
{
    int files = test_folder_count(&g_folder), wrong = 0;
    for (size_t i = 0; i < count; ++i)
    {
        CommandOptions options = {.file_limit = file_limit};
        Command command = command_start(PROGRAM, g_folder.path, cases[i].line, &options);
        CommandResult result = command_finish(&command);
        TestFolder outputs;
        snprintf(outputs.path, sizeof outputs.path, "%.200s/outputs", g_folder.path);
        bool clean = test_folder_count(&outputs) == 0 && test_folder_count(&g_folder) == files;
        if (!good_line(&result, &cases[i]) || !clean)
        {
            print_error("riffle %s\n  gave %d%s: %s  expected %d: %s\n", cases[i].line, result.code,
                        clean ? "" : " and left files", result.err, cases[i].code, cases[i].fragment);
            ++wrong;
        }
        else if (getenv("RIFFLE_SHOW_MESSAGES"))
            print_message("%d %s", result.code, result.err);
        command_free(&result);
    }
    assert_int_equal(wrong, 0);
}

#define CHECK(cases) check(cases, sizeof cases / sizeof cases[0], 0)
#define FLOW "texture builtin:vortex?size=32x32 "
#define WITH " good.png outputs/a.%04d.png --frames 1-2"

static void broken_images_are_told_by_name_and_place(void **state)
{
    (void)state;
    static const Case cases[] = {
        {FLOW "missing.png outputs/a.png --frames 1", 3, "missing.png: cannot be opened: No such file"},
        {FLOW "empty.png outputs/a.png --frames 1", 3, "empty.png: not a PNG: the file is empty"},
        {FLOW "cut12.png outputs/a.png --frames 1", 3,
         "cut12.png: not a PNG: the file ends inside the header (12 of 33 bytes)"},
        {FLOW "cut.png outputs/a.png --frames 1", 3, "cut.png:row 0: broken PNG: the file ends after "},
        {FLOW "huge.png outputs/a.png --frames 1", 3, "huge.png:"},
        {FLOW "text.png outputs/a.png --frames 1", 3, "text.png: not a PNG: its first bytes are of no kind of image"},
        {FLOW "good.flo outputs/a.png --frames 1", 3, "good.flo: not a readable image"},
        {FLOW "cut.jpg outputs/a.png --frames 1", 3, "cut.jpg:header: broken JPEG"},
        {FLOW "empty.jpg outputs/a.png --frames 1", 3, "empty.jpg: not a JPEG: the file is empty"},
        {FLOW "cut.exr outputs/a.png --frames 1", 3, "cut.exr:header: broken EXR"},
        {FLOW "cut8.exr outputs/a.png --frames 1", 3, "cut8.exr:header: broken EXR"},
        {FLOW "huge.ppm outputs/a.png --frames 1", 3,
         "huge.ppm:header: says 99999999 x 99999999 pixels: each side must be 1 to 32768"},
        {FLOW "cut.pgm outputs/a.png --frames 1", 3,
         "cut.pgm:byte 23: broken PGM: the file ends inside the pixels (10 of 256 bytes)"},
        {FLOW "zero.pgm outputs/a.png --frames 1", 3,
         "zero.pgm:byte 10: broken PGM: the greatest value must be 1 to 65535"},
        {FLOW "word.pgm outputs/a.png --frames 1", 3, "word.pgm:byte 13: broken PGM: a number should be here"},
        {FLOW "folder outputs/a.png --frames 1", 3, "folder: "},
        {"info missing.png", 3, "missing.png: "},
        {"info text.png", 3, "text.png: "},
        {"convert cut.png outputs/a.exr", 3, "cut.png:row 0: "},
        {"convert folder outputs/a.%04d.png", 3, "folder"},
        {"render missing.%04d.exr outputs/a.%04d.png --as relief", 3, "missing.%04d.exr"},
    };
    CHECK(cases);
}

static void unusable_exemplars_are_refused_with_what_to_do(void **state)
{
    (void)state;
    static const Case cases[] = {
        {FLOW "tiny.png outputs/a.png --frames 1", 3, "4 x 4 pixels: each side must be 8 to 32768"},
        {FLOW "nan.exr outputs/a.png --frames 1", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {FLOW "height.exr outputs/a.png --frames 1", 3, "no colour here: looked for R G B or Y; its first channel is "},
        {FLOW "builtin:fudge outputs/a.png --frames 1", 3,
         "builtin:fudge: there is no built-in exemplar of that name; there are: "},
        {FLOW "builtin:foam?size=0 outputs/a.png --frames 1", 3, "builtin:foam?size=0:size: "},
        {FLOW "good.png outputs/a.png --map roughness=missing.png", 3, "missing.png: "},
        {FLOW "good.png outputs/a.png --map roughness=small.png", 3, "small.png:roughness: this map is 16 x 16 pixels"},
        {FLOW "good.png outputs/a.png --map normal=small.png", 3, "small.png:normal: "},
        {FLOW "good.png outputs/a.png --map roughness=nan.exr", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {FLOW "good.png outputs/a.png --map-weight roughness=1", 2, "there is no such map; there are: colour"},
        {FLOW "good.png outputs/a.png --mask black.pgm", 3, "black.pgm: the mask is black everywhere"},
        {FLOW "good.png outputs/a.png --mask missing.pgm", 3, "missing.pgm: "},
    };
    CHECK(cases);
}

static void broken_flows_are_told_by_name_and_place(void **state)
{
    (void)state;
    static const Case cases[] = {
        {"texture missing.flo" WITH, 3, "missing.flo: "},
        {"texture empty.flo" WITH, 3, "empty.flo: "},
        {"texture magic.flo" WITH, 3, "magic.flo:byte 0: not a .flo: it does not begin with PIEH"},
        {"texture cut.flo" WITH, 3, "cut.flo:data: 16 x 16 cells need 2060 bytes, the file has 1000"},
        {"texture huge.flo" WITH, 3, "huge.flo:header: 1048592 x 16 cells: each side must be 1 to 32768"},
        {"texture nan.flo" WITH, 3, "nan.flo:cell 2, 3: velocity is not a finite number"},
        {"texture cut.%04d.flo" WITH, 3, "cut.0002.flo:data: "},
        {"texture s.%04d.flo" WITH, 3, "s.0002.flo:header: 8 x 16 cells, but the first moment has 16 x 16"},
        {"texture nothing.%04d.flo" WITH, 3, "nothing.%04d.flo: no file of this name"},
        {"texture cut.npy" WITH, 3, "cut.npy:header: the shape needs 128 bytes of numbers, 118 are there"},
        {"texture magic.npy" WITH, 3, "magic.npy:header: not a NumPy array"},
        {"texture three.npy" WITH, 3, "three.npy:header: the shape is [4, 4, 3]"},
        {"texture huge.npy" WITH, 3, "huge.npy:header: "},
        {"texture cut.npz" WITH, 3, "cut.npz: not a sound zip archive"},
        {"texture text.npz" WITH, 3, "text.npz: not a sound zip archive"},
        {"texture scalar.vti" WITH, 3, "scalar.vti: no velocity here: looked for "},
        {"texture text.vti" WITH, 3, "text.vti:line 1: "},
        {"texture open.vti" WITH, 3, "open.vti:line 1: "},
        {"texture large.vti" WITH, 3, "large.vti:array velocity: it does not hold as many numbers as the extent says"},
        {"texture salt.nc" WITH, 3, "salt.nc: no velocity here: looked for u, v "},
        {"texture cut.nc" WITH, 3, "cut.nc: "},
        {"texture text.nc" WITH, 3, "text.nc: cannot be read as NetCDF"},
        {"texture text.vec" WITH, 3, "text.vec:header: not an Insight .vec"},
        {"texture empty.vec" WITH, 3, "empty.vec: the file is empty"},
        {"texture empty.txt" WITH, 3, "empty.txt: the file is empty"},
        {"texture words.txt" WITH, 3, "words.txt:line 1: "},
        {"texture small.png" WITH, 3, "small.json is missing"},
        {"texture ranges.png" WITH, 3, "ranges.json: the object has no \"vMax\""},
        {"texture broken.png" WITH, 3, "broken.json:line 1: "},
        {"texture height.exr --variables u,v" WITH, 3,
         "height.exr:channels: no velocity here: looked for u,v; it has: height, rough"},
        {"texture cut.exr" WITH, 3, "cut.exr:header: "},
        {"texture folder" WITH, 3, "folder: the directory holds no 2D flow"},
        {"texture good.pvd" WITH, 3, "good.pvd: "},
        {"texture builtin:gale" WITH, 3, "builtin:gale: there is no built-in flow of that name; there are: "},
        {"texture builtin:vortex?size=0x9" WITH, 3, "builtin:vortex?size=0x9:size: "},
        {"texture builtin:vortex?pace=2" WITH, 3,
         "builtin:vortex?pace=2:pace: there is no such parameter; there are: size, speed"},
        {"render cut.flo outputs/a.png", 3, "cut.flo:data: "},
        {"convert cut.flo outputs/a.vti", 3, "cut.flo:data: "},
        {"info cut.flo", 3, "cut.flo:data: "},
        {"info builtin:gale", 3, "builtin:gale: "},
    };
    CHECK(cases);
}

#define GOOD FLOW "good.png outputs/a.%04d.png --frames 1-2 "

static void wrong_command_lines_are_refused_with_the_right_one(void **state)
{
    (void)state;
    static const Case cases[] = {
        {"", 2, "no verb; riffle --help"},
        {"judge a b", 2, "unknown verb judge; there are: texture, synth, render, measure, convert, info"},
        {"texture", 2, "texture needs FLOW EXEMPLAR OUTPUT: 0 of 3 are given"},
        {FLOW "good.png", 2, "2 of 3 are given"},
        {FLOW "good.png outputs/a.png outputs/b.png", 2, "but \"outputs/b.png\" is left"},
        {GOOD "--bogus", 2, "texture has no option --bogus;"},
        {GOOD "--fixed good.png", 2, "texture has no option --fixed (synth has)"},
        {GOOD "--method optimize --windows 8", 2, "riffle: windows: 8 is even"},
        {GOOD "-z", 2, "texture has no option -z"},
        {GOOD "-qq", 2, "texture has no option -qq;"},
        {"convert good.png outputs/a.png --fade 3", 2, "convert has no option --fade"},
        {GOOD "--seed", 2, "--seed needs a value: N"},
        {GOOD "--seed -1", 2, "--seed -1: must be a whole number"},
        {GOOD "--resume=yes", 2, "--resume takes no value"},
        {GOOD "--size 0x512", 2, "--size 0x512: width must be 1 to 32768"},
        {GOOD "--size 512x99999", 2, "--size 512x99999: height must be 1 to 32768"},
        {GOOD "--size 512", 2, "--size 512: must be WxH"},
        {GOOD "--size 99999999999x1", 2, "--size 99999999999x1: must be WxH"},
        {GOOD "--frames 9-1", 2, "--frames 9-1: must be A-B"},
        {GOOD "--frames 1-9x0", 2, "--frames 1-9x0: must be A-B"},
        {GOOD "--frames -3", 2, "--frames -3: must be A-B"},
        {GOOD "--fps 0", 2, "--fps 0: must be 0.01 to 10000"},
        {GOOD "--fps nan", 2, "--fps nan: must be"},
        {GOOD "--velocity-scale inf", 2, "--velocity-scale inf: must be"},
        {GOOD "--threads 0", 2, "--threads 0: must be a whole number, 1 to 256"},
        {GOOD "--moment-every 0", 2, "--moment-every 0: must be a whole number, 1 to"},
        {GOOD "--method euler", 2,
         "--method euler: must be lagrangian, optimize, directional, eulerian, dual, sprites or "
         "warp"},
        {GOOD "--method dual --reset-every 1", 2, "--reset-every 1: must be a whole number, 2 to 100000 frames"},
        {GOOD "--method dual --blend histogram", 2, "--blend histogram: must be plain or contrast"},
        {GOOD "--method dual --latency 9", 2, "--latency is an option of --method eulerian, not of dual"},
        {GOOD "--method directional --rotations 2", 2, "--rotations 2: must be a whole number, 4 to 180"},
        {GOOD "--method directional --direction 400", 2, "--direction 400: must be -1 to 360 degrees"},
        {GOOD "--method directional --seam glue", 2, "--seam glue: must be feather or cut"},
        {GOOD "--method directional --cells far", 2, "--cells far: must be near or least"},
        {GOOD "--method directional --cell-min 40", 2, "riffle: cell-min: 40 is more than cell-max 32"},
        {GOOD "--method directional --speed-min 3 --speed-max 2", 2, "speed-min: 3 is more than speed-max 2"},
        {GOOD "--mask-width 3", 2, "--mask-width is an option of --method directional, not of lagrangian"},
        {FLOW "small.png outputs/a.%04d.png --frames 1-2 --method directional --exemplar-tiles no --mask-width 8", 3,
         "small.png: 16 x 16 pixels that do not tile have no room for patches of 18 x 18, however turned: they need "
         "sides of 27"},
        {GOOD "--preset best", 2, "--preset best: must be default or paper"},
        {GOOD "--blend soft", 2, "--blend soft: must be plain, contrast or histogram"},
        {GOOD "--particle-radius 5000", 2, "--particle-radius 5000: must be 0 to 4096 px"},
        {GOOD "--grid-vertices 7.5", 2, "--grid-vertices 7.5: must be a whole number, 4 to 32"},
        {GOOD "--method warp --fade 3", 2, "--fade is an option of --method lagrangian, not of warp"},
        {GOOD "--method warp --uv", 2, "--uv: --method warp has no layers"},
        {GOOD "--method warp --preset paper", 2, "--method warp has no presets"},
        {GOOD "--shader fire --uv", 2, "--uv and --shader exclude each other"},
        {GOOD "--shader water", 2, "--shader water: must be none, fire or clouds"},
        {GOOD "--map height", 2, "--map height: must be NAME=IMAGE"},
        {GOOD "--map a=good.png --map a=good.png", 2, "a map a was given before"},
        {GOOD "--map-weight a=-1", 2, "--map-weight a=-1: must be NAME=W"},
        {GOOD "--variables u", 2, "--variables u: must be two names"},
        {GOOD "--progress loud", 2, "--progress loud: must be auto, bar, plain, json or none"},
        {GOOD "-q -v", 2, "-q and -v exclude each other"},
        {GOOD "--exemplar-tiles maybe", 2, "--exemplar-tiles maybe: must be auto, no or yes"},
        {"render good.flo outputs/a.png --as smoke", 2, "--as smoke: must be wheel, arrows, lic or relief"},
        {"render good.flo outputs/a.png --map height=good.png", 2, "--map belongs to --as relief"},
        {"texture q.%d.flo good.png outputs/a.png --frames 5000x1-2", 2, "--frames 5000x1-2: must be A-B"},
        {"convert good.png outputs/a.png --frames 7-9", 2, "has the frames 1 to 1"},
    };
    CHECK(cases);
}

#define SYNTH "synth good.png outputs/a.png --size 32x32 "

static void what_a_still_cannot_be_made_of_is_refused_with_the_reason(void **state)
{
    (void)state;
    static const Case cases[] = {
        {"synth", 2, "synth needs EXEMPLAR OUTPUT: 0 of 2 are given"},
        {"synth missing.png outputs/a.png", 3, "missing.png: "},
        {"synth cut.png outputs/a.png", 3, "cut.png:row 0: broken PNG"},
        {"synth tiny.png outputs/a.png", 3, "4 x 4 pixels: each side must be 8 to 32768"},
        {"synth nan.exr outputs/a.png", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {"synth height.exr outputs/a.png", 3, "no colour here"},
        {"synth builtin:vortex outputs/a.png", 3, "builtin:vortex: "},
        {"synth good.png outputs/a.%04d.png", 2,
         "outputs/a.%04d.png: a still texture is one picture: leave the number"},
        {"synth good.png outputs/a.mp4", 2, "outputs/a.mp4: a still texture is one picture: png, exr"},
        {"synth good.png nowhere/a.png", 1, "nowhere/a.png: cannot be written: No such file or directory; make"},
        {"synth good.png good.png -y", 2, "good.png: is an input of this run and is never replaced"},
        {"synth good.png guide.png --fixed hole.png --target guide.png -y", 2, "guide.png: is an input of this run"},
        {"synth good.png outputs/a.png --size 0x512", 2, "--size 0x512: width must be 1 to 32768"},
        {"synth good.png outputs/a.png --size 512x99999", 2, "--size 512x99999: height must be 1 to 32768"},
        {"synth good.png outputs/a.png --size 7x64", 2, "7 x 64 pixels: each side must be 8 to 32768"},
        {SYNTH "--frames 1-3", 2, "synth has no option --frames"},
        {SYNTH "--fps 24", 2, "synth has no option --fps"},
        {SYNTH "--flow good.flo", 2, "synth has no option --flow"},
        {SYNTH "--mask good.png", 2, "synth has no option --mask"},
        {SYNTH "--resume", 2, "synth has no option --resume"},
        {SYNTH "--orient flow", 2, "synth has no option --orient (texture has)"},
        {SYNTH "--tile no", 2, "join yes and no as in --tile=no"},
        {SYNTH "--method warp", 2, "synth has no option --method"},
        {SYNTH "--windows", 2, "--windows needs a value: numbers, as 17,9"},
        {SYNTH "--windows 16", 2, "--windows: 16 is even"},
        {SYNTH "--windows 35", 2, "--windows 35: must be whole numbers, 5 to 33, as 17,9"},
        {SYNTH "--windows 9,3", 2, "--windows 9,3: must be whole numbers, 5 to 33"},
        {SYNTH "--windows 9,,7", 2, "--windows 9,,7: must be whole numbers, 5 to 33"},
        {SYNTH "--windows 9,", 2, "--windows 9,: must be whole numbers, 5 to 33"},
        {SYNTH "--windows 0", 2, "--windows 0: must be whole numbers, 5 to 33"},
        {SYNTH "--windows 9.5", 2, "--windows 9.5: must be whole numbers, 5 to 33"},
        {SYNTH "--windows 00000000000000000000009", 2, "must be whole numbers, 5 to 33"},
        {SYNTH "--windows 17,15,13,11,9", 2, "--windows 17,15,13,11,9: at most 4 numbers"},
        {SYNTH "--levels 11", 2, "--levels 11: must be a whole number, 0 to 10"},
        {SYNTH "--form soft", 2, "--form soft: must be discrete or mean"},
        {SYNTH "--fixed good.png", 3, "good.png: has no alpha: transparent pixels are those to be made"},
        {SYNTH "--fixed missing.png", 3, "missing.png: "},
        {SYNTH "--fixed wide.png", 3, "wide.png: is 24 x 16 pixels, the result 32 x 32: they need one size"},
        {"synth small.png outputs/a.png --fixed hole.png", 3, "hole.png:colour: has 3 channels, the exemplar's map 1"},
        {"synth builtin:chocolate?size=32 outputs/a.png --fixed hole.png", 3,
         "hole.png: has no height, which the exemplar has: give one EXR with all its maps"},
        {SYNTH "--target missing.png", 3, "missing.png: "},
        {SYNTH "--target nan.exr", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {"synth good.png outputs/a.png --size 16x16 --target height.exr", 3,
         "height.exr: has no colour, which the exemplar has"},
        {SYNTH "--target wide.png", 3, "wide.png: is 24 x 16 pixels, the result 32 x 32"},
        {SYNTH "--target guide.png@", 2, "--target guide.png@: must be IMAGE or IMAGE@W"},
        {SYNTH "--target @3", 2, "--target @3: must be IMAGE or IMAGE@W"},
        {SYNTH "--target guide.png@-1", 2, "--target guide.png@-1: the weight must be 0 to 1e+06, or an image"},
        {SYNTH "--target guide.png@missing.png", 3, "missing.png: "},
        {SYNTH "--target guide.png@good.png", 3, "good.png:pixel (8, 16): is no grey: one number a pixel is needed"},
        {"synth good.png outputs/a.png --target guide.png --scale-map wide.png", 3,
         "wide.png: is 24 x 16 pixels, guide.png 32 x 32: they need one size"},
        {"synth builtin:chocolate?size=32 outputs/a.png --target good.png", 3,
         "good.png: has no height, which the exemplar has: give one EXR with all its maps, or --map-weight height=0"},
        {SYNTH "--guide guide.png", 2, "--guide guide.png: the exemplar has no such map"},
        {SYNTH "--map guide=guide.png", 2, "the exemplar has a map named guide: say with --guide IMAGE"},
        {SYNTH "--map guide=guide.png --guide good.png", 3,
         "good.png: has 3 channels, the exemplar's map guide 1: they are compared"},
        {SYNTH "--map guide=guide.png --guide wide.png", 3, "wide.png: is 24 x 16 pixels"},
        {SYNTH "--map guide=small.png --guide guide.png", 3, "small.png:guide: this map is 16 x 16 pixels"},
        {SYNTH "--orientation-map good.png", 3, "good.png:pixel (8, 16): is no grey"},
        {SYNTH "--orientation-map wide.png", 3, "wide.png: is 24 x 16 pixels"},
        {SYNTH "--scale-map scale.exr", 3, "scale.exr:pixel (8, 16): a scale of "},
        {SYNTH "--map-weight colour=0", 3, "good.png: nothing to compare: all maps of the exemplar have weight 0"},
    };
    CHECK(cases);
}

static void a_still_too_large_for_the_machine_is_refused_at_once(void **state)
{
    (void)state;
    double there = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE);
    if (there > 64e9)
    {
        print_message("skipped: this machine has memory for 32768 x 32768 pixels\n");
        skip();
    }
    static const Case cases[] = {
        {"synth good.png outputs/a.png --size 32768x32768", 1, "32768 x 32768 pixels need about "},
    };
    CHECK(cases);
}

static void frames_that_cannot_be_judged_are_refused_with_the_reason(void **state)
{
    (void)state;
    static const Case cases[] = {
        {"measure", 2, "measure needs FRAMES: 0 of 1 are given"},
        {"measure good.png small.png", 2, "but \"small.png\" is left"},
        {"measure missing.png", 3, "missing.png: "},
        {"measure missing.%04d.png", 3, "missing.%04d.png: "},
        {"measure cut.png", 3, "cut.png:row 0: broken PNG"},
        {"measure good.flo", 3, "good.flo: not a readable image"},
        {"measure height.exr", 3, "height.exr: no colour here: looked for R G B or Y; its first channel is "},
        {"measure nan.exr", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {"measure tiny.png", 3, "tiny.png: 4 x 4 pixels: frames need 16 on each side to be measured"},
        {"measure size.%d.png", 3, "size.2.png: is 16 x 16 pixels, the first frame 32 x 32: all need one size"},
        {"measure kind.%d.png", 3, "kind.2.png: has 1 channel of colour and alpha, the first frame 3"},
        {"measure size.1.png --frames 2-3", 2, "--frames 2-3: size.1.png has the frames 1 to 1"},
        {"measure good.png --exemplar missing.png", 3, "missing.png: "},
        {"measure good.png --exemplar tiny.png", 3,
         "tiny.png: 4 x 4 pixels: an exemplar needs 16 on each side to be measured with"},
        {"measure good.png --exemplar nan.exr", 3, "nan.exr:pixel (8, 16), channel R: is NaN"},
        {"measure good.png --exemplar height.exr", 3, "height.exr: no colour here"},
        {"measure good.png --flow cut.flo", 3, "cut.flo:data: "},
        {"measure good.png --flow builtin:gale", 3, "builtin:gale: there is no built-in flow of that name"},
        {"measure gap.%d.png --flow builtin:gyre?size=32x32", 3,
         "gap.%d.png: has no frame 2, between 1 and 3: motion is judged from each frame to the next"},
        {"measure gap.%d.png --flow builtin:gyre?size=32x32 --frames 1-3x2", 2,
         "--frames 1-3x2: motion is judged from each frame to the next; leave x2 out"},
        {"measure good.png --mask black.pgm", 3, "black.pgm: the mask is black everywhere"},
        {"measure good.png --report outputs/a.txt", 2, "a report is written as .json or .html"},
        {"measure good.png --report nowhere/a.json", 1, "nowhere/a.json: cannot be written: No such file"},
        {"measure good.png --flow ranges.png --report ranges.json -y", 2,
         "ranges.json: is an input of this run and is never replaced"},
        {"measure good.png --rotations 0", 2, "--rotations 0: must be a whole number, 1 to 72"},
        {"measure good.png --holes none", 2, "--holes none: must be auto, alpha, zero or nan"},
        {"measure good.png --spectrum-crop 17", 2, "--spectrum-crop 17: must be 0, or even and 16 to 512"},
        {"measure good.png --spectrum-crop 64", 2, "--spectrum-crop 64: good.png is 32 x 32 pixels"},
        {"measure good.png --exemplar small.png --patch-size 31", 2, "--patch-size 31: small.png is 16 x 16 pixels"},
        {"measure good.png --fade 3", 2, "measure has no option --fade"},
        {"measure good.png --resume", 2, "measure has no option --resume"},
    };
    CHECK(cases);
}

static void outputs_that_cannot_be_are_refused_before_anything_is_made(void **state)
{
    (void)state;
    static const Case cases[] = {
        {FLOW "good.png outputs/a.tiff", 2, "outputs/a.tiff: frames are written as png, exr, npy"},
        {FLOW "good.png outputs/a.jpg", 2, "outputs/a.jpg: frames are written as png, exr, npy"},
        {FLOW "good.png outputs/a", 2, "outputs/a: frames are written as"},
        {FLOW "good.png outputs", 2, "outputs: is a directory; name the files in it: outputs/frame.%04d.png"},
        {FLOW "good.png outputs/a.png --frames 1-3", 2,
         "one name for 3 frames; put a number in it, as outputs/a.%04d.png"},
        {FLOW "good.png outputs/a.%04d.png -o outputs/a.%04d.png", 2, "is an output twice"},
        {FLOW "good.png md5: -o -", 2, "md5: and - both write to stdout"},
        {FLOW "good.png null: --resume", 2, "null: cannot resume"},
        {FLOW "good.png outputs/a.mp4 --resume", 2, "write images beside it"},
        {FLOW "good.png md5: --uv", 2, "--uv needs an image output"},
        {"convert good.flo outputs/a.png", 2, "a flow is written as flo, npy, exr or vti"},
        {"convert good.png outputs/a.flo", 2, "outputs/a.flo: frames are written as"},
        {"convert good.flo -", 2, "a flow is written as"},
        {FLOW "good.png good.png/a.png --frames 1", 1, "good.png/a.png: cannot be written: Not a directory"},
        {FLOW "good.png nowhere/a.png --frames 1", 1,
         "nowhere/a.png: cannot be written: No such file or directory; make"},
        {"convert good.flo nowhere/a.vti", 1, "nowhere/a.vti: cannot be written"},
        {FLOW "good.png folder/ --frames 1", 2, "folder/: is a directory; name the files in it: folder/frame.%04d.png"},
    };
    CHECK(cases);
}

static void a_full_disk_fails_the_run_and_leaves_no_half_file(void **state)
{
    (void)state;
    static const Case cases[] = {
        {FLOW "builtin:noise outputs/a.png --size 256x256 --frames 1 -q", 1, "outputs/a.png: cannot be written: "},
        {FLOW "builtin:noise outputs/a.exr --size 256x256 --frames 1 -q", 1, "outputs/a.exr: cannot be written: "},
        {FLOW "builtin:noise outputs/a.npy --size 256x256 --frames 1 -q", 1, "outputs/a.npy: cannot be written: "},
        {"convert builtin:vortex outputs/a.flo -q", 1, "outputs/a.flo: cannot be written: "},
        {"convert builtin:vortex outputs/a.vti -q", 1, "outputs/a.vti: cannot be written: "},
        {"convert builtin:vortex outputs/a.npy -q", 1, "outputs/a.npy: cannot be written: "},
        {"convert builtin:vortex outputs/a.exr -q", 1, "outputs/a.exr: cannot be written: "},
        {"render builtin:vortex outputs/a.png --as lic --frames 1 -q", 1, "outputs/a.png: cannot be written: "},
        {"synth builtin:noise outputs/a.png -q", 1, "outputs/a.png: cannot be written: "},
        {"synth builtin:noise?size=64 outputs/a.exr -q", 1, "outputs/a.exr: cannot be written: "},
        {"measure builtin:noise --report outputs/a.html -q", 1, "outputs/a.html: cannot be written: "},
        {"measure builtin:noise --report outputs/a.json -q", 1, "outputs/a.json: cannot be written: "},
    };
    // The largest file that the program may write.
    check(cases, sizeof cases / sizeof cases[0], 4096);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(broken_images_are_told_by_name_and_place),
        cmocka_unit_test(unusable_exemplars_are_refused_with_what_to_do),
        cmocka_unit_test(broken_flows_are_told_by_name_and_place),
        cmocka_unit_test(wrong_command_lines_are_refused_with_the_right_one),
        cmocka_unit_test(what_a_still_cannot_be_made_of_is_refused_with_the_reason),
        cmocka_unit_test(a_still_too_large_for_the_machine_is_refused_at_once),
        cmocka_unit_test(frames_that_cannot_be_judged_are_refused_with_the_reason),
        cmocka_unit_test(outputs_that_cannot_be_are_refused_before_anything_is_made),
        cmocka_unit_test(a_full_disk_fails_the_run_and_leaves_no_half_file),
    };
    return cmocka_run_group_tests(tests, make_files, remove_files);
}
