// SPDX-License-Identifier: Apache-2.0
// Finds what pops in Lagrangian texture advection: blocks of 16 x 16 pixels that change most from one frame to the next
// when the motion is taken out, and the grids that gain and lose weight there.
//
//   bench_pops [FLOW] [EXEMPLAR] [size=WxH] [frames=120] [from=10] [worst=10] [preset=default|paper] [OPTION=VALUE ...]
//
// FLOW is "vortices" (the scene of the tests) or any flow that riffle reads; an OPTION is any of the method's. One
// summary line, then the worst blocks: their change in grey levels and, at their middle, the grids whose share of the
// picture changed most.

#include "measure/judgement.h"
#include "methods/lagrangian/lagrangian.h"
#include "riffle/riffle.h"
#include "support/scenes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    BLOCK = 16,
    MAX_IDS = 1 << 16,
    LISTED = 4,
    LAYERS = 4
};

typedef struct Settings
{
    const char *flow, *exemplar;
    int width, height, frames, from, worst;
    RfLagrangianOptions options;
} Settings;

// A grid's share of the picture at a block's middle, before and after a step.
typedef struct Shift
{
    int id;
    float before, after;
    char what[120];
} Shift;

typedef struct Event
{
    float change, swap;
    int frame, x, y;
    Shift shifts[LISTED];
} Event;

typedef struct Run
{
    Settings settings;
    RfFlow *flow;
    SceneMoments scene;
    RfImage *exemplar_image, *frame_image;
    RfExemplar *exemplar;
    RfLagrangian *lagrangian;
    RfImageView frame, layers[2];
    float *grey[2], *displacement, *backward, *changes;
    // Of all judged blocks; and what befell each grid.
    float *all;
    size_t all_count, all_capacity;
    Event *events;
    int event_count, event_capacity;
    char causes[MAX_IDS];
    double layer_sum, live, fading, born, contrast, with, without;
    int with_count, without_count;
} Run;

static void fail(const char *what)
{
    fprintf(stderr, "bench_pops: %s: %s\n", what, rf_last_error()->message);
    exit(1);
}

static bool set_option(RfLagrangianOptions *options, const char *name, const char *value)
{
    int count;
    const RfOption *table = rf_lagrangian_option_table(&count);
    for (int i = 0; i < count; ++i)
    {
        if (strcmp(table[i].name, name) != 0)
            continue;
        uint8_t *field = (uint8_t *)options + table[i].offset;
        if (table[i].kind == RF_OPTION_FLOAT)
            *(float *)(void *)field = (float)atof(value);
        else if (table[i].kind == RF_OPTION_UINT64)
            *(uint64_t *)(void *)field = strtoull(value, NULL, 10);
        else
            *(int *)(void *)field = atoi(value);
        return true;
    }
    return false;
}

static void set(Settings *s, const char *name, const char *value)
{
    if (strcmp(name, "size") == 0)
    {
        char *end;
        s->width = (int)strtol(value, &end, 10);
        s->height = *end == 'x' ? (int)strtol(end + 1, NULL, 10) : s->width;
    }
    else if (strcmp(name, "frames") == 0)
        s->frames = atoi(value);
    else if (strcmp(name, "from") == 0)
        s->from = atoi(value);
    else if (strcmp(name, "worst") == 0)
        s->worst = atoi(value);
    else if (strcmp(name, "preset") == 0)
        s->options = strcmp(value, "paper") == 0 ? rf_lagrangian_paper() : rf_lagrangian_defaults();
    else if (!set_option(&s->options, name, value))
    {
        fprintf(stderr, "bench_pops: no option called %s\n", name);
        exit(2);
    }
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.flow = "vortices",
                    .exemplar = "builtin:foam",
                    .width = 256,
                    .height = 256,
                    .frames = 120,
                    .from = 10,
                    .worst = 10,
                    .options = rf_lagrangian_defaults()};
    int names = 0;
    for (int i = 1; i < argc; ++i)
    {
        char *equals = strchr(argv[i], '=');
        if (!equals || strncmp(argv[i], "builtin:", 8) == 0)
        {
            *(names == 0 ? &s->flow : &s->exemplar) = argv[i];
            ++names;
            continue;
        }
        *equals = '\0';
        set(s, argv[i], equals + 1);
    }
}

static void *memory_of(size_t count, size_t size)
{
    void *memory = calloc(count, size);
    if (!memory)
        exit(1);
    return memory;
}

