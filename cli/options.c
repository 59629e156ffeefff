// SPDX-License-Identifier: Apache-2.0
#include "options.h"
#include "errors.h"
#include "option_table.h"
#include "text.h"

#include <stdio.h>
#include <string.h>

/// Where the parser stands.
typedef struct Parser
{
    Settings *settings;
    int count, at;
    char **words;
} Parser;

static int keep_method_option(Settings *settings, const RfOption *option, const char *text)
{
    if (settings->method_option_count == MAX_METHOD_OPTIONS)
        return fail(CODE_USAGE, NULL, NULL, "--%s: more than %d options of a method", option->name, MAX_METHOD_OPTIONS);
    settings->method_options[settings->method_option_count].option = option;
    settings->method_options[settings->method_option_count].text = text;
    ++settings->method_option_count;
    return CODE_DONE;
}

static const RfOption *verb_option(const Verb *verb, const char *name)
{
    int count = 0;
    const RfOption *table = verb->table ? verb->table(&count) : NULL;
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].name, name) == 0)
            return &table[i];
    return NULL;
}

/// Says which other verbs have it. name: NULL for a letter.
static int unknown_option(const Verb *verb, const char *word, const char *name)
{
    char names[128] = "";
    int count = 0;
    const Verb *verbs = verb_table(&count);
    const GenericOption *generic = name || !word[2] ? generic_option(name, word[1]) : NULL;
    const RfOption *option = NULL;
    unsigned elsewhere = generic ? generic->verbs : 0;
    if (name && method_with_option(name, &option))
        elsewhere |= VERB_TEXTURE;
    for (int i = 0; i < count; ++i)
        if (verbs[i].bit != verb->bit && ((verbs[i].bit & elsewhere) || (name && verb_option(&verbs[i], name))))
            snprintf(names + strlen(names), sizeof names - strlen(names), "%s%s", names[0] ? ", " : "", verbs[i].name);
    return fail(CODE_USAGE, NULL, NULL, "%s has no option %s%s%s%s; riffle %s --help lists them", verb->name, word,
                names[0] ? " (" : "", names, names[0] ? " has)" : "", verb->name);
}

/// The text after '=' or the next word.
static int take_value(Parser *parser, const char *word, const char *equals, const char *wanted, const char **value)
{
    if (equals)
        *value = equals + 1;
    else if (parser->at + 1 < parser->count)
        *value = parser->words[++parser->at];
    else
        return fail(CODE_USAGE, NULL, NULL, "%s needs a value: %s", word, wanted);
    return CODE_DONE;
}

static int refuse_value(const char *name, const char *equals)
{
    return equals ? fail(CODE_USAGE, NULL, NULL, "--%s takes no value", name) : CODE_DONE;
}

static int parse_method_option(Parser *parser, const char *word, const char *name, const char *equals)
{
    const Verb *verb = parser->settings->verb;
    const RfOption *option = verb_option(verb, name);
    if (!option && (verb->bit != VERB_TEXTURE || !method_with_option(name, &option)))
        return unknown_option(verb, word, name);
    const char *value = equals ? equals + 1 : "yes";
    if (option->kind != RF_OPTION_BOOL)
    {
        int code = take_value(parser, word, equals,
                              option->kind == RF_OPTION_INTS ? "numbers, as 17,9"
                              : option->choices              ? option->choices
                                                             : "a number",
                              &value);
        if (code)
            return code;
    }
    return keep_method_option(parser->settings, option, value);
}

static int parse_option(Parser *parser, const char *word, const GenericOption *option, const char *name,
                        const char *equals)
{
    if (!option || !(option->verbs & parser->settings->verb->bit))
        return name ? parse_method_option(parser, word, name, equals)
                    : unknown_option(parser->settings->verb, word, NULL);
    const char *value = NULL;
    int code = option->value ? take_value(parser, word, equals, option->value, &value) : refuse_value(name, equals);
    return code ? code : option->set(parser->settings, value);
}

static int parse_long(Parser *parser, const char *word)
{
    char name[64];
    const char *equals = strchr(word, '=');
    size_t length = equals ? (size_t)(equals - word) - 2 : strlen(word) - 2;
    if (length >= sizeof name)
        return unknown_option(parser->settings->verb, word, word + 2);
    memcpy(name, word + 2, length);
    name[length] = '\0';
    return parse_option(parser, word, generic_option(name, 0), name, equals);
}

