// SPDX-License-Identifier: Apache-2.0
// NetCDF 3 and 4: two variables over [..., y, x], found by name or by standard name (CF conventions 1.10).
//
// The last two dimensions are y and x. One of the others may be time, whose values are the moments; of any further one
// (depth, height, ensemble) the first index is taken.
//
// Axes. The north component points up, so v is always negated; rows are turned round unless y, or the latitude, falls
// along its dimension. Columns are turned round if x falls. Without coordinates y is taken to run up.
//
// Units. Velocity is in world units a second (cm/s are made m/s). Over coordinates in degrees a cell measures
// 111.2 km a degree, times the cosine of its latitude along x (at least 0.01, so that the poles stay finite); over
// coordinates in km, m or anything else the mean spacing of the coordinate counts, and without any one cell is one
// unit.
#ifdef RF_HAVE_NETCDF
#include "in/child.h"
#endif
#include "in/flow_format.h"

#include "core/memory.h"
#include "core/result.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

static bool netcdf_probe(const uint8_t *bytes, size_t size)
{
    return (size >= 4 && memcmp(bytes, "CDF", 3) == 0 && (bytes[3] == 1 || bytes[3] == 2 || bytes[3] == 5)) ||
           (size >= 8 && memcmp(bytes, "\x89HDF\r\n\x1a\n", 8) == 0);
}

#ifdef RF_HAVE_NETCDF
#include <netcdf.h>
#include <netcdf_mem.h>

static const double metres_a_degree = 111200;
static const int64_t most_cells = (int64_t)1 << 28;

enum
{
    /// Numbers read at once.
    BLOCK = 1 << 20,
    MAX_FILLS = 4
};

static const char *const known_names[][2] = {{"u", "v"}, {"velocity_x", "velocity_y"}, {"uo", "vo"}, {"u10", "v10"}};

/// A velocity component.
typedef struct Component
{
    int id;
    double scale, offset;
    double fills[MAX_FILLS];
    int fill_count;
} Component;

typedef enum AxisUnit
{
    AXIS_NONE,
    AXIS_DEGREES,
    AXIS_METRES,
    AXIS_OTHER
} AxisUnit;

/// One of the last two dimensions.
typedef struct Axis
{
    char name[NC_MAX_NAME + 1];
    size_t count;
    AxisUnit unit;
    /// In metres or degrees where the unit says so; spacing > 0.
    double first, spacing;
    bool falling;
} Axis;

typedef struct Reader
{
    const RfFlowSource *source;
    int file;
    Component components[2];
    int dimension_count, dimensions[NC_MAX_VAR_DIMS];
    /// Place of time among the dimensions; -1: none.
    int time_dimension;
    size_t moments;
    Axis x, y;
    /// Of velocity, in metres a second where it is known.
    double velocity_unit;
} Reader;

// Of a mapped file EPERM says that its end is passed.
static RfResult netcdf_failed(const Reader *reader, int status, const char *place)
{
    return rf_fail(status == NC_ENOMEM ? RF_OUT_OF_MEMORY : RF_BAD_INPUT, reader->source->path, place,
                   "cannot be read as NetCDF: %s", status == EPERM ? "the file is cut" : nc_strerror(status));
}

#define NC_TRY(reader, place, expression)                                                                              \
    do                                                                                                                 \
    {                                                                                                                  \
        int nc_try_status = (expression);                                                                              \
        if (nc_try_status != NC_NOERR)                                                                                 \
            return netcdf_failed(reader, nc_try_status, place);                                                        \
    } while (0)

// ---- attributes --------------------------------------------------------------------------------------------------

// "" if there is none, or it is too long to be one of those looked for.
static void text_attribute(const Reader *reader, int variable, const char *name, char text[128])
{
    size_t length = 0;
    nc_type type;
    text[0] = '\0';
    if (nc_inq_att(reader->file, variable, name, &type, &length) != NC_NOERR || type != NC_CHAR || length >= 128 ||
        nc_get_att_text(reader->file, variable, name, text) != NC_NOERR)
        length = 0;
    text[length] = '\0';
}

