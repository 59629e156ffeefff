// SPDX-License-Identifier: Apache-2.0
#include "option_table.h"
#include "errors.h"
#include "text.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    MAX_MOMENT_EVERY = 1000000,
    MAX_THREADS = 256,
    /// Of one run.
    MAX_FRAMES = 10000000
};

static int set_output(Settings *settings, const char *value)
{
    if (settings->output_count == MAX_OUTPUTS - 1)
        return fail(CODE_USAGE, NULL, NULL, "-o %s: more than %d outputs", value, MAX_OUTPUTS);
    if (value[0] == '\0')
        return fail(CODE_USAGE, NULL, NULL, "-o: the name is empty");
    settings->outputs[settings->output_count++] = value;
    return CODE_DONE;
}

static int bad_frames(const char *value)
{
    return fail(CODE_USAGE, NULL, NULL,
                "--frames %s: must be A-B or A-BxS, A not after B, S at least 1: 1-100 or 10-90x2", value);
}

/// Digits only, so that signs and blanks are refused; moves `*text` behind them.
static bool take_number(const char **text, int *out)
{
    char digits[16];
    size_t length = strspn(*text, "0123456789");
    if (length == 0 || length >= sizeof digits)
        return false;
    memcpy(digits, *text, length);
    digits[length] = '\0';
    *text += length;
    return text_to_int(digits, out);
}

static int set_frames(Settings *settings, const char *value)
{
    const char *at = value;
    int first = 0, last = 0, step = 1;
    if (!take_number(&at, &first))
        return bad_frames(value);
    last = first;
    if (*at == '-')
    {
        ++at;
        if (!take_number(&at, &last))
            return bad_frames(value);
    }
    if (*at == 'x')
    {
        ++at;
        if (!take_number(&at, &step))
            return bad_frames(value);
    }
    if (*at || last < first || step < 1)
        return bad_frames(value);
    if (last - first >= MAX_FRAMES)
        return fail(CODE_USAGE, NULL, NULL, "--frames %s: at most %d frames in one run", value, MAX_FRAMES);
    settings->frames_given = true;
    settings->first_frame = first;
    settings->last_frame = last;
    settings->frame_step = step;
    return CODE_DONE;
}

static int set_size(Settings *settings, const char *value)
{
    const char *at = value;
    int width = 0, height = 0;
    bool good = take_number(&at, &width) && *at == 'x';
    at += good ? 1 : 0;
    if (!good || !take_number(&at, &height) || *at)
        return fail(CODE_USAGE, NULL, NULL, "--size %s: must be WxH, as 512x512", value);
    if (width < 1 || width > RF_MAX_SIZE)
        return fail(CODE_USAGE, NULL, NULL, "--size %s: width must be 1 to %d", value, RF_MAX_SIZE);
    if (height < 1 || height > RF_MAX_SIZE)
        return fail(CODE_USAGE, NULL, NULL, "--size %s: height must be 1 to %d", value, RF_MAX_SIZE);
    settings->width = width;
    settings->height = height;
    return CODE_DONE;
}

static int set_double(const char *name, const char *value, double low, double high, double *out)
{
    if (!text_to_double(value, out) || *out < low || *out > high)
        return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be %g to %g", name, value, low, high);
    return CODE_DONE;
}

static int set_int(const char *name, const char *value, int low, int high, int *out)
{
    if (!text_to_int(value, out) || *out < low || *out > high)
        return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be a whole number, %d to %d", name, value, low, high);
    return CODE_DONE;
}

static int set_choice(const char *name, const char *value, const char *choices, int *out)
{
    char list[256];
    *out = text_choice(choices, value);
    text_list(choices, list, sizeof list);
    return *out < 0 ? fail(CODE_USAGE, NULL, NULL, "--%s %s: must be %s", name, value, list) : CODE_DONE;
}

static int set_fps(Settings *settings, const char *value)
{
    return set_double("fps", value, 0.01, 10000, &settings->fps);
}

static int set_velocity_scale(Settings *settings, const char *value)
{
    return set_double("velocity-scale", value, -1e6, 1e6, &settings->velocity_scale);
}

static int set_seed(Settings *settings, const char *value)
{
    if (!text_to_uint64(value, &settings->seed))
        return fail(CODE_USAGE, NULL, NULL, "--seed %s: must be a whole number, 0 to 18446744073709551615", value);
    return CODE_DONE;
}

