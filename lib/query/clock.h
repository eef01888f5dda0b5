/* Nanoseconds of a clock that does not go back. */
#ifndef EBPO_QUERY_CLOCK_H
#define EBPO_QUERY_CLOCK_H

#include <stdint.h>
#include <time.h>

static inline uint64_t ebpo_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

#endif
