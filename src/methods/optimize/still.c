// SPDX-License-Identifier: Apache-2.0
// A still texture, from coarse to fine.
//
// Kwatra, Essa, Bobick, Kwatra. Texture optimization for example-based synthesis. 2005. Han, Zhou, Wei, Gong, Bao,
// Zhang, Guo. Fast example-based surface texture synthesis via discrete optimization. 2006.
//
// The coarsest level starts from windows thrown together at random and searches exactly: there the layout is found, and
// it is small. Finer levels start from the doubled places of the coarser one, so that they are pieces of the exemplar
// from the first, and only mend where pieces meet: k-coherent candidates are enough (residuals are 2 to 5 % above those
// of an exact search there, at a fifth of the time).
//
// Deviations. Kwatra et al. start each level from blurred pixels; doubled places are sharp (Han et al.). The use of the
// exemplar is spread by prices (kernels/usage.h). What is given, a target or fixed pixels, is mixed into the picture
// that is compared, in place of a term of its own in the search.
#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/result.h"
#include "kernels/pyramid.h"
#include "methods/optimize/optimize.h"

#include <stdio.h>
#include <string.h>

enum
{
    LEAST_SIDE = 8
};

// Strong enough to leave nothing of a fixed pixel to its windows, in 16-bit numbers.
static const float FIXED_HOLD = 1e6f;
// Places within this of each other, in exemplar pixels, are one where windows are turned or scaled.
static const float TURNED_TOGETHER = 0.75f;
// Of four turns of one length, so much of it must be left of their mean for it to be a direction.
static const float LEAST_AGREEMENT = 0.05f;

/// What the constraints say on one level.
typedef struct Bounds
{
    int width, height;
    /// [height][width][channels without guides], compared; NULL: no target and nothing fixed.
    float *target;
    float *hold;
    /// [height][width][guides]
    float *guide;
    RfVec2 *turns;
    RfFixedPicture held;
} Bounds;

typedef struct Still
{
    const RfOptimizeOptions *options;
    const RfOptimizeConstraints *constraints;
    RfSynthesisMaterial material;
    Bounds bounds[RF_SYNTHESIS_LEVELS];
    RfUsage usage;
    RfSynthesisFrame frame;
    /// Of the windows at work.
    int level, side;
    RfWindowDatabase *windows;
    /// Of windows, on the coarsest level; on others NULL.
    float *variations;
    float *prices;
    float first_energy;
    /// In pixels searched.
    double done, steps;
} Still;

// ---- constraints

static void free_bounds(Bounds *b)
{
    rf_release(b->target);
    rf_release(b->hold);
    rf_release(b->guide);
    rf_release(b->turns);
    rf_fixed_free(&b->held);
}

static const float *view_pixel(const RfImageView *view, int x, int y)
{
    return view->pixels + y * view->row_stride + (ptrdiff_t)x * view->channels;
}

// Channels of a result come without those of the guide: the first one of each is known by counting.
static int made_channel(const RfExemplar *e, int channel)
{
    int before = 0;
    for (int i = 0; i < e->map_count; ++i)
    {
        if (channel < e->first_channel[i] + e->maps[i].image.channels)
            break;
        if (strcmp(e->maps[i].name, RF_GUIDE_MAP) == 0)
            before += e->maps[i].image.channels;
    }
    return channel - before;
}

static void read_target(const Still *s, Bounds *b, int x, int y)
{
    const RfSynthesisMaterial *m = &s->material;
    const RfOptimizeConstraints *k = s->constraints;
    int made = m->comparison.channels - m->comparison.guides;
    size_t pixel = (size_t)y * (size_t)b->width + (size_t)x;
    const float *from = NULL;
    if (k->target.pixels)
    {
        from = view_pixel(&k->target, x, y);
        b->hold[pixel] = k->target_weight.pixels ? rf_clamp(*view_pixel(&k->target_weight, x, y), 0, FIXED_HOLD) : 1;
    }
    if (k->fixed.pixels && view_pixel(&k->fixed, x, y)[k->fixed.channels - 1] >= 0.5f)
    {
        from = view_pixel(&k->fixed, x, y);
        b->hold[pixel] = FIXED_HOLD;
    }
    for (int c = 0; c < made && from; ++c)
        b->target[pixel * (size_t)made + (size_t)c] =
            (from[made_channel(m->comparison.exemplar, m->comparison.from[c])] - m->comparison.middle[c]) *
            m->comparison.factor[c];
}

