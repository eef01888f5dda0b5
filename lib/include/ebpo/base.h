/* SPDX-License-Identifier: MIT
 * Rules and types that all headers of the library share.
 *
 *   Versions   EBPO_VERSION_NUMBER, ebpo_version
 *   Structs    struct_size and EBPO_..._INIT
 *   Errors     ebpo_status, ebpo_error
 *   Dates      ebpo_is_date
 *   Progress   ebpo_progress
 *   Outputs    ebpo_write_file, ebpo_output_begin, ebpo_check_output, ebpo_abandon_outputs,
 *              ebpo_folder_begin, ebpo_folder_publish
 *
 * These rules hold for every function. Other headers do not repeat them.
 *
 * Arguments: first the object, then other inputs, options and outputs; the error is last. Options
 * may be NULL, which selects the default values. The error may be NULL. An output may be NULL only
 * if its comment says so. Indices begin at 0. `[n][3]` gives the shape of an array in row-major
 * order.
 *
 * Ownership: ebpo_..._free frees what ebpo_..._new made, and ebpo_..._close closes what
 * ebpo_..._open opened. Both accept NULL. "Lent" memory belongs to the library. "Borrowed" memory
 * belongs to the caller and must stay unchanged for the stated time.
 *
 * Failure: a function that fails makes no object, and sets its output for a new object to NULL.
 *
 * A callback that receives results returns false to stop the call. After this, the callback is not
 * called again, and the call succeeds.
 *
 * Errors: comments list the statuses that need an explanation. Any function that returns
 * ebpo_status can return EBPO_E_MEMORY, and EBPO_E_ARGUMENT for an argument that is NULL, out of
 * range or not initialized with its macro. A function with a progress callback can return
 * EBPO_E_CANCELLED. "The errors of reading" are EBPO_E_IO and EBPO_E_FORMAT, and EBPO_E_PENDING for
 * files with a source of async.h. The comment of ebpo_status gives the general meaning of each
 * status. "Also if ..." after a status adds a case to this meaning. If a comment refers to the
 * errors of another function, the errors of that function are also possible.
 *
 * Parameter or member `threads`: number of threads to use; 0: all cores. The result does not depend
 * on this number. Member `progress`: callback that reports progress; by default none. Parameter
 * `user`: passed to the callback unchanged. Members `reserved` are 0.
 *
 * "Threads:" in a comment says which threads may call a function at the same time:
 *   any                   any number of threads, also with the same arguments, if no thread changes
 *                         the arguments meanwhile
 *   one at a time per X   one thread at a time for each object X; any number of threads with
 *                         different objects
 * The caller frees an object after all threads have ended their use of the object. A function may
 * start threads. These threads end before the function returns, except if the comment of the
 * function says otherwise.
 *
 * Stack: functions use the calling thread's stack: a query (query.h) less than 64 KiB, building and
 * verifying less than 256 KiB, all other functions less than 1 MiB. The threads that the library
 * starts have stacks of 4 MiB, independent of the process limit.
 *
 * Floating-point environment: a function saves the caller's rounding mode, traps and treatment of
 * denormals, computes in the default environment, and restores what it saved. Callbacks run in the
 * default environment.
 */
#ifndef EBPO_BASE_H
#define EBPO_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* ---- structs with struct_size ---- */

/*
 * A struct that may grow in later versions begins with its own size. These structs are all options
 * structs, and most structs that the library fills in. Initialize each of them with its macro,
 * which sets the size and the default values:
 *
 *     ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
 *     ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
 *
 * From version 1.0 on, a program that uses these macros runs with every later library of the same
 * major version. Members that the program's structs lack have their default values, or are not
 * filled in. The program also runs with an earlier library. But if the program sets a member that
 * the earlier library does not know, the call returns EBPO_E_UNSUPPORTED. A wrong struct_size is
 * EBPO_E_ARGUMENT.
 *
 * All other structs keep their layout within a major version. Their reserved members are 0.
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

#if defined(_WIN32)
#define EBPO_API __declspec(dllexport)
#elif defined(__GNUC__)
#define EBPO_API __attribute__((visibility("default")))
#else
#define EBPO_API
#endif

#if defined(__GNUC__)
#define EBPO_MUST_USE          __attribute__((warn_unused_result))
#define EBPO_PRINTF(fmt, args) __attribute__((format(printf, fmt, args)))
#else
#define EBPO_MUST_USE
#define EBPO_PRINTF(fmt, args)
#endif

/* ---- versions ---- */

