// SPDX-License-Identifier: Apache-2.0
// A 2D flow as a row of moments, wherever they come from: one file a moment, one container of many, or a built-in
// scene. Two moments are kept, so that going forward reads each one once.
//
// Of a sequence, only the file at hand is ever in memory. NetCDF and .npy are opened again for each moment, and only
// that moment is read; an .npz is unpacked once and stays, since deflated data cannot be entered in the middle.
#include "in/flow_format.h"

#include "core/memory.h"
#include "core/progress.h"
#include "core/result.h"
#include "fluids/builtin.h"
#include "in/file.h"
#include "in/file_list.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

enum
{
    STEADY_FRAMES = 100,
    CACHED = 2
};

static const char builtin_prefix[] = "builtin:";

typedef struct CachedMoment
{
    /// -1: nothing here.
    int moment;
    RfFlowMoment content;
} CachedMoment;

struct RfFlow
{
    RfFlowReadOptions options;
    char variables[160];
    char path[4096];
    RfFlowScene *scene;
    /// A file a moment: numbered, or named by a list.
    RfSequence *sequence;
    RfFileList list;
    /// Of a container.
    RfBytes bytes;
    const RfFlowFormat *format;
    RfFlowInfo info;
    CachedMoment cache[CACHED];
};

RfFlowReadOptions rf_flow_read_defaults(void)
{
    return (RfFlowReadOptions){
        .struct_size = sizeof(RfFlowReadOptions), .fps = 24, .velocity_scale = 1, .moment_every = 1};
}

static RfResult check_options(const RfFlowReadOptions *options)
{
    RF_REQUIRE(options->struct_size == sizeof *options, "flow options: start from rf_flow_read_defaults()");
    RF_REQUIRE(options->fps > 0 && isfinite(options->fps), "fps %g: must be greater than 0", (double)options->fps);
    RF_REQUIRE(isfinite(options->velocity_scale), "velocity-scale must be a finite number");
    RF_REQUIRE(options->moment_every >= 1, "moment-every %d: must be at least 1", options->moment_every);
    if (!options->variables)
        return RF_OK;
    const char *comma = strchr(options->variables, ',');
    RF_REQUIRE(comma && comma != options->variables && comma[1] && !strchr(comma + 1, ',') &&
                   comma - options->variables < 64 && strlen(comma + 1) < 64,
               "variables \"%s\": two names with a comma between them, as u,v", options->variables);
    return RF_OK;
}

// ---- one moment --------------------------------------------------------------------------------------------------

static RfResult scale_and_check(const char *path, float scale, RfFlowField *field)
{
    size_t count = 2 * (size_t)field->width * (size_t)field->height;
    for (size_t k = 0; k < count; ++k)
    {
        field->velocity[k] *= scale;
        if (isfinite(field->velocity[k]))
            continue;
        char place[64];
        snprintf(place, sizeof place, "cell %zu, %zu", k / 2 % (size_t)field->width, k / 2 / (size_t)field->width);
        return rf_fail(RF_BAD_INPUT, path, place,
                       "velocity is not a finite number: only finite velocities can be followed");
    }
    return RF_OK;
}

static RfResult find_format(RfFlow *flow, const char *path)
{
    uint8_t head[RF_FLOW_PROBE_BYTES];
    FILE *file = fopen(path, "rbe");
    if (!file)
        return rf_fail(RF_UNREADABLE, path, NULL, "cannot be opened: %s", strerror(errno));
    size_t size = fread(head, 1, sizeof head, file);
    fclose(file);
    flow->format = rf_flow_format_find(path, head, size);
    return flow->format ? RF_OK : rf_last_error()->result;
}

static RfResult decode(RfFlow *flow, const char *path, const RfBytes *bytes, int moment, RfFlowMoment *out)
{
    RfFlowSource source = {path, bytes->data, bytes->size, &flow->options};
    RfResult result = flow->format->read(&source, moment, out);
    if (result != RF_OK)
        rf_flow_moment_free(out);
    return result;
}

