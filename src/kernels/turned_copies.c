// SPDX-License-Identifier: Apache-2.0
#include "kernels/turned_copies.h"
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/result.h"
#include "kernels/principal.h"

#include <math.h>

enum
{
    // Exemplars with longer sides are searched on a coarser level.
    SEARCHED_SIDE = 256,
    // As long as the shorter ones keep this.
    LEAST_SIDE = 64,
    // Of the square by which a pixel's look is told: about that of a patch.
    LOOK_RADIUS = 4
};

static_assert((int)RF_LOOKS == (int)RF_PATCH_GROUPS, "patches are priced by their look");

typedef struct Turning
{
    RfTurnedCopies *copies;
    /// Of one worker each: room for the largest copy.
    float *pixels;
    uint8_t *valid, *groups;
    size_t room;
    RfResult result;
} Turning;

float rf_turned_copy_direction(const RfTurnedCopies *copies, int copy)
{
    return 2 * RF_PI * (float)copy / (float)copies->count;
}

int rf_turned_copy_of(const RfTurnedCopies *copies, float direction)
{
    return rf_wrap_int(rf_nearest_int(direction * (float)copies->count / (2 * RF_PI)), copies->count);
}

static RfResult find_jacobians(RfTurnedCopies *copies)
{
    copies->jacobians = rf_allocate((size_t)copies->count, sizeof *copies->jacobians);
    if (!copies->jacobians)
        return RF_OUT_OF_MEMORY;
    for (int k = 0; k < copies->count; ++k)
    {
        float angle = rf_turned_copy_direction(copies, k) - copies->direction;
        copies->jacobians[k] = (RfJacobian){cosf(angle), sinf(angle), -sinf(angle), cosf(angle)};
    }
    return RF_OK;
}

static RfVec2 middle_of(const RfTurnedCopies *copies, int copy)
{
    const RfPatchPicture *p = &copies->pictures[copy];
    return (RfVec2){0.5f * (float)(p->width - 1), 0.5f * (float)(p->height - 1)};
}

static RfVec2 exemplar_middle(const RfTurnedCopies *copies)
{
    const RfExemplar *e = copies->sampler->exemplar;
    return (RfVec2){0.5f * (float)e->width, 0.5f * (float)e->height};
}

// j: that of the copy.
static RfVec2 source_of(const RfTurnedCopies *copies, int copy, RfJacobian j, RfVec2 point)
{
    RfVec2 step = rf_vec2_sub(point, middle_of(copies, copy));
    step = (RfVec2){step.x * (float)copies->size, step.y * (float)copies->size};
    return rf_vec2_add(exemplar_middle(copies), rf_jacobian_step(j, step));
}

RfVec2 rf_turned_copy_source(const RfTurnedCopies *copies, int copy, RfVec2 point)
{
    return source_of(copies, copy, rf_turned_copy_jacobian(copies, copy), point);
}

RfVec2 rf_turned_copy_point(const RfTurnedCopies *copies, int copy, RfVec2 source)
{
    RfJacobian j = rf_turned_copy_jacobian(copies, copy);
    RfVec2 step = rf_vec2_sub(source, exemplar_middle(copies));
    RfVec2 back = {j.xx * step.x + j.yx * step.y, j.xy * step.x + j.yy * step.y};
    float size = (float)copies->size;
    return rf_vec2_add(middle_of(copies, copy), (RfVec2){back.x / size, back.y / size});
}

void rf_turned_copies_compared(const RfTurnedCopies *copies, const float *pixel, float *values)
{
    const RfComparison *k = copies->comparison;
    float own[RF_MAX_EXEMPLAR_CHANNELS];
    for (int c = 0; c < k->channels; ++c)
        own[c] = rf_comparison_value(k, c, pixel);
    for (int a = 0; a < k->channels; ++a)
    {
        values[a] = 0;
        for (int c = 0; c < k->channels; ++c)
            values[a] += copies->axes[a * k->channels + c] * own[c];
    }
}

