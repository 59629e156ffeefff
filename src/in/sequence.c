// SPDX-License-Identifier: Apache-2.0
// Numbered files: a pattern, a directory or a single file.
//
//   wind.%04d.flo   four digits, or more without leading zeros, as printf writes them; %d without any padding
//   wind.####.flo   the same as %04d
//   wind.$F4.flo    the same; $F as %d
//   wind/           every file of the wanted extensions, by the last number in its name
//
// A file that exists under the very name wins over its reading as a pattern.
#include "riffle/io.h"

#include "core/memory.h"
#include "core/result.h"

#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

enum
{
    MAX_FILES = 10000000,
    // Numbers of more digits do not fit 64 bits.
    MAX_DIGITS = 18
};

typedef struct SequenceFile
{
    char *path;
    // The number in the name, -1 without one.
    int64_t key;
    int number;
} SequenceFile;

struct RfSequence
{
    SequenceFile *files;
    size_t count, capacity;
};

// Of a pattern's last part: what stands before the number and after it, and how many digits it has at least.
typedef struct Pattern
{
    char prefix[512], suffix[512];
    int digits;
} Pattern;

// ---- names ---------------------------------------------------------------------------------------------------------

static const char *base_of(const char *path)
{
    const char *slash = strrchr(path, '/');
    return slash ? slash + 1 : path;
}

// The last run of digits before the extension; -1 without one, and for more digits than a number can have.
static int64_t number_in(const char *name)
{
    const char *dot = strrchr(name, '.');
    const char *end = dot && dot != name ? dot : name + strlen(name);
    while (end > name && !isdigit((unsigned char)end[-1]))
        --end;
    const char *begin = end;
    while (begin > name && isdigit((unsigned char)begin[-1]))
        --begin;
    if (begin == end || end - begin > MAX_DIGITS)
        return -1;
    return strtoll(begin, NULL, 10);
}

// Names as people order them: runs of digits by value, the rest by character.
static int compare_natural(const char *a, const char *b)
{
    while (*a && *b)
    {
        if (isdigit((unsigned char)*a) && isdigit((unsigned char)*b))
        {
            a += strspn(a, "0");
            b += strspn(b, "0");
            size_t na = strspn(a, "0123456789"), nb = strspn(b, "0123456789");
            int order = na != nb ? (na < nb ? -1 : 1) : strncmp(a, b, na);
            if (order != 0)
                return order;
            a += na;
            b += nb;
        }
        else if (*a != *b)
            return (unsigned char)*a < (unsigned char)*b ? -1 : 1;
        else
        {
            ++a;
            ++b;
        }
    }
    return (*a != '\0') - (*b != '\0');
}

static int compare_files(const void *left, const void *right)
{
    const SequenceFile *a = left, *b = right;
    if (a->key != b->key)
        return a->key < b->key ? -1 : 1;
    int order = compare_natural(base_of(a->path), base_of(b->path));
    return order != 0 ? order : strcmp(a->path, b->path);
}

// ---- patterns ------------------------------------------------------------------------------------------------------

// Length of the number mark that begins at `text`, 0 if none does.
static size_t mark_at(const char *text, int *digits)
{
    *digits = 1;
    if (*text == '#')
    {
        size_t length = strspn(text, "#");
        *digits = length <= MAX_DIGITS ? (int)length : MAX_DIGITS;
        return length;
    }
    bool houdini = text[0] == '$' && text[1] == 'F';
    if (!houdini && *text != '%')
        return 0;
    const char *p = text + (houdini ? 2 : 1);
    int width = 0;
    for (; isdigit((unsigned char)*p); ++p)
        width = width < 100 ? width * 10 + (*p - '0') : width;
    if (!houdini && *p++ != 'd')
        return 0;
    *digits = width < 1 ? 1 : width <= MAX_DIGITS ? width : MAX_DIGITS;
    return (size_t)(p - text);
}

// Number of marks in the name; the pattern is that of the last.
static int parse_pattern(const char *name, Pattern *pattern)
{
    int marks = 0;
    *pattern = (Pattern){0};
    for (const char *p = name; *p;)
    {
        int digits;
        size_t length = mark_at(p, &digits);
        if (length > 0)
        {
            ++marks;
            pattern->digits = digits;
            snprintf(pattern->prefix, sizeof pattern->prefix, "%.*s", (int)(p - name), name);
            snprintf(pattern->suffix, sizeof pattern->suffix, "%s", p + length);
        }
        p += length > 0 ? length : 1;
    }
    return marks;
}