/* Version of these headers. */
#define EBPO_VERSION_MAJOR 0
#define EBPO_VERSION_MINOR 1
#define EBPO_VERSION_PATCH 0

/*
 * Version as one number for comparisons:
 *
 *     #if EBPO_VERSION_NUMBER >= EBPO_VERSION_OF(0, 2, 0)
 */
#define EBPO_VERSION_OF(major, minor, patch) ((major)*1000000 + (minor)*1000 + (patch))
#define EBPO_VERSION_NUMBER \
    EBPO_VERSION_OF(EBPO_VERSION_MAJOR, EBPO_VERSION_MINOR, EBPO_VERSION_PATCH)

/*
 * Returns the version of the library in use, in the form of EBPO_VERSION_NUMBER. If the major
 * version of the library differs from the major version of the headers, compile the program again.
 *
 * Threads: any.
 */
EBPO_API int ebpo_version_number(void);

/*
 * Returns the version of the library as a static string, "major.minor.patch".
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_version(void);

/* ---- errors ---- */

/*
 * Result of every function that can fail. A value is never reused for another status. The library
 * keeps no error state, neither global nor per thread.
 */
typedef enum ebpo_status {
    EBPO_OK = 0,
    EBPO_E_MEMORY = -1,      /* an allocation failed */
    EBPO_E_ARGUMENT = -2,    /* the caller broke a documented rule */
    EBPO_E_IO = -3,          /* the operating system or a server reported an error */
    EBPO_E_FORMAT = -4,      /* a file has the wrong format or is damaged */
    EBPO_E_VERSION = -5,     /* a file needs a newer reader */
    EBPO_E_UNSUPPORTED = -6, /* valid, but not supported by this build or version */
    EBPO_E_NOT_SOLID = -7,   /* a solid is required, and the mesh is not closed */
    EBPO_E_LIMIT = -8,       /* a count or size exceeds a stated limit */
    EBPO_E_CANCELLED = -9,   /* a callback requested to stop */
    EBPO_E_ABSENT = -10,     /* the file does not contain the required data */
    EBPO_E_PENDING = -11     /* bytes of the file are not available yet (async.h) */
} ebpo_status;

/*
 * Description of an error. A function that fails fills it in; other functions do not change it.
 * Initialize it with EBPO_ERROR_INIT.
 */
typedef struct ebpo_error {
    ebpo_status status;

    /*
     * Description of the error, its location and the remedy: UTF-8 without a newline. The text
     * begins with `file` and `object` if these are known.
     */
    char message[480];

    /* Name of the file, URL or mesh that caused the error, as in messages; "" if none. */
    char file[256];

    /* Path inside an .ebpo.h5 file, such as "/levels/03/planes"; "" if none. */
    char object[64];

    /* Byte offset of the error in the file; -1 if unknown. */
    int64_t offset;

    /*
     * errno of the system call that failed, such as ENOENT; 0 if no call failed, or if errno was
     * not recorded. ENOENT is also set when a web server has no such file.
     */
    int64_t system_error;

    uint64_t reserved[3];
} ebpo_error;

#define EBPO_ERROR_INIT                   \
    {                                     \
        EBPO_OK, "", "", "", -1, 0, { 0 } \
    }

/*
 * Returns the name of a status, such as "EBPO_E_FORMAT". The string is static and never NULL.
 *
 * Threads: any.
 */