static void start(Run *run)
{
    const Settings *s = &run->settings;
    if (rf_image_read(s->exemplar, &run->exemplar_image) != RF_OK)
        fail(s->exemplar);
    RfImageView pixels = rf_image_view(run->exemplar_image);
    RfMapView map = {"colour", pixels.channels == 1 || pixels.channels == 3 ? RF_MAP_COLOUR : RF_MAP_DATA, pixels, 1};
    if (rf_exemplar_create(&map, 1, RF_TILING_AUTO, &run->exemplar) != RF_OK ||
        rf_lagrangian_create(run->exemplar, &s->options, &run->lagrangian) != RF_OK ||
        rf_image_create(s->width, s->height, pixels.channels, &run->frame_image) != RF_OK)
        fail("create");
    run->frame = rf_image_view(run->frame_image);
    if (strcmp(s->flow, "vortices") == 0)
        run->scene = scene_moments(scene_two_vortices, s->width, s->height);
    else if (rf_flow_open(s->flow, NULL, &run->flow) != RF_OK)
        fail(s->flow);
    size_t n = (size_t)s->width * (size_t)s->height;
    for (int i = 0; i < 2; ++i)
    {
        run->grey[i] = memory_of(n, sizeof(float));
        run->layers[i] = (RfImageView){memory_of(16 * n, sizeof(float)), s->width, s->height, 16, 16 * s->width};
    }
    run->displacement = memory_of(2 * n, sizeof(float));
    run->backward = memory_of(2 * n, sizeof(float));
    run->changes = memory_of(n, sizeof(float));
}

static void finish(Run *run)
{
    rf_lagrangian_destroy(run->lagrangian);
    rf_exemplar_destroy(run->exemplar);
    rf_image_destroy(run->exemplar_image);
    rf_image_destroy(run->frame_image);
    if (run->flow)
        rf_flow_close(run->flow);
    else
        scene_moments_free(&run->scene);
    for (int i = 0; i < 2; ++i)
    {
        free(run->grey[i]);
        free(run->layers[i].pixels);
    }
    free(run->displacement);
    free(run->backward);
    free(run->changes);
    free(run->all);
    free(run->events);
}

static RfFlowView flow_at(Run *run, int frame)
{
    RfFlowView view;
    if (!run->flow)
        return scene_step(&run->scene, frame);
    if (rf_flow_at(run->flow, frame, &view) != RF_OK)
        fail(run->settings.flow);
    return view;
}

// Why each grid was retired in this step.
static void note_causes(Run *run)
{
    const RfLagrangian *l = run->lagrangian;
    for (int i = 0; i < l->count; ++i)
    {
        const Grid *g = &l->grids[i];
        if (g->retired && g->retirement == l->time && g->id < MAX_IDS)
            run->causes[g->id] = g->folded ? 'f' : g->worn ? 'w' : g->uncovering ? 'u' : 'c';
    }
}

static void describe(const Run *run, Shift *shift)
{
    const RfLagrangian *l = run->lagrangian;
    snprintf(shift->what, sizeof shift->what, "gone");
    for (int i = 0; i < l->count; ++i)
    {
        const Grid *g = &l->grids[i];
        if ((int)g->id != shift->id)
            continue;
        int n = snprintf(shift->what, sizeof shift->what, "age %.0f fade-in %.1f others %.2f strain %.3f F %.2f q %.2f",
                         l->time - g->birth, (double)g->fade_in, (double)g->others, (double)g->strain,
                         (double)rf_lagrangian_grid_fade(g, l->time), (double)g->least_quality);
        if (g->retired)
            snprintf(shift->what + n, sizeof shift->what - (size_t)n, " retired %.0f ago (%c) fade-out %.1f",
                     l->time - g->retirement, run->causes[g->id], (double)g->fade_out);
    }
}

static float share_of(const float *layers, int id)
{
    for (int k = 0; k < LAYERS; ++k)
        if (layers[4 * k + 2] > 0 && (int)layers[4 * k + 3] == id)
            return layers[4 * k + 2];
    return 0;
}

static void keep_shift(Shift *shifts, Shift shift)
{
    int slot = LISTED;
    while (slot > 0 && fabsf(shift.after - shift.before) > fabsf(shifts[slot - 1].after - shifts[slot - 1].before))
        --slot;
    if (slot == LISTED)
        return;
    memmove(shifts + slot + 1, shifts + slot, (size_t)(LISTED - 1 - slot) * sizeof *shifts);
    shifts[slot] = shift;
}

// Shares at (x, y) of this frame and where that was in the frame before; half the sum of what they changed by.
static float find_shifts(const Run *run, int frame, int x, int y, Shift shifts[LISTED])
{
    int width = run->settings.width, height = run->settings.height;
    const float *back = run->backward + 2 * (y * width + x);
    int x0 = (int)lrintf((float)x + back[0]), y0 = (int)lrintf((float)y + back[1]);
    if (x0 < 0 || y0 < 0 || x0 >= width || y0 >= height)
        return 0;
    const float *after = run->layers[frame % 2].pixels + 16 * ((size_t)y * (size_t)width + (size_t)x);
    const float *before = run->layers[(frame + 1) % 2].pixels + 16 * ((size_t)y0 * (size_t)width + (size_t)x0);
    float moved = 0;
    for (int k = 0; k < 2 * LAYERS; ++k)
    {
        const float *layer = k < LAYERS ? after + 4 * k : before + 4 * (k - LAYERS);
        if (!(layer[2] > 0) || (k >= LAYERS && share_of(after, (int)layer[3]) > 0))
            continue;
        Shift shift = {.id = (int)layer[3]};
        shift.before = share_of(before, shift.id);
        shift.after = share_of(after, shift.id);
        moved += 0.5f * fabsf(shift.after - shift.before);
        keep_shift(shifts, shift);
    }
    return moved;
}

