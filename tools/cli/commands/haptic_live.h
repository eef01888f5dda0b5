/* Passes the haptic steps to a thread that paints and shows them, without delaying a step: the loop
 * writes to a ring without locks, and the thread reads the ring every few milliseconds. */
#ifndef EBPO_TOOLS_HAPTIC_LIVE_H
#define EBPO_TOOLS_HAPTIC_LIVE_H

#include <stdbool.h>
#include <stdint.h>

/* One haptic step. */
typedef struct haptic_sample {
    double time;        /* milliseconds since the first step */
    double device[3];   /* position of the device */
    double proxy[3];    /* position of the proxy */
    double rotation[4]; /* of the proxy */
    double device_rotation[4];
    double normal[3]; /* of a tool in contact: away from the face */
    double force[3];
    double touch[3];   /* in contact: the point of contact; otherwise the position of the proxy */
    double depth;      /* as in ebpo_haptic_ball_result */
    double pressure;   /* of a stylus; 0: the force sets it */
    uint64_t clock;    /* tool_clock at the end of the step */
    uint64_t instance; /* in contact: index of the touched instance; UINT64_MAX: not known */
    uint32_t flags;    /* ebpo_haptic_flag bits */
    bool lifted;       /* the pen of the device does not paint */
    uint8_t rgb[3];    /* of a probe: colour of the distance */
} haptic_sample;

/* Takes `count` successive steps. Called by one thread. */
typedef void (*haptic_live_fn)(void *user, const haptic_sample *samples, uint64_t count);

typedef struct haptic_live haptic_live;

/* Starts the thread that calls `take`. Call it before the thread of the loop gets real-time
 * scheduling, which the new thread would inherit. Returns NULL if the system lacks memory or
 * threads. */
haptic_live *haptic_live_begin(haptic_live_fn take, void *user);

/* Adds a step. Takes no lock, never waits. If the thread is far behind, the step is lost, and
 * counted. Called by the thread of the loop. */
void haptic_live_push(haptic_live *live, const haptic_sample *sample);

/* Passes the remaining steps, ends the thread and frees the object. Returns the number of lost
 * steps. `live` may be NULL. */
uint64_t haptic_live_end(haptic_live *live);

#endif
