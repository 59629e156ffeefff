// SPDX-License-Identifier: Apache-2.0
// Still texture synthesis: how good, beside four other tools, and how fast?
//
//   bench_synth peers [runs=3] [seeds=1] [only=TEXT] [threads=N] [windows=17,9] [out=FOLDER] [OPTION=VALUE ...]
//   bench_synth speed [runs=3] [only=TEXT] [windows=17,9] [OPTION=VALUE ...]
//
// Without arguments both, the first only where its data are. OPTION is any of rf_optimize_still, choices by their
// names: seed=, spread=, iterations=, similar=, search=exact, ...
//
// peers: 512 x 512 pixels from each exemplar of $RIFFLE_DATA/reference/peers, judged as its figures were. CSV:
// exemplar,tool,residual,share,spectrum,verbatim,seconds (median of runs; of others as they are told, on as many
// threads as they have). With seeds=N that for N seeds, `seed` being the first. Then, in lines with #, each program's
// mean rank and who beats Riffle where. The pictures go to FOLDER/EXEMPLAR.png (of N seeds those of the last), if said.
//
// speed: exemplars drawn by the program, 1 and 2 threads. CSV: exemplar,from,to,threads,ms (median of runs),runs,
// ns a pixel. The machine may be shared, so compare figures of one run only.
#include "bench.h"
#include "support/peers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum
{
    MAX_RUNS = 99
};

typedef struct Settings
{
    RfOptimizeOptions options;
    const char *only, *out;
    int runs, seeds, threads;
} Settings;

// ---- arguments

// The place of a name in "one|two|three", or the number that it is.
static int choice_of(const char *choices, const char *value)
{
    size_t length = strlen(value);
    int index = 0;
    for (const char *at = choices; at; ++index)
    {
        const char *end = strchr(at, '|');
        if ((end ? (size_t)(end - at) : strlen(at)) == length && strncmp(at, value, length) == 0)
            return index;
        at = end ? end + 1 : NULL;
    }
    return atoi(value);
}

static bool set_option(RfOptimizeOptions *options, const char *name, const char *value)
{
    int count;
    const RfOption *table = rf_optimize_option_table(&count);
    for (int i = 0; i < count; ++i)
    {
        if (strcmp(table[i].name, name) != 0)
            continue;
        void *field = (uint8_t *)options + table[i].offset;
        if (table[i].kind == RF_OPTION_FLOAT)
            *(float *)field = (float)atof(value);
        else if (table[i].kind == RF_OPTION_UINT64)
            *(uint64_t *)field = strtoull(value, NULL, 10);
        else if (table[i].kind == RF_OPTION_BOOL)
            *(bool *)field = atoi(value) != 0;
        else
            *(int *)field = table[i].kind == RF_OPTION_CHOICE ? choice_of(table[i].choices, value) : atoi(value);
        return true;
    }
    return false;
}

static void set_windows(RfOptimizeOptions *options, const char *value)
{
    memset(options->windows, 0, sizeof options->windows);
    for (int i = 0; i < RF_MAX_OPTIMIZE_WINDOWS && *value; ++i)
    {
        char *end;
        options->windows[i] = (int)strtol(value, &end, 10);
        value = *end == ',' ? end + 1 : "";
    }
}

static void parse(int argc, char **argv, Settings *s)
{
    *s = (Settings){.options = rf_optimize_defaults(), .only = "", .runs = 3, .seeds = 1};
    for (int i = 2; i < argc; ++i)
    {
        char *value = strchr(argv[i], '=');
        if (value)
            *value++ = '\0';
        if (value && strcmp(argv[i], "runs") == 0)
            s->runs = atoi(value);
        else if (value && strcmp(argv[i], "seeds") == 0)
            s->seeds = atoi(value);
        else if (value && strcmp(argv[i], "only") == 0)
            s->only = value;
        else if (value && strcmp(argv[i], "out") == 0)
            s->out = value;
        else if (value && strcmp(argv[i], "threads") == 0)
            s->threads = atoi(value);
        else if (value && strcmp(argv[i], "windows") == 0)
            set_windows(&s->options, value);
        else if (!value || !set_option(&s->options, argv[i], value))
        {
            fprintf(stderr, "bench_synth: no argument called %s\n", argv[i]);
            exit(2);
        }
    }
    s->runs = s->runs < 1 ? 1 : s->runs > MAX_RUNS ? MAX_RUNS : s->runs;
    if (s->threads > 0)
        rf_set_threads(s->threads);
}

