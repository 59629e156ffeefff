// SPDX-License-Identifier: Apache-2.0
// Does a still cost as its pixels? Pictures of 128 x 128 to 2048 x 2048 pixels from one exemplar of 128 x 128, on 1 and
// 2 threads.
//
//   bench_cost [runs=3] [exemplar=builtin:lava] [largest=2048] [plot=FILE.svg]
//
// CSV: threads,side,pixels,seconds (median of runs),ns a pixel. Then, in lines with #, the law a + b pixels that comes
// nearest in proportion: a is the exemplar's own share, b the price of a pixel, and how far the times are from it says
// whether the cost is linear. The plot has both axes logarithmic, so that b pixels alone is a dashed line of slope 1.
#include "bench.h"
#include "riffle/riffle.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    FROM = 128,
    SIZES = 5,
    THREADS = 2,
    MAX_RUNS = 99
};

typedef struct Settings
{
    const char *exemplar, *plot;
    int runs, largest;
} Settings;

static int side_of(int size)
{
    return FROM << size;
}

static double pixels_of(int size)
{
    return (double)side_of(size) * side_of(size);
}

// ---- measuring

static double seconds_of_one(const RfExemplar *exemplar, int side, int channels, int runs)
{
    double times[MAX_RUNS];
    RfOptimizeOptions options = rf_optimize_defaults();
    RfImage *out;
    bench_require(rf_image_create(side, side, channels, &out));
    RfImageView view = rf_image_view(out);
    for (int r = 0; r < runs; ++r)
    {
        double start = bench_now();
        bench_require(rf_optimize_still(exemplar, &options, NULL, &view));
        times[r] = bench_now() - start;
    }
    rf_image_destroy(out);
    return 1e-3 * bench_median(times, runs);
}

// Fills seconds[threads - 1][size] and prints it; returns how many sizes there are.
static int measure(const Settings *s, double seconds[THREADS][SIZES])
{
    char name[256];
    RfImage *image;
    RfExemplar *exemplar;
    int count = 0;
    snprintf(name, sizeof name, "%s?size=%d", s->exemplar, FROM);
    bench_require(rf_image_read(name, &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_NO, &exemplar));
    printf("threads,side,pixels,seconds,ns a pixel\n");
    for (; count < SIZES && side_of(count) <= s->largest; ++count)
        for (int t = 0; t < THREADS; ++t)
        {
            rf_set_threads(t + 1);
            seconds[t][count] = seconds_of_one(exemplar, side_of(count), map.image.channels, s->runs);
            printf("%d,%d,%.0f,%.4f,%.0f\n", t + 1, side_of(count), pixels_of(count), seconds[t][count],
                   1e9 * seconds[t][count] / pixels_of(count));
            fflush(stdout);
        }
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
    return count;
}

// ---- the law

typedef struct Law
{
    double share, price;
    // The largest part by which a time is off.
    double off;
} Law;

// Least squares of (a + b n) / t - 1, so that small pictures count as large ones do.
static Law law_of(const double *seconds, int count)
{
    double aa = 0, ab = 0, bb = 0, a = 0, b = 0;
    for (int i = 0; i < count; ++i)
    {
        double u = 1 / seconds[i], v = pixels_of(i) / seconds[i];
        aa += u * u;
        ab += u * v;
        bb += v * v;
        a += u;
        b += v;
    }
    // One size alone tells no share.
    double determinant = aa * bb - ab * ab;
    Law law = {.price = b / bb};
    if (count > 1)
        law = (Law){.share = (a * bb - b * ab) / determinant, .price = (b * aa - a * ab) / determinant};
    for (int i = 0; i < count; ++i)
        law.off = fmax(law.off, fabs((law.share + law.price * pixels_of(i)) / seconds[i] - 1));
    return law;
}

static void tell_law(FILE *out, const Law *law, int threads)
{
    fprintf(out, "%d thread%s: %.3f s + %.0f ns a pixel, at most %.0f %% off", threads, threads == 1 ? "" : "s",
            law->share, 1e9 * law->price, 100 * law->off);
}

// ---- drawing

enum
{
    WIDTH = 640,
    HEIGHT = 480,
    LEFT = 70,
    TOP = 40,
    RIGHT = 45,
    BOTTOM = 55
};

// Logarithms of the ends of both axes.
typedef struct Axes
{
    double x0, x1, y0, y1;
} Axes;

static double plot_x(const Axes *a, double pixels)
{
    return LEFT + (log(pixels) - a->x0) / (a->x1 - a->x0) * (WIDTH - LEFT - RIGHT);
}

static double plot_y(const Axes *a, double seconds)
{
    return HEIGHT - BOTTOM - (log(seconds) - a->y0) / (a->y1 - a->y0) * (HEIGHT - TOP - BOTTOM);
}

static Axes axes_of(double seconds[THREADS][SIZES], int count)
{
    Axes a = {log(pixels_of(0)) - 0.6, log(pixels_of(count - 1)) + 0.3, INFINITY, -INFINITY};
    for (int t = 0; t < THREADS; ++t)
    {
        // The dashed line stays inside, too.
        double price = law_of(seconds[t], count).price;
        for (int i = 0; i < count; ++i)
        {
            a.y0 = fmin(a.y0, log(fmin(seconds[t][i], price * pixels_of(i))) - 0.4);
            a.y1 = fmax(a.y1, log(fmax(seconds[t][i], price * pixels_of(i))) + 0.4);
        }
    }
    return a;
}