static void read_guide(const Still *s, Bounds *b, int x, int y)
{
    const RfSynthesisMaterial *m = &s->material;
    size_t pixel = (size_t)y * (size_t)b->width + (size_t)x;
    const float *from = view_pixel(&s->constraints->guide, x, y);
    for (int c = 0; c < m->comparison.guides; ++c)
    {
        int k = m->comparison.channels - m->comparison.guides + c;
        b->guide[pixel * (size_t)m->comparison.guides + (size_t)c] =
            (from[c] - m->comparison.middle[k]) * m->comparison.factor[k];
    }
}

static void read_turn(const Still *s, Bounds *b, int x, int y)
{
    const RfOptimizeConstraints *k = s->constraints;
    float angle = k->orientation.pixels ? *view_pixel(&k->orientation, x, y) * (RF_PI / 180) : 0;
    float scale = k->scale.pixels ? rf_clamp(*view_pixel(&k->scale, x, y), 1.0f / 16, 16) : 1;
    // Turning the exemplar by an angle turns steps of the frame back by it.
    b->turns[(size_t)y * (size_t)b->width + (size_t)x] = (RfVec2){cosf(angle) / scale, -sinf(angle) / scale};
}

static RfResult read_bounds(Still *s, int width, int height)
{
    const RfSynthesisMaterial *m = &s->material;
    const RfOptimizeConstraints *k = s->constraints;
    Bounds *b = &s->bounds[0];
    size_t pixels = (size_t)width * (size_t)height;
    bool target = k->target.pixels || k->fixed.pixels, guide = m->comparison.guides > 0;
    bool turns = k->orientation.pixels || k->scale.pixels;
    b->width = width;
    b->height = height;
    if (target)
        b->target =
            rf_allocate_zero(pixels * (size_t)(m->comparison.channels - m->comparison.guides), sizeof *b->target);
    if (target)
        b->hold = rf_allocate_zero(pixels, sizeof *b->hold);
    if (guide)
        b->guide = rf_allocate(pixels * (size_t)m->comparison.guides, sizeof *b->guide);
    if (turns)
        b->turns = rf_allocate(pixels, sizeof *b->turns);
    if ((target && (!b->target || !b->hold)) || (guide && !b->guide) || (turns && !b->turns))
        return RF_OUT_OF_MEMORY;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x)
        {
            if (target)
                read_target(s, b, x, y);
            if (guide)
                read_guide(s, b, x, y);
            if (turns)
                read_turn(s, b, x, y);
        }
    return RF_OK;
}

// A target is halved as a picture whose pixels count by their hold.
static void halve_target(const Bounds *fine, Bounds *coarse, int channels, bool tiles)
{
    size_t pixels = (size_t)coarse->width * (size_t)coarse->height;
    size_t numbers = (size_t)fine->width * (size_t)fine->height * (size_t)channels;
    for (size_t i = 0; i < numbers; ++i)
        fine->target[i] *= fine->hold[i / (size_t)channels];
    rf_halve(fine->target, fine->width, fine->height, channels, tiles, coarse->target);
    rf_halve(fine->hold, fine->width, fine->height, 1, tiles, coarse->hold);
    for (size_t i = 0; i < numbers; ++i)
        fine->target[i] /= rf_max(fine->hold[i / (size_t)channels], 1e-20f);
    for (size_t i = 0; i < pixels * (size_t)channels; ++i)
        coarse->target[i] /= rf_max(coarse->hold[i / (size_t)channels], 1e-20f);
}

