// SPDX-License-Identifier: Apache-2.0
// make_image_seeds DIR: small valid and broken image files, in DIR/png, DIR/jpeg, DIR/exr and DIR/pnm, for the fuzzers
// to start from.
#include "support/image_files.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

static void write_seed(const char *folder, const char *kind, int index, const void *data, size_t size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, kind);
    mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/%s/seed%03d", folder, kind, index);
    FILE *file = fopen(path, "wb");
    if (!file || (size > 0 && fwrite(data, size, 1, file) != 1) || fclose(file) != 0)
    {
        perror(path);
        exit(1);
    }
}

// The file whole, without its last third, and with a byte spoilt in the middle.
static void write_three(const char *folder, const char *kind, int *index, TestBytes bytes)
{
    write_seed(folder, kind, (*index)++, bytes.data, bytes.size);
    write_seed(folder, kind, (*index)++, bytes.data, bytes.size * 2 / 3);
    bytes.data[bytes.size / 2] ^= 0x55;
    write_seed(folder, kind, (*index)++, bytes.data, bytes.size);
    test_bytes_free(bytes);
}

static void write_pngs(const char *folder)
{
    static const int types[][2] = {{0, 1}, {0, 4}, {0, 16}, {2, 8}, {3, 2}, {3, 8}, {4, 8}, {6, 16}};
    int index = 0;
    for (int i = 0; i < 16; ++i)
    {
        int type = types[i / 2][0];
        TestPng png = {9, 7, type, types[i / 2][1], i % 2 == 1, type < 4 && i % 2 == 0};
        write_three(folder, "png", &index, test_png(&png));
    }
}

static void write_jpegs(const char *folder)
{
    static const int components[] = {1, 3, 4};
    int index = 0;
    for (int i = 0; i < 6; ++i)
        write_three(folder, "jpeg", &index, test_jpeg(17, 9, components[i / 2], i % 2 == 1));
}

static void write_exrs(const char *folder)
{
    int index = 0;
    for (int i = 0; i < 16; ++i)
    {
        TestExr exr = {13, 18, i / 2, i % 3, i % 2 * 8, -i, 3 * i};
        write_three(folder, "exr", &index, test_exr(&exr));
    }
}

static void write_pnms(const char *folder)
{
    static const char *const texts[] = {"P2\n# a comment\n3 2\n15\n0 1 2 3 4 15\n",
                                        "P3 1 2 65535 1 2 3 65535 5 6",
                                        "P5 4 2 255\nabcdefgh",
                                        "P5 2 1 1000\n\1\2\3\4",
                                        "P6\n2 1\n255\nabcdef",
                                        "P6 1 1 65535 abcdef"};
    int index = 0;
    for (int i = 0; i < 6; ++i)
    {
        TestBytes bytes = {(uint8_t *)strdup(texts[i]), strlen(texts[i])};
        write_three(folder, "pnm", &index, bytes);
    }
}

int main(int argc, char **argv)
{
    if (argc != 2)
    {
        fprintf(stderr, "usage: make_image_seeds DIR\n");
        return 2;
    }
    mkdir(argv[1], 0777);
    write_pngs(argv[1]);
    write_jpegs(argv[1]);
    write_exrs(argv[1]);
    write_pnms(argv[1]);
    return 0;
}
