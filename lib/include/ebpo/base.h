/* SPDX-License-Identifier: MIT
 * EBP-Octree in HDF5: what all parts of the library share.
 *
 *   Versions   EBPO_VERSION_NUMBER, ebpo_version
 *   Structs    those that begin with their size, and EBPO_..._INIT
 *   Errors     ebpo_status, ebpo_error
 *   Dates      ebpo_is_date
 *   Progress   ebpo_progress
 *   Outputs    ebpo_write_file, ebpo_output_begin, ebpo_check_output, ebpo_abandon_outputs,
 *              ebpo_folder_begin, ebpo_folder_publish
 *
 * Rules that hold for every function:
 *
 * Arguments come in this order: the object that is worked on, what else is
 * needed, options, outputs, and the error last.
 *
 * Options may be NULL: all of them have their usual values then. So may the
 * error, and any output that says so.
 *
 * What is made by ebpo_..._new is freed by ebpo_..._free, and what is opened is
 * closed. NULL may be freed and closed. A function that fails makes nothing.
 *
 * "Threads:" says who may call a function at the same time:
 *   any           any number of threads, also with the same arguments;
 *   one per X     one thread at a time for one object X; different objects do
 *                 not matter to each other.
 * Freeing an object is for the last thread that uses it.
 *
 * Stack: a query (query.h) takes less than 64 KiB of the calling thread's, building
 * and verifying less than 256 KiB, everything else less than 1 MiB. The library's
 * threads have stacks of 4 MiB, whatever the limit of the process is.
 *
 * The caller's floating-point environment does not matter. Rounding mode,
 * flushing of denormals and traps are put aside while a function computes, and
 * are as they were when it returns. Callbacks run in the default environment.
 */
#ifndef EBPO_BASE_H
#define EBPO_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- structs that begin with their size ---- */

/*
 * A struct that may grow in later versions begins with its own size. That goes
 * for all options, and for most structs that the library fills in. Begin them
 * with their macro, which sets the size and the usual values:
 *
 *     ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
 *     ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
 *
 * A program then runs with every later library of the same major version, from 1.0
 * on: what
 * its structs do not have yet keeps the usual values, or is not filled in. It
 * runs with an earlier library too, unless it sets something that this library
 * does not know, which is EBPO_E_UNSUPPORTED. Without the macro, struct_size is
 * wrong, which is EBPO_E_ARGUMENT.
 *
 * All other structs stay as they are within a major version. Their reserved
 * members are 0.
 */
#ifdef __cplusplus
template <class T> inline T ebpo_sized()
{
    T it = T();
    it.struct_size = sizeof(T);
    return it;
}
#define EBPO_SIZED(type) ebpo_sized<type>()
#else
#define EBPO_SIZED(type)            \
    {                               \
        .struct_size = sizeof(type) \
    }
#endif

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define EBPO_API               __attribute__((visibility("default")))
#define EBPO_MUST_USE          __attribute__((warn_unused_result))
#define EBPO_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define EBPO_API
#define EBPO_MUST_USE
#define EBPO_PRINTF(fmt, args)
#endif

/* ---- versions ---- */

/* Of these headers. */
#define EBPO_VERSION_MAJOR 0
#define EBPO_VERSION_MINOR 1
#define EBPO_VERSION_PATCH 0

/*
 * One number to compare with:
 *
 *     #if EBPO_VERSION_NUMBER >= EBPO_VERSION_OF(0, 2, 0)
 */
#define EBPO_VERSION_OF(major, minor, patch) ((major)*1000000 + (minor)*1000 + (patch))
#define EBPO_VERSION_NUMBER \
    EBPO_VERSION_OF(EBPO_VERSION_MAJOR, EBPO_VERSION_MINOR, EBPO_VERSION_PATCH)

/*
 * The version of the library that runs, as EBPO_VERSION_NUMBER is that of the
 * headers. Where the two differ in the major version, the program has to be
 * compiled again.
 *
 * Threads: any.
 */
EBPO_API int ebpo_version_number(void);

/*
 * The same as a text, "major.minor.patch". A static string.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_version(void);

/* ---- errors ---- */

/*
 * Every function that can fail returns one of these. Numbers are never reused.
 * There is no error state, neither global nor of a thread.
 */
typedef enum ebpo_status {
    EBPO_OK = 0,
    EBPO_E_MEMORY = -1,      /* an allocation failed */
    EBPO_E_ARGUMENT = -2,    /* the caller broke a documented rule */
    EBPO_E_IO = -3,          /* the operating system or a server said no */
    EBPO_E_FORMAT = -4,      /* a file is not what it says it is, or is damaged */
    EBPO_E_VERSION = -5,     /* a file needs a newer reader */
    EBPO_E_UNSUPPORTED = -6, /* valid, but this build or version cannot do it */
    EBPO_E_NOT_SOLID = -7,   /* a solid is required, and the mesh does not balance */
    EBPO_E_LIMIT = -8,       /* a count or size is beyond a stated limit */
    EBPO_E_CANCELLED = -9,   /* a callback asked to stop */
    EBPO_E_ABSENT = -10      /* the file was written without what is needed */
} ebpo_status;