// 0 if the moments do not come in files of their own.
static int file_count(const RfFlow *flow)
{
    return flow->sequence ? rf_sequence_count(flow->sequence) : flow->list.count;
}

static const char *moment_path(const RfFlow *flow, int moment)
{
    if (flow->sequence)
        return rf_sequence_path(flow->sequence, moment);
    return flow->list.count ? flow->list.paths[moment] : flow->path;
}

static RfResult read_file_of_many(RfFlow *flow, int moment, RfFlowMoment *out)
{
    const char *path = moment_path(flow, moment);
    RfBytes bytes = {0};
    RF_TRY(find_format(flow, path));
    if (!flow->format->by_path)
        RF_TRY(rf_bytes_read(path, 0, &bytes));
    RfResult result = decode(flow, path, &bytes, 0, out);
    rf_bytes_free(&bytes);
    if (result == RF_OK && out->moment_count > 1 && file_count(flow) > 1)
    {
        result = rf_fail(RF_BAD_INPUT, path, NULL, "has %d moments of its own: open it alone, not in a sequence",
                         out->moment_count);
        rf_flow_moment_free(out);
    }
    return result;
}

static RfResult read_moment(RfFlow *flow, int moment, RfFlowMoment *out)
{
    *out = (RfFlowMoment){0};
    if (file_count(flow) > 0)
        return read_file_of_many(flow, moment, out);
    if (!flow->scene)
        return decode(flow, flow->path, &flow->bytes, moment, out);
    snprintf(out->conventions, sizeof out->conventions, "cells a frame, y down");
    out->moment_count = rf_flow_scene_moment_count(flow->scene);
    return rf_flow_scene_moment(flow->scene, moment, &out->field);
}

static RfResult finish_moment(const RfFlow *flow, int moment, RfFlowMoment *content)
{
    const RfFlowField *field = &content->field;
    if (flow->info.width && (field->width != flow->info.width || field->height != flow->info.height))
        return rf_fail(RF_BAD_INPUT, moment_path(flow, moment), "header",
                       "%d x %d cells, but the first moment has %d x %d: all must have one size", field->width,
                       field->height, flow->info.width, flow->info.height);
    return scale_and_check(moment_path(flow, moment), flow->options.velocity_scale, &content->field);
}

static CachedMoment *cached(RfFlow *flow, int moment)
{
    for (int i = 0; i < CACHED; ++i)
        if (flow->cache[i].moment == moment)
            return &flow->cache[i];
    return NULL;
}

// The moment, from the cache or read in place of the one that is not `keep`.
static RfResult load(RfFlow *flow, int moment, int keep, CachedMoment **out)
{
    *out = cached(flow, moment);
    if (*out)
        return RF_OK;
    if (!flow->scene)
        RF_TRY(rf_progress("reading the flow", 0));
    CachedMoment *slot = &flow->cache[flow->cache[0].moment == keep];
    rf_flow_moment_free(&slot->content);
    *slot = (CachedMoment){.moment = -1};
    RF_TRY(read_moment(flow, moment, &slot->content));
    RfResult result = finish_moment(flow, moment, &slot->content);
    if (result != RF_OK)
    {
        rf_flow_moment_free(&slot->content);
        return result;
    }
    slot->moment = moment;
    *out = slot;
    return RF_OK;
}

// ---- opening -----------------------------------------------------------------------------------------------------

static bool is_directory(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && S_ISDIR(status.st_mode);
}

static bool is_file(const char *path)
{
    struct stat status;
    return stat(path, &status) == 0 && S_ISREG(status.st_mode);
}

// A PNG counts only with its JSON beside it.
static bool can_be_flow(const char *directory, const char *name, const char *extension)
{
    const char *dot = strrchr(name, '.');
    if (!dot || dot == name || strcasecmp(dot + 1, extension) != 0)
        return false;
    char companion[4096];
    int length = snprintf(companion, sizeof companion, "%s/%.*s.json", directory, (int)(dot - name), name);
    return strcmp(extension, "png") != 0 || ((size_t)length < sizeof companion && is_file(companion));
}

