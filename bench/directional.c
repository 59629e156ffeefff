// SPDX-License-Identifier: Apache-2.0
// Directional moving texture: what a frame costs, how sharp it stays, how well it lies along the flow.
//
//   bench_directional [speed] [sharpness] [angles] [frames=200] [size=512] [exemplar=builtin:canes?size=128]
//                     [plot=FILE.svg]
//
// Without a word all three. CSV each:
//   speed      flow,threads,first ms,ms (median after the first),worst ms,move,fill,renew (medians),filled,renewed
//   (means
//              of the parts of all pixels): the vortex, a solid rotation, the double gyre, the cylinder, turbulence.
//   sharpness  frame,mean gradient in the vortex in parts of that of the first frame,the same without renewal (figure 7
//              of Wang et al. 2005), which are also plotted.
//   angles     flow,copies,frame,median angle between the stripes (structure tensor of 9 x 9 pixels) and the flow,
//              degrees: the vortex and the unsteady gyre.
#include "bench.h"
#include "riffle/riffle.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    THREADS = 2,
    STAGES = 4,
    MAX_FRAMES = 2000,
    EVERY = 5
};

typedef struct Settings
{
    int frames, size;
    const char *exemplar, *plot;
    bool speed, sharpness, angles;
} Settings;

static const double PI = 3.14159265358979;

// ---- running

/// Sees every frame.
typedef void Watch(void *context, int frame, double seconds, const RfDirectional *d, const RfImageView *view,
                   const RfFlowView *flow);

static RfExemplar *read_exemplar(const Settings *s, int *channels)
{
    RfImage *image;
    RfExemplar *exemplar;
    bench_require(rf_image_read(s->exemplar, &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    *channels = map.image.channels;
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar));
    rf_image_destroy(image);
    return exemplar;
}

static void run(const Settings *s, const char *flow_name, const RfDirectionalOptions *options, Watch *watch,
                void *context)
{
    char path[128];
    int channels;
    RfExemplar *exemplar = read_exemplar(s, &channels);
    RfFlowReadOptions reading = rf_flow_read_defaults();
    RfFlow *flow;
    RfDirectional *d;
    RfImage *frame;
    snprintf(path, sizeof path, "builtin:%s?size=%dx%d", flow_name, s->size, s->size);
    bench_require(rf_flow_open(path, &reading, &flow));
    bench_require(rf_directional_create(exemplar, options, &d));
    bench_require(rf_image_create(s->size, s->size, channels, &frame));
    RfImageView view = rf_image_view(frame);
    for (int f = 0; f < s->frames; ++f)
    {
        RfFlowView now;
        bench_require(rf_flow_at(flow, rf_flow_info(flow).first_frame + f, &now));
        double start = bench_now();
        bench_require(rf_directional_step(d, &now, &view));
        watch(context, f, 1e-3 * (bench_now() - start), d, &view, &now);
    }
    rf_image_destroy(frame);
    rf_directional_destroy(d);
    rf_flow_close(flow);
    rf_exemplar_destroy(exemplar);
}

// ---- speed

typedef struct Times
{
    int count;
    double first, filled, renewed, of[STAGES][MAX_FRAMES];
} Times;

static void watch_times(void *context, int frame, double seconds, const RfDirectional *d, const RfImageView *view,
                        const RfFlowView *flow)
{
    (void)view, (void)flow;
    Times *t = context;
    RfDirectionalStats stats = rf_directional_stats(d);
    if (frame == 0)
    {
        t->first = seconds;
        return;
    }
    const double parts[STAGES] = {seconds, stats.move_seconds, stats.fill_seconds, stats.renew_seconds};
    for (int i = 0; i < STAGES; ++i)
        t->of[i][t->count] = parts[i];
    ++t->count;
    t->filled += (double)stats.filled;
    t->renewed += (double)stats.renewed;
}

static void measure_speed(const Settings *s)
{
    static const char *const flows[] = {"vortex", "rotation", "gyre", "cylinder", "turbulence"};
    static Times times;
    RfDirectionalOptions options = rf_directional_defaults();
    printf("flow,threads,first ms,ms,worst ms,move ms,fill ms,renew ms,filled,renewed\n");
    for (int f = 0; f < 5; ++f)
        for (int threads = 1; threads <= THREADS; ++threads)
        {
            rf_set_threads(threads);
            times = (Times){0};
            run(s, flows[f], &options, watch_times, &times);
            double median[STAGES], worst = 0;
            for (int i = 0; i < STAGES; ++i)
            {
                median[i] = 1e3 * bench_median(times.of[i], times.count);
                worst = i == 0 ? 1e3 * times.of[0][times.count - 1] : worst;
            }
            printf("%s,%d,%.0f,%.1f,%.1f,%.1f,%.1f,%.1f,%.4f,%.4f\n", flows[f], threads, 1e3 * times.first, median[0],
                   worst, median[1], median[2], median[3], times.filled / times.count, times.renewed / times.count);
            fflush(stdout);
        }
    rf_set_threads(0);
}

