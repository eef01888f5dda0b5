/* What the commands share. */
#ifndef EBPO_TOOLS_COMMAND_H
#define EBPO_TOOLS_COMMAND_H

#include <ebpo/ebpo.h>
#include <pthread.h>

enum { EXIT_FINE = 0, EXIT_FAILED = 1, EXIT_USAGE = 2, EXIT_NOT_SOLID = 3, EXIT_DIFFERS = 4 };

/* Prints "ebpo convert: message" and returns the exit code that the status stands for. */
int command_failed(const char *name, const ebpo_error *error);

/* Says on stderr what is wrong with the command line, and where help is; EXIT_USAGE. */
int command_usage(const char *name, const char *format, ...) EBPO_PRINTF(2, 3);

/* Says that there was not enough memory; EXIT_FAILED. */
int command_no_memory(const char *name);

/* Cores that this process may use; at least 1. */
unsigned command_cores(void);

/* Starts a thread as pthread_create does, with a stack of COMMAND_STACK bytes instead of what
 * RLIMIT_STACK or the C library gives. All threads of the command start here. */
enum { COMMAND_STACK = 4 << 20 };
int command_thread(pthread_t *thread, void *(*body)(void *), void *argument);

/* True when both paths lead to one existing file. */
bool command_same_file(const char *a, const char *b);

/* True, said on stderr (exit with EXIT_USAGE): writing `out` would overwrite `in`. */
bool command_overwrites(const char *name, const char *in, const char *out);

/* 1: the file begins as an HDF5 file does, or opening it will tell: a URL, or no such file; 0: it
 * begins otherwise, -1: it cannot be read (said on stderr). */
int command_is_hdf5(const char *name, const char *path);

/* False, said on stderr (exit with EXIT_FAILED): the file cannot be read, or is something else than
 * HDF5. */
bool command_wants_hdf5(const char *name, const char *path);

/* False, said on stderr (exit with EXIT_USAGE): the file has no such level. Negative: none was
 * given. */
bool command_has_level(const char *name, const ebpo_info *info, int64_t level);

/* What was printed counts only once it has arrived: a full disk shows here. False: it has not,
 * which is said on stderr, once (exit with EXIT_FAILED). `name` NULL: no command's. */
bool command_flush(const char *name);

/* Says why standard output could not be written, once. False. */
bool command_not_written(const char *name);

/* Bytes to standard output, past stdio's buffer. False as above. */
bool command_write(const char *name, const char *bytes, size_t count);

#endif