// Turns are halved as directions, and lengths apart: the mean of two that point against each other is none.
static RfResult halve_turns(const Bounds *fine, Bounds *coarse, bool tiles)
{
    size_t pixels = (size_t)fine->width * (size_t)fine->height;
    float *lengths = rf_allocate(pixels, sizeof *lengths);
    float *halved = rf_allocate((size_t)coarse->width * (size_t)coarse->height, sizeof *halved);
    coarse->turns = rf_allocate((size_t)coarse->width * (size_t)coarse->height, sizeof *coarse->turns);
    bool enough = lengths && halved && coarse->turns;
    for (size_t i = 0; i < pixels && enough; ++i)
        lengths[i] = rf_vec2_length(fine->turns[i]);
    if (enough)
    {
        rf_halve(lengths, fine->width, fine->height, 1, tiles, halved);
        rf_halve(&fine->turns->x, fine->width, fine->height, 2, tiles, &coarse->turns->x);
    }
    for (int y = 0; y < coarse->height && enough; ++y)
        for (int x = 0; x < coarse->width; ++x)
        {
            size_t i = (size_t)y * (size_t)coarse->width + (size_t)x;
            RfVec2 turn = coarse->turns[i], own = fine->turns[(size_t)(2 * y) * (size_t)fine->width + (size_t)(2 * x)];
            if (rf_vec2_length(turn) < LEAST_AGREEMENT * halved[i])
                turn = own;
            float factor = halved[i] / rf_vec2_length(turn);
            coarse->turns[i] = (RfVec2){turn.x * factor, turn.y * factor};
        }
    rf_release(lengths);
    rf_release(halved);
    return enough ? RF_OK : RF_OUT_OF_MEMORY;
}

static RfResult halve_bounds(Still *s, int level)
{
    const Bounds *fine = &s->bounds[level - 1];
    Bounds *b = &s->bounds[level];
    int channels = s->material.comparison.channels - s->material.comparison.guides,
        guides = s->material.comparison.guides;
    b->width = (fine->width + 1) / 2;
    b->height = (fine->height + 1) / 2;
    size_t pixels = (size_t)b->width * (size_t)b->height;
    bool tiles = s->options->tile;
    if (fine->target)
    {
        b->target = rf_allocate(pixels * (size_t)channels, sizeof *b->target);
        b->hold = rf_allocate(pixels, sizeof *b->hold);
        if (!b->target || !b->hold)
            return RF_OUT_OF_MEMORY;
        halve_target(fine, b, channels, tiles);
    }
    if (fine->guide)
    {
        b->guide = rf_allocate(pixels * (size_t)guides, sizeof *b->guide);
        if (!b->guide)
            return RF_OUT_OF_MEMORY;
        rf_halve(fine->guide, fine->width, fine->height, guides, tiles, b->guide);
    }
    return fine->turns ? halve_turns(fine, b, tiles) : RF_OK;
}

static RfResult fix_bounds(const Still *s, Bounds *b)
{
    if (!b->target)
        return RF_OK;
    RF_TRY(rf_fixed_create(b->width, b->height, s->material.comparison.channels - s->material.comparison.guides, 0,
                           &b->held));
    rf_fixed_set(&b->held, b->target, s->material.levels[0].scale);
    return RF_OK;
}

static RfResult make_bounds(Still *s, int width, int height)
{
    RF_TRY(read_bounds(s, width, height));
    for (int l = 1; l < s->material.level_count; ++l)
        RF_TRY(halve_bounds(s, l));
    for (int l = 0; l < s->material.level_count; ++l)
        RF_TRY(fix_bounds(s, &s->bounds[l]));
    return RF_OK;
}

static void show_guide(Still *s)
{
    const Bounds *b = &s->bounds[s->level];
    int guides = s->material.comparison.guides, made = s->material.comparison.channels - guides;
    const float limit = RF_FIXED_RANGE / 2;
    for (int y = 0; y < b->height && guides; ++y)
        for (int x = 0; x < b->width; ++x)
            for (int c = 0; c < guides; ++c)
                rf_fixed_at(&s->frame.picture, x, y)[made + c] = (int16_t)lrintf(
                    rf_clamp(b->guide[((size_t)y * (size_t)b->width + (size_t)x) * (size_t)guides + (size_t)c] *
                                 s->material.levels[s->level].scale,
                             -limit, limit));
}

// ---- one level

static int iterations_of(const Still *s, int level, int window)
{
    int coarsest = s->material.level_count - 1, n = s->options->iterations;
    bool last = window + 1 == RF_MAX_OPTIMIZE_WINDOWS || s->options->windows[window + 1] == 0;
    for (int l = coarsest; l > level && (n > 1); --l)
        n = (n + 1) / 2;
    // The last window of the finest level mends what is seen.
    return last && level < coarsest ? rf_max_int(n, (s->options->iterations + 1) / 2) : n;
}

