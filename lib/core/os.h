/* Declares functions that depend on the operating system: clock, cores, memory, pages, and unnamed
 * files (os_machine.c, os_files.c). All other code is written for POSIX; os_windows.h declares the
 * parts of POSIX that Windows lacks. */
#ifndef EBPO_CORE_OS_H
#define EBPO_CORE_OS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <time.h>

/* Returns nanoseconds since an arbitrary time, from a clock that never goes back. */
static inline uint64_t ebpo_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

/* Returns the time of ebpo_clock in seconds. */
static inline double ebpo_seconds(void) { return 1e-9 * (double)ebpo_clock(); }

/* Returns the number of cores that this process may use, at least 1. */
int ebpo_cores(void);

/* Advises the system to use pages of 2 MiB for the part of an array that such pages fill
 * completely. With pages of 4 KiB, address translation takes a fifth of the time of a search in a
 * large model. Call this function before the array is filled. Any pointer and size are allowed. */
void ebpo_prefer_huge_pages(void *array, size_t bytes);

/* Returns the memory of the machine in bytes. If a control group of this process (as in a
 * container) has a lower limit, returns the lowest limit. */
uint64_t ebpo_machine_memory(void);

/* Returns the last separator of a path: '/', on Windows also '\\'. Returns NULL if there is none.
 */
static inline char *ebpo_last_separator(const char *path)
{
    char *last = strrchr(path, '/');
#ifdef _WIN32
    char *other = strrchr(last ? last : path, '\\');
    last = other ? other : last;
#endif
    return last;
}

/* Returns true for a path that does not depend on the current folder; on Windows also for a path
 * with a drive ("C:"). */
static inline bool ebpo_path_is_absolute(const char *path)
{
#ifdef _WIN32
    if (*path == '\\' || (*path && path[1] == ':'))
        return true;
#endif
    return *path == '/';
}

/* Creates an unnamed temporary file in a folder. Returns its descriptor, or -1 with errno. */
int ebpo_open_unnamed(const char *folder);

/* Removes the temporary file that another thread is creating, if the file has a name at this
 * moment. Signal handlers call this function just before the process ends. */
void ebpo_workspace_abandon(void);

#endif
