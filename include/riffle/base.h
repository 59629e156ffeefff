// SPDX-License-Identifier: Apache-2.0
// What every other header of Riffle needs: results, errors, memory, threads, progress and the description of options.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define RF_EXTERN extern "C"
#else
#define RF_EXTERN extern
#endif
#if defined(__GNUC__)
#define RF_API RF_EXTERN __attribute__((visibility("default")))
#define RF_MUST_USE __attribute__((warn_unused_result))
#else
#define RF_API RF_EXTERN
#define RF_MUST_USE
#endif

/// What became of a call. Everything but RF_OK leaves a message in rf_last_error().
typedef enum RfResult
{
    RF_OK = 0,
    /// The caller's mistake: an option out of its range, a NULL, sizes that do not agree. Builds with
    /// RIFFLE_STOP_ON_MISUSE=ON (the debug preset) stop there.
    RF_INVALID_ARGUMENT,
    /// A file is missing, cannot be opened or cannot be read.
    RF_UNREADABLE,
    /// A file's content is broken, too large, or not what was asked for.
    RF_BAD_INPUT,
    /// The content is fine, but this build or version cannot deal with it.
    RF_UNSUPPORTED,
    /// Writing failed: disk full, place not writable, the video encoder died.
    RF_WRITE_FAILED,
    RF_OUT_OF_MEMORY,
    /// The progress callback said stop.
    RF_CANCELLED
} RfResult;

/// The last failure of the calling thread. `file` and `place` are empty where they mean nothing.
typedef struct RfError
{
    RfResult result;
    char file[512];
    /// Where in the file: "line 812", "byte 96", "header".
    char place[128];
    /// What is wrong and what to do about it, one line, without file and place.
    char message[768];
} RfError;

/// Never NULL; result is RF_OK if nothing has failed yet. Valid until the thread's next failing call.
RF_API const RfError *rf_last_error(void);

/// "bad input", "out of memory", ...
RF_API const char *rf_result_name(RfResult result);

/// "0.1.0"
RF_API const char *rf_version(void);

/// The pair every allocation of the library goes through. `allocate` gets the alignment wanted (a power of two, at most
/// 64); `release` is never called with NULL. Both may be called from any thread.
typedef struct RfAllocator
{
    void *(*allocate)(size_t bytes, size_t alignment, void *user);
    void (*release)(void *memory, void *user);
    void *user;
} RfAllocator;

/// Replaces the allocator; NULL brings the default back. Call it before anything else is created, from one thread.
RF_API void rf_set_allocator(const RfAllocator *allocator);

/// Frees what a function of the library gave out as a plain block (saved states). Accepts NULL.
RF_API void rf_free(void *memory);

/// Number of threads that every later call uses, 1 to 256; 0 means one a processor (the default). Results do not depend
/// on it.
RF_API void rf_set_threads(int count);
RF_API int rf_threads(void);

/// The instruction set in use: "plain", "avx2" or "avx512". The environment variable RF_SIMD picks a lower one than the
/// machine has. (AVX-512 comes with VNNI or without; RF_SIMD=avx512 does not use it. No result differs by that.)
/// Results are the same bytes for any number of threads on one instruction set; between two sets they agree within
/// 1e-4.
RF_API const char *rf_simd_name(void);

/// Progress of a long call. `report` gets the stage's name and the fraction of it done, 0 to 1, which does not decrease
/// while the stage lasts; it returns false to stop the call, which then returns RF_CANCELLED and leaves nothing
/// half-done. Called from the calling thread only, several times a second as a rule.
typedef struct RfProgress
{
    bool (*report)(void *user, const char *stage, double fraction);
    void *user;
} RfProgress;

/// Every later long call of this thread reports to it; NULL ends that. The struct is borrowed. A report may not call
/// the library.
RF_API void rf_set_progress(const RfProgress *progress);

typedef enum RfOptionKind
{
    RF_OPTION_FLOAT,
    RF_OPTION_INT,
    RF_OPTION_UINT64,
    RF_OPTION_BOOL,
    /// An int whose values are named by `choices`.
    RF_OPTION_CHOICE,
    /// An array of RF_MAX_OPTION_INTS ints, of which the first one is given; a 0 ends it where it is shorter.
    RF_OPTION_INTS
} RfOptionKind;

enum
{
    /// Entries of an RF_OPTION_INTS.
    RF_MAX_OPTION_INTS = 4
};

/// One field of an options struct, so that command lines, help texts and bindings need not repeat it.
typedef struct RfOption
{
    /// Spelled with dashes, as on the command line: "particle-radius".
    const char *name;
    RfOptionKind kind;
    /// Of the field, in bytes from the start of the struct.
    size_t offset;
    /// "px", "s", "" for plain numbers.
    const char *unit;
    /// Of RF_OPTION_INTS each entry is held to minimum and maximum, and default_value is its first one.
    double minimum, maximum, default_value;
    /// "plain|contrast|histogram" for RF_OPTION_CHOICE: the n-th name stands for the value n, from 0. "17,9", the
    /// default, for RF_OPTION_INTS. Else NULL.
    const char *choices;
    /// One sentence: meaning, and what turning it does.
    const char *sentence;
} RfOption;