static int parse_word(Parser *parser, const char *word)
{
    Settings *settings = parser->settings;
    if (settings->word_count == MAX_WORDS)
        return fail(CODE_USAGE, NULL, NULL, "more than %d inputs; give a pattern (name.%%04d.ext) instead", MAX_WORDS);
    settings->words[settings->word_count++] = word;
    return CODE_DONE;
}

static int parse_words(Parser *parser)
{
    bool only_words = false;
    for (; parser->at < parser->count; ++parser->at)
    {
        const char *word = parser->words[parser->at];
        int code = CODE_DONE;
        if (only_words || word[0] != '-' || word[1] == '\0')
            code = parse_word(parser, word);
        else if (strcmp(word, "--") == 0)
            only_words = true;
        else if (word[1] == '-')
            code = parse_long(parser, word);
        else
            code = parse_option(parser, word, word[2] ? NULL : generic_option(NULL, word[1]), NULL, NULL);
        if (code || parser->settings->help)
            return code;
    }
    return CODE_DONE;
}

static int check_words(const Settings *settings)
{
    const Verb *verb = settings->verb;
    int count = settings->word_count;
    for (int i = 0; i < count; ++i)
        if (settings->words[i][0] == '\0')
            return fail(CODE_USAGE, NULL, NULL, "%s %s: word %d is empty", verb->name, verb->usage, i + 1);
    if (count < verb->words)
        return fail(CODE_USAGE, NULL, NULL, "%s needs %s: %d of %d %s given; riffle %s --help tells more", verb->name,
                    verb->usage, count, verb->words, count == 1 ? "is" : "are", verb->name);
    if (count > verb->words && !verb->more)
        return fail(CODE_USAGE, NULL, NULL, "%s takes %s and no more, but \"%s\" is left; quote patterns%s", verb->name,
                    verb->usage, settings->words[verb->words],
                    text_choice("yes|no", settings->words[verb->words]) >= 0 ? ", and join yes and no as in --tile=no"
                                                                             : "");
    return CODE_DONE;
}

static int check_conflicts(const Settings *settings)
{
    if (settings->quiet && settings->verbose)
        return fail(CODE_USAGE, NULL, NULL, "-q and -v exclude each other");
    if (settings->uv && !settings->method->layers)
        return fail(CODE_USAGE, NULL, NULL, "--uv: --method %s has no layers; lagrangian has", settings->method->name);
    if (settings->uv && settings->shader != RF_SHADER_NONE)
        return fail(CODE_USAGE, NULL, NULL, "--uv and --shader exclude each other");
    if (settings->shader != RF_SHADER_NONE && settings->map_count > 0)
        return fail(CODE_USAGE, NULL, NULL, "--shader and --map exclude each other: a shader makes its own colour");
    if (settings->preset && !settings->method->presets)
        return fail(CODE_USAGE, NULL, NULL, "--preset %s: --method %s has no presets", settings->preset,
                    settings->method->name);
    return CODE_DONE;
}

int settings_parse(Settings *settings, const Verb *verb, int count, char **words)
{
    *settings = (Settings){.verb = verb,
                           .fps = 24,
                           .velocity_scale = 1,
                           .seed = 1,
                           .moment_every = 1,
                           .frame_step = 1,
                           .displace = 0.05,
                           .tiling = RF_TILING_AUTO};
    settings->method = method_find("lagrangian");
    Parser parser = {.settings = settings, .count = count, .words = words};
    int code = parse_words(&parser);
    if (code || settings->help)
        return code;
    code = check_words(settings);
    return code ? code : check_conflicts(settings);
}

static int bad_range(const RfOption *option, const char *text)
{
    return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be %s%.15g to %.15g%s%s", option->name, text,
                option->kind == RF_OPTION_FLOAT ? "" : "a whole number, ", option->minimum, option->maximum,
                option->unit[0] ? " " : "", option->unit);
}

static int set_choice(void *field, const RfOption *option, const char *text)
{
    char list[256];
    int choice = text_choice(option->choices, text);
    text_list(option->choices, list, sizeof list);
    if (choice < 0)
        return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be %s", option->name, text, list);
    memcpy(field, &choice, sizeof choice);
    return CODE_DONE;
}

static int set_bool(void *field, const RfOption *option, const char *text)
{
    int choice = text_choice("no|yes", text);
    if (choice < 0)
        return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be yes or no", option->name, text);
    bool value = choice == 1;
    memcpy(field, &value, sizeof value);
    return CODE_DONE;
}