static RfResult open_windows(Still *s)
{
    const RfSynthesisExemplar *e = &s->material.levels[s->level];
    rf_windows_destroy(s->windows);
    s->windows = NULL;
    rf_release(s->variations);
    s->variations = NULL;
    bool coarsest = s->level == s->material.level_count - 1;
    if (!coarsest && s->options->search != RF_SEARCH_EXACT)
        return RF_OK;
    RfWindowSource source = {.image = {e->pixels, e->width, e->height, e->channels, (ptrdiff_t)e->width * e->channels}};
    RfWindowOptions options = {.side = s->side, .tiles = e->tiles};
    RF_TRY(rf_windows_create(&source, 1, &options, &s->windows));
    if (!coarsest)
        return RF_OK;
    s->variations = rf_allocate((size_t)rf_windows_count(s->windows), sizeof *s->variations);
    if (!s->variations)
        return RF_OUT_OF_MEMORY;
    rf_windows_vary(s->windows, e->channels - s->material.comparison.guides, s->variations);
    return RF_OK;
}

static bool is_turned(const Still *s)
{
    return s->bounds[s->level].turns != NULL;
}

static RfSynthesisHeld held_of(const Still *s)
{
    const Bounds *b = &s->bounds[s->level];
    return (RfSynthesisHeld){&b->held, b->hold};
}

static RfResult search_step(Still *s, int round, bool all, RfSynthesisEnergy *energy)
{
    RfSynthesisSearch search = {
        .exemplar = &s->material.levels[s->level],
        .frame = &s->frame,
        .side = s->side,
        .windows = s->windows,
        .variations = s->variations,
        .prices = round > 0 && s->options->spread > 0 ? s->prices : NULL,
        .guides = s->material.comparison.guides,
        .held = held_of(s),
        .plain = !is_turned(s),
        .all = all,
        .seed = s->options->seed,
        .round = (uint64_t)(s->level * 1000 + s->side * 100 + round),
    };
    return rf_synthesis_search(&search, energy);
}

static RfResult assign_step(Still *s, bool robust, bool all)
{
    RfSynthesisAssign assign = {
        .exemplar = &s->material.levels[s->level],
        .frame = &s->frame,
        .side = s->side,
        .mean = s->options->form == RF_FORM_MEAN,
        .robust = robust,
        .together = is_turned(s) ? TURNED_TOGETHER : 0,
        .all = all,
        .guides = s->material.comparison.guides,
        .held = held_of(s),
    };
    return rf_synthesis_assign(&assign);
}

static void set_prices(Still *s, double energy)
{
    const RfSynthesisExemplar *e = &s->material.levels[s->level];
    rf_synthesis_settle_prices(&s->frame, e, s->side, &s->usage);
    // Not the present energy: that of a frame that collapses falls, and the prices with it.
    if (s->first_energy < 0)
        s->first_energy = (float)energy;
    rf_synthesis_prices(e, s->side, &s->usage, s->options->spread * s->first_energy, s->prices);
}

static double pixels_of(const Still *s, int level)
{
    return (double)s->bounds[level].width * s->bounds[level].height;
}

static RfResult tell(Still *s, int iteration, int iterations, double energy)
{
    char stage[96];
    int numbers = s->side * s->side * s->material.comparison.channels;
    double rms = sqrt(energy / numbers) / (s->material.levels[0].scale * s->material.comparison.widest);
    snprintf(stage, sizeof stage, "level %d of %d, windows of %d, iteration %d of %d, energy %.4f",
             s->material.level_count - s->level, s->material.level_count, s->side, iteration + 1, iterations, rms);
    s->done += pixels_of(s, s->level);
    return rf_progress(stage, s->done / s->steps);
}

static RfResult run_windows(Still *s, int window, bool start)
{
    const RfSynthesisExemplar *e = &s->material.levels[s->level];
    s->side = rf_synthesis_side(&s->material, s->level, s->options->windows[window], s->frame.width, s->frame.height);
    if (s->side == 0)
        return RF_OK;
    RF_TRY(rf_synthesis_cut(&s->frame, rf_max_int(s->side / 4, 1)));
    rf_synthesis_place(&s->frame, s->bounds[s->level].turns);
    RF_TRY(open_windows(s));
    if (start)
    {
        rf_synthesis_scatter(&s->frame, e, s->side, s->options->seed);
        RF_TRY(assign_step(s, false, true));
    }
    s->first_energy = -1;
    int iterations = iterations_of(s, s->level, window);
    for (int i = 0; i < iterations; ++i)
    {
        RfSynthesisEnergy energy;
        RF_TRY(search_step(s, i, i == 0 || s->windows, &energy));
        if (s->options->spread > 0)
            set_prices(s, energy.mean);
        RF_TRY(assign_step(s, true, i == 0 || s->windows));
        RF_TRY(tell(s, i, iterations, energy.mean));
    }
    return RF_OK;
}

