/* A hand played at a steady rate, and how long its ticks took. */
#ifndef EBPO_TOOLS_TOUCH_PLAY_H
#define EBPO_TOOLS_TOUCH_PLAY_H

#include "cli/commands/touch_device.h"

/* Of a microsecond: bin 0 is less than 1, bin n from 2^(n - 1) to 2^n, the last all beyond. */
enum { TOUCH_BINS = 16 };

typedef struct touch_times {
    uint64_t ticks, late;                 /* not done a period after they were due */
    double p50, p99, p99_9, p99_99, most; /* seconds from begin to end of a tick */
    double wake_p99_9, wake_most;         /* seconds from when a tick was due to its begin */
    double cpu_p99_9, cpu_most;           /* processor time from begin to end of a tick */
    uint64_t over_ms;                     /* took more than a millisecond from begin to end */
    uint64_t bins[TOUCH_BINS];
    uint64_t page_faults;              /* of the ticks' thread */
    double between_mean, between_most; /* of a probe: from lo to hi */
} touch_times;

typedef struct touch_play {
    double rate, seconds;
    ebpo_touch *touch;          /* NULL: an empty loop */
    const touch_device *device; /* of the hand */
    ebpo_touch_kind kind;
    double range;       /* of colours, for probes */
    touch_pose *record; /* [ticks] where the hand was, or NULL */
} touch_play;

/* Ticks that there will be at most. */
uint64_t touch_play_ticks(const touch_play *play);

/* False: no memory for the times. */
bool touch_play_run(const touch_play *play, touch_times *out);

/* Asks the system to run this thread before others, and to keep the memory of the process. What it
 * was granted, in words. Threads that are made from here on run before others, too. */
const char *touch_play_first(void);
/* As others again. */
void touch_play_behind(void);

#endif
