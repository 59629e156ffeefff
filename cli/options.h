// SPDX-License-Identifier: Apache-2.0
// One parser for every verb, driven by two tables: the options all verbs share, and each method's own. Help is printed
// from the same tables.
#pragma once

#include "methods.h"

enum
{
    MAX_OUTPUTS = 16,
    MAX_REPORTS = 4,
    MAX_METHOD_OPTIONS = 64,
    MAX_WORDS = 4096,
    NAME_SIZE = 32
};

/// A verb, as a bit, so that an option can say which verbs have it.
enum
{
    VERB_TEXTURE = 1,
    VERB_RENDER = 2,
    VERB_CONVERT = 4,
    VERB_INFO = 8,
    VERB_MEASURE = 16,
    VERB_SYNTH = 32,
    VERBS_WITH_FRAMES = VERB_TEXTURE | VERB_RENDER | VERB_CONVERT,
    VERBS_WITH_OUTPUTS = VERBS_WITH_FRAMES | VERB_SYNTH,
    VERBS_WITH_NUMBERS = VERBS_WITH_FRAMES | VERB_MEASURE,
    VERBS_WITH_FLOWS = VERBS_WITH_NUMBERS | VERB_INFO,
    VERBS_WITH_PROGRESS = VERBS_WITH_NUMBERS | VERB_SYNTH,
    VERBS_ALL = VERBS_WITH_FLOWS | VERB_SYNTH
};

typedef enum ProgressKind
{
    PROGRESS_AUTO,
    PROGRESS_BAR,
    PROGRESS_PLAIN,
    PROGRESS_JSON,
    PROGRESS_NONE
} ProgressKind;

/// Pictures of a flow, then what is no flow.
typedef enum Picture
{
    PICTURE_WHEEL,
    PICTURE_ARROWS,
    PICTURE_LIC,
    PICTURE_RELIEF
} Picture;

/// --map NAME=FILE
typedef struct MapArgument
{
    char name[NAME_SIZE];
    const char *file;
} MapArgument;

/// --map-weight NAME=W
typedef struct WeightArgument
{
    char name[NAME_SIZE];
    float weight;
} WeightArgument;

struct Settings;

typedef struct Verb
{
    const char *name;
    unsigned bit;
    /// "FLOW EXEMPLAR OUTPUT"; `words` of them, or at least that many where `more` is set.
    const char *usage;
    int words;
    bool more;
    const char *sentence;
    /// Further lines of its help; may be NULL.
    const char *notes;
    /// Options of its own; NULL where it has none (the methods of `texture` have theirs).
    const RfOption *(*table)(int *count);
    /// Over them in the help: "How it measures".
    const char *heading;
    int (*run)(struct Settings *settings);
} Verb;

/// The command line, checked but for what depends on the inputs. Texts point into argv.
typedef struct Settings
{
    const Verb *verb;
    bool help;
    const char *words[MAX_WORDS];
    int word_count;
    /// From -o.
    const char *outputs[MAX_OUTPUTS];
    int output_count;

    bool frames_given;
    int first_frame, last_frame, frame_step;
    /// 0: not given.
    int width, height;
    double fps, velocity_scale;
    const char *mask, *variables;
    uint64_t seed;
    int threads, moment_every;
    bool resume, replace, uv;
    ProgressKind progress;
    bool quiet, verbose;

    MapArgument maps[RF_MAX_MAPS];
    int map_count;
    WeightArgument weights[RF_MAX_MAPS];
    int weight_count;
    RfTiling tiling;

    const Method *method;
    const char *preset;
    RfShader shader;
    /// --NAME VALUE of the method's own table, applied by settings_method_options.
    struct
    {
        const RfOption *option;
        const char *text;
    } method_options[MAX_METHOD_OPTIONS];
    int method_option_count;

    Picture picture;
    double displace, full_speed;

    /// Of `measure`; NULL: not given.
    const char *flow, *exemplar;
    const char *reports[MAX_REPORTS];
    int report_count;

    /// Of `synth`; NULL: not given. target: "IMAGE" or "IMAGE@WEIGHT".
    const char *fixed, *target, *guide, *orientation_map, *scale_map;
} Settings;

/// All verbs there are.
const Verb *verb_table(int *count);

/// Fills the settings from the words after the verb.
int settings_parse(Settings *settings, const Verb *verb, int count, char **words);
/// The method's options: its preset, then --seed and --fps, then its own.
int settings_method_options(const Settings *settings, MethodOptions *options);
/// The same for the verb's own table, over the defaults that stand in `options`.
int settings_verb_options(const Settings *settings, void *options);
bool settings_json(const Settings *settings);
/// What to look for before anything is parsed, so that a wrong command line is told in the right form too.
bool wants_json(int count, char **words);

void print_verb_help(const Verb *verb);
void print_help(const Verb *verbs, int count);