static void draw_axes(FILE *out, const Axes *a, const Settings *s, int count)
{
    fprintf(out,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" font-family=\"sans-serif\" "
            "font-size=\"13\">\n<rect width=\"%d\" height=\"%d\" fill=\"#fff\"/>\n"
            "<text x=\"%d\" y=\"24\" font-size=\"16\">A still from 128 x 128 pixels of %s</text>\n",
            WIDTH, HEIGHT, WIDTH, HEIGHT, LEFT, s->exemplar);
    for (int i = 0; i < count; ++i)
        fprintf(out,
                "<path d=\"M%.1f %dV%d\" stroke=\"#ddd\"/><text x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">%d x "
                "%d</text>\n",
                plot_x(a, pixels_of(i)), TOP, HEIGHT - BOTTOM, plot_x(a, pixels_of(i)), HEIGHT - BOTTOM + 18,
                side_of(i), side_of(i));
    for (double ten = 1e-4; ten < 1e4; ten *= 10)
        for (int k = 1; k < 10; k = k == 1 ? 2 : k == 2 ? 5 : 10)
            if (log(k * ten) >= a->y0 && log(k * ten) <= a->y1)
                fprintf(out,
                        "<path d=\"M%d %.1fH%d\" stroke=\"#ddd\"/><text x=\"%d\" y=\"%.1f\" "
                        "text-anchor=\"end\">%g</text>\n",
                        LEFT, plot_y(a, k * ten), WIDTH - RIGHT, LEFT - 8, plot_y(a, k * ten) + 4, k * ten);
    fprintf(out,
            "<text x=\"%d\" y=\"%d\" text-anchor=\"middle\">pixels</text>\n"
            "<text transform=\"translate(20 %d) rotate(-90)\" text-anchor=\"middle\">seconds</text>\n"
            "<text x=\"%d\" y=\"%d\" fill=\"#57606a\">dashed: that price a pixel alone. At the points: "
            "nanoseconds a pixel</text>\n",
            (LEFT + WIDTH - RIGHT) / 2, HEIGHT - 14, (TOP + HEIGHT - BOTTOM) / 2, LEFT + 10, TOP + 54);
}

static void draw_threads(FILE *out, const Axes *a, const double *seconds, int count, int threads)
{
    const char *colour = threads == 1 ? "#d1242f" : "#0969da";
    Law law = law_of(seconds, count);
    double first = pixels_of(0), last = pixels_of(count - 1);
    fprintf(out, "<path d=\"M%.1f %.1fL%.1f %.1f\" stroke=\"%s\" stroke-dasharray=\"4 4\"/>\n", plot_x(a, first),
            plot_y(a, law.price * first), plot_x(a, last), plot_y(a, law.price * last), colour);
    fprintf(out, "<polyline fill=\"none\" stroke=\"%s\" stroke-width=\"2\" points=\"", colour);
    for (int i = 0; i < count; ++i)
        fprintf(out, "%.1f,%.1f ", plot_x(a, pixels_of(i)), plot_y(a, seconds[i]));
    fprintf(out, "\"/>\n");
    // The figures of one thread, the slower, stand above its line, those of two below theirs.
    for (int i = 0; i < count; ++i)
        fprintf(out,
                "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\"/><text x=\"%.1f\" y=\"%.1f\" font-size=\"11\" "
                "text-anchor=\"%s\" fill=\"%s\">%.0f</text>\n",
                plot_x(a, pixels_of(i)), plot_y(a, seconds[i]), colour,
                plot_x(a, pixels_of(i)) + (threads == 1 ? -6 : 6), plot_y(a, seconds[i]) + (threads == 1 ? -6 : 14),
                threads == 1 ? "end" : "start", colour, 1e9 * seconds[i] / pixels_of(i));
    fprintf(out, "<text x=\"%d\" y=\"%d\" fill=\"%s\" font-weight=\"bold\">", LEFT + 10, TOP + 18 * threads, colour);
    tell_law(out, &law, threads);
    fprintf(out, "</text>\n");
}

static void draw(const Settings *s, double seconds[THREADS][SIZES], int count)
{
    Axes a = axes_of(seconds, count);
    FILE *out = fopen(s->plot, "w");
    if (out)
    {
        draw_axes(out, &a, s, count);
        for (int t = 0; t < THREADS; ++t)
            draw_threads(out, &a, seconds[t], count, t + 1);
        fprintf(out, "</svg>\n");
    }
    if (!out || fclose(out) != 0)
    {
        fprintf(stderr, "bench_cost: %s: cannot be written\n", s->plot);
        exit(1);
    }
}

int main(int argc, char **argv)
{
    Settings s = {.exemplar = "builtin:lava", .runs = 3, .largest = 2048};
    double seconds[THREADS][SIZES];
    for (int i = 1; i < argc; ++i)
    {
        const char *value;
        if ((value = bench_value(argv[i], "runs")))
            s.runs = atoi(value);
        else if ((value = bench_value(argv[i], "exemplar")))
            s.exemplar = value;
        else if ((value = bench_value(argv[i], "largest")))
            s.largest = atoi(value);
        else if ((value = bench_value(argv[i], "plot")))
            s.plot = value;
        else
            return fprintf(stderr, "bench_cost: no argument called %s\n", argv[i]), 2;
    }
    s.runs = s.runs < 1 ? 1 : s.runs > MAX_RUNS ? MAX_RUNS : s.runs;
    s.largest = s.largest < FROM ? FROM : s.largest;
    int count = measure(&s, seconds);
    for (int t = 0; t < THREADS; ++t)
    {
        Law law = law_of(seconds[t], count);
        printf("# ");
        tell_law(stdout, &law, t + 1);
        printf("\n");
    }
    if (s.plot)
        draw(&s, seconds, count);
    return 0;
}