static void find_axes(RfTurnedCopies *copies)
{
    const RfComparison *k = copies->comparison;
    const RfExemplar *e = k->exemplar;
    double sums[RF_MAX_EXEMPLAR_CHANNELS] = {0};
    double products[RF_MAX_EXEMPLAR_CHANNELS * RF_MAX_EXEMPLAR_CHANNELS] = {0};
    int n = k->channels;
    size_t pixels = (size_t)e->width * (size_t)e->height;
    for (size_t i = 0; i < pixels; ++i)
        for (int a = 0; a < n; ++a)
        {
            double value = (double)rf_comparison_value(k, a, e->pixels + i * (size_t)e->channels);
            sums[a] += value;
            for (int b = 0; b < n; ++b)
                products[a * n + b] += value * (double)rf_comparison_value(k, b, e->pixels + i * (size_t)e->channels);
        }
    for (int a = 0; a < n; ++a)
        for (int b = 0; b < n; ++b)
            products[a * n + b] -= sums[a] * sums[b] / (double)pixels;
    for (int a = 0; a < n; ++a)
        copies->variance += (float)(products[a * n + a] / (double)pixels);
    rf_principal_axes(products, n, copies->axes);
}

// By the first principal axis.
static RfResult find_looks(RfTurnedCopies *copies)
{
    const RfExemplar *e = copies->comparison->exemplar;
    size_t pixels = (size_t)e->width * (size_t)e->height;
    float *values = rf_allocate(pixels, sizeof *values);
    copies->looks = rf_allocate(pixels, 1);
    RfResult result = values && copies->looks ? RF_OK : RF_OUT_OF_MEMORY;
    for (size_t i = 0; i < pixels && result == RF_OK; ++i)
    {
        float compared[RF_MAX_EXEMPLAR_CHANNELS];
        rf_turned_copies_compared(copies, e->pixels + i * (size_t)e->channels, compared);
        values[i] = compared[0];
    }
    if (result == RF_OK)
        result = rf_looks_find(values, e->width, e->height, e->tiles, LOOK_RADIUS, copies->looks);
    rf_release(values);
    return result;
}

int rf_turned_copies_look(const RfTurnedCopies *copies, RfVec2 source)
{
    const RfExemplar *e = copies->comparison->exemplar;
    int x = rf_border_int(rf_nearest_int(source.x - 0.5f), e->width, e->tiles);
    int y = rf_border_int(rf_nearest_int(source.y - 0.5f), e->height, e->tiles);
    return copies->looks[(ptrdiff_t)y * e->width + x];
}

static bool is_valid(const RfTurnedCopies *copies, RfVec2 source)
{
    const RfExemplar *e = copies->sampler->exemplar;
    float margin = e->tiles ? 0 : 0.5f * (float)copies->size - 0.01f; // a copy that is not turned has all its pixels
    return source.x >= margin && source.y >= margin && source.x <= (float)e->width - margin &&
           source.y <= (float)e->height - margin;
}

static void make_copy(void *context, int copy, int worker)
{
    Turning *t = context;
    RfTurnedCopies *copies = t->copies;
    RfPatchPicture *p = &copies->pictures[copy];
    int width = p->width, height = p->height, channels = copies->comparison->channels;
    float *pixels = t->pixels + (size_t)worker * t->room * (size_t)channels;
    uint8_t *valid = t->valid + (size_t)worker * t->room, *groups = t->groups + (size_t)worker * t->room;
    RfJacobian j = rf_turned_copy_jacobian(copies, copy);
    float size = (float)copies->size;
    RfJacobian wide = {j.xx * size, j.xy * size, j.yx * size, j.yy * size};
    bool tiles = copies->sampler->exemplar->tiles;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            float values[RF_SAMPLE_CHANNELS];
            RfVec2 source = source_of(copies, copy, j, (RfVec2){(float)x, (float)y});
            size_t pixel = (size_t)y * (size_t)width + (size_t)x;
            valid[pixel] = is_valid(copies, source);
            groups[pixel] = (uint8_t)rf_turned_copies_look(copies, source);
            if (!valid[pixel] && !tiles)
                continue;
            rf_sampler_at(copies->sampler, source, wide, values);
            rf_turned_copies_compared(copies, values, pixels + pixel * (size_t)channels);
        }
    RfPatchRoom room = tiles ? RF_ROOM_OF_MIDDLE : RF_ROOM_OF_ALL;
    if (rf_patch_picture_create(pixels, width, height, channels, valid, groups, room, p) != RF_OK)
        t->result = RF_OUT_OF_MEMORY;
}

