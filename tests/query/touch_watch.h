/* The calls that a tick of a hand may not make, counted by touch_watch.c. */
#ifndef EBPO_TESTS_TOUCH_WATCH_H
#define EBPO_TESTS_TOUCH_WATCH_H

#include <stdbool.h>

extern _Thread_local bool in_tick; /* whether this thread is in a tick */
extern unsigned long forbidden;    /* calls within ticks */

/* Lets GMP's allocations count, too. */
void watch_gmp(void);

/* Sleeps for 0.3 ms, as a device does between ticks; subtrees arrive meanwhile. */
void pause_a_little(void);

#endif