static void keep_event(Run *run, int frame, int block)
{
    int columns = run->settings.width / BLOCK;
    if (run->event_count == run->event_capacity)
    {
        run->event_capacity = 2 * run->event_capacity + 64;
        run->events = realloc(run->events, (size_t)run->event_capacity * sizeof *run->events);
    }
    Event *event = &run->events[run->event_count++];
    *event = (Event){.change = run->changes[block],
                     .frame = frame,
                     .x = block % columns * BLOCK + BLOCK / 2,
                     .y = block / columns * BLOCK + BLOCK / 2};
    event->swap = find_shifts(run, frame, event->x, event->y, event->shifts);
    for (int i = 0; i < LISTED; ++i)
        describe(run, &event->shifts[i]);
}

static void judge(Run *run, int frame, const RfFlowView *view)
{
    int width = run->settings.width, height = run->settings.height, blocks = width / BLOCK * (height / BLOCK);
    const uint8_t *mask = view->mask && view->width == width ? view->mask : NULL;
    RfFramePair pair = {width, height, run->grey[(frame + 1) % 2], run->grey[frame % 2], mask, mask};
    rf_measure_displacement(view, view->time - 1, width, height, run->displacement);
    if (rf_measure_invert(run->displacement, width, height, run->backward) != RF_OK ||
        rf_measure_block_changes(&pair, run->displacement, BLOCK, run->changes) != RF_OK)
        fail("measure");
    int worst = 0;
    for (int k = 0; k < blocks; ++k)
    {
        worst = run->changes[k] > run->changes[worst] ? k : worst;
        if (run->changes[k] < 0)
            continue;
        if (run->all_count == run->all_capacity)
        {
            run->all_capacity = 2 * run->all_capacity + 1024;
            run->all = realloc(run->all, run->all_capacity * sizeof *run->all);
        }
        run->all[run->all_count++] = run->changes[k];
    }
    bool births = rf_lagrangian_stats(run->lagrangian).born > 0;
    *(births ? &run->with : &run->without) += (double)run->changes[worst];
    ++*(births ? &run->with_count : &run->without_count);
    keep_event(run, frame, worst);
}

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static int compare_events(const void *a, const void *b)
{
    return -compare_floats(&((const Event *)a)->change, &((const Event *)b)->change);
}

static void report(Run *run)
{
    const Settings *s = &run->settings;
    size_t n = run->all_count;
    if (n == 0)
        return;
    qsort(run->all, n, sizeof *run->all, compare_floats);
    qsort(run->events, (size_t)run->event_count, sizeof *run->events, compare_events);
    double median = (double)run->all[n / 2], mean = 0, mean_worst = 0;
    for (size_t k = 0; k < n; ++k)
        mean += (double)run->all[k] / (double)n;
    for (int i = 0; i < run->event_count; ++i)
        mean_worst += (double)run->events[i].change / run->event_count;
    printf("%s,%s,mean %.2f,median %.2f,99%% %.2f,99.9%% %.2f,worst of a step %.2f (with births %.2f, without "
           "%.2f),worst of all %.2f,over median x%.1f,layers %.2f,live %.0f,fading %.0f,born %.2f\n",
           s->flow, s->exemplar, mean, median, (double)run->all[n * 99 / 100], (double)run->all[n * 999 / 1000],
           mean_worst, run->with / run->with_count, run->without / run->without_count, (double)run->all[n - 1],
           (double)run->all[n - 1] / median, run->layer_sum / s->frames, run->live / s->frames, run->fading / s->frames,
           run->born / s->frames);
    for (int i = 0; i < run->event_count && i < s->worst; ++i)
    {
        const Event *e = &run->events[i];
        printf("  frame %d at %d,%d: %.1f grey levels, %.0f %% of the picture replaced\n", e->frame, e->x, e->y,
               (double)e->change, 100 * (double)e->swap);
        for (int k = 0; k < LISTED && e->shifts[k].before != e->shifts[k].after; ++k)
            printf("    grid %d: %.2f -> %.2f, %s\n", e->shifts[k].id, (double)e->shifts[k].before,
                   (double)e->shifts[k].after, e->shifts[k].what);
    }
}

static void add_stats(Run *run)
{
    RfLagrangianStats stats = rf_lagrangian_stats(run->lagrangian);
    run->layer_sum += (double)stats.layers;
    run->live += stats.live;
    run->fading += stats.fading;
    run->born += stats.born;
}

int main(int argc, char **argv)
{
    static Run run;
    parse(argc, argv, &run.settings);
    start(&run);
    for (int f = 1; f <= run.settings.frames; ++f)
    {
        RfFlowView view = flow_at(&run, f);
        if (rf_lagrangian_step(run.lagrangian, &view, &run.frame) != RF_OK ||
            (f >= run.settings.from && rf_lagrangian_layers(run.lagrangian, &run.layers[f % 2]) != RF_OK))
            fail("step");
        note_causes(&run);
        add_stats(&run);
        rf_measure_grey(&run.frame, run.grey[f % 2]);
        if (f > run.settings.from)
            judge(&run, f, &view);
    }
    report(&run);
    finish(&run);
    return 0;
}
