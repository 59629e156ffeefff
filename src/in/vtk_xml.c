// SPDX-License-Identifier: Apache-2.0
// The XML part of a .vti. Its AppendedData may hold raw bytes, which no XML parser accepts, so expat sees only what
// stands before that element; the texts of inline arrays are remembered by their place in the file and decoded later
// (vtk_data.c). A document type is refused: nothing in these files needs entities, and they can be made to explode.
#include "in/vtk_xml.h"
#include "in/text.h"

#include "core/result.h"

#include <expat.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

typedef struct Parse
{
    RfVtkImage *image;
    XML_Parser parser;
    RfResult result;
    RfVtkPlace place;
    bool is_image, has_piece;
    /// The array whose text is being passed, and how many elements deep inside it we are.
    RfVtkArray *open;
    int depth;
} Parse;

__attribute__((format(printf, 3, 4))) static void stop(Parse *parse, RfResult result, const char *format, ...)
{
    if (parse->result != RF_OK)
        return;
    char place[32], message[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(message, sizeof message, format, arguments);
    va_end(arguments);
    snprintf(place, sizeof place, "line %lu", (unsigned long)XML_GetCurrentLineNumber(parse->parser));
    parse->result = rf_fail(result, parse->image->path, place, "%s", message);
    XML_StopParser(parse->parser, XML_FALSE);
}

static const char *attribute(const char **attributes, const char *name, const char *otherwise)
{
    for (; attributes[0]; attributes += 2)
        if (strcmp(attributes[0], name) == 0)
            return attributes[1];
    return otherwise;
}

static bool take_numbers(const char *string, double *out, int count)
{
    RfText text = {string, string + strlen(string)};
    for (int i = 0; i < count; ++i)
    {
        rf_text_skip(&text, "");
        if (!rf_text_number(&text, &out[i]) || !isfinite(out[i]))
            return false;
    }
    return true;
}

// ---- elements ----------------------------------------------------------------------------------------------------

static void take_file(Parse *parse, const char **attributes)
{
    RfVtkImage *image = parse->image;
    const char *type = attribute(attributes, "type", "?"), *compressor = attribute(attributes, "compressor", "");
    if (strcmp(type, "ImageData") != 0)
        stop(parse, RF_UNSUPPORTED, "the file holds %.40s: ImageData is read here", type);
    if (compressor[0] && strcmp(compressor, "vtkZLibDataCompressor") != 0)
        stop(parse, RF_UNSUPPORTED, "compressed by %.60s: save it with zlib or uncompressed", compressor);
    image->compressed = compressor[0] != '\0';
    image->big_endian = strcmp(attribute(attributes, "byte_order", "LittleEndian"), "BigEndian") == 0;
    image->wide_headers = strcmp(attribute(attributes, "header_type", "UInt32"), "UInt64") == 0;
}

static bool take_extent(const char *text, int64_t extent[6])
{
    double numbers[6];
    if (!take_numbers(text, numbers, 6))
        return false;
    for (int i = 0; i < 6; ++i)
    {
        if (!(fabs(numbers[i]) < 1e9))
            return false;
        extent[i] = (int64_t)numbers[i];
    }
    return extent[1] >= extent[0] && extent[3] >= extent[2] && extent[5] >= extent[4];
}

static void take_image(Parse *parse, const char **attributes)
{
    RfVtkImage *image = parse->image;
    parse->is_image = true;
    if (!take_extent(attribute(attributes, "WholeExtent", ""), image->extent))
        stop(parse, RF_BAD_INPUT, "WholeExtent must hold six whole numbers, each pair in order");
    if (!take_numbers(attribute(attributes, "Origin", "0 0 0"), image->origin, 3) ||
        !take_numbers(attribute(attributes, "Spacing", "1 1 1"), image->spacing, 3))
        stop(parse, RF_BAD_INPUT, "Origin and Spacing must hold three numbers each");
}

static void take_piece(Parse *parse, const char **attributes)
{
    int64_t extent[6];
    const char *text = attribute(attributes, "Extent", NULL);
    bool whole = !text || (take_extent(text, extent) && memcmp(extent, parse->image->extent, sizeof extent) == 0);
    if (parse->has_piece || !whole)
        stop(parse, RF_UNSUPPORTED, "the image comes in several pieces: save it as one");
    parse->has_piece = true;
}

static bool take_kind(const char *type, RfNumberKind *out)
{
    static const char *const names[] = {"Int8",  "UInt8",  "Int16",   "UInt16",  "Int32",  "UInt32",
                                        "Int64", "UInt64", "Float16", "Float32", "Float64"};
    for (int i = 0; i < (int)(sizeof names / sizeof names[0]); ++i)
        if (strcmp(type, names[i]) == 0)
        {
            *out = (RfNumberKind)i;
            return true;
        }
    return false;
}

static void take_array(Parse *parse, const char **attributes)
{
    RfVtkImage *image = parse->image;
    if (parse->place == RF_VTK_NOWHERE || image->array_count == RF_VTK_MAX_ARRAYS)
        return;
    RfVtkArray *array = &image->arrays[image->array_count];
    *array = (RfVtkArray){.place = parse->place};
    // Strings and bits cannot be what we look for.
    if (!take_kind(attribute(attributes, "type", ""), &array->kind))
        return;
    snprintf(array->name, sizeof array->name, "%s", attribute(attributes, "Name", ""));
    double components = 1, offset = 0;
    const char *format = attribute(attributes, "format", "ascii");
    if (!take_numbers(attribute(attributes, "NumberOfComponents", "1"), &components, 1) || components < 1 ||
        components > 1000 || !take_numbers(attribute(attributes, "offset", "0"), &offset, 1) || offset < 0 ||
        offset > 1e15)
    {
        stop(parse, RF_BAD_INPUT, "array %s: NumberOfComponents or offset is out of range", array->name);
        return;
    }
    array->components = (int)components;
    array->coding = strcmp(format, "appended") == 0 ? RF_VTK_APPENDED
                    : strcmp(format, "binary") == 0 ? RF_VTK_BASE64
                                                    : RF_VTK_ASCII;
    array->begin = (size_t)offset;
    ++image->array_count;
    if (array->coding == RF_VTK_APPENDED)
        return;
    array->begin = (size_t)(XML_GetCurrentByteIndex(parse->parser) + XML_GetCurrentByteCount(parse->parser));
    array->end = 0;
    parse->open = array;
    parse->depth = 0;
}

static bool blank(const Parse *parse, size_t begin, size_t end)
{
    for (size_t i = begin; i < end && i < parse->image->size; ++i)
        if (!strchr(" \t\r\n", parse->image->bytes[i]))
            return false;
    return true;
}

static void XMLCALL element_begins(void *user, const char *name, const char **attributes)
{
    Parse *parse = user;
    if (parse->open)
    {
        // InformationKey and its like stand before the numbers, or behind them.
        size_t here = (size_t)XML_GetCurrentByteIndex(parse->parser);
        if (parse->depth++ == 0 && !parse->open->end && !blank(parse, parse->open->begin, here))
            parse->open->end = here;
    }
    else if (strcmp(name, "VTKFile") == 0)
        take_file(parse, attributes);
    else if (strcmp(name, "ImageData") == 0)
        take_image(parse, attributes);
    else if (strcmp(name, "Piece") == 0)
        take_piece(parse, attributes);
    else if (strcmp(name, "PointData") == 0)
        parse->place = RF_VTK_POINTS;
    else if (strcmp(name, "CellData") == 0)
        parse->place = RF_VTK_CELLS;
    else if (strcmp(name, "DataArray") == 0)
        take_array(parse, attributes);
}

static void XMLCALL element_ends(void *user, const char *name)
{
    Parse *parse = user;
    size_t here = (size_t)XML_GetCurrentByteIndex(parse->parser);
    if (parse->open && parse->depth > 0)
    {
        --parse->depth;
        if (!parse->open->end)
            parse->open->begin = here + (size_t)XML_GetCurrentByteCount(parse->parser);
    }
    else if (parse->open)
    {
        if (!parse->open->end)
            parse->open->end = here;
        if (parse->open->end < parse->open->begin)
            parse->open->end = parse->open->begin;
        parse->open = NULL;
    }
    else if (strcmp(name, "PointData") == 0 || strcmp(name, "CellData") == 0)
        parse->place = RF_VTK_NOWHERE;
}

static void XMLCALL doctype_begins(void *user, const char *name, const char *system, const char *public, int internal)
{
    (void)name;
    (void)system;
    (void)public;
    (void)internal;
    stop(user, RF_UNSUPPORTED, "the file declares a document type, which VTK files do not need: remove it");
}

// ---- the file ----------------------------------------------------------------------------------------------------

// Where <AppendedData begins, or the size.
static size_t find_appended(RfVtkImage *image)
{
    const char *text = (const char *)image->bytes;
    const char *tag = memmem(text, image->size, "<AppendedData", 13);
    if (!tag)
        return image->size;
    const char *close = memchr(tag, '>', image->size - (size_t)(tag - text));
    RfText inside = {tag, close ? close : text + image->size};
    image->appended_base64 = rf_text_find(inside, "base64") != NULL;
    const char *line = close ? memchr(close, '_', image->size - (size_t)(close - text)) : NULL;
    image->appended = line ? (size_t)(line + 1 - text) : 0;
    return (size_t)(tag - text);
}

RfResult rf_vtk_image_parse(const char *path, const uint8_t *bytes, size_t size, RfVtkImage *out)
{
    *out = (RfVtkImage){.path = path, .bytes = bytes, .size = size};
    size_t xml = find_appended(out);
    if (xml > INT32_MAX)
        return rf_fail(RF_UNSUPPORTED, path, NULL, "more than 2 GiB of inline numbers: save them appended");
    Parse parse = {.image = out, .parser = XML_ParserCreate(NULL)};
    if (!parse.parser)
        return rf_fail(RF_OUT_OF_MEMORY, path, NULL, "no memory for the XML parser");
    XML_SetUserData(parse.parser, &parse);
    XML_SetElementHandler(parse.parser, element_begins, element_ends);
    XML_SetStartDoctypeDeclHandler(parse.parser, doctype_begins);
    enum XML_Status status = XML_Parse(parse.parser, (const char *)bytes, (int)xml, xml == size);
    if (status != XML_STATUS_OK && parse.result == RF_OK)
        stop(&parse, RF_BAD_INPUT, "not XML: %s", XML_ErrorString(XML_GetErrorCode(parse.parser)));
    if (parse.result == RF_OK && !parse.is_image)
        stop(&parse, RF_BAD_INPUT, "no ImageData in it: a .vti holds a VTKFile of type ImageData");
    XML_ParserFree(parse.parser);
    return parse.result;
}

int64_t rf_vtk_image_count(const RfVtkImage *image, RfVtkPlace place, int axis)
{
    int64_t steps = image->extent[2 * axis + 1] - image->extent[2 * axis];
    return place == RF_VTK_POINTS ? steps + 1 : steps > 0 ? steps : 1;
}

const RfVtkArray *rf_vtk_image_find(const RfVtkImage *image, const char *name, int least_components,
                                    int most_components)
{
    for (int i = 0; i < image->array_count; ++i)
    {
        const RfVtkArray *array = &image->arrays[i];
        if (strcasecmp(array->name, name) == 0 && array->components >= least_components &&
            array->components <= most_components)
            return array;
    }
    return NULL;
}
