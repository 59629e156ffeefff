// SPDX-License-Identifier: Apache-2.0
//
// Two slots: while the worker computes frame n + 1 into one, this thread writes frame n from the other. A state taken
// behind frame n is written only when frame n's files stand, so that whatever ends the program, the state on the disk
// never promises a frame that is not there.
//
//   worker   | compute 1 | compute 2      | compute 3 ...
//   main                 | write 1, state | write 2, state ...
//
// After a signal the frame being computed gets 0.4 s to finish, then the library is told to end it, and 0.6 s after the
// signal it is waited for no more. If it is finished, it is written and the state saved; if not,
// the program leaves without it: the last state is at most ten frames old, and these are made again.
#include "run.h"
#include "setup.h"
#include "state.h"
#include "stop.h"
#include "worker.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum
{
    RARE_STATE = 10
};

// Part of a frame's time that saving may take before it is done only every tenth frame.
static const double g_saving_limit = 0.05;
// The library may end a frame for so long after a signal, and is waited for a little longer.
static const double g_step_seconds = 0.4, g_grace_seconds = 0.6, g_poll_seconds = 0.05;

/// What the library is doing for the worker.
typedef struct Telling
{
    pthread_mutex_t lock;
    char stage[64];
    RfProgress progress;
} Telling;

/// One frame for the worker.
typedef struct Job
{
    const FrameSource *source;
    FrameSlot *slot;
    /// The run's, told by the worker.
    Telling *telling;
    int index, frame;
    bool drawn, save;
} Job;

typedef struct Run
{
    const Settings *settings;
    const FramePlan *plan;
    const FrameSource *source;
    Outputs *outputs;
    Progress progress;
    State state;
    bool stateful;
    int state_every;
    double busy_seconds, saving_seconds;
    int saved;
    FrameSlot slots[2];
    Job jobs[2];
    /// 1 where nothing is written: a second frame in memory would be of no use.
    int slot_count;
    Worker worker;
    Telling telling;
    /// Frames written by this run, and whether it continued another.
    int written;
    bool resumed;
    /// --resume, and there is nothing left to do.
    bool finished;
} Run;

static int drawn_number(const void *context, int index)
{
    const FramePlan *plan = context;
    return plan_number(plan, index * plan->step);
}

/// From the worker's thread. A frame that is nearly done is finished after a signal.
static bool hear(void *user, const char *stage, double fraction)
{
    (void)fraction;
    Telling *telling = user;
    pthread_mutex_lock(&telling->lock);
    snprintf(telling->stage, sizeof telling->stage, "%s", stage);
    pthread_mutex_unlock(&telling->lock);
    return stop_age() < g_step_seconds;
}

static void show_stage(Run *run)
{
    char stage[sizeof run->telling.stage];
    pthread_mutex_lock(&run->telling.lock);
    memcpy(stage, run->telling.stage, sizeof stage);
    pthread_mutex_unlock(&run->telling.lock);
    progress_stage(&run->progress, stage[0] ? stage : "computing");
}

static int compute(void *context)
{
    Job *job = context;
    FrameSlot *slot = job->slot;
    rf_set_progress(&job->telling->progress);
    double start = now_seconds();
    slot->report = (FrameReport){.stage_count = 0};
    slot->seconds = 0;
    int code = job->source->produce(job->source->context, job->index, job->frame, job->drawn, slot);
    slot->busy_seconds = now_seconds() - start;
    if (code || !job->save)
        return code;
    start = now_seconds();
    if (job->source->save)
        code = job->source->save(job->source->context, &slot->block, &slot->block_size);
    slot->save_seconds = now_seconds() - start;
    return code;
}

static void post(Run *run, int index)
{
    Job *job = &run->jobs[index % run->slot_count];
    *job = (Job){.source = run->source,
                 .slot = &run->slots[index % run->slot_count],
                 .telling = &run->telling,
                 .index = index,
                 .frame = plan_number(run->plan, index),
                 .drawn = plan_drawn(run->plan, index),
                 .save = run->stateful && (run->state_every == 1 || (index + 1) % run->state_every == 0)};
    worker_post(&run->worker, compute, job);
}

/// Waits for the frame being computed. False: a signal came and it was not done in time.
static bool await(Run *run, int *code)
{
    while (!worker_wait(&run->worker, g_poll_seconds, code))
    {
        show_stage(run);
        if (stop_age() > g_grace_seconds)
            return false;
    }
    return true;
}