static RfResult start_level(Still *s, bool start)
{
    const RfSynthesisMaterial *m = &s->material;
    const Bounds *b = &s->bounds[s->level];
    RfSynthesisFrame fine;
    RF_TRY(rf_synthesis_frame_create(b->width, b->height, m->comparison.channels, s->options->tile, &fine));
    if (!start)
        rf_synthesis_refine(&s->frame, b->turns, &fine);
    rf_synthesis_frame_free(&s->frame);
    s->frame = fine;
    rf_release(s->prices);
    s->prices = rf_allocate((size_t)m->levels[s->level].width * (size_t)m->levels[s->level].height, sizeof *s->prices);
    if (!s->prices)
        return RF_OUT_OF_MEMORY;
    rf_synthesis_show(&s->frame, &m->levels[s->level], m->comparison.guides, held_of(s));
    show_guide(s);
    rf_fixed_extend(&s->frame.picture, s->options->tile);
    return RF_OK;
}

// True if windows fit into the level at all; coarse ones of small pictures are left out.
static bool level_is_useful(const Still *s, int level)
{
    return rf_synthesis_side(&s->material, level, s->options->windows[0], s->bounds[level].width,
                             s->bounds[level].height) > 0;
}

static void count_steps(Still *s)
{
    for (int l = 0; l < s->material.level_count; ++l)
        for (int w = 0; w < RF_MAX_OPTIMIZE_WINDOWS && s->options->windows[w]; ++w)
            s->steps += iterations_of(s, l, w) * pixels_of(s, l);
}

static RfResult run_levels(Still *s)
{
    while (s->material.level_count > 1 && !level_is_useful(s, s->material.level_count - 1))
        rf_synthesis_exemplar_free(&s->material.levels[--s->material.level_count]);
    if (!level_is_useful(s, 0))
        return rf_fail(RF_BAD_INPUT, NULL, NULL, "a picture of %d x %d pixels has no room for windows of 5",
                       s->bounds[0].width, s->bounds[0].height);
    count_steps(s);
    bool start = true;
    for (s->level = s->material.level_count - 1; s->level >= 0; --s->level)
    {
        RF_TRY(start_level(s, start));
        for (int w = 0; w < RF_MAX_OPTIMIZE_WINDOWS && s->options->windows[w]; ++w, start = false)
            RF_TRY(run_windows(s, w, start));
    }
    return RF_OK;
}

// ---- the result

typedef struct Drawing
{
    const Still *still;
    const RfImageView *image;
} Drawing;

static void draw_row(void *context, int y, int worker)
{
    (void)worker;
    const Drawing *d = context;
    const Still *s = d->still;
    const Bounds *b = &s->bounds[0];
    const RfImageView *fixed = &s->constraints->fixed;
    for (int x = 0; x < d->image->width; ++x)
    {
        size_t pixel = (size_t)y * (size_t)b->width + (size_t)x;
        float *values = d->image->pixels + y * d->image->row_stride + (ptrdiff_t)x * d->image->channels;
        if (fixed->pixels && view_pixel(fixed, x, y)[fixed->channels - 1] >= 0.5f)
            memcpy(values, view_pixel(fixed, x, y), (size_t)d->image->channels * sizeof *values);
        else
            rf_optimize_sample(&s->material, s->frame.sources[pixel], b->turns ? &b->turns[pixel] : NULL,
                               s->options->form == RF_FORM_MEAN ? rf_fixed_at(&s->frame.picture, x, y) : NULL, values);
    }
}

static void free_still(Still *s)
{
    rf_synthesis_frame_free(&s->frame);
    rf_windows_destroy(s->windows);
    rf_release(s->variations);
    rf_release(s->prices);
    for (int l = 0; l < RF_SYNTHESIS_LEVELS; ++l)
        free_bounds(&s->bounds[l]);
    rf_synthesis_material_free(&s->material);
    rf_release(s);
}