// ---- sharpness

static double grey(const RfImageView *v, int x, int y)
{
    const float *p = v->pixels + y * v->row_stride + (ptrdiff_t)x * v->channels;
    double sum = 0;
    for (int c = 0; c < v->channels; ++c)
        sum += (double)p[c];
    return sum / v->channels;
}

static void watch_gradients(void *context, int frame, double seconds, const RfDirectional *d, const RfImageView *view,
                            const RfFlowView *flow)
{
    (void)seconds, (void)d, (void)flow;
    double *gradients = context, sum = 0;
    for (int y = 0; y + 1 < view->height && frame % EVERY == 0; ++y)
        for (int x = 0; x + 1 < view->width; ++x)
            sum += hypot(grey(view, x + 1, y) - grey(view, x, y), grey(view, x, y + 1) - grey(view, x, y));
    if (frame % EVERY == 0)
        gradients[frame / EVERY] = sum;
}

static void draw_curve(FILE *out, const double *values, int count, const char *colour, const char *label, int row)
{
    fprintf(out, "<path fill=\"none\" stroke=\"%s\" stroke-width=\"2\" d=\"", colour);
    for (int i = 0; i < count; ++i)
        fprintf(out, "%c%.1f %.1f", i ? 'L' : 'M', 60 + 540.0 * i / (count - 1),
                340 - 280 * (values[i] / values[0] - 0.8) / 0.4);
    fprintf(out, "\"/>\n<text x=\"80\" y=\"%d\" fill=\"%s\">%s</text>\n", 300 + 18 * row, colour, label);
}

static void draw_plot(const Settings *s, const double *renewed, const double *kept, int count)
{
    FILE *out = fopen(s->plot, "w");
    if (!out)
    {
        fprintf(stderr, "bench_directional: %s cannot be written\n", s->plot);
        exit(1);
    }
    fprintf(out, "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 640 390\" font-family=\"sans-serif\" "
                 "font-size=\"13\">\n<rect width=\"640\" height=\"390\" fill=\"#fff\"/>\n"
                 "<text x=\"60\" y=\"26\" font-size=\"16\">Mean gradient of canes in the vortex, frame 1 = 1</text>\n");
    for (int k = 0; k <= 4; ++k)
        fprintf(out,
                "<path d=\"M60 %dH600\" stroke=\"#ddd\"/><text x=\"52\" y=\"%d\" text-anchor=\"end\">%.1f</text>\n",
                340 - 70 * k, 344 - 70 * k, 0.8 + 0.1 * k);
    for (int k = 0; k <= 4; ++k)
        fprintf(out, "<text x=\"%d\" y=\"362\" text-anchor=\"middle\">%d</text>\n", 60 + 135 * k,
                1 + (count - 1) * EVERY * k / 4);
    fprintf(out, "<text x=\"330\" y=\"382\" text-anchor=\"middle\">frame</text>\n");
    draw_curve(out, renewed, count, "#0969da", "cells that were blended twice are replaced", 0);
    draw_curve(out, kept, count, "#d1242f", "they are not (--renew-after 0)", 1);
    fprintf(out, "</svg>\n");
    if (fclose(out) != 0)
    {
        fprintf(stderr, "bench_directional: %s cannot be written\n", s->plot);
        exit(1);
    }
}

static void measure_sharpness(const Settings *s)
{
    static double gradients[2][MAX_FRAMES / EVERY + 1];
    for (int kept = 0; kept <= 1; ++kept)
    {
        RfDirectionalOptions options = rf_directional_defaults();
        options.renew_after = kept ? 0 : options.renew_after;
        run(s, "vortex", &options, watch_gradients, gradients[kept]);
    }
    int count = (s->frames - 1) / EVERY + 1;
    printf("frame,gradient,gradient without renewal\n");
    for (int i = 0; i < count; ++i)
        printf("%d,%.4f,%.4f\n", 1 + i * EVERY, gradients[0][i] / gradients[0][0], gradients[1][i] / gradients[1][0]);
    if (s->plot)
        draw_plot(s, gradients[0], gradients[1], count);
}

