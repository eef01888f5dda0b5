/* A monotonic clock. */
#ifndef EBPO_TOOL_CLOCK_H
#define EBPO_TOOL_CLOCK_H

#include <errno.h>
#include <stdint.h>
#include <time.h>

/* Returns nanoseconds since an arbitrary time. */
static inline uint64_t tool_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * UINT64_C(1000000000) + (uint64_t)t.tv_nsec;
}

/* Sleeps until tool_clock() reaches `when` nanoseconds. */
static inline void tool_wait_until(uint64_t when)
{
#ifdef EBPO_HAVE_CLOCK_NANOSLEEP
    struct timespec t = { (time_t)(when / 1000000000), (long)(when % 1000000000) };
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL) == EINTR)
        ;
#else
    for (uint64_t now = tool_clock(); now < when; now = tool_clock()) {
        uint64_t left = when - now;
        nanosleep(&(struct timespec){ (time_t)(left / 1000000000), (long)(left % 1000000000) },
                  NULL);
    }
#endif
}

#endif
