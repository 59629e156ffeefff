// SPDX-License-Identifier: Apache-2.0
//
//   "RFSTATE1" | hash | next | size of block | hash of block | block
//
// Numbers are little-endian 64-bit words, as on every machine this is built for; the block is the method's and checks
// itself too.
#include "state.h"
#include "errors.h"
#include "inputs.h"
#include "text.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct Header
{
    char magic[8];
    uint64_t hash;
    int64_t next;
    uint64_t size, block_hash;
} Header;

static const char g_magic[8] = {'R', 'F', 'S', 'T', 'A', 'T', 'E', '1'};

bool state_place(State *state, const char *image)
{
    *state = (State){0};
    const char *base = text_base_name(image);
    int length = snprintf(state->path, sizeof state->path, "%.*s.%s.rfstate", (int)(base - image), image, base);
    return length > 0 && (size_t)length < sizeof state->path;
}

bool state_exists(const State *state)
{
    return state->path[0] && access(state->path, F_OK) == 0;
}

static int damaged(const State *state)
{
    return fail(CODE_BAD_INPUT, state->path, NULL, "the state is damaged; remove it and start again without --resume");
}

static int read_body(State *state, FILE *file)
{
    Header header;
    if (fread(&header, sizeof header, 1, file) != 1 || memcmp(header.magic, g_magic, sizeof g_magic) != 0)
        return damaged(state);
    if (header.hash != state->hash)
        return fail(CODE_BAD_INPUT, state->path, NULL,
                    "belongs to a run with other inputs or options; give the same ones, or start again without "
                    "--resume");
    if (header.next < 0 || fseek(file, 0, SEEK_END) != 0 || ftell(file) < 0 ||
        (uint64_t)ftell(file) - sizeof header != header.size || fseek(file, sizeof header, SEEK_SET) != 0)
        return damaged(state);
    state->block = malloc(header.size ? header.size : 1);
    if (!state->block)
        return fail(CODE_FAILED, state->path, NULL, "out of memory");
    if ((header.size && fread(state->block, header.size, 1, file) != 1) ||
        hash_add(0, state->block, header.size) != header.block_hash)
        return damaged(state);
    state->next = header.next;
    state->size = header.size;
    return CODE_DONE;
}

int state_read(State *state)
{
    FILE *file = fopen(state->path, "rbe");
    if (!file)
        return fail(CODE_BAD_INPUT, state->path, NULL, "cannot be opened: %s", strerror(errno));
    int code = read_body(state, file);
    fclose(file);
    if (code)
        state_free(state);
    return code;
}

void state_free(State *state)
{
    free(state->block);
    state->block = NULL;
    state->size = 0;
}

static void temporary_name(const State *state, char *name, size_t size)
{
    snprintf(name, size, "%s.new", state->path);
}

int state_write(const State *state, int64_t next, const void *block, size_t size)
{
    char temporary[sizeof state->path + 8];
    temporary_name(state, temporary, sizeof temporary);
    Header header = {.hash = state->hash, .next = next, .size = size, .block_hash = hash_add(0, block, size)};
    memcpy(header.magic, g_magic, sizeof g_magic);
    FILE *file = fopen(temporary, "wbe");
    if (!file)
        return fail(CODE_FAILED, state->path, NULL, "cannot be written: %s", strerror(errno));
    bool good = fwrite(&header, sizeof header, 1, file) == 1 && (size == 0 || fwrite(block, size, 1, file) == 1) &&
                fflush(file) == 0 && fsync(fileno(file)) == 0;
    int why = errno;
    good = fclose(file) == 0 && good;
    if (good && rename(temporary, state->path) == 0)
        return CODE_DONE;
    why = good ? errno : why;
    unlink(temporary);
    return fail(CODE_FAILED, state->path, NULL, "cannot be written: %s", strerror(why));
}

void state_remove(const State *state)
{
    if (!state->path[0])
        return;
    char temporary[sizeof state->path + 8];
    temporary_name(state, temporary, sizeof temporary);
    unlink(state->path);
    // Left by a run that was killed while it wrote.
    unlink(temporary);
}
