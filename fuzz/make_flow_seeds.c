// SPDX-License-Identifier: Apache-2.0
// make_flow_seeds DIR: writes small sound files as DIR/flo/..., DIR/npy/... and so on, one folder a fuzzer.
#include "../tests/support/flow_files.c"

#include <errno.h>
#include <sys/stat.h>

static TestBytes file;
static const char *directory;

static void save(const char *format, const char *name)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", directory, format);
    if (mkdir(path, 0777) != 0 && errno != EEXIST)
    {
        perror(path);
        exit(1);
    }
    snprintf(path, sizeof path, "%s/%s/%s", directory, format, name);
    FILE *out = fopen(path, "wb");
    if (!out || fwrite(file.data, file.size, 1, out) != 1 || fclose(out) != 0)
    {
        perror(path);
        exit(1);
    }
}

static double numbers[24];

static void make_arrays(void)
{
    static TestBytes array, parts[2];
    test_flo(&file, 2, 2, (float[]){1, 2, 3, 4, 5, 6, 1e10f, 8});
    save("flo", "hole");
    static const char *const kinds[] = {"<f2", "<f4", ">f8"};
    for (int i = 0; i < 3; ++i)
    {
        test_npy(&file, kinds[i], i == 1, "2, 2, 3, 2", numbers, 24);
        save("npy", kinds[i] + 1);
    }
    for (int deflated = 0; deflated < 2; ++deflated)
    {
        test_npy(&array, "<f4", false, "2, 3, 2", numbers, 12);
        test_zip(&file, &(TestZipEntry){"flow.npy", &array}, 1, deflated);
        save("npz", deflated ? "deflated" : "stored");
    }
    for (int c = 0; c < 2; ++c)
        test_npy(&parts[c], "<f4", false, "2, 3", numbers, 6);
    test_zip(&file, (TestZipEntry[]){{"u.npy", &parts[0]}, {"v.npy", &parts[1]}}, 2, true);
    save("npz", "pair");
}

static void make_netcdf(void)
{
    const char *const names[] = {"time", "lat", "lon"};
    const int sizes[] = {2, 2, 3};
    const TestNcVariable variables[] = {
        {.name = "lat", .dimension_count = 1, .dimensions = {1}, .units = "degrees_north", .values = numbers},
        {.name = "u", .dimension_count = 3, .dimensions = {0, 1, 2}, .values = numbers},
        {.name = "v",
         .dimension_count = 3,
         .dimensions = {0, 1, 2},
         .packed = true,
         .scale = 0.5,
         .has_fill = true,
         .fill = 3,
         .values = numbers}};
    test_nc(&file, names, sizes, 3, variables, 3);
    save("netcdf", "classic");
}

static void make_vti(void)
{
    static const char *const codings[] = {"ascii", "binary", "raw", "base64"};
    for (int i = 0; i < 8; ++i)
    {
        char name[32];
        TestVti vti = {.width = 2,
                       .height = 2,
                       .depth = 1,
                       .spacing = {1, 2},
                       .name = "velocity",
                       .components = 3,
                       .values = numbers,
                       .coding = codings[i / 2],
                       .type = i & 1 ? "Float32" : "Float64",
                       .points = i & 1,
                       .wide = i & 1,
                       .compressed = i & 1};
        test_vti(&file, &vti);
        snprintf(name, sizeof name, "%s%d", vti.coding, i & 1);
        save("vti", name);
    }
}

static void make_text(void)
{
    test_vec(&file);
    save("vec", "insight");
    file.size = 0;
    test_bytes_text(&file, "# x\ty\tu\tv\tmask\n0\t4\t1.5\t-2\t0\n8\t4\t1e-1\tnan\t1\n0\t0\t1\t1\t0\n8\t0\t2\t2\t0\n");
    save("openpiv", "table");
    file.size = 0;
    test_bytes_text(&file, "{\"a\": [1, {\"b\": \"\\\"\"}], \"uMin\": -1.5e1, \"uMax\": 2, \"vMin\": 0, \"vMax\": 1}");
    save("wind", "range");
    file.size = 0;
    test_bytes_text(&file, "1<VTKFile><Collection><DataSet file=\"a.vti\"/></Collection></VTKFile>");
    save("file_list", "pvd");
    file.size = 0;
    test_bytes_text(&file, "0{\"v\": \"1.0\", \"files\": [{\"name\": \"a.vti\", \"time\": 0}]}");
    save("file_list", "series");
}

int main(int argument_count, char **arguments)
{
    if (argument_count != 2)
    {
        fprintf(stderr, "usage: make_flow_seeds DIR\n");
        return 2;
    }
    directory = arguments[1];
    if (mkdir(directory, 0777) != 0 && errno != EEXIST)
    {
        perror(directory);
        return 1;
    }
    for (int k = 0; k < 24; ++k)
        numbers[k] = 0.5 * k - 4;
    make_arrays();
    make_netcdf();
    make_vti();
    make_text();
    return 0;
}
