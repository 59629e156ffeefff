// SPDX-License-Identifier: Apache-2.0
// One thread beside the main one, which computes the next frame while this one is written, and which need not be waited
// for when the user wants to stop.
#pragma once

#include "errors.h"

#include <pthread.h>
#include <stdbool.h>

typedef struct Worker
{
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    int (*job)(void *context);
    void *context;
    bool busy, quit, started;
    int code;
    Fault fault;
} Worker;

int worker_start(Worker *worker);
/// Starts a job; the worker must be idle.
void worker_post(Worker *worker, int (*job)(void *context), void *context);
/// Waits at most `seconds` for the job; true if it is done. Then *code is its result, and its fault this thread's.
bool worker_wait(Worker *worker, double seconds, int *code);
/// Waits for the job and ends the thread. Accepts a worker that was not started.
void worker_end(Worker *worker);
