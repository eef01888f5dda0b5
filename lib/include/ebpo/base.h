/* EBP-Octree in HDF5: status codes, errors, progress, version.
 *
 * Every function that can fail returns an ebpo_status. The detail goes into an
 * ebpo_error that the caller owns; passing NULL for it is always allowed.
 * There is no global or thread-local error state.
 *
 * The caller's floating-point environment does not matter: rounding mode, flushing of denormals and
 * traps are put aside while a function computes, and are as they were when it returns. Callbacks
 * run in the default environment.
 */
#ifndef EBPO_BASE_H
#define EBPO_BASE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

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

/* Structs that may grow in later versions begin with their own size: options, and what the library
 * fills in for its caller. Begin them with their macro (EBPO_BUILD_OPTIONS_INIT), which sets the
 * size and the usual values:
 *
 *     ebpo_build_options options = EBPO_BUILD_OPTIONS_INIT;
 *     ebpo_model_stats stats = EBPO_MODEL_STATS_INIT;
 *
 * A program then runs with every later library of the same major version: what its structs do not
 * have yet keeps the usual values, or is not filled in. With an earlier library it runs too, as
 * long as it sets nothing that this one does not know (EBPO_E_UNSUPPORTED). A struct_size that was
 * never set is EBPO_E_ARGUMENT. */
#ifdef __cplusplus
extern "C++" {
template <class T> inline T ebpo_sized()
{
    T it = T();
    it.struct_size = sizeof(T);
    return it;
}
}
#define EBPO_SIZED(type) ebpo_sized<type>()
#else
#define EBPO_SIZED(type)            \
    {                               \
        .struct_size = sizeof(type) \
    }
#endif

/* Stable: numbers are never reused. */
typedef enum ebpo_status {
    EBPO_OK = 0,
    EBPO_E_MEMORY = -1,      /* an allocation failed */
    EBPO_E_ARGUMENT = -2,    /* the caller broke a documented precondition */
    EBPO_E_IO = -3,          /* the operating system said no */
    EBPO_E_FORMAT = -4,      /* a file is not what it says it is, or is damaged */
    EBPO_E_VERSION = -5,     /* a file needs a newer reader (version or required part) */
    EBPO_E_UNSUPPORTED = -6, /* valid, but this build or version cannot do it */
    EBPO_E_NOT_SOLID = -7,   /* a solid is required and the mesh does not balance */
    EBPO_E_LIMIT = -8,       /* a count or size is beyond a stated limit */
    EBPO_E_CANCELLED = -9,   /* the progress callback asked to stop */
    EBPO_E_ABSENT = -10      /* the file was written without the part that is needed */
} ebpo_status;

/* Set by a function that fails, otherwise left alone. The caller owns it, and may pass NULL
 * instead. */
typedef struct ebpo_error {
    ebpo_status status;
    /* what went wrong, where, and what to do next: one sentence without a newline, which begins
     * with `file` and `object` where these are known */
    char message[480];
    char file[256];       /* the file or URL at fault, as messages show it; "" when there is none */
    char object[64];      /* path inside an .ebpo.h5 file, such as "/levels/03/planes"; or "" */
    int64_t offset;       /* byte in the file at fault; -1: not known */
    uint64_t reserved[4]; /* 0 */
} ebpo_error;

#define EBPO_ERROR_INIT                \
    {                                  \
        EBPO_OK, "", "", "", -1, { 0 } \
    }

/* Name of a status ("EBPO_E_FORMAT"); a static string, never NULL. */
EBPO_API const char *ebpo_status_name(ebpo_status status);

/* Library version, "major.minor.patch"; a static string. */
EBPO_API const char *ebpo_version(void);

/* Called from the thread that called the library, when a stage begins and then some times a second
 * at most. `stage` is a static string; `total` is 0 when it is not known. Return false to stop: the
 * running call then ends with EBPO_E_CANCELLED and leaves no file behind. */
typedef bool (*ebpo_progress_fn)(void *user, const char *stage, uint64_t done, uint64_t total);

typedef struct ebpo_progress {
    ebpo_progress_fn report; /* NULL: silent */
    void *user;
} ebpo_progress;

/* Writes `size` bytes as one file, which appears whole or not at all (temporary name, fsync,
 * rename); an existing regular file is replaced. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_write_file(const char *path, const void *data, size_t size,
                                                   ebpo_error *error);

/* EBPO_E_IO when an output could not even be begun at `path` now: a folder that is not there or
 * cannot be written to, a path that is a folder or a device. For asking before hours of work. */
EBPO_API EBPO_MUST_USE ebpo_status ebpo_check_output(const char *path, ebpo_error *error);

/* Removes the temporary files of all outputs that this process is writing; they cannot be finished
 * afterwards. Only calls unlink: made for signal handlers, just before the process ends. */
EBPO_API void ebpo_abandon_outputs(void);

#ifdef __cplusplus
}
#endif
#endif