EBPO_API const char *ebpo_status_name(ebpo_status status);

/* ---- dates ---- */

/*
 * Returns true for a valid calendar date in ISO 8601: YYYY, YYYY-MM or YYYY-MM-DD. The last form
 * may continue with T and a time (HH:MM, HH:MM:SS or HH:MM:SS with decimals). The time may be
 * followed by Z, +HH:MM or -HH:MM.
 *
 * Threads: any.
 */
EBPO_API bool ebpo_is_date(const char *text);

/* ---- progress ---- */

/*
 * Callback that reports progress. The library calls the callback in the thread of the caller, when
 * a stage begins, and at most a few times a second during the stage. `stage` is a static string.
 * `done` counts up to `total`, which is 0 if unknown.
 *
 * Return false to stop: the running call returns EBPO_E_CANCELLED and leaves no file.
 */
typedef bool (*ebpo_progress_fn)(void *user, const char *stage, uint64_t done, uint64_t total);

/* A progress callback and its argument. */
typedef struct ebpo_progress {
    ebpo_progress_fn report; /* NULL: no reports */
    void *user;              /* argument of `report` */
} ebpo_progress;

/* ---- outputs ---- */

/*
 * Writes `size` bytes to a file, which is replaced atomically: a temporary file is written, synced
 * and renamed. EBPO_E_IO: the file could not be written.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_write_file(const char *path, const void *data, size_t size,
                                                   ebpo_error *error);

/* A file that is being written. */
typedef struct ebpo_output ebpo_output;

/*
 * Begins a file that is too large for memory. The file appears at `path` when ebpo_output_end is
 * called. Temporary files that killed programs left for the same path are removed.
 *
 * out          ended by ebpo_output_end or ebpo_output_abandon
 * descriptor   file descriptor for writing, and for reading the written data; ending the output
 *              closes it
 *
 * EBPO_E_IO: the conditions of ebpo_check_output are not met. EBPO_E_LIMIT: more than 32 outputs at
 * the same time.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_output_begin(const char *path, ebpo_output **out,
                                                     int *descriptor, ebpo_error *error);

/*
 * Syncs the file and renames it to its path. Always frees `out`. EBPO_E_IO: the file could not be
 * written; the file at the path is unchanged.
 *
 * Threads: one at a time per output.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_output_end(ebpo_output *out, ebpo_error *error);

/*
 * Removes the temporary file and frees `out`. NULL is allowed.
 *
 * Threads: one at a time per output.
 */
EBPO_API void ebpo_output_abandon(ebpo_output *out);

/*
 * Checks that an output can be begun at `path` now. EBPO_E_IO: the folder does not exist or is not
 * writable, or the path is a folder or a device.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_check_output(const char *path, ebpo_error *error);

/*
 * Removes the temporary files of all outputs that this process is writing. These outputs cannot be
 * completed afterwards. A signal handler may call this function just before the process ends,
 * because the function calls only unlink.
 *
 * Threads: any.
 */
EBPO_API void ebpo_abandon_outputs(void);

/*
 * Makes a temporary folder beside `folder`. The caller fills it, and ebpo_folder_publish renames it
 * to `folder`. If the caller does not publish the temporary folder, the caller removes it and its
 * contents. Temporary folders that killed programs left for the same `folder` are removed.
 *
 * making   path of the temporary folder; freed by free()
 *
 * EBPO_E_IO: `folder` exists already, or no folder can be made beside it.
 *
 * Threads: any.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_folder_begin(const char *folder, char **making,
                                                     ebpo_error *error);

/*
 * Renames the folder `making` to `folder` atomically, with the default permissions of a new folder.
 * EBPO_E_IO: the folder cannot be renamed, and is still at `making`.
 *
 * Threads: one at a time in the process, because the umask is read.
 */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_folder_publish(const char *making, const char *folder,
                                                       ebpo_error *error);

#ifdef __cplusplus
}
#endif
#endif