static int set_uint64(void *field, const RfOption *option, const char *text)
{
    uint64_t value = 0;
    if (!text_to_uint64(text, &value))
        return bad_range(option, text);
    memcpy(field, &value, sizeof value);
    return CODE_DONE;
}

static int set_number(void *field, const RfOption *option, const char *text)
{
    double value = 0;
    int whole = 0;
    bool is_int = option->kind == RF_OPTION_INT;
    bool good = is_int ? text_to_int(text, &whole) : text_to_double(text, &value);
    if (is_int)
        value = whole;
    if (!good || value < option->minimum || value > option->maximum)
        return bad_range(option, text);
    float single = (float)value;
    memcpy(field, is_int ? (void *)&whole : (void *)&single, is_int ? sizeof whole : sizeof single);
    return CODE_DONE;
}

/// "17,9"
static int set_ints(void *field, const RfOption *option, const char *text)
{
    int values[RF_MAX_OPTION_INTS] = {0}, count = 0;
    for (const char *at = text;; ++at)
    {
        char number[16];
        size_t length = strcspn(at, ",");
        snprintf(number, sizeof number, "%.*s", (int)(length < sizeof number ? length : sizeof number - 1), at);
        if (count == RF_MAX_OPTION_INTS)
            return fail(CODE_USAGE, NULL, NULL, "--%s %s: at most %d numbers", option->name, text, RF_MAX_OPTION_INTS);
        if (!text_to_int(number, &values[count]) || values[count] < option->minimum || values[count] > option->maximum)
            return fail(CODE_USAGE, NULL, NULL, "--%s %s: must be whole numbers, %g to %g, as %s", option->name, text,
                        option->minimum, option->maximum, option->choices);
        ++count;
        at += length;
        if (*at == '\0')
            break;
    }
    memcpy(field, values, sizeof values);
    return CODE_DONE;
}

static int set_field(void *options, const RfOption *option, const char *text)
{
    void *field = (unsigned char *)options + option->offset;
    switch (option->kind)
    {
    case RF_OPTION_CHOICE:
        return set_choice(field, option, text);
    case RF_OPTION_BOOL:
        return set_bool(field, option, text);
    case RF_OPTION_UINT64:
        return set_uint64(field, option, text);
    case RF_OPTION_INTS:
        return set_ints(field, option, text);
    case RF_OPTION_FLOAT:
    case RF_OPTION_INT:
        break;
    }
    return set_number(field, option, text);
}

int settings_method_options(const Settings *settings, MethodOptions *options)
{
    const Method *method = settings->method;
    int preset = settings->preset ? text_choice(method->presets, settings->preset) : 0;
    char list[256];
    if (preset < 0)
    {
        text_list(method->presets, list, sizeof list);
        return fail(CODE_USAGE, NULL, NULL, "--preset %s: must be %s", settings->preset, list);
    }
    *options = (MethodOptions){0};
    method->defaults(preset, options);
    const RfOption *seed = method_option(method, "seed"), *fps = method_option(method, "fps");
    float frames_a_second = (float)settings->fps;
    if (seed)
        memcpy(options->bytes + seed->offset, &settings->seed, sizeof settings->seed);
    if (fps)
        memcpy(options->bytes + fps->offset, &frames_a_second, sizeof frames_a_second);
    for (int i = 0; i < settings->method_option_count; ++i)
    {
        const char *name = settings->method_options[i].option->name;
        const RfOption *option = method_option(method, name), *other = NULL;
        if (!option)
            return fail(CODE_USAGE, NULL, NULL, "--%s is an option of --method %s, not of %s", name,
                        method_with_option(name, &other)->name, method->name);
        int code = set_field(options, option, settings->method_options[i].text);
        if (code)
            return code;
    }
    return CODE_DONE;
}

int settings_verb_options(const Settings *settings, void *options)
{
    int code = CODE_DONE;
    for (int i = 0; i < settings->method_option_count && !code; ++i)
        code = set_field(options, settings->method_options[i].option, settings->method_options[i].text);
    return code;
}

bool settings_json(const Settings *settings)
{
    return settings->progress == PROGRESS_JSON;
}

bool wants_json(int count, char **words)
{
    for (int i = 0; i < count && strcmp(words[i], "--") != 0; ++i)
        if (strcmp(words[i], "--json") == 0 || strcmp(words[i], "--progress=json") == 0 ||
            (strcmp(words[i], "--progress") == 0 && i + 1 < count && strcmp(words[i + 1], "json") == 0))
            return true;
    return false;
}
