// SPDX-License-Identifier: Apache-2.0
#include "kernels/cubic_spline.h"

#include "core/parallel.h"

// The recursive filter's pole, sqrt(3) - 2. Its powers fall under float's precision after 12 samples.
#define POLE (-0.26794919243112270647f)
#define GAIN 6.0f

enum
{
    HORIZON = 12,
    BAND = 64
};

typedef struct Job
{
    float *samples;
    int width, height, channels;
} Job;

// One line of `count` samples `step` floats apart, `lanes` of them side by side: forward, then backward recursion. The
// mirrored border fixes both starting values.
static void filter_lines(float *line, int count, ptrdiff_t step, int lanes)
{
    if (count < 2)
        return;
    for (int l = 0; l < lanes; ++l)
    {
        float sum = line[l], power = POLE;
        for (int k = 1; k <= HORIZON; ++k, power *= POLE)
        {
            int turned = k % (2 * count - 2);
            sum += power * line[(turned < count ? turned : 2 * count - 2 - turned) * step + l];
        }
        line[l] = sum;
    }
    for (int i = 1; i < count; ++i)
    {
        float *now = line + i * step;
        const float *before = now - step;
        for (int l = 0; l < lanes; ++l)
            now[l] += POLE * before[l];
    }
    float *last = line + (count - 1) * step;
    for (int l = 0; l < lanes; ++l)
        last[l] = POLE / (POLE * POLE - 1) * (last[l] + POLE * last[l - step]);
    for (int i = count - 2; i >= 0; --i)
    {
        float *now = line + i * step;
        const float *after = now + step;
        for (int l = 0; l < lanes; ++l)
            now[l] = POLE * (after[l] - now[l]);
    }
    for (int i = 0; i < count; ++i)
        for (int l = 0; l < lanes; ++l)
            line[i * step + l] *= GAIN;
}

static void filter_row_band(void *context, int item, int worker)
{
    (void)worker;
    const Job *job = context;
    size_t row_floats = (size_t)job->width * (size_t)job->channels;
    int end = rf_min_int((item + 1) * BAND, job->height);
    for (int y = item * BAND; y < end; ++y)
        filter_lines(job->samples + (size_t)y * row_floats, job->width, job->channels, job->channels);
}

static void filter_column_band(void *context, int item, int worker)
{
    (void)worker;
    const Job *job = context;
    int row_floats = job->width * job->channels, start = item * BAND;
    filter_lines(job->samples + start, job->height, row_floats, rf_min_int(BAND, row_floats - start));
}

void rf_spline_prefilter(float *samples, int width, int height, int channels)
{
    Job job = {samples, width, height, channels};
    rf_parallel_for((height + BAND - 1) / BAND, filter_row_band, &job);
    rf_parallel_for((width * channels + BAND - 1) / BAND, filter_column_band, &job);
}