static RfResult run_still(Still *s, const RfExemplar *exemplar, int width, int height)
{
    RF_TRY(rf_progress("preparing the exemplar", 0));
    RF_TRY(rf_synthesis_material_create(exemplar, s->options->levels, s->options->similar, &s->material));
    RF_TRY(make_bounds(s, width, height));
    return run_levels(s);
}

static RfResult make_still(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                           const RfOptimizeConstraints *constraints, int width, int height, Still **out)
{
    static const RfOptimizeConstraints none;
    *out = NULL;
    Still *s = rf_allocate_zero(1, sizeof *s);
    if (!s)
        return RF_OUT_OF_MEMORY;
    s->options = options;
    s->constraints = constraints ? constraints : &none;
    RfResult result = run_still(s, exemplar, width, height);
    if (result == RF_OK)
        *out = s;
    else
        free_still(s);
    return result;
}

RfResult rf_optimize_start(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                           const RfOptimizeConstraints *constraints, int width, int height, RfOptimizeStart *out)
{
    Still *s;
    RF_TRY(make_still(exemplar, options, constraints, width, height, &s));
    *out = (RfOptimizeStart){s->material, s->frame};
    s->material = (RfSynthesisMaterial){0};
    s->frame = (RfSynthesisFrame){0};
    free_still(s);
    return RF_OK;
}

static RfResult check_view(const char *name, const RfImageView *view, int channels, const RfImageView *image)
{
    if (!view->pixels)
        return RF_OK;
    RF_REQUIRE(view->width == image->width && view->height == image->height && view->channels == channels,
               "rf_optimize_still: %s is %d x %d with %d channels, not %d x %d with %d", name, view->width,
               view->height, view->channels, image->width, image->height, channels);
    for (int y = 0; y < view->height; ++y)
        for (int i = 0; i < view->width * channels; ++i)
            RF_REQUIRE(fabsf(view->pixels[y * view->row_stride + i]) < 1e15f,
                       "rf_optimize_still: %s has a value that is not finite", name);
    return RF_OK;
}

static RfResult check_views(const RfExemplar *exemplar, const RfOptimizeConstraints *k, const RfImageView *image)
{
    int made = rf_optimize_channels(exemplar), guides = exemplar->channels - made;
    RF_REQUIRE(image->channels == made, "rf_optimize_still: the image has %d channels, %d are made", image->channels,
               made);
    RF_REQUIRE(image->width >= LEAST_SIDE && image->height >= LEAST_SIDE && image->width <= RF_MAX_SIZE &&
                   image->height <= RF_MAX_SIZE,
               "rf_optimize_still: %d x %d pixels: each side must be %d to %d", image->width, image->height, LEAST_SIDE,
               RF_MAX_SIZE);
    RF_REQUIRE((guides > 0) == (k->guide.pixels != NULL),
               "rf_optimize_still: the exemplar's map %s and a guide belong "
               "together",
               RF_GUIDE_MAP);
    RF_REQUIRE(k->target.pixels || !k->target_weight.pixels, "rf_optimize_still: a weight without a target");
    RF_TRY(check_view("fixed", &k->fixed, made + 1, image));
    RF_TRY(check_view("target", &k->target, made, image));
    RF_TRY(check_view("target_weight", &k->target_weight, 1, image));
    RF_TRY(check_view("guide", &k->guide, guides, image));
    RF_TRY(check_view("orientation", &k->orientation, 1, image));
    return check_view("scale", &k->scale, 1, image);
}

RfResult rf_optimize_still(const RfExemplar *exemplar, const RfOptimizeOptions *options,
                           const RfOptimizeConstraints *constraints, const RfImageView *image)
{
    RF_REQUIRE(exemplar && options && image && image->pixels, "rf_optimize_still: exemplar, options or image is NULL");
    RF_TRY(rf_optimize_check(options));
    static const RfOptimizeConstraints none;
    RF_TRY(check_views(exemplar, constraints ? constraints : &none, image));
    Still *s;
    RF_TRY(make_still(exemplar, options, constraints, image->width, image->height, &s));
    Drawing drawing = {s, image};
    rf_parallel_for(image->height, draw_row, &drawing);
    free_still(s);
    return RF_OK;
}
