/* Plays a haptic device at a steady rate, and measures the times of its steps. */
#ifndef EBPO_TOOLS_HAPTIC_PLAY_H
#define EBPO_TOOLS_HAPTIC_PLAY_H

#include <signal.h>

#include "cli/commands/haptic_device.h"
#include "cli/commands/haptic_live.h"

/* Number of bins of the histogram of step times. Bin 0 counts times below 1 microsecond, bin n
 * times from 2^(n - 1) to 2^n microseconds; the last bin also counts all longer times. */
enum { HAPTIC_BINS = 16 };

typedef struct haptic_times {
    uint64_t step_count; /* number of steps */
    uint64_t late;       /* steps that end more than a period after their due times */
    double p50, p99, p99_9, p99_99, max_time; /* seconds from the start to the end of a step */
    double wake_p99_9, wake_max;              /* seconds from the due time of a step to its start */
    double cpu_p99_9, cpu_max;    /* processor time from the start to the end of a step */
    uint64_t over_ms;             /* steps that took more than a millisecond from start to end */
    uint64_t bins[HAPTIC_BINS];   /* histogram of times from the start to the end of a step */
    uint64_t page_faults;         /* page faults of the thread that plays the steps */
    double width_mean, width_max; /* widths hi - lo of the bounds of a probe's distance */
} haptic_times;

/* What haptic_play_run plays. */
typedef struct haptic_play {
    double rate;                 /* steps per second */
    double seconds;              /* duration; used if the device's step_count is 0 */
    ebpo_haptic *haptic;         /* NULL: steps do nothing */
    const haptic_device *device; /* source of positions */
    ebpo_haptic_kind kind;
    double range;         /* for probes: the distance that has the last colour of the scale */
    haptic_pose first;    /* the first position, at which the haptic object was made */
    haptic_pose *record;  /* [maximum number of steps], set to the device's positions; or NULL */
    const double *points; /* points of the tool, or NULL */
    haptic_live *live;    /* takes the steps; or NULL */
} haptic_play;

/* Set by a signal handler: the loop ends after the current step. */
extern volatile sig_atomic_t haptic_play_stopped;

/* Requests real-time scheduling for this thread and locked memory for the process. Returns a text
 * that says what the system granted. Threads created afterwards inherit the scheduling. */
const char *haptic_request_real_time(void);

/* Returns to normal scheduling. */
void haptic_end_real_time(void);

/* Returns the maximum number of steps. */
uint64_t haptic_play_steps(const haptic_play *p);

/* Plays all steps and sets *out to their times. Returns false if there is not enough memory for
 * this. */
bool haptic_play_run(const haptic_play *p, haptic_times *out);

#endif
