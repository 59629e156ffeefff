// SPDX-License-Identifier: Apache-2.0
// Prints a table of the library as Markdown, as it stands in docs/:
//
//     options lagrangian|eulerian|dual|sprites|warp|optimize|directional|measure|quantities|flow|exemplar
//
// Options of a method or of the measures, the quantities these give, or the built-in flows or exemplars. A test holds
// the docs to it (cmake/doc_tables.sh).
#include <riffle/riffle.h>

#include <stdio.h>
#include <string.h>

/// The name of a choice's value.
static void print_choice(const RfOption *option, int value)
{
    const char *name = option->choices;
    for (int i = 0; i < value; ++i)
        name += strcspn(name, "|") + (name[strcspn(name, "|")] == '|');
    printf("%.*s", (int)strcspn(name, "|"), name);
}

/// A | would end the column.
static void print_choices(const char *choices)
{
    for (const char *at = choices; *at; ++at)
        if (*at == '|')
            printf(", ");
        else
            putchar(*at);
}

static void print_range(const RfOption *option)
{
    if (option->kind == RF_OPTION_CHOICE)
        print_choices(option->choices);
    else if (option->kind == RF_OPTION_BOOL)
        printf("yes, no");
    else if (option->kind == RF_OPTION_UINT64)
        printf("any whole number");
    else if (option->kind == RF_OPTION_INTS)
        printf("up to %d numbers, %g to %g%s%s", RF_MAX_OPTION_INTS, option->minimum, option->maximum,
               option->unit[0] ? " " : "", option->unit);
    else
        printf("%g to %g%s%s", option->minimum, option->maximum, option->unit[0] ? " " : "", option->unit);
}

static void print_options(const RfOption *table, int count)
{
    printf("| option | range | default | what it does |\n| --- | --- | --- | --- |\n");
    for (int i = 0; i < count; ++i)
    {
        const RfOption *option = &table[i];
        printf("| `--%s` | ", option->name);
        print_range(option);
        printf(" | ");
        if (option->kind == RF_OPTION_CHOICE)
            print_choice(option, (int)option->default_value);
        else if (option->kind == RF_OPTION_BOOL)
            printf("%s", option->default_value != 0 ? "yes" : "no");
        else if (option->kind == RF_OPTION_INTS)
            printf("%s", option->choices);
        else
            printf("%g", option->default_value);
        printf(" | %s |\n", option->sentence);
    }
}

/// 0, or 1 if there are none.
static int print_builtins(const char *kind)
{
    int count = 0, found = 0;
    const RfBuiltin *table = rf_builtin_table(&count);
    printf("| name | what | parameters and their defaults |\n| --- | --- | --- |\n");
    for (int i = 0; i < count; ++i)
        if (strcmp(table[i].kind, kind) == 0)
        {
            printf("| `builtin:%s` | %s | %s%s%s |\n", table[i].name, table[i].sentence,
                   table[i].parameters[0] ? "`" : "", table[i].parameters, table[i].parameters[0] ? "`" : "");
            ++found;
        }
    return found ? 0 : 1;
}

static const char *sense_name(RfMeasureSense sense)
{
    static const char *const names[] = {"", "low", "high", "1", "0"};
    return names[sense];
}

static void print_quantities(void)
{
    int count = 0;
    const RfMeasureQuantity *table = rf_measure_quantity_table(&count);
    printf("| quantity | unit | good | floor | what it is |\n| --- | --- | --- | --- | --- |\n");
    for (int i = 0; i < count; ++i)
        printf("| `%s` | %s | %s | %s%s%s | %s |\n", table[i].name, table[i].unit, sense_name(table[i].sense),
               table[i].floor ? "`" : "", table[i].floor ? table[i].floor : "", table[i].floor ? "`" : "",
               table[i].sentence);
}

int main(int argc, char **argv)
{
    const char *what = argc == 2 ? argv[1] : "";
    int count = 0;
    const RfOption *table = NULL;
    if (strcmp(what, "lagrangian") == 0)
        table = rf_lagrangian_option_table(&count);
    else if (strcmp(what, "eulerian") == 0)
        table = rf_eulerian_option_table(&count);
    else if (strcmp(what, "dual") == 0)
        table = rf_dual_option_table(&count);
    else if (strcmp(what, "sprites") == 0)
        table = rf_sprites_option_table(&count);
    else if (strcmp(what, "warp") == 0)
        table = rf_warp_option_table(&count);
    else if (strcmp(what, "optimize") == 0)
        table = rf_optimize_option_table(&count);
    else if (strcmp(what, "directional") == 0)
        table = rf_directional_option_table(&count);
    else if (strcmp(what, "measure") == 0)
        table = rf_measure_option_table(&count);
    else if (strcmp(what, "flow") == 0 || strcmp(what, "exemplar") == 0)
        return print_builtins(what);
    else if (strcmp(what, "quantities") == 0)
    {
        print_quantities();
        return 0;
    }
    if (!table)
    {
        fprintf(stderr,
                "usage: options lagrangian|eulerian|dual|sprites|warp|optimize|directional|measure|quantities|flow|"
                "exemplar\n");
        return 2;
    }
    print_options(table, count);
    return 0;
}