// ---- beside other tools

static bool is_first_of_its_name(const PeerTable *table, int row)
{
    for (int i = 0; i < row; ++i)
        if (strcmp(table->rows[i].name, table->rows[row].name) == 0)
            return false;
    return true;
}

static bool is_first_of_its_tool(const PeerTable *table, int row)
{
    for (int i = 0; i < row; ++i)
        if (strcmp(table->rows[i].tool, table->rows[row].tool) == 0)
            return false;
    return true;
}

static void print_row(const PeerRow *row, double verbatim)
{
    printf("%s,%s,%.2f,%.3f,%.2f,%.3f,%.3f\n", row->name, row->tool, row->values[0], row->values[1], row->values[2],
           verbatim, row->seconds);
    fflush(stdout);
}

// The rows of others, with what of theirs is verbatim.
static void print_others(const PeerTable *table, const char *name)
{
    RfImage *exemplar, *picture;
    bench_require(peers_image(table, name, "exemplar", &exemplar));
    RfImageView from = rf_image_view(exemplar);
    for (int i = 0; i < table->count; ++i)
    {
        if (strcmp(table->rows[i].name, name) != 0)
            continue;
        bench_require(peers_image(table, name, table->rows[i].tool, &picture));
        RfImageView to = rf_image_view(picture);
        print_row(&table->rows[i], peers_verbatim(&from, &to));
        rf_image_destroy(picture);
    }
    rf_image_destroy(exemplar);
}

static void print_who_beats_riffle(const PeerTable *table, const char *name)
{
    const PeerRow *own = peers_find(table, name, "riffle");
    printf("# %s: beaten by", name);
    int beaten = 0;
    for (int i = 0; i < table->count; ++i)
    {
        const PeerRow *row = &table->rows[i];
        int wins = strcmp(row->name, name) == 0 ? peers_wins(row, own) : 0;
        if (wins == 0)
            continue;
        printf("%s %s in %d (", beaten++ ? "," : "", row->tool, wins);
        for (int m = 0, told = 0; m < PEER_MEASURES; ++m)
            if (peers_compare(m, row, own) < 0)
                printf("%s%s", told++ ? " " : "", peer_measures[m]);
        printf(")");
    }
    printf("%s\n", beaten ? "" : " none");
}

static void print_summary(const PeerTable *table)
{
    for (int i = 0; i < table->count; ++i)
        if (is_first_of_its_name(table, i) && peers_find(table, table->rows[i].name, "riffle"))
            print_who_beats_riffle(table, table->rows[i].name);
    for (int i = 0; i < table->count; ++i)
        if (is_first_of_its_tool(table, i))
            printf("# %s: mean rank %.2f\n", table->rows[i].tool, peers_mean_rank(table, table->rows[i].tool));
    fflush(stdout);
}

// Only exemplars that were asked for.
static void keep_named(PeerTable *table, const char *only)
{
    int kept = 0;
    for (int i = 0; i < table->count; ++i)
        if (strstr(table->rows[i].name, only))
            table->rows[kept++] = table->rows[i];
    table->count = kept;
}

// Riffle's row, and its picture where that is wanted.
static void run_own(const Settings *s, const RfOptimizeOptions *options, const char *name, PeerTable *table)
{
    PeerOwn own;
    char path[1200];
    bench_require(peers_synthesise(table, name, options, s->runs, &own));
    peers_add(table, &own.row);
    print_row(&own.row, own.verbatim);
    if (s->out)
    {
        snprintf(path, sizeof path, "%s/%s.png", s->out, name);
        rf_image_set_origin(own.picture, RF_SAMPLE_U8, RF_ENCODING_SRGB);
        bench_require(rf_image_write(path, own.picture));
    }
    rf_image_destroy(own.picture);
}

