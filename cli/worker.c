// SPDX-License-Identifier: Apache-2.0
#include "worker.h"

#include <string.h>
#include <time.h>

static void *work(void *context)
{
    Worker *worker = context;
    pthread_mutex_lock(&worker->lock);
    while (!worker->quit || worker->busy)
    {
        if (!worker->busy)
        {
            pthread_cond_wait(&worker->changed, &worker->lock);
            continue;
        }
        pthread_mutex_unlock(&worker->lock);
        int code = worker->job(worker->context);
        pthread_mutex_lock(&worker->lock);
        worker->code = code;
        worker->fault = *last_fault();
        worker->busy = false;
        pthread_cond_broadcast(&worker->changed);
    }
    pthread_mutex_unlock(&worker->lock);
    return NULL;
}

int worker_start(Worker *worker)
{
    *worker = (Worker){0};
    pthread_mutex_init(&worker->lock, NULL);
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&worker->changed, &attributes);
    pthread_condattr_destroy(&attributes);
    int error = pthread_create(&worker->thread, NULL, work, worker);
    worker->started = error == 0;
    return error ? fail(CODE_FAILED, NULL, NULL, "no thread to compute with: %s", strerror(error)) : CODE_DONE;
}

void worker_post(Worker *worker, int (*job)(void *context), void *context)
{
    pthread_mutex_lock(&worker->lock);
    worker->job = job;
    worker->context = context;
    worker->busy = true;
    pthread_cond_broadcast(&worker->changed);
    pthread_mutex_unlock(&worker->lock);
}

bool worker_wait(Worker *worker, double seconds, int *code)
{
    struct timespec until;
    clock_gettime(CLOCK_MONOTONIC, &until);
    long nanoseconds = until.tv_nsec + (long)(1e9 * seconds);
    until.tv_sec += nanoseconds / 1000000000;
    until.tv_nsec = nanoseconds % 1000000000;
    pthread_mutex_lock(&worker->lock);
    int waited = 0;
    while (worker->busy && waited == 0)
        waited = pthread_cond_timedwait(&worker->changed, &worker->lock, &until);
    bool done = !worker->busy;
    if (done)
    {
        *code = worker->code;
        adopt_fault(&worker->fault);
    }
    pthread_mutex_unlock(&worker->lock);
    return done;
}

void worker_end(Worker *worker)
{
    if (!worker->started)
        return;
    pthread_mutex_lock(&worker->lock);
    worker->quit = true;
    pthread_cond_broadcast(&worker->changed);
    pthread_mutex_unlock(&worker->lock);
    pthread_join(worker->thread, NULL);
    pthread_mutex_destroy(&worker->lock);
    pthread_cond_destroy(&worker->changed);
    worker->started = false;
}
