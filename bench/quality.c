// SPDX-License-Identifier: Apache-2.0
// Judges Lagrangian texture advection on the two-vortex scene: flow error by the fine estimator and by inverse search
// ("dis"), over the frame's own floor and over the exemplar's; spectrum distance over its floor; flicker and contrast.
// "product" is the inverse search's ratio times the spectrum's.
//
//   bench_quality [EXEMPLAR] [size=256] [frames=200] [every=10] [out=FOLDER] [preset=default|paper] [label=TEXT]
//   [OPTION=VALUE ...]
//
// EXEMPLAR is an image or a built-in one; an OPTION is any of the method's. One CSV line on stdout; with out= every
// `every`-th frame as a PNG there.

#include "riffle/riffle.h"
#include "support/measures.h"
#include "support/scenes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct Settings
{
    const char *exemplar, *out, *label;
    int size, frames, every;
    RfLagrangianOptions options;
} Settings;

static void fail(const char *what)
{
    fprintf(stderr, "bench_quality: %s: %s: %s\n", what, rf_last_error()->file, rf_last_error()->message);
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

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.exemplar = "builtin:foam",
                    .label = "",
                    .size = 256,
                    .frames = 200,
                    .every = 10,
                    .options = rf_lagrangian_defaults()};
    for (int i = 1; i < argc; ++i)
    {
        char *equals = strchr(argv[i], '=');
        if (!equals || strncmp(argv[i], "builtin:", 8) == 0)
        {
            s->exemplar = argv[i];
            continue;
        }
        *equals = '\0';
        const char *value = equals + 1;
        if (strcmp(argv[i], "size") == 0)
            s->size = atoi(value);
        else if (strcmp(argv[i], "frames") == 0)
            s->frames = atoi(value);
        else if (strcmp(argv[i], "every") == 0)
            s->every = atoi(value);
        else if (strcmp(argv[i], "out") == 0)
            s->out = value;
        else if (strcmp(argv[i], "label") == 0)
            s->label = value;
        else if (strcmp(argv[i], "preset") == 0)
            s->options = strcmp(value, "paper") == 0 ? rf_lagrangian_paper() : rf_lagrangian_defaults();
        else if (!set_option(&s->options, argv[i], value))
        {
            fprintf(stderr, "bench_quality: no option called %s\n", argv[i]);
            exit(2);
        }
    }
    if (s->options.particle_radius == 0)
        s->options.particle_radius = (float)s->size / 8;
}

// Sums, for ratios of means.
static void add_error(MeasureFlowError *sum, MeasureFlowError e)
{
    sum->error += e.error;
    sum->floor += e.floor;
    sum->exemplar_floor += e.exemplar_floor;
}

