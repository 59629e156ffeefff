// SPDX-License-Identifier: Apache-2.0
// The state of a stopped run: a small file beside the first image output, named .NAME.rfstate after the first frame's
// file. It says which frame comes next and holds the method's own block. A run that ends well removes it.
#pragma once

#include "pattern.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct State
{
    char path[PATH_SIZE + 16];
    /// Of inputs and options: a run with another one is another run.
    uint64_t hash;
    /// Index of the next frame in the run's list.
    int64_t next;
    void *block;
    size_t size;
} State;

/// Where the state of a run stands whose first image is `image`; false if the name is too long.
bool state_place(State *state, const char *image);
bool state_exists(const State *state);
/// Reads next and block. Refuses another hash, another version and damage. Free the block with state_free.
int state_read(State *state);
void state_free(State *state);
/// Writes the file whole, flushed, in place of the old one.
int state_write(const State *state, int64_t next, const void *block, size_t size);
void state_remove(const State *state);