static int number_attributes(const Reader *reader, int variable, const char *name, double *out, int most)
{
    size_t length = 0;
    nc_type type;
    double values[16];
    if (nc_inq_att(reader->file, variable, name, &type, &length) != NC_NOERR || type == NC_CHAR || length < 1 ||
        length > 16 || type > NC_UINT64 || nc_get_att_double(reader->file, variable, name, values) != NC_NOERR)
        return 0;
    int count = (int)length < most ? (int)length : most;
    memcpy(out, values, (size_t)count * sizeof *out);
    return count;
}

// ---- which variables ---------------------------------------------------------------------------------------------

static int find_variable(const Reader *reader, const char *name)
{
    int count = 0;
    nc_inq_nvars(reader->file, &count);
    for (int id = 0; id < count; ++id)
    {
        char found[NC_MAX_NAME + 1];
        if (nc_inq_varname(reader->file, id, found) == NC_NOERR && strcasecmp(found, name) == 0)
            return id;
    }
    return -1;
}

// eastward_X and northward_X for one X.
static bool find_by_standard_name(Reader *reader)
{
    int count = 0;
    char east[128], north[128];
    nc_inq_nvars(reader->file, &count);
    for (int u = 0; u < count; ++u)
    {
        text_attribute(reader, u, "standard_name", east);
        for (int v = 0; strncmp(east, "eastward_", 9) == 0 && v < count; ++v)
        {
            text_attribute(reader, v, "standard_name", north);
            if (strncmp(north, "northward_", 10) != 0 || strcmp(east + 9, north + 10) != 0)
                continue;
            reader->components[0].id = u;
            reader->components[1].id = v;
            return true;
        }
    }
    return false;
}

static RfResult no_velocity(const Reader *reader)
{
    char names[400] = "";
    int count = 0;
    nc_inq_nvars(reader->file, &count);
    for (int id = 0; id < count; ++id)
    {
        char name[NC_MAX_NAME + 1] = "";
        nc_inq_varname(reader->file, id, name);
        size_t used = strlen(names);
        if (used + strlen(name) + 8 > sizeof names)
        {
            snprintf(names + used, sizeof names - used, ", ...");
            break;
        }
        snprintf(names + used, sizeof names - used, "%s%s", used ? ", " : "", name);
    }
    const char *wanted = reader->source->options->variables;
    return rf_fail(RF_BAD_INPUT, reader->source->path, NULL,
                   "no velocity here: looked for %s; it has: %s; name them with --variables",
                   wanted ? wanted
                          : "u, v (also velocity_x, velocity_y; uo, vo; u10, v10; eastward_/northward_ standard names)",
                   names[0] ? names : "no variables");
}

static RfResult find_components(Reader *reader)
{
    char wanted[2][64];
    bool told = rf_flow_wanted_names(reader->source->options, wanted[0], wanted[1]);
    int pairs = (int)(sizeof known_names / sizeof known_names[0]);
    for (int i = 0; i < (told ? 1 : pairs); ++i)
    {
        reader->components[0].id = find_variable(reader, told ? wanted[0] : known_names[i][0]);
        reader->components[1].id = find_variable(reader, told ? wanted[1] : known_names[i][1]);
        if (reader->components[0].id >= 0 && reader->components[1].id >= 0)
            return RF_OK;
    }
    return !told && find_by_standard_name(reader) ? RF_OK : no_velocity(reader);
}

