// SPDX-License-Identifier: Apache-2.0
// Particle image velocimetry: the .vec of TSI Insight and the .txt of OpenPIV. Both are tables of x, y, u, v and a word
// on the vector's validity, one vector a line, in image pixels and pixels between the two exposures.
//
// Which way y runs. Insight says so: OriginInImageY is the image row, counted from the top, on which y is 0. In the
// files seen it is the last row (2671 of 2672), so y runs up, and v with it: read so, the six fields of a cavity have
// a root mean square divergence of 1.1, with v the other way 1.4. OpenPIV says nothing, but writes the rows of the
// image in order, the top one first: y falling down the file runs up, y growing down the file runs down. In the field
// seen y falls, and the stream parts before its cylinder, away from it on both sides, only if v points along y. The
// same rule serves a .vec without an origin. Vectors are placed by their coordinates, not by their order.
//
// Validity. Insight: CHC <= 0 is invalid. OpenPIV: a flag other than 0 is invalid. Invalid vectors are measurements
// that failed in the midst of the fluid, not land: they are filled from their neighbours and counted.
//
// One step of the measurement is taken as one frame. Where the lengths are not pixels (millimetres, with metres a
// second), the frame rate counts instead.
#include "in/flow_format.h"
#include "in/text.h"

#include "core/memory.h"
#include "core/result.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct PivVector
{
    double x, y, u, v;
    bool valid;
} PivVector;

typedef struct PivTable
{
    PivVector *vectors;
    size_t count;
    /// y and v run up.
    bool y_up;
    /// Millimetres and metres a second instead of pixels.
    bool metric;
} PivTable;

/// The positions along one axis: first, first + spacing, ...
typedef struct PivAxis
{
    double first, spacing;
    int count;
} PivAxis;

// ---- the table ---------------------------------------------------------------------------------------------------

static RfResult bad_line(const RfFlowSource *source, int line, const char *what)
{
    char place[32];
    snprintf(place, sizeof place, "line %d", line);
    return rf_fail(RF_BAD_INPUT, source->path, place, "%s", what);
}

static int take_columns(RfText line, double columns[6])
{
    int count = 0;
    for (rf_text_skip(&line, ","); count < 6 && rf_text_number(&line, &columns[count]); rf_text_skip(&line, ",;"))
        ++count;
    return count;
}

static RfResult take_vector(const RfFlowSource *source, RfText line, int number, bool insight, PivVector *out)
{
    double c[6];
    int count = take_columns(line, c);
    if (count < 4)
        return bad_line(source, number, "four numbers or more were expected here: x y u v and the vector's validity");
    if (!isfinite(c[0]) || !isfinite(c[1]))
        return bad_line(source, number, "the position is not a finite number");
    bool finite = isfinite(c[2]) && isfinite(c[3]);
    bool valid = count < 5 || (insight ? c[4] > 0 : c[4] == 0 && (count < 6 || c[5] == 0));
    *out = (PivVector){c[0], c[1], finite ? c[2] : 0, finite ? c[3] : 0, finite && valid};
    return RF_OK;
}

static size_t count_lines(RfText text)
{
    size_t lines = 0;
    for (RfText line; rf_text_line(&text, &line);)
        ++lines;
    return lines;
}

static bool is_blank(RfText line)
{
    rf_text_skip(&line, "");
    return line.at == line.end || *line.at == '#' || *line.at == '\0';
}

// Every line after the header; `number` is the last line of the header.
static RfResult take_vectors(const RfFlowSource *source, RfText text, int number, bool insight, PivTable *out)
{
    out->vectors = rf_allocate(count_lines(text), sizeof *out->vectors);
    if (!out->vectors)
        return RF_OUT_OF_MEMORY;
    for (RfText line; rf_text_line(&text, &line);)
    {
        ++number;
        if (!is_blank(line))
            RF_TRY(take_vector(source, line, number, insight, &out->vectors[out->count++]));
    }
    if (out->count == 0)
        return rf_fail(RF_BAD_INPUT, source->path, NULL, "no vectors: the file ends after its header");
    return RF_OK;
}