// The number that `name` has where the pattern has its mark, -1 if it does not fit; `digits` gets how many it has,
// whether they are as many as the pattern wants or not.
static int64_t match(const Pattern *pattern, const char *name, int *digits)
{
    size_t before = strlen(pattern->prefix), after = strlen(pattern->suffix), length = strlen(name);
    *digits = 0;
    if (length <= before + after || strncmp(name, pattern->prefix, before) != 0 ||
        strcmp(name + length - after, pattern->suffix) != 0)
        return -1;
    const char *number = name + before;
    size_t count = length - before - after;
    if (strspn(number, "0123456789") < count || count > MAX_DIGITS)
        return -1;
    *digits = (int)count;
    bool fits = *digits == pattern->digits || (*digits > pattern->digits && number[0] != '0');
    return fits ? strtoll(number, NULL, 10) : -1;
}

// ---- gathering -----------------------------------------------------------------------------------------------------

static RfResult add_file(RfSequence *sequence, const char *folder, const char *name, int64_t key)
{
    if (sequence->count == MAX_FILES)
        return rf_fail(RF_BAD_INPUT, folder, NULL, "holds more than %d files", MAX_FILES);
    if (sequence->count == sequence->capacity)
    {
        size_t capacity = sequence->capacity ? 2 * sequence->capacity : 64;
        SequenceFile *grown = rf_reallocate(sequence->files, sequence->count, capacity, sizeof *grown);
        if (!grown)
            return RF_OUT_OF_MEMORY;
        sequence->files = grown;
        sequence->capacity = capacity;
    }
    size_t size = strlen(folder) + strlen(name) + 1;
    char *path = rf_allocate(size, 1);
    if (!path)
        return RF_OUT_OF_MEMORY;
    snprintf(path, size, "%s%s", folder, name);
    sequence->files[sequence->count++] = (SequenceFile){path, key, 0};
    return RF_OK;
}

// What gathering goes by: the pattern, or where there is none the extensions (NULL: all files).
typedef struct Gathering
{
    RfSequence *sequence;
    // With its slash; empty for the current one.
    const char *folder;
    const Pattern *pattern;
    const char *extensions;
    // The widths of numbers seen that the pattern does not fit, for the message.
    int other_digits;
    int refused;
} Gathering;

static bool has_extension(const char *name, const char *extensions)
{
    if (!extensions)
        return true;
    size_t length = strlen(name);
    for (const char *e = extensions; *e; e += strcspn(e, ","), e += *e == ',')
    {
        size_t n = strcspn(e, ",");
        if (n > 0 && length > n + 1 && name[length - n - 1] == '.' && strncasecmp(name + length - n, e, n) == 0)
            return true;
    }
    return false;
}

static bool is_file(DIR *directory, const char *name)
{
    struct stat status;
    return fstatat(dirfd(directory), name, &status, 0) == 0 && S_ISREG(status.st_mode);
}

static RfResult consider(Gathering *gathering, DIR *directory, const char *name)
{
    int64_t key;
    if (gathering->pattern)
    {
        int digits;
        key = match(gathering->pattern, name, &digits);
        if (key < 0)
        {
            gathering->other_digits = digits > 0 ? digits : gathering->other_digits;
            return RF_OK;
        }
    }
    else
    {
        if (name[0] == '.')
            return RF_OK;
        if (!has_extension(name, gathering->extensions))
        {
            ++gathering->refused;
            return RF_OK;
        }
        key = number_in(name);
    }
    return is_file(directory, name) ? add_file(gathering->sequence, gathering->folder, name, key) : RF_OK;
}

static RfResult gather(Gathering *gathering, const char *path)
{
    DIR *directory = opendir(gathering->folder[0] ? gathering->folder : ".");
    if (!directory)
        return rf_fail(RF_UNREADABLE, path, NULL, "the folder cannot be opened: %s", strerror(errno));
    RfResult result = RF_OK;
    for (struct dirent *entry; result == RF_OK && (entry = readdir(directory)) != NULL;)
        result = consider(gathering, directory, entry->d_name);
    closedir(directory);
    return result;
}

// ---- the three kinds -----------------------------------------------------------------------------------------------

// Numbers the files: by their names where all have a number that fits, else by their order.
static RfResult finish(RfSequence *sequence, const char *path)
{
    qsort(sequence->files, sequence->count, sizeof *sequence->files, compare_files);
    bool named = true;
    for (size_t i = 0; i < sequence->count; ++i)
    {
        const SequenceFile *file = &sequence->files[i];
        named = named && file->key >= 0 && file->key <= INT_MAX;
        if (i > 0 && file->key >= 0 && file->key == file[-1].key)
            return rf_fail(RF_BAD_INPUT, path, NULL,
                           "holds two files of number %lld: %s and %s; name one sequence by a pattern (name.%%04d.ext)",
                           (long long)file->key, base_of(file[-1].path), base_of(file->path));
    }
    for (size_t i = 0; i < sequence->count; ++i)
        sequence->files[i].number = named ? (int)sequence->files[i].key : (int)i + 1;
    return RF_OK;
}