static RfResult describe_component(Reader *reader, Component *component)
{
    nc_type type;
    NC_TRY(reader, "velocity", nc_inq_vartype(reader->file, component->id, &type));
    if (type == NC_CHAR || type == NC_STRING || type > NC_UINT64)
        return rf_fail(RF_BAD_INPUT, reader->source->path, "velocity", "the variable does not hold numbers");
    component->scale = 1;
    number_attributes(reader, component->id, "scale_factor", &component->scale, 1);
    number_attributes(reader, component->id, "add_offset", &component->offset, 1);
    double *fills = component->fills;
    int count = number_attributes(reader, component->id, "_FillValue", fills, 1);
    if (count == 0 && type != NC_BYTE && type != NC_UBYTE)
        fills[count++] = type == NC_SHORT    ? NC_FILL_SHORT
                         : type == NC_INT    ? NC_FILL_INT
                         : type == NC_DOUBLE ? NC_FILL_DOUBLE
                                             : (double)NC_FILL_FLOAT;
    count += number_attributes(reader, component->id, "missing_value", fills + count, MAX_FILLS - count);
    component->fill_count = count;
    return RF_OK;
}

// ---- dimensions and coordinates ----------------------------------------------------------------------------------

static bool is_time(const Reader *reader, int dimension)
{
    char name[NC_MAX_NAME + 1] = "", units[128] = "";
    int variable;
    nc_inq_dimname(reader->file, dimension, name);
    if (nc_inq_varid(reader->file, name, &variable) == NC_NOERR)
        text_attribute(reader, variable, "units", units);
    return strstr(units, " since ") || strcasecmp(name, "time") == 0 || strcasecmp(name, "t") == 0 ||
           strcasecmp(name, "valid_time") == 0 || strcasecmp(name, "ocean_time") == 0;
}

static RfResult find_dimensions(Reader *reader)
{
    int others[NC_MAX_VAR_DIMS], other_count = 0, u = reader->components[0].id, v = reader->components[1].id;
    NC_TRY(reader, "velocity", nc_inq_varndims(reader->file, u, &reader->dimension_count));
    NC_TRY(reader, "velocity", nc_inq_varndims(reader->file, v, &other_count));
    if (reader->dimension_count != other_count || other_count < 2 || other_count > NC_MAX_VAR_DIMS)
        return rf_fail(RF_BAD_INPUT, reader->source->path, "velocity",
                       "the components have %d and %d dimensions: both must have the same, two or more",
                       reader->dimension_count, other_count);
    NC_TRY(reader, "velocity", nc_inq_vardimid(reader->file, u, reader->dimensions));
    NC_TRY(reader, "velocity", nc_inq_vardimid(reader->file, v, others));
    for (int d = 0; d < other_count; ++d)
    {
        size_t a = 0, b = 0;
        NC_TRY(reader, "velocity", nc_inq_dimlen(reader->file, reader->dimensions[d], &a));
        NC_TRY(reader, "velocity", nc_inq_dimlen(reader->file, others[d], &b));
        if (a != b || a == 0)
            return rf_fail(RF_BAD_INPUT, reader->source->path, "velocity",
                           "the components have %zu and %zu values along a dimension: they must agree and not be 0", a,
                           b);
    }
    reader->time_dimension = -1;
    reader->moments = 1;
    for (int d = 0; d < reader->dimension_count - 2 && reader->time_dimension < 0; ++d)
        if (is_time(reader, reader->dimensions[d]))
            reader->time_dimension = d;
    if (reader->time_dimension >= 0)
        nc_inq_dimlen(reader->file, reader->dimensions[reader->time_dimension], &reader->moments);
    return RF_OK;
}

static AxisUnit axis_unit(const char *units, double *factor)
{
    *factor = 1;
    if (strncmp(units, "degree", 6) == 0)
        return AXIS_DEGREES;
    if (strcmp(units, "m") == 0 || strncmp(units, "met", 3) == 0)
        return AXIS_METRES;
    if (strcmp(units, "km") == 0 || strncmp(units, "kilomet", 7) == 0)
    {
        *factor = 1000;
        return AXIS_METRES;
    }
    return AXIS_OTHER;
}

static bool one_value(const Reader *reader, int variable, size_t index, double *out)
{
    return nc_get_var1_double(reader->file, variable, &index, out) == NC_NOERR && isfinite(*out);
}