static bool has_file_with(const char *directory, const char *extension)
{
    DIR *folder = opendir(directory);
    bool found = false;
    for (struct dirent *entry; folder && !found && (entry = readdir(folder));)
        found = can_be_flow(directory, entry->d_name, extension);
    if (folder)
        closedir(folder);
    return found;
}

// A directory may hold other things beside the flow: the first format that is there is taken, and only it.
static RfResult open_directory(RfFlow *flow)
{
    const char *extension;
    for (int i = 0; (extension = rf_flow_format_extension(i)) != NULL; ++i)
        if (has_file_with(flow->path, extension))
            return rf_sequence_open(flow->path, extension, &flow->sequence);
    return rf_fail(
        RF_BAD_INPUT, flow->path, NULL,
        "the directory holds no 2D flow: looked for flo, npy, exr, vti, vec, txt (PIV) files, and png beside json");
}

static RfResult open_single(RfFlow *flow)
{
    RF_TRY(find_format(flow, flow->path));
    if (flow->format->by_path)
        return RF_OK;
    RF_TRY(rf_bytes_read(flow->path, 0, &flow->bytes));
    if (!flow->format->unpack)
        return RF_OK;
    RfFlowSource source = {flow->path, flow->bytes.data, flow->bytes.size, &flow->options};
    RfBytes unpacked;
    RF_TRY(flow->format->unpack(&source, &unpacked));
    rf_bytes_free(&flow->bytes);
    flow->bytes = unpacked;
    return RF_OK;
}

static RfResult open_source(RfFlow *flow)
{
    size_t prefix = sizeof builtin_prefix - 1;
    if (strncmp(flow->path, builtin_prefix, prefix) == 0)
        return rf_flow_scene_create(flow->path + prefix, &flow->scene);
    if (is_directory(flow->path))
        return open_directory(flow);
    if (rf_file_list_is(flow->path))
        return rf_file_list_read(flow->path, &flow->list);
    if (is_file(flow->path))
        return open_single(flow);
    return rf_sequence_open(flow->path, NULL, &flow->sequence);
}

static void measure_speed(const RfFlowField *field, RfFlowInfo *info)
{
    size_t cells = (size_t)field->width * (size_t)field->height;
    double sum = 0;
    size_t fluid = 0;
    for (size_t k = 0; k < cells; ++k)
    {
        if (field->mask && !field->mask[k])
            continue;
        float speed = hypotf(field->velocity[2 * k], field->velocity[2 * k + 1]);
        info->max_speed = fmaxf(info->max_speed, speed);
        sum += (double)speed;
        ++fluid;
    }
    info->mean_speed = fluid ? (float)(sum / (double)fluid) : 0;
}

static int number_step(const RfSequence *sequence)
{
    int count = sequence ? rf_sequence_count(sequence) : 0;
    int step = count > 1 ? rf_sequence_number(sequence, 1) - rf_sequence_number(sequence, 0) : 1;
    for (int i = 2; i < count; ++i)
        if (rf_sequence_number(sequence, i) - rf_sequence_number(sequence, i - 1) != step)
            return 0;
    return step;
}

static RfResult count_moments(RfFlow *flow, const RfFlowMoment *first)
{
    RfFlowInfo *info = &flow->info;
    info->first_frame = 1;
    info->number_step = number_step(flow->sequence);
    info->moment_count = first->moment_count;
    if (file_count(flow) > 0)
        info->moment_count = file_count(flow);
    if (flow->sequence)
        info->first_frame = rf_sequence_number(flow->sequence, 0);
    else if (info->moment_count > 1)
        info->first_frame = 0;
    int64_t last = info->moment_count < 2
                       ? (int64_t)info->first_frame + STEADY_FRAMES - 1
                       : info->first_frame + (int64_t)(info->moment_count - 1) * flow->options.moment_every;
    if (last > INT_MAX)
        return rf_fail(RF_BAD_INPUT, flow->path, NULL, "the last frame would be %lld: use a smaller --moment-every",
                       (long long)last);
    info->last_frame = (int)last;
    return RF_OK;
}