static int write_state(Run *run, int next, const void *block, size_t size)
{
    double start = now_seconds();
    int code = state_write(&run->state, next, block, size);
    run->saving_seconds += now_seconds() - start;
    ++run->saved;
    return code;
}

/// Where saving is dear, it is done for every tenth frame from now on.
static void weigh_saving(Run *run)
{
    if (run->state_every == 1 && run->saved >= 3 && run->saving_seconds > g_saving_limit * run->busy_seconds)
        run->state_every = RARE_STATE;
}

static int finish_frame(Run *run, int index)
{
    Job *job = &run->jobs[index % run->slot_count];
    FrameSlot *slot = job->slot;
    double start = now_seconds();
    int code = CODE_DONE;
    if (job->drawn)
    {
        progress_stage(&run->progress, "writing");
        code = slot->velocity ? outputs_write_flow(run->outputs, job->frame, &slot->flow)
                              : outputs_write(run->outputs, job->frame, slot->pixels, &slot->layout, slot->uv);
        run->written += code ? 0 : 1;
    }
    run->busy_seconds += slot->busy_seconds + now_seconds() - start;
    if (!code && job->save)
    {
        run->saving_seconds += slot->save_seconds;
        code = write_state(run, index + 1, slot->block, slot->block_size);
        weigh_saving(run);
    }
    rf_free(slot->block);
    slot->block = NULL;
    if (!code && job->drawn)
        progress_frame(&run->progress, job->frame, slot->seconds, &slot->report);
    return code;
}

/// Saves behind the last frame finished; the worker is idle.
static int save_now(Run *run, int next)
{
    void *block = NULL;
    size_t size = 0;
    int code = run->source->save ? run->source->save(run->source->context, &block, &size) : CODE_DONE;
    if (!code)
        code = state_write(&run->state, next, block, size);
    rf_free(block);
    return code;
}

static void tell_stop(const Run *run)
{
    const char *remedy = run->stateful ? "; --resume goes on from there" : "";
    warn(run->settings, NULL, "stopped by signal %d with %d of %d frames made%s", stop_asked(),
         run->progress.made_before + run->progress.made, plan_drawn_count(run->plan), remedy);
}

/// The frame on the way cannot be waited for: what is open is closed, and the program leaves from here, since the
/// worker still uses everything else.
static _Noreturn void leave(Run *run)
{
    outputs_close(run->outputs, false);
    progress_clear(&run->progress);
    tell_stop(run);
    _exit(CODE_SIGNAL + stop_asked());
}

/// Ends a run after a signal: `index` frames are finished, and a further one may be on the way.
static int stop_run(Run *run, int index, bool posted)
{
    int code = CODE_DONE;
    if (posted)
    {
        if (!await(run, &code))
            leave(run);
        if (!code)
            code = finish_frame(run, index);
        index += code ? 0 : 1;
    }
    if (!code && run->stateful)
        code = save_now(run, index);
    return code ? code : CODE_SIGNAL + stop_asked();
}

static int stream(Run *run, int first)
{
    int count = run->plan->count;
    bool overlap = run->slot_count > 1;
    if (first < count)
        post(run, first);
    for (int index = first; index < count; ++index)
    {
        int code = CODE_DONE;
        if (!await(run, &code))
            leave(run);
        if (code)
            return code;
        bool more = index + 1 < count && !stop_asked();
        if (more && overlap)
            post(run, index + 1);
        code = finish_frame(run, index);
        if (code)
            return code;
        if (stop_asked() && index + 1 < count)
            return stop_run(run, index + 1, more && overlap);
        if (more && !overlap)
            post(run, index + 1);
    }
    return CODE_DONE;
}

/// Finds out where to start; the frames before are encoded again where a video is wanted.
static int resume(Run *run, int *first)
{
    State *state = &run->state;
    int code = state_read(state);
    if (code)
        return code;
    *first = state->next < run->plan->count ? (int)state->next : run->plan->count;
    if (state->next > 0 && run->source->load && *first < run->plan->count)
        code = run->source->load(run->source->context, state->block, state->size);
    if (code == CODE_BAD_INPUT)
        code = fail(code, state->path, NULL, "%s", last_fault()->message);
    state_free(state);
    run->resumed = !code;
    if (run->resumed)
        outputs_sweep(run->outputs);
    return code;
}