// Round numbers of pixels, of the exemplar's own parity, so that a copy that is not turned is the exemplar.
static int side_of(float length, int size, int own)
{
    int side = (int)ceilf(length / (float)size - 0.01f), parity = own / size % 2;
    return side + (side % 2 != parity);
}

static size_t set_sizes(RfTurnedCopies *copies, int box)
{
    const RfExemplar *e = copies->sampler->exemplar;
    size_t most = 0;
    int beyond = e->tiles ? box / copies->size + 2 : 0;
    for (int k = 0; k < copies->count; ++k)
    {
        RfJacobian j = rf_turned_copy_jacobian(copies, k);
        float c = fabsf(j.xx), s = fabsf(j.xy), width = (float)e->width, height = (float)e->height;
        RfPatchPicture *p = &copies->pictures[k];
        p->width = side_of(c * width + s * height, copies->size, e->width) + beyond / 2 * 2;
        p->height = side_of(s * width + c * height, copies->size, e->height) + beyond / 2 * 2;
        size_t pixels = (size_t)p->width * (size_t)p->height;
        most = pixels > most ? pixels : most;
    }
    return most;
}

static RfResult make_copies(RfTurnedCopies *copies, int box)
{
    copies->pictures = rf_allocate_zero((size_t)copies->count, sizeof *copies->pictures);
    if (!copies->pictures)
        return RF_OUT_OF_MEMORY;
    Turning turning = {copies, NULL, NULL, NULL, set_sizes(copies, box), RF_OK};
    size_t pixels = (size_t)rf_threads() * turning.room;
    turning.pixels = rf_allocate(pixels * (size_t)copies->comparison->channels, sizeof *turning.pixels);
    turning.valid = rf_allocate(pixels, 1);
    turning.groups = rf_allocate(pixels, 1);
    if (turning.pixels && turning.valid && turning.groups)
        rf_parallel_for(copies->count, make_copy, &turning);
    else
        turning.result = RF_OUT_OF_MEMORY;
    rf_release(turning.pixels);
    rf_release(turning.valid);
    rf_release(turning.groups);
    return turning.result;
}

RfResult rf_turned_copies_create(const RfSampler *sampler, const RfComparison *comparison, float direction, int count,
                                 int box, RfTurnedCopies *out)
{
    const RfExemplar *e = sampler->exemplar;
    *out = (RfTurnedCopies){
        .count = count, .size = 1, .direction = direction, .sampler = sampler, .comparison = comparison};
    while (rf_max_int(e->width, e->height) > SEARCHED_SIDE * out->size &&
           rf_min_int(e->width, e->height) >= LEAST_SIDE * 2 * out->size)
        out->size *= 2;
    find_axes(out);
    RfResult result = find_jacobians(out);
    if (result == RF_OK)
        result = find_looks(out);
    if (result == RF_OK)
        result = make_copies(out, box);
    if (result != RF_OK)
        rf_turned_copies_free(out);
    return result;
}

void rf_turned_copies_free(RfTurnedCopies *copies)
{
    for (int k = 0; k < copies->count && copies->pictures; ++k)
        rf_patch_picture_free(&copies->pictures[k]);
    rf_release(copies->pictures);
    rf_release(copies->looks);
    rf_release(copies->jacobians);
    *copies = (RfTurnedCopies){0};
}
