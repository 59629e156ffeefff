// SPDX-License-Identifier: Apache-2.0
// The files a run reads: which they are, so that none is written over, and a fingerprint of them.
#pragma once

#include "riffle/riffle.h"

#include <sys/types.h>

#define IMAGE_EXTENSIONS "png,jpg,jpeg,exr,pgm,ppm"
#define FLOW_EXTENSIONS "flo,npy,npz,exr,vti,nc,vec,txt,png"

typedef struct InputFile
{
    dev_t device;
    ino_t inode;
} InputFile;

typedef struct InputFiles
{
    InputFile *files;
    size_t count, capacity;
    /// Of the names, sizes and times of change of all files.
    uint64_t hash;
    /// Containers (.pvd, .series) name other files in their text.
    const char *containers[8];
    int container_count;
} InputFiles;

/// Adds what a path, a pattern or a directory (its files with those extensions) stands for; built-in inputs and what is
/// not there add nothing.
void inputs_add(InputFiles *inputs, const char *path, const char *extensions);
/// True if writing `path` would replace an input.
bool inputs_contain(const InputFiles *inputs, const char *path);
void inputs_free(InputFiles *inputs);

/// A 64-bit hash for telling inputs and options apart, started from 0 and continued with what it returned.
uint64_t hash_add(uint64_t hash, const void *data, size_t size);
uint64_t hash_add_text(uint64_t hash, const char *text);