static int replay(Run *run, int first)
{
    int code = CODE_DONE;
    for (int i = 0; i < first && !code && !stop_asked(); ++i)
        if (plan_drawn(run->plan, i))
            code = outputs_replay(run->outputs, plan_number(run->plan, i));
    return code;
}

static int prepare(Run *run, int *first)
{
    char name[PATH_SIZE];
    int code = outputs_gather(run->outputs, plan_drawn_count(run->plan));
    const Output *image = outputs_first_image(run->outputs);
    if (image && !outputs_have(run->outputs, OUTPUT_ARRAY) &&
        pattern_name(&image->pattern, plan_number(run->plan, 0), NULL, NULL, name))
        run->stateful = state_place(&run->state, name);
    run->state.hash = run->source->hash;
    if (code)
        return code;
    if (run->settings->resume && run->stateful && state_exists(&run->state))
        code = resume(run, first);
    else if (run->settings->resume && !run->outputs->replace)
        run->finished = outputs_complete(run->outputs, drawn_number, run->plan, plan_drawn_count(run->plan));
    if (run->finished)
        return code;
    run->outputs->replace = run->outputs->replace || run->resumed;
    if (!code)
        code = outputs_check(run->outputs, drawn_number, run->plan, plan_drawn_count(run->plan));
    if (code == CODE_USAGE && run->stateful && !run->settings->resume && state_exists(&run->state))
        fail(code, last_fault()->file, NULL, "%s; --resume goes on with the stopped run it belongs to",
             last_fault()->message);
    return code;
}

static int run_prepared(Run *run, int first)
{
    int drawn_before = first > 0 ? (first - 1) / run->plan->step + 1 : 0;
    int code = stop_asked() ? CODE_SIGNAL + stop_asked() : CODE_DONE;
    if (!code && run->stateful && !run->resumed)
        code = state_write(&run->state, 0, NULL, 0);
    progress_begin(&run->progress, run->settings, plan_drawn_count(run->plan), drawn_before);
    if (!code && run->resumed)
        code = replay(run, first);
    if (!code)
        code = worker_start(&run->worker);
    if (!code)
        code = stream(run, first);
    return code;
}

/// Ends the worker within a second even where its job goes on for long.
static void end_worker(Run *run, int code)
{
    int ignored = 0;
    if (run->worker.started && code && !await(run, &ignored))
        leave(run);
    worker_end(&run->worker);
}

static int close_run(Run *run, int code)
{
    Fault fault = *last_fault();
    end_worker(run, code);
    adopt_fault(&fault);
    int closed = outputs_close(run->outputs, code == CODE_DONE);
    if (code)
        adopt_fault(&fault);
    bool complete = code == CODE_DONE;
    code = code ? code : closed;
    // A run that wrote nothing leaves nothing.
    if (run->stateful && (complete || (run->written == 0 && !run->resumed && code < CODE_SIGNAL)))
        state_remove(&run->state);
    if (code == CODE_DONE)
        progress_done(&run->progress);
    else
        progress_clear(&run->progress);
    if (code >= CODE_SIGNAL)
        tell_stop(run);
    return code;
}

int run_frames(const Settings *settings, const FramePlan *plan, const FrameSource *source, Outputs *outputs)
{
    Run *run = calloc(1, sizeof *run);
    if (!run)
        return fail(CODE_FAILED, NULL, NULL, "out of memory");
    run->settings = settings;
    run->plan = plan;
    run->source = source;
    run->outputs = outputs;
    run->state_every = 1;
    run->telling.progress = (RfProgress){hear, &run->telling};
    pthread_mutex_init(&run->telling.lock, NULL);
    run->slot_count = outputs_idle(outputs) ? 1 : 2;
    int first = 0;
    int code = prepare(run, &first);
    setup_end();
    if (run->finished)
        progress_nothing_left(settings, plan_drawn_count(plan));
    else
        code = code ? code : close_run(run, run_prepared(run, first));
    for (int i = 0; i < 2; ++i)
    {
        rf_image_destroy(run->slots[i].pixels);
        rf_image_destroy(run->slots[i].uv);
        rf_free(run->slots[i].block);
        free(run->slots[i].velocity);
        free(run->slots[i].mask);
    }
    pthread_mutex_destroy(&run->telling.lock);
    free(run);
    return code;
}
