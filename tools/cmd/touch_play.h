/* A hand played at a steady rate, and how long its ticks took. */
#ifndef EBPO_TOOLS_TOUCH_PLAY_H
#define EBPO_TOOLS_TOUCH_PLAY_H

#include <ebpo/ebpo.h>

/* Of a microsecond: bin 0 is less than 1, bin n from 2^(n - 1) to 2^n, the last all beyond. */
enum { TOUCH_BINS = 16 };

typedef struct touch_times {
    uint64_t ticks, late;                 /* not done a period after they were due */
    double p50, p99, p99_9, p99_99, most; /* seconds from begin to end of a tick */
    double wake_p99_9, wake_most;         /* seconds from when a tick was due to its begin */
    uint64_t bins[TOUCH_BINS];
    uint64_t page_faults; /* of the ticks' thread */
} touch_times;

typedef struct touch_play {
    double rate, seconds;
    ebpo_touch *touch;  /* NULL: an empty loop */
    const double *path; /* [count][3], a place for each tick; NULL: */
    uint64_t count;
    const ebpo_info *info; /* the hand goes around this model */
} touch_play;

/* Where the hand of its own is at a time: it goes around the model in 8 seconds and nods, so that
 * it is now in front of the surface and now far behind it. */
void touch_hand_at(const ebpo_info *info, double seconds, double hand[3]);

/* False: no memory for the times. */
bool touch_play_run(const touch_play *play, touch_times *out);

/* Asks the system to run this thread before others, and to keep the memory of the process. What it
 * was granted, in words. */
const char *touch_play_first(void);

#endif
