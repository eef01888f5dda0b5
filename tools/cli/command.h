/* Functions shared by the commands. */
#ifndef EBPO_TOOLS_COMMAND_H
#define EBPO_TOOLS_COMMAND_H

#include <ebpo/ebpo.h>
#include <pthread.h>

/* Exit codes. In all functions, `name` is the name of the command, for messages. */
enum {
    EXIT_OK = 0,
    EXIT_FAILED = 1,    /* error in data, input or output */
    EXIT_USAGE = 2,     /* error in the command line */
    EXIT_NOT_SOLID = 3, /* the mesh must be a solid, and is not a solid */
    EXIT_DIFFERS = 4,   /* a comparison found differences */
    EXIT_EMPTY = 5      /* the result is empty */
};

/* Prints "ebpo convert: message" and returns the exit code of the status. */
int command_failed(const char *name, const ebpo_error *error);

/* Prints an error of the command line and a hint to --help on stderr. Returns EXIT_USAGE. */
int command_usage(const char *name, const char *format, ...) EBPO_PRINTF(2, 3);

/* Reports that there is not enough memory. Returns EXIT_FAILED. */
int command_no_memory(const char *name);

/* Returns the number of cores that this process may use; at least 1. */
unsigned command_cores(void);

/* Starts a thread as pthread_create does, but always with a stack of COMMAND_STACK bytes. All
 * commands start their threads by this function. */
enum { COMMAND_STACK = 4 << 20 };
int command_thread(pthread_t *thread, void *(*body)(void *), void *argument);

/* Returns true if both paths lead to one existing file. */
bool command_same_file(const char *a, const char *b);

/* Returns true, after an error message, if writing the file `out` would overwrite the file `in`.
 * The caller then exits with EXIT_USAGE. */
bool command_overwrites(const char *name, const char *in, const char *out);

/* Returns the path of a file that a scene names: relative to the scene's folder, or absolute, or a
 * URL. Returns NULL without memory. The caller frees the path. */
char *command_path_in_scene(const char *scene, const char *path);

/* Returns 1 if the file begins with the signature of HDF5, and 0 if it begins with other bytes.
 * Returns -1, after a report on stderr, if the file cannot be read. Returns 1 also for a URL and
 * for a file that does not exist: the caller then opens the file, and reports the error. */
int command_is_hdf5(const char *name, const char *path);

/* Returns false, after an error message, if the file cannot be read or is not HDF5. The caller then
 * exits with EXIT_FAILED. */
bool command_requires_hdf5(const char *name, const char *path);

/* Returns false, after an error message, if the file does not have the level. The caller then exits
 * with EXIT_USAGE. If no level was given, `level` is negative, and the result is true. */
bool command_has_level(const char *name, const ebpo_info *info, int64_t level);

/* Flushes standard output, which detects a full disk. Returns false after an error. Only the first
 * error is reported on stderr. The caller then exits with EXIT_FAILED. `name` may be NULL. */
bool command_flush(const char *name);

/* Reports why standard output could not be written, according to errno. Reports nothing if an error
 * of standard output was reported before. Returns false. */
bool command_not_written(const char *name);

/* Writes bytes to standard output, bypassing the buffer of stdio. Returns false after an error, as
 * command_flush does. */
bool command_write(const char *name, const char *bytes, size_t count);

#endif
