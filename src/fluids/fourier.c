// SPDX-License-Identifier: Apache-2.0
#include "fluids/fourier.h"

#include "core/maths.h"
#include "core/memory.h"
#include "core/parallel.h"

struct RfFourier
{
    int width, height;
    /// [inverse]
    kiss_fft_cfg rows[2], columns[2];
    RfComplex *scratch;
};

typedef struct Pass
{
    kiss_fft_cfg plan;
    const RfComplex *from;
    RfComplex *to;
    /// Lines and samples of a line in `from`.
    int lines, samples;
} Pass;

enum
{
    LINES_AN_ITEM = 16,
    /// Samples of a pass that takes longer than threads take to wake: about half a millisecond.
    WORTH_THREADS = 1 << 16
};

/// Transforms lines of `from` and writes them as lines of `to`.
static void transform_lines(void *context, int item, int worker)
{
    (void)worker;
    const Pass *pass = context;
    int end = rf_min_int(pass->lines, (item + 1) * LINES_AN_ITEM);
    for (int line = item * LINES_AN_ITEM; line < end; ++line)
    {
        size_t start = (size_t)line * (size_t)pass->samples;
        kiss_fft(pass->plan, pass->from + start, pass->to + start);
    }
}

/// `to`[samples][lines] = `from`[lines][samples] turned, in blocks that stay in the cache.
static void transpose_lines(void *context, int item, int worker)
{
    (void)worker;
    const Pass *pass = context;
    int end = rf_min_int(pass->lines, (item + 1) * LINES_AN_ITEM);
    for (int first = 0; first < pass->samples; first += LINES_AN_ITEM)
        for (int line = item * LINES_AN_ITEM; line < end; ++line)
            for (int k = first; k < rf_min_int(pass->samples, first + LINES_AN_ITEM); ++k)
                pass->to[(size_t)k * (size_t)pass->lines + (size_t)line] =
                    pass->from[(size_t)line * (size_t)pass->samples + (size_t)k];
}

static void run(RfParallelFn *function, Pass pass)
{
    int items = (pass.lines + LINES_AN_ITEM - 1) / LINES_AN_ITEM;
    if ((int64_t)pass.lines * pass.samples >= WORTH_THREADS)
        rf_parallel_for(items, function, &pass);
    else
        for (int item = 0; item < items; ++item)
            function(&pass, item, 0);
}

/// KissFFT takes its plans' memory from us. (For lengths with a prime factor over 5 it also asks malloc for one line.)
static kiss_fft_cfg make_plan(int length, bool inverse)
{
    size_t size = 0;
    kiss_fft_alloc(length, inverse, NULL, &size);
    void *memory = rf_allocate(size, 1);
    return memory ? kiss_fft_alloc(length, inverse, memory, &size) : NULL;
}

RfResult rf_fourier_create(int width, int height, RfFourier **out)
{
    RfFourier *fourier = rf_allocate_zero(1, sizeof *fourier);
    if (!fourier)
        return RF_OUT_OF_MEMORY;
    fourier->width = width;
    fourier->height = height;
    fourier->scratch = rf_allocate((size_t)width * (size_t)height, sizeof(RfComplex));
    bool made = fourier->scratch != NULL;
    for (int inverse = 0; inverse < 2; ++inverse)
    {
        fourier->rows[inverse] = make_plan(width, inverse);
        fourier->columns[inverse] = make_plan(height, inverse);
        made = made && fourier->rows[inverse] && fourier->columns[inverse];
    }
    if (!made)
    {
        rf_fourier_destroy(fourier);
        return RF_OUT_OF_MEMORY;
    }
    *out = fourier;
    return RF_OK;
}

void rf_fourier_destroy(RfFourier *fourier)
{
    if (!fourier)
        return;
    for (int inverse = 0; inverse < 2; ++inverse)
    {
        rf_release(fourier->rows[inverse]);
        rf_release(fourier->columns[inverse]);
    }
    rf_release(fourier->scratch);
    rf_release(fourier);
}

void rf_fourier_transform(RfFourier *fourier, RfComplex *field, bool inverse)
{
    int width = fourier->width, height = fourier->height;
    RfComplex *scratch = fourier->scratch;
    run(transform_lines, (Pass){fourier->rows[inverse], field, scratch, height, width});
    run(transpose_lines, (Pass){NULL, scratch, field, height, width});
    run(transform_lines, (Pass){fourier->columns[inverse], field, scratch, width, height});
    run(transpose_lines, (Pass){NULL, scratch, field, width, height});
}
