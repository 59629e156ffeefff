// SPDX-License-Identifier: Apache-2.0
#include "inputs.h"
#include "text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

// FNV-1a (Fowler, Noll, Vo), eight bytes at a time.
uint64_t hash_add(uint64_t hash, const void *data, size_t size)
{
    const uint8_t *bytes = data;
    hash ^= 0xcbf29ce484222325u + size;
    for (; size >= 8; bytes += 8, size -= 8)
    {
        uint64_t word;
        memcpy(&word, bytes, 8);
        hash = (hash ^ word) * 0x100000001b3u;
        hash ^= hash >> 31;
    }
    for (; size > 0; ++bytes, --size)
        hash = (hash ^ *bytes) * 0x100000001b3u;
    return hash ^ (hash >> 29);
}

uint64_t hash_add_text(uint64_t hash, const char *text)
{
    return hash_add(hash, text, strlen(text));
}

static void add_file(InputFiles *inputs, const char *path)
{
    struct stat status;
    if (stat(path, &status) != 0)
        return;
    if (inputs->count == inputs->capacity)
    {
        size_t capacity = inputs->capacity ? 2 * inputs->capacity : 64;
        InputFile *files = realloc(inputs->files, capacity * sizeof *files);
        if (!files)
            return;
        inputs->files = files;
        inputs->capacity = capacity;
    }
    inputs->files[inputs->count++] = (InputFile){status.st_dev, status.st_ino};
    int64_t facts[2] = {(int64_t)status.st_size, (int64_t)status.st_mtime};
    inputs->hash = hash_add_text(inputs->hash, text_base_name(path));
    inputs->hash = hash_add(inputs->hash, facts, sizeof facts);
}

/// A PNG flow has its ranges in a JSON file beside it.
static void add_companion(InputFiles *inputs, const char *path)
{
    char name[4096];
    size_t stem = strlen(path) - strlen(text_extension(path));
    if (text_extension_in(path, "png") && stem + 5 < sizeof name)
    {
        snprintf(name, sizeof name, "%.*sjson", (int)stem, path);
        add_file(inputs, name);
    }
}

void inputs_add(InputFiles *inputs, const char *path, const char *extensions)
{
    struct stat status;
    if (text_starts(path, "builtin:"))
    {
        inputs->hash = hash_add_text(inputs->hash, path);
        return;
    }
    if (stat(path, &status) == 0 && !S_ISDIR(status.st_mode))
    {
        add_file(inputs, path);
        add_companion(inputs, path);
        if (text_extension_in(path, "pvd|series") && inputs->container_count < 8)
            inputs->containers[inputs->container_count++] = path;
        return;
    }
    RfSequence *sequence = NULL;
    if (rf_sequence_open(path, extensions, &sequence) != RF_OK)
        return;
    for (int i = 0; i < rf_sequence_count(sequence); ++i)
    {
        add_file(inputs, rf_sequence_path(sequence, i));
        add_companion(inputs, rf_sequence_path(sequence, i));
    }
    rf_sequence_destroy(sequence);
}

/// True if the container's text has the file's name in it.
static bool container_names(const char *container, const char *name)
{
    FILE *file = fopen(container, "rbe");
    if (!file)
        return false;
    bool found = false;
    char *line = NULL;
    size_t size = 0;
    while (!found && getline(&line, &size, file) >= 0)
        found = strstr(line, name) != NULL;
    free(line);
    fclose(file);
    return found;
}

bool inputs_contain(const InputFiles *inputs, const char *path)
{
    struct stat status;
    if (stat(path, &status) != 0)
        return false;
    for (size_t i = 0; i < inputs->count; ++i)
        if (inputs->files[i].device == status.st_dev && inputs->files[i].inode == status.st_ino)
            return true;
    for (int i = 0; i < inputs->container_count; ++i)
        if (container_names(inputs->containers[i], text_base_name(path)))
            return true;
    return false;
}

void inputs_free(InputFiles *inputs)
{
    free(inputs->files);
    *inputs = (InputFiles){0};
}
