// SPDX-License-Identifier: Apache-2.0
#include "option_table.h"
#include "text.h"

#include <stdio.h>
#include <string.h>

enum
{
    NAME_COLUMN = 32,
    LINE_WIDTH = 118
};

/// Prints words from the name column on, breaking lines between them.
static void print_wrapped(const char *text)
{
    int column = NAME_COLUMN;
    for (bool first = true; *text; first = false)
    {
        int length = (int)strcspn(text, " ");
        if (!first && column + 1 + length > LINE_WIDTH)
        {
            printf("\n%*s", NAME_COLUMN, "");
            column = NAME_COLUMN;
        }
        else if (!first)
            column += printf(" ");
        column += printf("%.*s", length, text);
        text += length + strspn(text + length, " ");
    }
    fputc('\n', stdout);
}

static void print_entry(const char *name, const char *text)
{
    if ((int)strlen(name) >= NAME_COLUMN)
        printf("%s\n%*s", name, NAME_COLUMN, "");
    else
        printf("%-*s", NAME_COLUMN, name);
    print_wrapped(text);
}

static void print_generic(const GenericOption *option)
{
    char name[96], text[512], letter[8] = "";
    if (option->letter)
        snprintf(letter, sizeof letter, "-%c, ", option->letter);
    snprintf(name, sizeof name, "  %s--%s%s%s", letter, option->name, option->value ? " " : "",
             option->value ? option->value : "");
    snprintf(text, sizeof text, "%s%s%s%s", option->sentence, option->fallback[0] ? " [" : "", option->fallback,
             option->fallback[0] ? "]" : "");
    print_entry(name, text);
}

static void describe_range(const RfOption *option, char *text, size_t size)
{
    const char *unit = option->unit && option->unit[0] ? option->unit : "";
    if (option->kind == RF_OPTION_INTS)
    {
        snprintf(text, size, "[%s; 1 to %d numbers, %g to %g%s%s]", option->choices, RF_MAX_OPTION_INTS,
                 option->minimum, option->maximum, unit[0] ? " " : "", unit);
        return;
    }
    if (option->kind == RF_OPTION_FLOAT || option->kind == RF_OPTION_INT)
        snprintf(text, size, "[%g; %g to %g%s%s]", option->default_value, option->minimum, option->maximum,
                 unit[0] ? " " : "", unit);
    else if (option->kind == RF_OPTION_BOOL)
        snprintf(text, size, "[%s]", option->default_value != 0 ? "yes" : "no");
    else
        snprintf(text, size, "[%g]", option->default_value);
}

/// What stands for the value: " PX", " SECONDS", " N".
static const char *placeholder(const RfOption *option)
{
    if (option->kind == RF_OPTION_BOOL)
        return "[=yes|no]";
    if (option->kind == RF_OPTION_INTS)
        return " N,N,...";
    if (option->unit && strcmp(option->unit, "px") == 0)
        return " PX";
    if (option->unit && strcmp(option->unit, "s") == 0)
        return " SECONDS";
    return option->kind == RF_OPTION_FLOAT ? " X" : option->kind == RF_OPTION_CHOICE ? " " : " N";
}

static void print_method_option(const RfOption *option)
{
    char name[128], text[768], range[128] = "";
    bool choice = option->kind == RF_OPTION_CHOICE;
    snprintf(name, sizeof name, "    --%s%s%s", option->name, placeholder(option), choice ? option->choices : "");
    if (choice)
    {
        const char *at = option->choices;
        for (int i = 0; i < (int)option->default_value && strchr(at, '|'); ++i)
            at = strchr(at, '|') + 1;
        snprintf(range, sizeof range, "[%.*s]", (int)strcspn(at, "|"), at);
    }
    else
        describe_range(option, range, sizeof range);
    snprintf(text, sizeof text, "%s %s", option->sentence, range);
    print_entry(name, text);
}

/// Those of the table that the list of generic options, as far as the verb has them, has not told yet.
static void print_table(const RfOption *table, int count, unsigned verb)
{
    for (int i = 0; i < count; ++i)
    {
        const GenericOption *told = generic_option(table[i].name, 0);
        if (!told || !(told->verbs & verb))
            print_method_option(&table[i]);
    }
}

static void print_method(const Method *method)
{
    int count = 0;
    const RfOption *table = method->table(&count);
    printf("\n  --method %s: %s\n", method->name, method->sentence);
    if (method->presets)
    {
        char name[96];
        snprintf(name, sizeof name, "    --preset %s", method->presets);
        print_entry(name, "where the options below start from; paper: the constants of the publication");
    }
    print_table(table, count, VERB_TEXTURE);
}

void print_verb_help(const Verb *verb)
{
    int count = 0;
    const GenericOption *options = generic_option_table(&count);
    printf("riffle %s %s [options]\n%s\n", verb->name, verb->usage, verb->sentence);
    if (verb->notes)
        printf("\n%s", verb->notes);
    printf("\nOptions, with their defaults in brackets:\n");
    for (int i = 0; i < count; ++i)
        if (options[i].verbs & verb->bit)
            print_generic(&options[i]);
    if (verb->table)
    {
        const RfOption *table = verb->table(&count);
        printf("\n%s (default; range):\n", verb->heading);
        print_table(table, count, verb->bit);
    }
    if (verb->bit != VERB_TEXTURE)
        return;
    const Method *methods = method_table(&count);
    printf("\nMethods and their own options (default; range):\n");
    for (int i = 0; i < count; ++i)
        print_method(&methods[i]);
}

void print_help(const Verb *verbs, int count)
{
    printf("Riffle textures things that flow, by example.\n\n");
    for (int i = 0; i < count; ++i)
    {
        char name[128];
        snprintf(name, sizeof name, "riffle %s %s", verbs[i].name, verbs[i].usage);
        print_entry(name, verbs[i].sentence);
    }
    printf("riffle --version | --help | VERB --help\n");
    printf("\nInputs: a file, a numbered pattern (name.%%04d.ext, name.####.ext, name.$F4.ext), a directory,\n"
           "a container with time in it, or a built-in one:\n");
    int builtins = 0;
    const RfBuiltin *table = rf_builtin_table(&builtins);
    for (int i = 0; i < builtins; ++i)
    {
        char name[96], text[512];
        snprintf(name, sizeof name, "  builtin:%s", table[i].name);
        snprintf(text, sizeof text, "%s: %s%s%s", table[i].kind, table[i].sentence, table[i].parameters[0] ? " ?" : "",
                 table[i].parameters);
        print_entry(name, text);
    }
    printf(
        "\nOutputs: images (png, exr, npy; a number in the name for more than one: out.%%04d.png), video (mp4, webm,\n"
        "mov, gif), null: (computes and discards), md5: (a hash of each frame on stdout), - (PNM frames on stdout).\n"
        "\nExit codes: 0 done, 1 failed while running, 2 wrong usage, 3 bad input, 130 and 143 stopped by a signal.\n");
}