static bool run_peers(const Settings *s)
{
    static PeerTable others, table;
    if (!peers_read(RF_SOURCE_DIR "/../shared/data", &others))
    {
        fprintf(stderr, "bench_synth: %s: no quality.csv there; set RIFFLE_DATA\n", others.folder);
        return false;
    }
    keep_named(&others, s->only);
    printf("exemplar,tool,residual,share,spectrum,verbatim,seconds\n");
    for (int seed = 0; seed < s->seeds; ++seed)
    {
        RfOptimizeOptions options = s->options;
        options.seed += (uint64_t)seed;
        table = others;
        for (int i = 0; i < others.count; ++i)
        {
            if (!is_first_of_its_name(&others, i))
                continue;
            run_own(s, &options, others.rows[i].name, &table);
            if (seed == 0)
                print_others(&others, others.rows[i].name);
        }
        printf("# seed %llu\n", (unsigned long long)options.seed);
        print_summary(&table);
    }
    return true;
}

// ---- speed

typedef struct Case
{
    const char *exemplar;
    int from, to;
} Case;

static double time_case(const Case *c, const Settings *s, int threads)
{
    char name[96];
    double times[MAX_RUNS];
    RfImage *image, *out;
    RfExemplar *exemplar;
    snprintf(name, sizeof name, "%s?size=%d", c->exemplar, c->from);
    bench_require(rf_image_read(name, &image));
    RfMapView map = {"colour", RF_MAP_COLOUR, rf_image_view(image), 1};
    bench_require(rf_exemplar_create(&map, 1, RF_TILING_NO, &exemplar));
    bench_require(rf_image_create(c->to, c->to, map.image.channels, &out));
    RfImageView view = rf_image_view(out);
    rf_set_threads(threads);
    for (int r = 0; r < s->runs; ++r)
    {
        double start = bench_now();
        bench_require(rf_optimize_still(exemplar, &s->options, NULL, &view));
        times[r] = bench_now() - start;
    }
    double ms = bench_median(times, s->runs);
    printf("%s,%d,%d,%d,%.1f,%d,%.0f\n", c->exemplar, c->from, c->to, threads, ms, s->runs,
           1e6 * ms / ((double)c->to * c->to));
    fflush(stdout);
    rf_exemplar_destroy(exemplar);
    rf_image_destroy(image);
    rf_image_destroy(out);
    return ms;
}

static void run_speed(const Settings *s)
{
    static const char *const exemplars[] = {"builtin:pebbles", "builtin:lava"};
    // How the cost grows with the pixels: bench_cost.
    static const int sizes[][2] = {{128, 512}, {64, 256}, {256, 1024}};
    printf("exemplar,from,to,threads,ms,runs,ns a pixel\n");
    for (size_t e = 0; e < sizeof exemplars / sizeof *exemplars; ++e)
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes && strstr(exemplars[e], s->only); ++i)
        {
            Case c = {exemplars[e], sizes[i][0], sizes[i][1]};
            double one = time_case(&c, s, 1), two = time_case(&c, s, 2);
            printf("# %s %d to %d: 2 threads are %.2f times as fast as 1\n", c.exemplar, c.from, c.to, one / two);
        }
}

int main(int argc, char **argv)
{
    static Settings settings;
    const char *what = argc > 1 ? argv[1] : "";
    bool peers = strcmp(what, "peers") == 0, speed = strcmp(what, "speed") == 0;
    if (argc > 1 && !peers && !speed)
        return fprintf(stderr, "bench_synth: the first argument must be peers or speed\n"), 2;
    parse(argc, argv, &settings);
    if (!speed && !run_peers(&settings) && peers)
        return 1;
    if (!peers)
        run_speed(&settings);
    return 0;
}