static bool rows_fall(const PivTable *table)
{
    return table->vectors[0].y > table->vectors[table->count - 1].y;
}

// ---- the grid ----------------------------------------------------------------------------------------------------

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static RfResult find_axis(const RfFlowSource *source, const PivTable *table, bool vertical, double *scratch,
                          PivAxis *out)
{
    for (size_t k = 0; k < table->count; ++k)
        scratch[k] = vertical ? table->vectors[k].y : table->vectors[k].x;
    qsort(scratch, table->count, sizeof *scratch, compare_doubles);
    double range = scratch[table->count - 1] - scratch[0];
    int64_t count = 1;
    for (size_t k = 1; k < table->count; ++k)
        count += scratch[k] - scratch[k - 1] > 1e-6 * range;
    if (count > RF_MAX_SIZE || !isfinite(range))
        return rf_fail(RF_BAD_INPUT, source->path, NULL,
                       "%lld different %s positions: the vectors must lie on a regular grid of at most %d",
                       (long long)count, vertical ? "y" : "x", RF_MAX_SIZE);
    *out = (PivAxis){scratch[0], count > 1 ? range / (double)(count - 1) : 0, (int)count};
    return RF_OK;
}

static int axis_index(const PivAxis *axis, double position)
{
    double i = axis->spacing > 0 ? (position - axis->first) / axis->spacing : 0;
    double nearest = floor(i + 0.5);
    return fabs(i - nearest) < 0.2 ? (int)nearest : -1;
}

static RfResult place_vectors(const RfFlowSource *source, const PivTable *table, const PivAxis axes[2],
                              const double scale[2], uint8_t *valid, RfFlowField *field)
{
    for (size_t k = 0; k < table->count; ++k)
    {
        const PivVector *vector = &table->vectors[k];
        int i = axis_index(&axes[0], vector->x), j = axis_index(&axes[1], vector->y);
        if (i < 0 || j < 0)
            return rf_fail(RF_BAD_INPUT, source->path, NULL,
                           "the vector at %g, %g lies off the regular grid of the others (%g by %g)", vector->x,
                           vector->y, axes[0].spacing, axes[1].spacing);
        size_t row = (size_t)(table->y_up ? field->height - 1 - j : j), cell = row * (size_t)field->width + (size_t)i;
        field->velocity[2 * cell] = (float)(vector->u * scale[0]);
        field->velocity[2 * cell + 1] = (float)((table->y_up ? -vector->v : vector->v) * scale[1]);
        valid[cell] = vector->valid;
    }
    return RF_OK;
}

static RfResult fill_grid(const RfFlowSource *source, const PivTable *table, const PivAxis axes[2], RfFlowMoment *out)
{
    double spacing[2] = {axes[0].spacing, axes[1].spacing}, scale[2];
    for (int a = 0; a < 2; ++a)
    {
        double step = spacing[a] > 0 ? spacing[a] : spacing[1 - a] > 0 ? spacing[1 - a] : 1;
        // Metres a second over millimetres.
        scale[a] = table->metric ? 1000 / (step * (double)source->options->fps) : 1 / step;
    }
    uint8_t *valid = rf_allocate_zero((size_t)axes[0].count * (size_t)axes[1].count, 1);
    if (!valid)
        return RF_OUT_OF_MEMORY;
    RfResult result = place_vectors(source, table, axes, scale, valid, &out->field);
    if (result == RF_OK)
        out->filled_vectors = rf_flow_field_fill_invalid(&out->field, valid);
    rf_release(valid);
    return result;
}

