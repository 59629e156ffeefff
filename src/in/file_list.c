// SPDX-License-Identifier: Apache-2.0
#include "in/file_list.h"
#include "in/file.h"
#include "in/json.h"

#include "core/memory.h"
#include "core/result.h"

#include <expat.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

enum
{
    MOST_FILES = 1000000,
    LARGEST_LIST = 1 << 28
};

typedef struct Collecting
{
    const char *path;
    XML_Parser parser;
    RfFileList *list;
    int capacity;
    RfResult result;
} Collecting;

static bool ends_in(const char *path, const char *extension)
{
    size_t length = strlen(path), end = strlen(extension);
    return length > end && strcasecmp(path + length - end, extension) == 0;
}

bool rf_file_list_is(const char *path)
{
    return ends_in(path, ".pvd") || ends_in(path, ".series");
}

static char *beside(const char *list, const char *name, size_t length)
{
    const char *slash = strrchr(list, '/');
    size_t folder = slash && name[0] != '/' ? (size_t)(slash - list) + 1 : 0;
    char *path = rf_allocate(folder + length + 1, 1);
    if (!path)
        return NULL;
    memcpy(path, list, folder);
    memcpy(path + folder, name, length);
    path[folder + length] = '\0';
    return path;
}

static RfResult add_name(void *user, const char *name, size_t length)
{
    Collecting *collecting = user;
    RfFileList *list = collecting->list;
    if (length == 0 || memchr(name, '\0', length))
        return rf_fail(RF_BAD_INPUT, collecting->path, NULL, "a file's name is empty");
    if (list->count == MOST_FILES)
        return rf_fail(RF_BAD_INPUT, collecting->path, NULL, "names more than %d files", MOST_FILES);
    if (list->count == collecting->capacity)
    {
        int capacity = collecting->capacity ? 2 * collecting->capacity : 64;
        char **paths = rf_reallocate(list->paths, (size_t)list->count, (size_t)capacity, sizeof *paths);
        if (!paths)
            return RF_OUT_OF_MEMORY;
        list->paths = paths;
        collecting->capacity = capacity;
    }
    char *path = beside(collecting->path, name, length);
    if (!path)
        return RF_OUT_OF_MEMORY;
    list->paths[list->count++] = path;
    return RF_OK;
}

// ---- .pvd --------------------------------------------------------------------------------------------------------

static void stop(Collecting *collecting, RfResult result)
{
    collecting->result = result;
    XML_StopParser(collecting->parser, XML_FALSE);
}

static void XMLCALL element_begins(void *user, const char *name, const char **attributes)
{
    Collecting *collecting = user;
    if (collecting->result != RF_OK || strcmp(name, "DataSet") != 0)
        return;
    for (; attributes[0]; attributes += 2)
        if (strcmp(attributes[0], "file") == 0)
        {
            RfResult result = add_name(collecting, attributes[1], strlen(attributes[1]));
            if (result != RF_OK)
                stop(collecting, result);
        }
}

static void XMLCALL doctype_begins(void *user, const char *name, const char *system, const char *public, int internal)
{
    Collecting *collecting = user;
    (void)name;
    (void)system;
    (void)public;
    (void)internal;
    stop(collecting, rf_fail(RF_UNSUPPORTED, collecting->path, NULL,
                             "declares a document type, which VTK files do not need: remove it"));
}

static RfResult parse_collection(Collecting *collecting, const uint8_t *bytes, size_t size)
{
    collecting->parser = XML_ParserCreate(NULL);
    if (!collecting->parser)
        return rf_fail(RF_OUT_OF_MEMORY, collecting->path, NULL, "no memory for the XML parser");
    XML_SetUserData(collecting->parser, collecting);
    XML_SetStartElementHandler(collecting->parser, element_begins);
    XML_SetStartDoctypeDeclHandler(collecting->parser, doctype_begins);
    enum XML_Status status = XML_Parse(collecting->parser, (const char *)bytes, (int)size, XML_TRUE);
    if (status != XML_STATUS_OK && collecting->result == RF_OK)
    {
        char place[32];
        snprintf(place, sizeof place, "line %lu", (unsigned long)XML_GetCurrentLineNumber(collecting->parser));
        collecting->result = rf_fail(RF_BAD_INPUT, collecting->path, place, "not XML: %s",
                                     XML_ErrorString(XML_GetErrorCode(collecting->parser)));
    }
    XML_ParserFree(collecting->parser);
    return collecting->result;
}

// ---- either ------------------------------------------------------------------------------------------------------

RfResult rf_file_list_parse(const char *path, const uint8_t *bytes, size_t size, RfFileList *out)
{
    *out = (RfFileList){0};
    Collecting collecting = {.path = path, .list = out};
    if (size > LARGEST_LIST)
        return rf_fail(RF_BAD_INPUT, path, NULL, "has more than %d bytes: no list is that long", LARGEST_LIST);
    RfResult result = ends_in(path, ".pvd")
                          ? parse_collection(&collecting, bytes, size)
                          : rf_json_strings(path, bytes, size, "files", "name", add_name, &collecting);
    if (result == RF_OK && out->count == 0)
        result = rf_fail(RF_BAD_INPUT, path, NULL, "names no files");
    if (result != RF_OK)
        rf_file_list_free(out);
    return result;
}

RfResult rf_file_list_read(const char *path, RfFileList *out)
{
    RfBytes bytes;
    *out = (RfFileList){0};
    RF_TRY(rf_bytes_read(path, LARGEST_LIST, &bytes));
    RfResult result = rf_file_list_parse(path, bytes.data, bytes.size, out);
    rf_bytes_free(&bytes);
    return result;
}

void rf_file_list_free(RfFileList *list)
{
    for (int i = 0; i < list->count; ++i)
        rf_release(list->paths[i]);
    rf_release(list->paths);
    *list = (RfFileList){0};
}