// The coordinate variable of a dimension bears its name. Its mean spacing counts, so a grid that is not quite regular
// is taken as if it were.
static RfResult describe_axis(Reader *reader, int dimension, Axis *axis)
{
    int id = reader->dimensions[dimension], variable, rank = 0;
    double first, last, factor;
    char units[128];
    NC_TRY(reader, "dimensions", nc_inq_dim(reader->file, id, axis->name, &axis->count));
    axis->spacing = 1;
    if (nc_inq_varid(reader->file, axis->name, &variable) != NC_NOERR ||
        nc_inq_varndims(reader->file, variable, &rank) != NC_NOERR || rank != 1 || axis->count < 2 ||
        !one_value(reader, variable, 0, &first) || !one_value(reader, variable, axis->count - 1, &last) ||
        first == last)
        return RF_OK;
    text_attribute(reader, variable, "units", units);
    axis->unit = axis_unit(units, &factor);
    axis->falling = last < first;
    axis->first = first * factor;
    axis->spacing = fabs(last - first) * factor / (double)(axis->count - 1);
    return RF_OK;
}

static RfResult describe(Reader *reader)
{
    RF_TRY(find_components(reader));
    for (int c = 0; c < 2; ++c)
        RF_TRY(describe_component(reader, &reader->components[c]));
    RF_TRY(find_dimensions(reader));
    RF_TRY(describe_axis(reader, reader->dimension_count - 2, &reader->y));
    RF_TRY(describe_axis(reader, reader->dimension_count - 1, &reader->x));
    if (reader->x.count > RF_MAX_SIZE || reader->y.count > RF_MAX_SIZE ||
        (int64_t)reader->x.count * (int64_t)reader->y.count > most_cells || reader->moments > 1000000)
        return rf_fail(RF_BAD_INPUT, reader->source->path, "dimensions",
                       "%zu moments of %zu x %zu cells: each side must be 1 to %d, all cells at most %lld, moments "
                       "1 to 1000000",
                       reader->moments, reader->x.count, reader->y.count, RF_MAX_SIZE, (long long)most_cells);
    char units[128];
    text_attribute(reader, reader->components[0].id, "units", units);
    bool world = reader->x.unit == AXIS_DEGREES || reader->x.unit == AXIS_METRES;
    bool centimetres = strncmp(units, "cm/s", 4) == 0 || strncmp(units, "cm s", 4) == 0;
    reader->velocity_unit = world && centimetres ? 0.01 : 1;
    return RF_OK;
}

// ---- the numbers -------------------------------------------------------------------------------------------------

static bool is_fill(const Component *component, double raw)
{
    bool fill = !isfinite(raw) || fabs(raw) > 1e30;
    for (int i = 0; i < component->fill_count; ++i)
        fill |= raw == component->fills[i] || (float)raw == (float)component->fills[i];
    return fill;
}

static void take_rows(const Reader *reader, int c, const double *values, size_t first_row, size_t rows,
                      RfFlowField *field, bool *holes)
{
    const Component *component = &reader->components[c];
    size_t width = reader->x.count, height = reader->y.count;
    for (size_t j = 0; j < rows; ++j)
        for (size_t i = 0; i < width; ++i)
        {
            double raw = values[j * width + i];
            size_t y = reader->y.falling ? first_row + j : height - 1 - first_row - j;
            size_t cell = y * width + (reader->x.falling ? width - 1 - i : i);
            bool fill = is_fill(component, raw);
            field->velocity[2 * cell + (size_t)c] = fill ? NAN : (float)(raw * component->scale + component->offset);
            *holes |= fill;
        }
}

static RfResult take_component(const Reader *reader, int c, int moment, double *block, RfFlowField *field, bool *holes)
{
    size_t start[NC_MAX_VAR_DIMS] = {0}, count[NC_MAX_VAR_DIMS], width = reader->x.count, height = reader->y.count;
    int row = reader->dimension_count - 2;
    for (int d = 0; d < reader->dimension_count; ++d)
        count[d] = 1;
    count[row + 1] = width;
    if (reader->time_dimension >= 0)
        start[reader->time_dimension] = (size_t)moment;
    size_t rows = BLOCK / width;
    for (size_t first = 0; first < height; first += rows)
    {
        start[row] = first;
        count[row] = height - first < rows ? height - first : rows;
        NC_TRY(reader, c ? "second component" : "first component",
               nc_get_vara_double(reader->file, reader->components[c].id, start, count, block));
        take_rows(reader, c, block, first, count[row], field, holes);
    }
    return RF_OK;
}

