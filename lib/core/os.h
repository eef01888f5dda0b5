/* What depends on the operating system: the clock, the machine's cores and memory, its pages, and
 * files without names (os_machine.c, os_files.c). */
#ifndef EBPO_CORE_OS_H
#define EBPO_CORE_OS_H

#include <stddef.h>
#include <stdint.h>
#include <time.h>

/* A clock that does not go back: nanoseconds since some time. */
static inline uint64_t ebpo_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

/* The same in seconds. */
static inline double ebpo_seconds(void) { return 1e-9 * (double)ebpo_clock(); }

/* Cores that this process may use, at least 1. */
int ebpo_cores(void);

/* Asks the system to hold an array in pages of 2 MiB, as far as whole ones fit within it (no more
 * memory is taken): translating addresses is a fifth of what a search in a large model costs. To be
 * called before the array is filled; only advice, any pointer and size will do. */
void ebpo_prefer_huge_pages(void *array, size_t bytes);

/* Bytes: the machine's, or the least that a control group of this process allows. */
uint64_t ebpo_machine_memory(void);

/* A temporary file that no name leads to: a descriptor; -1 and errno when it cannot be made. */
int ebpo_open_unnamed(const char *folder);

/* Removes the file that is being made just now, if it has a name: for signal handlers, just before
 * the process ends. */
void ebpo_workspace_abandon(void);

#endif