static int set_threads(Settings *settings, const char *value)
{
    return set_int("threads", value, 1, MAX_THREADS, &settings->threads);
}

static int set_moment_every(Settings *settings, const char *value)
{
    return set_int("moment-every", value, 1, MAX_MOMENT_EVERY, &settings->moment_every);
}

static int set_variables(Settings *settings, const char *value)
{
    const char *comma = strchr(value, ',');
    if (!comma || comma == value || comma[1] == '\0' || strchr(comma + 1, ','))
        return fail(CODE_USAGE, NULL, NULL, "--variables %s: must be two names, as u10,v10", value);
    settings->variables = value;
    return CODE_DONE;
}

/// The NAME of NAME=TEXT: letters, digits and _, at most 31.
static bool take_name(const char *value, char name[NAME_SIZE])
{
    size_t length = strspn(value, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_");
    if (length == 0 || length >= NAME_SIZE || value[length] != '=' || value[length + 1] == '\0')
        return false;
    memcpy(name, value, length);
    name[length] = '\0';
    return true;
}

static int set_map(Settings *settings, const char *value)
{
    MapArgument map;
    if (!take_name(value, map.name))
        return fail(CODE_USAGE, NULL, NULL, "--map %s: must be NAME=IMAGE, the name of letters, digits and _", value);
    if (strcmp(map.name, "colour") == 0)
        return fail(CODE_USAGE, NULL, NULL, "--map %s: the first image is the colour already", value);
    for (int i = 0; i < settings->map_count; ++i)
        if (strcmp(settings->maps[i].name, map.name) == 0)
            return fail(CODE_USAGE, NULL, NULL, "--map %s: a map %s was given before", value, map.name);
    if (settings->map_count == RF_MAX_MAPS - 1)
        return fail(CODE_USAGE, NULL, NULL, "--map %s: at most %d maps", value, RF_MAX_MAPS);
    map.file = value + strlen(map.name) + 1;
    settings->maps[settings->map_count++] = map;
    return CODE_DONE;
}

static int set_map_weight(Settings *settings, const char *value)
{
    WeightArgument weight;
    double number = 0;
    if (!take_name(value, weight.name) || !text_to_double(value + strlen(weight.name) + 1, &number) || number < 0 ||
        number > 1e6)
        return fail(CODE_USAGE, NULL, NULL, "--map-weight %s: must be NAME=W, W from 0 to 1e+06", value);
    if (settings->weight_count == RF_MAX_MAPS)
        return fail(CODE_USAGE, NULL, NULL, "--map-weight %s: at most %d weights", value, RF_MAX_MAPS);
    weight.weight = (float)number;
    settings->weights[settings->weight_count++] = weight;
    return CODE_DONE;
}

static int set_tiling(Settings *settings, const char *value)
{
    static const RfTiling tilings[] = {RF_TILING_AUTO, RF_TILING_NO, RF_TILING_YES};
    int choice = 0;
    int code = set_choice("exemplar-tiles", value, "auto|no|yes", &choice);
    if (!code)
        settings->tiling = tilings[choice];
    return code;
}

static int set_method(Settings *settings, const char *value)
{
    int count = 0;
    const Method *methods = method_table(&count), *found = method_find(value);
    if (found)
    {
        settings->method = found;
        return CODE_DONE;
    }
    char names[256] = "", list[256];
    for (int i = 0; i < count; ++i)
        snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", i ? "|" : "", methods[i].name);
    text_list(names, list, sizeof list);
    return fail(CODE_USAGE, NULL, NULL, "--method %s: must be %s", value, list);
}

static int set_preset(Settings *settings, const char *value)
{
    settings->preset = value;
    return CODE_DONE;
}

static int set_shader(Settings *settings, const char *value)
{
    static const RfShader shaders[] = {RF_SHADER_NONE, RF_SHADER_FIRE, RF_SHADER_CLOUDS};
    int choice = 0;
    int code = set_choice("shader", value, "none|fire|clouds", &choice);
    if (!code)
        settings->shader = shaders[choice];
    return code;
}

static int set_picture(Settings *settings, const char *value)
{
    int choice = 0;
    int code = set_choice("as", value, "wheel|arrows|lic|relief", &choice);
    if (!code)
        settings->picture = (Picture)choice;
    return code;
}

static int set_displace(Settings *settings, const char *value)
{
    return set_double("displace", value, 0, 10, &settings->displace);
}

static int set_full_speed(Settings *settings, const char *value)
{
    return set_double("full-speed", value, 0, 1e6, &settings->full_speed);
}

/// A file's name, looked at when it is opened.
#define FILE_SETTER(field)                                                                                             \
    static int set_##field(Settings *settings, const char *value)                                                      \
    {                                                                                                                  \
        settings->field = value;                                                                                       \
        return CODE_DONE;                                                                                              \
    }
FILE_SETTER(mask)
FILE_SETTER(flow)
FILE_SETTER(exemplar)
FILE_SETTER(fixed)
FILE_SETTER(target)
FILE_SETTER(guide)
FILE_SETTER(orientation_map)
FILE_SETTER(scale_map)

static int set_report(Settings *settings, const char *value)
{
    if (!text_extension_in(value, "json|html"))
        return fail(CODE_USAGE, NULL, NULL, "--report %s: a report is written as .json or .html", value);
    if (settings->report_count == MAX_REPORTS)
        return fail(CODE_USAGE, NULL, NULL, "--report %s: more than %d reports", value, MAX_REPORTS);
    settings->reports[settings->report_count++] = value;
    return CODE_DONE;
}

static int set_progress(Settings *settings, const char *value)
{
    int choice = 0;
    int code = set_choice("progress", value, "auto|bar|plain|json|none", &choice);
    if (!code)
        settings->progress = (ProgressKind)choice;
    return code;
}

static int set_json(Settings *settings, const char *value)
{
    (void)value;
    settings->progress = PROGRESS_JSON;
    return CODE_DONE;
}

#define FLAG_SETTER(field)                                                                                             \
    static int set_##field(Settings *settings, const char *value)                                                      \
    {                                                                                                                  \
        (void)value;                                                                                                   \
        settings->field = true;                                                                                        \
        return CODE_DONE;                                                                                              \
    }
FLAG_SETTER(uv)
FLAG_SETTER(resume)
FLAG_SETTER(replace)
FLAG_SETTER(quiet)
FLAG_SETTER(verbose)
FLAG_SETTER(help)

static const GenericOption g_options[] = {
    {"output", 'o', "OUTPUT", VERBS_WITH_OUTPUTS, "", "one more output of the same run", set_output},
    {"flow", 0, "FLOW", VERB_MEASURE, "",
     "what the frames should follow, built-in ones too; frame numbers are its moments' (first + n K of --moment-every)",
     set_flow},
    {"exemplar", 0, "IMAGE", VERB_MEASURE, "", "what the frames should look like", set_exemplar},
    {"report", 0, "FILE", VERB_MEASURE, "",
     "all numbers as .json, or a page with plots and pictures as .html; may be given several times", set_report},
    {"frames", 0, "A-B[xS]", VERBS_WITH_NUMBERS, "all; 100 of a steady or endless flow",
     "which frames, counted from the first file's number (a flow: moment n is frame first + n K of --moment-every); A "
     "starts afresh, xS writes every S-th",
     set_frames},
    {"size", 0, "WxH", VERB_TEXTURE | VERB_RENDER | VERB_SYNTH,
     "the input's cells; synth: as --fixed and the like, else twice the exemplar's",
     "output pixels, each side 1 to "
     "32768",
     set_size},
    {"fps", 0, "F", VERBS_WITH_FLOWS, "24", "frames a second, 0.01 to 10000", set_fps},
    {"velocity-scale", 0, "S", VERBS_WITH_FLOWS, "1", "multiplies every velocity", set_velocity_scale},
    {"moment-every", 0, "K", VERBS_WITH_FLOWS, "1", "frames from one moment of the flow to the next, 1 to 1000000",
     set_moment_every},
    {"variables", 0, "U,V", VERBS_WITH_FLOWS, "found by name", "names of the components in NetCDF, VTK, EXR",
     set_variables},
    {"mask", 0, "IMAGE", VERB_TEXTURE | VERB_MEASURE, "the flow's own",
     "white is fluid; stands in for the flow's own mask", set_mask},
    {"method", 0, "NAME", VERB_TEXTURE, "lagrangian", "how to texture; each is described below", set_method},
    {"preset", 0, "NAME", VERB_TEXTURE, "default", "where the method's options start from", set_preset},
    {"map", 0, "NAME=IMAGE", VERB_TEXTURE | VERB_RENDER | VERB_SYNTH, "",
     "a further registered map of the exemplar (height, normal, motion, alpha, ...); render: height=FRAMES; synth: one "
     "named guide belongs to --guide",
     set_map},
    {"map-weight", 0, "NAME=W", VERB_TEXTURE | VERB_SYNTH, "1", "of the map's differences when areas are compared",
     set_map_weight},
    {"exemplar-tiles", 0, "auto|no|yes", VERB_TEXTURE | VERB_SYNTH, "auto",
     "does the exemplar continue across opposite borders", set_tiling},
    {"fixed", 0, "IMAGE", VERB_SYNTH, "",
     "its opaque pixels stay, transparent ones (alpha under half) are made: fills holes", set_fixed},
    {"target", 0, "IMAGE[@W]", VERB_SYNTH, "@1",
     "what the result should look like from afar; W: a number, 1 counts as much as the exemplar, or an image of "
     "weights 0 to 1",
     set_target},
    {"guide", 0, "IMAGE", VERB_SYNTH, "",
     "what should be where, in the terms of the exemplar's map of that name (--map guide=IMAGE)", set_guide},
    {"orientation-map", 0, "IMAGE", VERB_SYNTH, "",
     "turns the exemplar clockwise: grey 0 to 1 is 0 to 360 degrees, EXR holds degrees", set_orientation_map},
    {"scale-map", 0, "IMAGE", VERB_SYNTH, "",
     "how large the exemplar appears: mid-grey as it is, black a quarter, white four times; EXR holds the factor, 1/16 "
     "to 16",
     set_scale_map},
    {"shader", 0, "none|fire|clouds", VERB_TEXTURE, "none", "turns blended noise into fire or clouds", set_shader},
    {"uv", 0, NULL, VERB_TEXTURE, "",
     "also write OUTPUT.uv.%04d.exr, float: u0 v0 weight0 id0 ... u3 v3 weight3 id3, the four strongest grids of each "
     "pixel, strongest first; u right, v down in exemplar pixels, weights of all grids add up to 1, none: 0 0 0 -1",
     set_uv},
    {"as", 0, "wheel|arrows|lic|relief", VERB_RENDER, "wheel",
     "a flow as colours, arrows or streaks; an image sequence of heights as a lit surface", set_picture},
    {"displace", 0, "S", VERB_RENDER, "0.05", "relief: height of 1, in widths of the field, 0 to 10", set_displace},
    {"full-speed", 0, "V", VERB_RENDER, "the greatest of the run's frames, looked for first",
     "cells a frame that get full saturation or the longest arrow, the same in all frames; faster ones are darkened",
     set_full_speed},
    {"seed", 0, "N", VERB_TEXTURE | VERB_RENDER | VERB_SYNTH, "1", "same seed and inputs: same bytes", set_seed},
    {"threads", 0, "N", VERBS_ALL, "all", "1 to 256; results do not depend on it", set_threads},
    {"resume", 0, NULL, VERBS_WITH_FRAMES, "", "continue a stopped run; a finished one stays as it is", set_resume},
    {"replace", 'y', NULL, VERBS_WITH_PROGRESS, "refuse", "replace outputs that are there", set_replace},
    {"progress", 0, "auto|bar|plain|json|none", VERBS_WITH_PROGRESS, "auto", "how progress is told on stderr",
     set_progress},
    {"quiet", 'q', NULL, VERBS_WITH_PROGRESS, "", "no progress, no warnings", set_quiet},
    {"verbose", 'v', NULL, VERBS_WITH_PROGRESS, "", "tell about inputs, and every frame with its stages", set_verbose},
    {"json", 0, NULL, VERBS_ALL, "", "one JSON object a line on stderr (info, and the numbers of measure: on stdout)",
     set_json},
    {"help", 'h', NULL, VERBS_ALL, "", "this text", set_help},
};

const GenericOption *generic_option_table(int *count)
{
    *count = sizeof g_options / sizeof g_options[0];
    return g_options;
}

const GenericOption *generic_option(const char *name, char letter)
{
    for (size_t i = 0; i < sizeof g_options / sizeof g_options[0]; ++i)
        if (name ? strcmp(g_options[i].name, name) == 0 : g_options[i].letter == letter)
            return &g_options[i];
    return NULL;
}