static RfResult open_directory(RfSequence *sequence, const char *path, const char *extensions)
{
    size_t length = strlen(path);
    char folder[PATH_MAX];
    if (length + 2 > sizeof folder)
        return rf_fail(RF_UNREADABLE, path, NULL, "the name is too long");
    snprintf(folder, sizeof folder, "%s%s", path, path[length - 1] == '/' ? "" : "/");
    Gathering gathering = {.sequence = sequence, .folder = folder, .extensions = extensions};
    RF_TRY(gather(&gathering, path));
    if (sequence->count == 0 && gathering.refused > 0)
        return rf_fail(RF_UNREADABLE, path, NULL, "holds no file of kind %s, but %d others", extensions,
                       gathering.refused);
    if (sequence->count == 0)
        return rf_fail(RF_UNREADABLE, path, NULL, "the folder is empty");
    return finish(sequence, path);
}

static RfResult open_pattern(RfSequence *sequence, const char *path, const Pattern *pattern)
{
    char folder[PATH_MAX];
    const char *base = base_of(path);
    snprintf(folder, sizeof folder, "%.*s", (int)(base - path), path);
    Gathering gathering = {.sequence = sequence, .folder = folder, .pattern = pattern};
    RF_TRY(gather(&gathering, path));
    if (sequence->count > 0)
        return finish(sequence, path);
    if (gathering.other_digits > 0)
        return rf_fail(RF_UNREADABLE, path, NULL,
                       "no file of this name; there are numbers of %d digits: write %s%%0%dd%s", gathering.other_digits,
                       pattern->prefix, gathering.other_digits, pattern->suffix);
    return rf_fail(RF_UNREADABLE, path, NULL, "no file of this name: looked for %s, %d or more digits, %s in %s",
                   pattern->prefix, pattern->digits, pattern->suffix, folder[0] ? folder : "the current folder");
}

static RfResult open_any(RfSequence *sequence, const char *path, const char *extensions)
{
    struct stat status;
    bool there = stat(path, &status) == 0;
    if (there && S_ISDIR(status.st_mode))
        return open_directory(sequence, path, extensions);
    Pattern pattern;
    int marks = there ? 0 : parse_pattern(base_of(path), &pattern);
    if (marks > 1)
        return rf_fail(RF_UNREADABLE, path, NULL, "has %d places for a number: one is understood", marks);
    if (strlen(path) >= PATH_MAX || strlen(base_of(path)) >= sizeof pattern.prefix)
        return rf_fail(RF_UNREADABLE, path, NULL, "the name is too long");
    if (marks == 1)
        return open_pattern(sequence, path, &pattern);
    if (!there)
        return rf_fail(RF_UNREADABLE, path, NULL, "cannot be opened: %s", strerror(errno));
    RF_TRY(add_file(sequence, "", path, number_in(base_of(path))));
    return finish(sequence, path);
}

RfResult rf_sequence_open(const char *path, const char *extensions, RfSequence **out)
{
    RF_REQUIRE(path && path[0] && out, "rf_sequence_open: no path");
    *out = NULL;
    RfSequence *sequence = rf_allocate_zero(1, sizeof *sequence);
    if (!sequence)
        return RF_OUT_OF_MEMORY;
    RfResult result = open_any(sequence, path, extensions);
    if (result != RF_OK)
    {
        rf_sequence_destroy(sequence);
        return result;
    }
    *out = sequence;
    return RF_OK;
}

void rf_sequence_destroy(RfSequence *sequence)
{
    if (!sequence)
        return;
    for (size_t i = 0; i < sequence->count; ++i)
        rf_release(sequence->files[i].path);
    rf_release(sequence->files);
    rf_release(sequence);
}

int rf_sequence_count(const RfSequence *sequence)
{
    return (int)sequence->count;
}

const char *rf_sequence_path(const RfSequence *sequence, int index)
{
    assert(index >= 0 && (size_t)index < sequence->count);
    return sequence->files[index].path;
}

int rf_sequence_number(const RfSequence *sequence, int index)
{
    assert(index >= 0 && (size_t)index < sequence->count);
    return sequence->files[index].number;
}
