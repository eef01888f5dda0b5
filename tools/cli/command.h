/* Functions shared by the commands. */
#ifndef EBPO_TOOLS_COMMAND_H
#define EBPO_TOOLS_COMMAND_H

#include <ebpo/ebpo.h>
#include <pthread.h>

enum {
    EXIT_OK = 0,
    EXIT_FAILED = 1,
    EXIT_USAGE = 2,
    EXIT_NOT_SOLID = 3,
    EXIT_DIFFERS = 4,
    EXIT_EMPTY = 5
};

/* Prints "ebpo convert: message" and returns the exit code of the status. */
int command_failed(const char *name, const ebpo_error *error);

/* Prints an error of the command line and a hint to --help on stderr. Returns EXIT_USAGE. */
int command_usage(const char *name, const char *format, ...) EBPO_PRINTF(2, 3);

/* Reports that there is not enough memory. Returns EXIT_FAILED. */
int command_no_memory(const char *name);

/* Returns the number of cores that this process may use; at least 1. */
unsigned command_cores(void);

/* Starts a thread as pthread_create does, with a stack of COMMAND_STACK bytes instead of the
 * default of RLIMIT_STACK or the C library. All threads of the command start here. */
enum { COMMAND_STACK = 4 << 20 };
int command_thread(pthread_t *thread, void *(*body)(void *), void *argument);

/* Returns true if both paths lead to one existing file. */
bool command_same_file(const char *a, const char *b);

/* Returns true if writing `out` would overwrite `in`, and reports it on stderr (exit with
 * EXIT_USAGE). */
bool command_overwrites(const char *name, const char *in, const char *out);

/* Returns 1 if the file begins with the signature of HDF5, 0 if it begins with other bytes, -1 if
 * it cannot be read (reported on stderr). Returns 1, too, for a URL and for a file that does not
 * exist, because opening these reports an error. */
int command_is_hdf5(const char *name, const char *path);

/* Returns false, with a report on stderr (exit with EXIT_FAILED), when the file cannot be read or
 * is not HDF5. */
bool command_requires_hdf5(const char *name, const char *path);

/* Returns false, with a report on stderr (exit with EXIT_USAGE), when the file has no such level.
 * level: negative if no level was given. */
bool command_has_level(const char *name, const ebpo_info *info, int64_t level);

/* Flushes standard output, which detects a full disk. Returns false after an error, reported on
 * stderr once (exit with EXIT_FAILED). `name` NULL: no command. */
bool command_flush(const char *name);

/* Reports once why standard output could not be written. Returns false. */
bool command_not_written(const char *name);

/* Writes bytes to standard output, bypassing the buffer of stdio. Returns false after an error, as
 * command_flush does. */
bool command_write(const char *name, const char *bytes, size_t count);

#endif