// From world units a second to cells a frame; v turned to point down.
static void scale_rows(const Reader *reader, RfFlowField *field)
{
    double second = (double)reader->source->options->fps;
    for (int y = 0; y < field->height; ++y)
    {
        double cell_x = reader->x.spacing, cell_y = reader->y.spacing;
        double step = reader->y.falling ? reader->y.spacing * y : reader->y.spacing * (field->height - 1 - y);
        double latitude = reader->y.falling ? reader->y.first - step : reader->y.first + step;
        if (reader->y.unit == AXIS_DEGREES)
            cell_y *= metres_a_degree;
        if (reader->x.unit == AXIS_DEGREES)
            cell_x *= metres_a_degree *
                      (reader->y.unit == AXIS_DEGREES ? fmax(cos(latitude * (double)RF_PI / 180), 0.01) : 1);
        float scale_x = (float)(reader->velocity_unit / (cell_x * second));
        float scale_y = -(float)(reader->velocity_unit / (cell_y * second));
        float *row = field->velocity + 2 * (size_t)y * (size_t)field->width;
        for (int x = 0; x < field->width; ++x, row += 2)
        {
            row[0] *= scale_x;
            row[1] *= scale_y;
        }
    }
}

static RfResult mask_holes(RfFlowField *field)
{
    RF_TRY(rf_flow_field_add_mask(field));
    for (size_t k = 0; k < (size_t)field->width * (size_t)field->height; ++k)
        if (isnan(field->velocity[2 * k]) || isnan(field->velocity[2 * k + 1]))
        {
            field->velocity[2 * k] = field->velocity[2 * k + 1] = 0;
            field->mask[k] = 0;
        }
    return RF_OK;
}

static void write_conventions(const Reader *reader, bool holes, char text[256])
{
    const Axis *x = &reader->x, *y = &reader->y;
    char cell[96];
    if (x->unit == AXIS_DEGREES)
        snprintf(cell, sizeof cell, "m/s over %.4g x %.4g degrees of 111.2 km", x->spacing, y->spacing);
    else if (x->unit == AXIS_NONE && y->unit == AXIS_NONE)
        snprintf(cell, sizeof cell, "units a second, one cell is one unit");
    else
        snprintf(cell, sizeof cell, "%s over %.4g x %.4g %s cells", x->unit == AXIS_METRES ? "m/s" : "units a second",
                 x->spacing, y->spacing, x->unit == AXIS_METRES ? "m" : "unit");
    snprintf(text, 256, "%s, at %g frames a second; %s%s", cell, (double)reader->source->options->fps,
             y->falling ? "rows run north to south, v was negated" : "y ran up: rows and v turned round",
             holes ? "; fill values masked" : "");
}

// A classic file holds every number of its variables as it is, unlike NetCDF 4, where what was never written takes no
// room: one that is too small for a moment is refused before memory for it is asked for.
static RfResult check_file_size(const Reader *reader)
{
    int format = 0;
    uint64_t bytes = 0, size = reader->source->size;
    nc_inq_format(reader->file, &format);
    if (format == NC_FORMAT_NETCDF4 || format == NC_FORMAT_NETCDF4_CLASSIC)
        return RF_OK;
    for (int c = 0; c < 2; ++c)
    {
        nc_type type = NC_BYTE;
        size_t number = 1;
        nc_inq_vartype(reader->file, reader->components[c].id, &type);
        nc_inq_type(reader->file, type, NULL, &number);
        bytes += (uint64_t)reader->x.count * reader->y.count * number;
    }
    if (size < bytes)
        return rf_fail(RF_BAD_INPUT, reader->source->path, "data",
                       "%zu x %zu cells need %llu bytes, the file has %llu: it is cut", reader->x.count,
                       reader->y.count, (unsigned long long)bytes, (unsigned long long)size);
    return RF_OK;
}

