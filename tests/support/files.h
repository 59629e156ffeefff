// SPDX-License-Identifier: Apache-2.0
// Temporary folders, small files and the real inputs, for tests.
#pragma once

#include <stdbool.h>
#include <stddef.h>

typedef struct TestFolder
{
    char path[256];
} TestFolder;

/// Below $TMPDIR or /tmp; stops the program if none can be made.
TestFolder test_folder_make(void);
/// With everything in it.
void test_folder_remove(const TestFolder *folder);
/// Number of entries, hidden ones too.
int test_folder_count(const TestFolder *folder);
/// The path of a file in the folder. One of 8 buffers in turn.
const char *test_folder_file(const TestFolder *folder, const char *name);

bool test_file_write(const char *path, const void *data, size_t size);
/// The whole file in memory from malloc, NULL if it cannot be read.
unsigned char *test_file_read(const char *path, size_t *size);

/// $RIFFLE_DATA/name, or ../shared/data/name beside the source; NULL if there is no such file. One of 8 buffers in
/// turn.
const char *test_data_file_from(const char *source_dir, const char *name);
#define test_data_file(name) test_data_file_from(RF_SOURCE_DIR, name)