int main(int argc, char **argv)
{
    Settings s;
    parse(argc, argv, &s);
    RfImage *image;
    RfExemplar *exemplar;
    RfLagrangian *lagrangian;
    if (rf_image_read(s.exemplar, &image) != RF_OK)
        fail(s.exemplar);
    RfImage *frame_image;
    RfImageView pixels = rf_image_view(image);
    RfMapView map = {"colour", pixels.channels == 1 || pixels.channels == 3 ? RF_MAP_COLOUR : RF_MAP_DATA, pixels, 1};
    if (rf_exemplar_create(&map, 1, RF_TILING_AUTO, &exemplar) != RF_OK ||
        rf_lagrangian_create(exemplar, &s.options, &lagrangian) != RF_OK ||
        rf_image_create(s.size, s.size, pixels.channels, &frame_image) != RF_OK)
        fail("create");
    rf_image_set_origin(frame_image, RF_SAMPLE_U8, RF_ENCODING_SRGB);
    RfImageView frame = rf_image_view(frame_image);
    size_t n = (size_t)s.size * (size_t)s.size;
    float *grey[2] = {malloc(n * sizeof(float)), malloc(n * sizeof(float))},
          *displacement = malloc(2 * n * sizeof(float));
    float *exemplar_grey = malloc((size_t)pixels.width * (size_t)pixels.height * sizeof(float));
    measure_grey(&pixels, exemplar_grey);
    SceneMoments scene = scene_moments(scene_two_vortices, s.size, s.size);

    MeasureFlowError fine = {0}, dis = {0};
    double spectrum = 0, spectrum_floor = 0, flicker = 0, flicker_floor = 0, pop = 0, contrast = 0, histogram = 0,
           ms = 0;
    double layers = 0, live = 0, fading = 0, born = 0;
    int64_t holes = 0;
    int judged = 0;
    for (int f = 1; f <= s.frames; ++f)
    {
        RfFlowView view = scene_step(&scene, f);
        if (rf_lagrangian_step(lagrangian, &view, &frame) != RF_OK)
            fail("step");
        RfLagrangianStats stats = rf_lagrangian_stats(lagrangian);
        holes += stats.holes;
        if (f > 1)
            ms += 1e3 * (stats.advect_seconds + stats.distribute_seconds + stats.draw_seconds) / (s.frames - 1);
        layers += (double)stats.layers / s.frames;
        live += (double)stats.live / s.frames;
        fading += (double)stats.fading / s.frames;
        born += f > 1 ? (double)stats.born / s.frames : 0;
        if (s.out && (f - 1) % s.every == 0)
        {
            char path[512];
            snprintf(path, sizeof path, "%s/%sframe.%04d.png", s.out, s.label, f);
            if (rf_image_write(path, frame_image) != RF_OK)
                fail(path);
        }
        if (f % s.every == s.every - 1)
            measure_grey(&frame, grey[0]);
        if (f % s.every != 0 || f < 2)
            continue;
        measure_grey(&frame, grey[1]);
        measure_displacement(&view, s.size, s.size, displacement);
        add_error(&fine, measure_flow_error(grey[0], grey[1], s.size, s.size, displacement, NULL, exemplar_grey,
                                            pixels.width, pixels.height));
        add_error(&dis, measure_inverse_search_error(grey[0], grey[1], s.size, s.size, displacement, NULL,
                                                     exemplar_grey, pixels.width, pixels.height));
        MeasureSpectrum m = measure_spectrum(grey[1], s.size, s.size, exemplar_grey, pixels.width, pixels.height);
        MeasureFlicker k = measure_flicker(grey[0], grey[1], s.size, s.size, displacement, NULL);
        MeasureContrast c = measure_contrast(&frame, NULL, &pixels);
        spectrum += m.distance;
        spectrum_floor += m.floor;
        flicker += k.whole;
        flicker_floor += k.floor;
        pop = k.pop > pop ? k.pop : pop;
        contrast += c.luma;
        histogram += c.histogram_mover;
        ++judged;
    }
    double spectrum_ratio = spectrum / spectrum_floor;
    printf("%s%s,error %.3f px,x%.2f,exemplar x%.2f,dis error %.3f px,x%.2f,exemplar x%.2f,spectrum %.2f dB,x%.2f,"
           "product %.2f,flicker %.3f,floor %.3f,pop %.2f,contrast %.3f,histogram %.2f,holes %lld,"
           "live %.0f,fading %.0f,born %.2f,layers %.2f,ms %.2f\n",
           s.label, s.exemplar, fine.error / judged, fine.error / fine.floor, fine.error / fine.exemplar_floor,
           dis.error / judged, dis.error / dis.floor, dis.error / dis.exemplar_floor, spectrum / judged, spectrum_ratio,
           dis.error / dis.floor * spectrum_ratio, flicker / judged, flicker_floor / judged, pop, contrast / judged,
           histogram / judged, (long long)holes, live, fading, born, layers, ms);
    scene_moments_free(&scene);
    rf_lagrangian_destroy(lagrangian);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
    rf_image_destroy(frame_image);
    free(grey[0]);
    free(grey[1]);
    free(displacement);
    free(exemplar_grey);
    return 0;
}
