// SPDX-License-Identifier: Apache-2.0
//
// Files are written as .tmpPID.NAME in the folder of NAME and renamed when they are whole. A killed program leaves its
// last one; the run that goes on where it stopped removes it.
#include "outputs.h"
#include "text.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/// NAME of .tmpPID.NAME, where no such process lives any more; else NULL.
static const char *orphan_name(const char *entry)
{
    if (!text_starts(entry, ".tmp") || !isdigit((unsigned char)entry[4]))
        return NULL;
    char *end = NULL;
    long process = strtol(entry + 4, &end, 10);
    bool alive = process <= 0 || kill((pid_t)process, 0) == 0 || errno != ESRCH;
    return *end == '.' && !alive ? end + 1 : NULL;
}

/// The output's own name, or that of any of its frames and maps.
static bool belongs(const char *name, const Output *output)
{
    const char *head = text_base_name(output->pattern.head), *tail = output->pattern.tail;
    if (!output->pattern.numbered)
        return strcmp(name, head) == 0;
    size_t length = strlen(name), stem = strlen(tail) - strlen(text_extension(tail));
    return text_starts(name, head) && length > strlen(head) + stem && stem > 0 &&
           (strcmp(name + length - strlen(tail), tail) == 0 || text_extension_in(name, "exr"));
}

static void sweep_folder(const char *folder, const Output *output)
{
    DIR *directory = opendir(folder);
    for (struct dirent *entry = NULL; directory && (entry = readdir(directory));)
    {
        const char *name = orphan_name(entry->d_name);
        char path[2 * PATH_SIZE];
        if (!name || !belongs(name, output))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, entry->d_name);
        unlink(path);
    }
    if (directory)
        closedir(directory);
}

void outputs_sweep(const Outputs *outputs)
{
    for (int i = 0; i < outputs->count; ++i)
    {
        const Output *output = &outputs->list[i];
        if (output->kind != OUTPUT_IMAGE && output->kind != OUTPUT_FLOW && output->kind != OUTPUT_ARRAY &&
            output->kind != OUTPUT_VIDEO)
            continue;
        char folder[PATH_SIZE];
        snprintf(folder, sizeof folder, "%.*s", (int)(text_base_name(output->text) - output->text), output->text);
        sweep_folder(folder[0] ? folder : ".", output);
    }
}