static RfResult take_moment(const Reader *reader, int moment, RfFlowMoment *out)
{
    RF_TRY(check_file_size(reader));
    RF_TRY(rf_flow_moment_create(reader->source, (int64_t)reader->x.count, (int64_t)reader->y.count, out));
    double *block = rf_allocate(BLOCK, sizeof *block);
    if (!block)
        return RF_OUT_OF_MEMORY;
    bool holes = false;
    RfResult result = take_component(reader, 0, moment, block, &out->field, &holes);
    if (result == RF_OK)
        result = take_component(reader, 1, moment, block, &out->field, &holes);
    rf_release(block);
    RF_TRY(result);
    if (holes)
        RF_TRY(mask_holes(&out->field));
    scale_rows(reader, &out->field);
    out->moment_count = (int)reader->moments;
    write_conventions(reader, holes, out->conventions);
    return RF_OK;
}

// The NetCDF library takes what lies behind the end of a classic file for zeros, but not behind that of memory.
static RfFlowSource map_classic(const RfFlowSource *source)
{
    RfFlowSource mapped = *source;
    struct stat status;
    char magic[3] = "";
    int file = source->bytes ? -1 : open(source->path, O_RDONLY | O_CLOEXEC);
    if (file >= 0 && fstat(file, &status) == 0 && pread(file, magic, 3, 0) == 3 && memcmp(magic, "CDF", 3) == 0)
    {
        void *bytes = mmap(NULL, (size_t)status.st_size, PROT_READ, MAP_PRIVATE, file, 0);
        if (bytes != MAP_FAILED)
        {
            mapped.bytes = bytes;
            mapped.size = (size_t)status.st_size;
        }
    }
    if (file >= 0)
        close(file);
    return mapped;
}

// Runs in the child, whose end unmaps the file.
static RfResult read_here(const RfFlowSource *given, int moment, RfFlowMoment *out)
{
    RfFlowSource source = map_classic(given);
    Reader *reader = rf_allocate_zero(1, sizeof *reader);
    if (!reader)
        return RF_OUT_OF_MEMORY;
    reader->source = &source;
    int status = source.bytes ? nc_open_mem("memory.nc", NC_NOWRITE, source.size, (void *)source.bytes, &reader->file)
                              : nc_open(source.path, NC_NOWRITE, &reader->file);
    // It does not open memory that ends within 8 bytes of the header.
    if (status != NC_NOERR && !given->bytes)
        status = nc_open(source.path, NC_NOWRITE, &reader->file);
    RfResult result = status == NC_NOERR ? RF_OK : netcdf_failed(reader, status, NULL);
    if (status == NC_NOERR)
    {
        result = describe(reader);
        if (result == RF_OK && (size_t)moment >= reader->moments)
            result = rf_fail(RF_BAD_INPUT, source.path, NULL, "has %zu moments now: it changed while it was read",
                             reader->moments);
        if (result == RF_OK)
            result = take_moment(reader, moment, out);
        nc_close(reader->file);
    }
    rf_release(reader);
    return result;
}

static RfResult netcdf_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    return rf_child_read(read_here, "the NetCDF library", source, moment, out);
}

#else

static RfResult netcdf_read(const RfFlowSource *source, int moment, RfFlowMoment *out)
{
    (void)moment;
    (void)out;
    return rf_fail(RF_UNSUPPORTED, source->path, NULL,
                   "this build reads no NetCDF: install libnetcdf-dev and build again");
}

#endif

const RfFlowFormat rf_flow_format_netcdf = {
    .name = "nc", .extensions = "nc,nc4,cdf", .probe = netcdf_probe, .read = netcdf_read, .by_path = true};
