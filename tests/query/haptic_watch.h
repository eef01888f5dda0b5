/* Counts calls that a haptic step must not make (haptic_watch.c). */
#ifndef EBPO_TESTS_HAPTIC_WATCH_H
#define EBPO_TESTS_HAPTIC_WATCH_H

#include <stdbool.h>

extern _Thread_local bool in_step; /* true while this thread is in a step */
extern unsigned long forbidden;    /* calls within steps */

/* Also counts allocations of GMP. */
void watch_gmp(void);

/* Sleeps for 0.3 ms, as a device does between steps; subtrees are loaded meanwhile. */
void pause_a_little(void);

#endif
