/* A clock that does not go back. */
#ifndef EBPO_CORE_CLOCK_H
#define EBPO_CORE_CLOCK_H

#include <stdint.h>
#include <time.h>

/* Nanoseconds since some time. */
static inline uint64_t ebpo_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

/* The same in seconds. */
static inline double ebpo_seconds(void) { return 1e-9 * (double)ebpo_clock(); }

#endif