static RfResult describe(RfFlow *flow)
{
    CachedMoment *first;
    RF_TRY(load(flow, 0, -1, &first));
    const RfFlowMoment *content = &first->content;
    RfFlowInfo *info = &flow->info;
    info->width = content->field.width;
    info->height = content->field.height;
    info->has_mask = content->field.mask != NULL;
    info->filled_vectors = content->filled_vectors;
    snprintf(info->format, sizeof info->format, "%s", flow->scene ? "builtin" : flow->format->name);
    snprintf(info->conventions, sizeof info->conventions, "%s", content->conventions);
    measure_speed(&content->field, info);
    RF_TRY(count_moments(flow, content));
    // A steady flow never reads its file again: its only moment stays in the cache.
    if (info->moment_count == 1)
        rf_bytes_free(&flow->bytes);
    return RF_OK;
}

RfResult rf_flow_open(const char *path, const RfFlowReadOptions *options, RfFlow **out)
{
    RF_REQUIRE(path && out, "rf_flow_open: path and out are needed");
    *out = NULL;
    RfFlowReadOptions chosen = options ? *options : rf_flow_read_defaults();
    RF_TRY(check_options(&chosen));
    RF_REQUIRE(strlen(path) < sizeof((RfFlow *)0)->path, "rf_flow_open: the path is too long");
    RfFlow *flow = rf_allocate_zero(1, sizeof *flow);
    if (!flow)
        return RF_OUT_OF_MEMORY;
    flow->options = chosen;
    strcpy(flow->path, path);
    if (chosen.variables)
    {
        snprintf(flow->variables, sizeof flow->variables, "%s", chosen.variables);
        flow->options.variables = flow->variables;
    }
    for (int i = 0; i < CACHED; ++i)
        flow->cache[i].moment = -1;
    RfResult result = open_source(flow);
    if (result == RF_OK)
        result = describe(flow);
    if (result == RF_OK)
        *out = flow;
    else
        rf_flow_close(flow);
    return result;
}

void rf_flow_close(RfFlow *flow)
{
    if (!flow)
        return;
    for (int i = 0; i < CACHED; ++i)
        rf_flow_moment_free(&flow->cache[i].content);
    rf_bytes_free(&flow->bytes);
    rf_sequence_destroy(flow->sequence);
    rf_file_list_free(&flow->list);
    rf_flow_scene_destroy(flow->scene);
    rf_release(flow);
}

RfFlowInfo rf_flow_info(const RfFlow *flow)
{
    return flow->info;
}

// The moment at which the step to `frame` begins: moments lie moment_every frames apart, so every step of one frame
// lies between two neighbours.
static int moment_before(const RfFlow *flow, int frame)
{
    int64_t since = (int64_t)frame - 1 - flow->info.first_frame;
    int64_t moment = since > 0 ? since / flow->options.moment_every : 0;
    int64_t last = flow->info.moment_count ? flow->info.moment_count - 1 : INT_MAX - 1;
    return (int)(moment < last ? moment : last);
}

RfResult rf_flow_at(RfFlow *flow, int frame, RfFlowView *out)
{
    RF_REQUIRE(flow && out, "rf_flow_at: flow and out are needed");
    int m = moment_before(flow, frame);
    bool last = flow->info.moment_count && m == flow->info.moment_count - 1;
    CachedMoment *now, *next = NULL;
    RF_TRY(load(flow, m, last ? m : m + 1, &now));
    if (!last)
        RF_TRY(load(flow, m + 1, m, &next));

    double start = (double)flow->info.first_frame + (double)m * flow->options.moment_every;
    *out = rf_flow_field_view(&now->content.field, start);
    out->time = frame;
    if (!next)
        return RF_OK;
    out->next_velocity = next->content.field.velocity;
    out->next_time = start + flow->options.moment_every;
    if (out->time >= out->next_time)
        out->mask = next->content.field.mask;
    return RF_OK;
}