// ---- angles

enum
{
    HALF = 4
};

static double angle_at(const RfImageView *v, const RfFlowView *flow, int x, int y)
{
    double xx = 0, xy = 0, yy = 0;
    for (int j = y - HALF; j <= y + HALF; ++j)
        for (int i = x - HALF; i <= x + HALF; ++i)
        {
            double gx = grey(v, i + 1, j) - grey(v, i - 1, j), gy = grey(v, i, j + 1) - grey(v, i, j - 1);
            xx += gx * gx, xy += gx * gy, yy += gy * gy;
        }
    // Gradients lie across the stripes.
    double stripes = 0.5 * atan2(2 * xy, xx - yy) + PI / 2;
    ptrdiff_t pixel = (ptrdiff_t)y * flow->width + x;
    const float *u = flow->velocity + 2 * pixel, *w = flow->next_velocity ? flow->next_velocity + 2 * pixel : u;
    double length = flow->next_time - flow->velocity_time,
           t = length > 0 ? (flow->time - flow->velocity_time) / length : 0;
    double vx = (double)u[0] + t * (double)(w[0] - u[0]), vy = (double)u[1] + t * (double)(w[1] - u[1]);
    double off = stripes - atan2(vy, vx);
    return fabs(off - PI * floor(off / PI + 0.5)) * 180 / PI;
}

typedef struct Angles
{
    const char *flow;
    int copies;
} Angles;

static void watch_angles(void *context, int frame, double seconds, const RfDirectional *d, const RfImageView *view,
                         const RfFlowView *flow)
{
    (void)seconds, (void)d;
    const Angles *a = context;
    if (frame != 0 && frame != 29 && frame != 99 && frame != 199)
        return;
    int count = 0;
    double *angles = malloc((size_t)view->width * (size_t)view->height * sizeof *angles);
    for (int y = HALF + 1; y + HALF + 1 < view->height && angles; y += 2)
        for (int x = HALF + 1; x + HALF + 1 < view->width; x += 2)
            angles[count++] = angle_at(view, flow, x, y);
    if (angles)
        printf("%s,%d,%d,%.2f\n", a->flow, a->copies, frame + 1, bench_median(angles, count));
    free(angles);
}

static void measure_angles(const Settings *s)
{
    static const char *const flows[] = {"vortex", "gyre"};
    printf("flow,copies,frame,median angle\n");
    for (int f = 0; f < 2; ++f)
        for (int copies = 24; copies <= 48; copies += 24)
        {
            RfDirectionalOptions options = rf_directional_defaults();
            options.rotations = copies;
            Angles angles = {flows[f], copies};
            run(s, flows[f], &options, watch_angles, &angles);
        }
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.frames = 200, .size = 512, .exemplar = "builtin:canes?size=128"};
    for (int i = 1; i < argc; ++i)
    {
        const char *value;
        if (strcmp(argv[i], "speed") == 0)
            s->speed = true;
        else if (strcmp(argv[i], "sharpness") == 0)
            s->sharpness = true;
        else if (strcmp(argv[i], "angles") == 0)
            s->angles = true;
        else if ((value = bench_value(argv[i], "frames")))
            s->frames = atoi(value);
        else if ((value = bench_value(argv[i], "size")))
            s->size = atoi(value);
        else if ((value = bench_value(argv[i], "exemplar")))
            s->exemplar = value;
        else if ((value = bench_value(argv[i], "plot")))
            s->plot = value;
        else
        {
            fprintf(stderr, "bench_directional: no option called %s\n", argv[i]);
            exit(2);
        }
    }
    if (!s->speed && !s->sharpness && !s->angles)
        s->speed = s->sharpness = s->angles = true;
    if (s->frames < 2 * EVERY || s->frames > MAX_FRAMES || s->size < 32)
    {
        fprintf(stderr, "bench_directional: frames= is %d to %d, size= 32 or more\n", 2 * EVERY, MAX_FRAMES);
        exit(2);
    }
}

int main(int argc, char **argv)
{
    Settings settings;
    parse(argc, argv, &settings);
    if (settings.speed)
        measure_speed(&settings);
    if (settings.sharpness)
        measure_sharpness(&settings);
    if (settings.angles)
        measure_angles(&settings);
    return 0;
}