static RfResult grid_of_table(const RfFlowSource *source, const PivTable *table, RfFlowMoment *out)
{
    PivAxis axes[2];
    double *scratch = rf_allocate(table->count, sizeof *scratch);
    if (!scratch)
        return RF_OUT_OF_MEMORY;
    RfResult result = find_axis(source, table, false, scratch, &axes[0]);
    if (result == RF_OK)
        result = find_axis(source, table, true, scratch, &axes[1]);
    rf_release(scratch);
    RF_TRY(result);
    int64_t cells = (int64_t)axes[0].count * axes[1].count;
    if ((int64_t)table->count > cells || (int64_t)table->count * 4 < cells)
        return rf_fail(RF_BAD_INPUT, source->path, NULL,
                       "%zu vectors at %d different x and %d different y: they lie on no regular grid", table->count,
                       axes[0].count, axes[1].count);
    RF_TRY(rf_flow_moment_create(source, axes[0].count, axes[1].count, out));
    RF_TRY(fill_grid(source, table, axes, out));
    out->moment_count = 1;
    char unit[64] = "pixels a step over";
    if (table->metric)
        snprintf(unit, sizeof unit, "m/s at %g frames a second over", (double)source->options->fps);
    snprintf(out->conventions, sizeof out->conventions, "%s a grid of %g x %g %s; %s; %d invalid vectors filled", unit,
             axes[0].spacing, axes[1].spacing, table->metric ? "mm" : "pixels",
             table->y_up ? "y ran up: rows and v turned round" : "y down, as in the file", out->filled_vectors);
    return RF_OK;
}

// ---- the two formats ---------------------------------------------------------------------------------------------

static bool vec_probe(const uint8_t *bytes, size_t size)
{
    RfText text = {(const char *)bytes, (const char *)bytes + size};
    return size > 5 && strncasecmp(text.at, "TITLE", 5) == 0 && rf_text_find(text, "VARIABLES");
}

// Lines up to the one that names the ZONE; false if none does.
static bool take_header(RfText *text, RfText *header, int *lines)
{
    *header = (RfText){text->at, text->at};
    for (RfText line; rf_text_line(text, &line);)
    {
        ++*lines;
        header->end = line.end;
        if (rf_text_find(line, "ZONE"))
            return true;
    }
    return false;
}

static RfResult vec_table(const RfFlowSource *source, PivTable *table)
{
    RfText text = {(const char *)source->bytes, (const char *)source->bytes + source->size}, header;
    int lines = 0;
    double i = 0, j = 0, origin = 0;
    if (!take_header(&text, &header, &lines))
        return rf_fail(RF_BAD_INPUT, source->path, "header", "not an Insight .vec: no line says ZONE I= J=");
    RfText zone = {rf_text_find(header, "ZONE"), header.end};
    if (!rf_text_number_after(zone, "I=", &i) || !rf_text_number_after(zone, "J=", &j) || !(i >= 1) || !(j >= 1))
        return rf_fail(RF_BAD_INPUT, source->path, "header", "ZONE gives no size: I= and J= were expected");
    RF_TRY(take_vectors(source, text, lines, true, table));
    if ((double)table->count != i * j)
        return rf_fail(RF_BAD_INPUT, source->path, "data", "%zu vectors, but the header says %g x %g: the file is cut",
                       table->count, i, j);
    table->metric = rf_text_find(header, "LengthUnit=\"mm\"") || rf_text_find(header, "\"X mm\"");
    bool told = rf_text_number_after(header, "OriginInImageY", &origin);
    table->y_up = told ? origin > 0 : rows_fall(table);
    return RF_OK;
}

static RfResult vec_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    PivTable table = {0};
    RfResult result = vec_table(source, &table);
    if (result == RF_OK)
        result = grid_of_table(source, &table, out);
    rf_release(table.vectors);
    return result;
}

static RfResult openpiv_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    RfText text = {(const char *)source->bytes, (const char *)source->bytes + source->size};
    PivTable table = {0};
    RfResult result = take_vectors(source, text, 0, false, &table);
    if (result == RF_OK)
    {
        table.y_up = rows_fall(&table);
        result = grid_of_table(source, &table, out);
    }
    rf_release(table.vectors);
    return result;
}

const RfFlowFormat rf_flow_format_vec = {.name = "vec", .extensions = "vec", .probe = vec_probe, .read = vec_read};
const RfFlowFormat rf_flow_format_openpiv = {.name = "openpiv", .extensions = "txt", .read = openpiv_read};
