// SPDX-License-Identifier: Apache-2.0
// riffle: the command. A new verb is one line in the table below and one file.
#include "errors.h"
#include "progress.h"
#include "setup.h"
#include "stop.h"
#include "verbs.h"

#include <stdlib.h>
#include <string.h>

static const Verb g_verbs[] = {
    {"texture", VERB_TEXTURE, "FLOW EXEMPLAR OUTPUT", 3, false, "texture a 2D flow",
     "Maps of the exemplar other than colour and alpha are written as OUTPUT.NAME.%04d.exr beside PNG frames, and all\n"
     "in one file where OUTPUT is EXR or NPY. A stopped run leaves .NAME.rfstate beside its first frame for "
     "--resume.\n"
     "A map named normal holds x right, y up and z out in 0 to 1 (0.5 is 0; green is up, as in OpenGL), motion or\n"
     "velocity two channels x right, y down: both are turned with the texture. alpha is opacity; all others are "
     "data.\n",
     NULL, NULL, run_texture},
    {"synth", VERB_SYNTH, "EXEMPLAR OUTPUT", 2, false, "a still texture of any size",
     "OUTPUT is one picture (png, exr, npy), null:, md5: or -. Maps of the exemplar other than colour and alpha are\n"
     "written as OUTPUT.NAME.exr beside PNG, and all in one file where OUTPUT is EXR or NPY. IMAGEs that say "
     "something\n"
     "of the result have its size.\n",
     synth_option_table, "How it is made", run_synth},
    {"render", VERB_RENDER, "INPUT OUTPUT", 2, false, "show a flow or a field of heights as images or video",
     "INPUT is a flow, or for --as relief images: heights from 0 to 1 (a channel named height, else the first), or\n"
     "colours with --map height=FRAMES. A steady flow fills one name without a number (out.png), or 100 frames.\n",
     NULL, NULL, run_render},
    {"measure", VERB_MEASURE, "FRAMES", 1, false,
     "judge any program's frames: do they follow the flow, are they the texture",
     "With --flow: the flow error and flicker; with --exemplar: spectrum, patches, contrast; always: holes. Each "
     "error\n"
     "stands beside its floor, the same measure where nothing is wrong. One still picture is judged by its exemplar.\n",
     rf_measure_option_table, "How it measures", run_measure},
    {"convert", VERB_CONVERT, "INPUT OUTPUT", 2, false, "between the formats of one kind of data",
     "Images become png, exr, npy or a video; 2D flows become flo, npy, exr or vti, a file a moment where the name "
     "has\n"
     "a number in it; out.npy takes all moments as [T, H, W, 2].\n",
     NULL, NULL, run_convert},
    {"info", VERB_INFO, "FILE...", 1, true, "what is in it: kind, size, channels, range, time, conventions",
     "Of an image also: whether it tiles, and which particle radius it has room for as an exemplar; whether it can be\n"
     "a flow.\n",
     NULL, NULL, run_info},
};

enum
{
    VERB_COUNT = sizeof g_verbs / sizeof g_verbs[0]
};

const Verb *verb_table(int *count)
{
    *count = VERB_COUNT;
    return g_verbs;
}

static int unknown_verb(const char *word)
{
    char names[256] = "";
    for (int i = 0; i < VERB_COUNT; ++i)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", i ? ", " : "", g_verbs[i].name);
    return fail(CODE_USAGE, NULL, NULL, "unknown verb %s; there are: %s", word, names);
}

static int run_verb(const Verb *verb, int count, char **words)
{
    // Some kilobytes of pointers, not on the stack.
    Settings *settings = calloc(1, sizeof *settings);
    if (!settings)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    int code = settings_parse(settings, verb, count, words);
    if (!code && settings->help)
        print_verb_help(verb);
    else if (!code)
    {
        rf_set_threads(settings->threads);
        setup_begin(settings);
        code = verb->run(settings);
        if (setup_end() && code >= CODE_SIGNAL)
            warn(settings, NULL, "stopped by signal %d before anything was made", code - CODE_SIGNAL);
    }
    free(settings);
    return code;
}

static int run(int count, char **words)
{
    if (count < 2)
        return fail(CODE_USAGE, NULL, NULL, "no verb; riffle --help lists them");
    if (strcmp(words[1], "--help") == 0 || strcmp(words[1], "-h") == 0)
    {
        print_help(g_verbs, VERB_COUNT);
        return CODE_DONE;
    }
    if (strcmp(words[1], "--version") == 0)
    {
        printf("riffle %s\n", rf_version());
        return CODE_DONE;
    }
    for (int i = 0; i < VERB_COUNT; ++i)
        if (strcmp(words[1], g_verbs[i].name) == 0)
            return run_verb(&g_verbs[i], count - 2, words + 2);
    return unknown_verb(words[1]);
}

int main(int count, char **words)
{
    stop_install();
    int code = run(count, words);
    if (code == CODE_DONE && (fflush(stdout) != 0 || ferror(stdout)))
        code = fail(CODE_FAILED, NULL, NULL, "stdout cannot be written");
    if (code > CODE_DONE && code < CODE_SIGNAL)
        print_fault(wants_json(count - 1, words + 1));
    return code;
}
