// SPDX-License-Identifier: Apache-2.0
#include "support/files.h"

#include <dirent.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

static char *next_buffer(void)
{
    static char buffers[8][4096];
    static int next;
    return buffers[next++ % 8];
}

TestFolder test_folder_make(void)
{
    TestFolder folder;
    const char *base = getenv("TMPDIR");
    snprintf(folder.path, sizeof folder.path, "%s/riffle-test-XXXXXX", base && *base ? base : "/tmp");
    if (!mkdtemp(folder.path))
    {
        perror(folder.path);
        abort();
    }
    return folder;
}

static int remove_one(const char *path, const struct stat *status, int kind, struct FTW *walk)
{
    (void)status;
    (void)kind;
    (void)walk;
    return remove(path);
}

void test_folder_remove(const TestFolder *folder)
{
    nftw(folder->path, remove_one, 8, FTW_DEPTH | FTW_PHYS);
}

int test_folder_count(const TestFolder *folder)
{
    DIR *directory = opendir(folder->path);
    int count = 0;
    while (directory && readdir(directory))
        ++count;
    if (directory)
        closedir(directory);
    // "." and ".."
    return count - 2;
}

const char *test_folder_file(const TestFolder *folder, const char *name)
{
    char *buffer = next_buffer();
    snprintf(buffer, 4096, "%s/%s", folder->path, name);
    return buffer;
}

bool test_file_write(const char *path, const void *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    if (!file)
        return false;
    bool done = size == 0 || fwrite(data, size, 1, file) == 1;
    return fclose(file) == 0 && done;
}

unsigned char *test_file_read(const char *path, size_t *size)
{
    *size = 0;
    FILE *file = fopen(path, "rb");
    struct stat status;
    if (!file || fstat(fileno(file), &status) != 0)
        return NULL;
    unsigned char *data = malloc((size_t)status.st_size + 1);
    *size = data ? fread(data, 1, (size_t)status.st_size, file) : 0;
    fclose(file);
    return data;
}

const char *test_data_file_from(const char *source_dir, const char *name)
{
    char *buffer = next_buffer();
    const char *base = getenv("RIFFLE_DATA");
    if (base && *base)
        snprintf(buffer, 4096, "%s/%s", base, name);
    else
        snprintf(buffer, 4096, "%s/../shared/data/%s", source_dir, name);
    return access(buffer, R_OK) == 0 ? buffer : NULL;
}