/*
 * What went wrong. A function that fails fills it in, others leave it alone.
 * Begin it with EBPO_ERROR_INIT.
 */
typedef struct ebpo_error {
    ebpo_status status;

    /*
     * What happened, where, and what to do next: one sentence of UTF-8 without
     * a newline. It begins with `file` and `object` where these are known.
     */
    char message[480];

    /* The file, URL or mesh at fault, as messages name it; "" if there is none. */
    char file[256];

    /* A path inside an .ebpo.h5 file, such as "/levels/03/planes"; or "". */
    char object[64];

    /* The byte of the file at fault; -1 if it is not known. */
    int64_t offset;

    uint64_t reserved[4];
} ebpo_error;

#define EBPO_ERROR_INIT                \
    {                                  \
        EBPO_OK, "", "", "", -1, { 0 } \
    }

/*
 * The name of a status, such as "EBPO_E_FORMAT". A static string, never NULL.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_status_name(ebpo_status status);

/* ---- dates ---- */

/*
 * Returns true for a date as in ISO 8601 that the calendar has: YYYY, YYYY-MM, YYYY-MM-DD, or the
 * last with a T and a time: HH:MM, HH:MM:SS, or that with decimals, and behind it Z, +HH:MM, -HH:MM
 * or nothing.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_is_date(const char *text);

/* ---- progress ---- */

/*
 * Called when a stage begins, and then a few times a second at most, by the
 * thread that called the library. `stage` is a static string. `done` counts up
 * to `total`, which is 0 if it is not known.
 *
 * Return false to stop: the running call then ends with EBPO_E_CANCELLED, and
 * leaves no file behind.
 */
typedef bool (*ebpo_progress_fn)(void *user, const char *stage, uint64_t done, uint64_t total);

typedef struct ebpo_progress {
    ebpo_progress_fn report; /* NULL: silent */
    void *user;              /* handed to `report` */
} ebpo_progress;

/* ---- outputs ---- */

/*
 * Writes `size` bytes as one file, which appears whole or not at all: it is
 * written under a temporary name, synced and renamed. An existing regular file
 * is replaced.
 *
 * EBPO_E_IO: it could not be written.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_write_file(const char *path, const void *data, size_t size,
                                                   ebpo_error *error);

/* A file in the making. */
typedef struct ebpo_output ebpo_output;

/*
 * The same for what is too long for memory: begins a file that appears at `path` when it
 * is ended, and leaves nothing behind otherwise. What killed programs have left for the
 * same path is removed.
 *
 * out          ended by ebpo_output_end, or ebpo_output_abandon. On failure NULL.
 * descriptor   to write to, and to read what was written; closed with the output
 *
 * EBPO_E_IO: as ebpo_check_output. EBPO_E_LIMIT: more than 32 outputs at a time.
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_output_begin(const char *path, ebpo_output **out,
                                                     int *descriptor, ebpo_error *error);

/*
 * Syncs it and gives it its name; frees `out` in any case.
 *
 * EBPO_E_IO: it could not be written; `path` is as it was.
 *
 * Threads: one per output.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_output_end(ebpo_output *out, ebpo_error *error);

/*
 * Removes it. NULL is fine.
 *
 * Threads: one per output.
 */
EBPO_API void ebpo_output_abandon(ebpo_output *out);

/*
 * Whether an output could be begun at `path` now. Worth asking before hours of
 * work.
 *
 * EBPO_E_IO: the folder is not there or cannot be written to, or the path is a
 * folder or a device.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_check_output(const char *path, ebpo_error *error);

/*
 * Removes the temporary files of all outputs that this process is writing. They
 * cannot be finished afterwards. Made for signal handlers, just before the
 * process ends: it calls nothing but unlink.
 *
 * Threads: any.
 */
EBPO_API void ebpo_abandon_outputs(void);

/*
 * Makes a folder beside `folder`, to be filled and then put in its place. It is
 * the caller's: where it is not published, he removes it and what is in it.
 * Those for the same `folder` that killed programs left are removed.
 *
 * making   the new folder's path. Freed by free(). On failure NULL.
 *
 * EBPO_E_IO: `folder` is there already, or nothing can be made beside it.
 * EBPO_E_MEMORY.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_folder_begin(const char *folder, char **making,
                                                     ebpo_error *error);

/*
 * Renames it, whole, with the rights of any folder that the user makes.
 *
 * EBPO_E_IO: it cannot be put there; it is still where it was.
 *
 * Threads: one at a time in the process, as it looks at the umask.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_folder_publish(const char *making, const char *folder,
                                                       ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
