/* What holds the hand: a driver gives its place in each tick and takes what it should feel. A new
 * driver is a file with these five functions, and a line in cmd_touch.c. */
#ifndef EBPO_TOOLS_TOUCH_DEVICE_H
#define EBPO_TOOLS_TOUCH_DEVICE_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/touch.h>

/* Unit quaternions x, y, z, w; 0 0 0 1: not turned. */
typedef struct touch_pose {
    double place[3], turn[4];
} touch_pose;

/* What it should feel: of a probe distance, lo, hi and where, of others the rest. */
typedef struct touch_answer {
    touch_pose proxy;
    double force[3], torque[3], normal[3];
    double depth; /* as in ebpo_touch_result; of a probe its distance, perhaps NAN */
    double lo, hi;
    uint64_t face;
    uint32_t flags;
    uint8_t rgb[3], where; /* the colour of the distance; an ebpo_where */
} touch_answer;

typedef struct touch_device {
    /* Waits for the first place, at most so long. False: said on stderr. */
    bool (*begin)(void *self, double seconds, touch_pose *first);
    /* In a tick: never waits. False: there is no more. */
    bool (*read)(void *self, uint64_t tick, touch_pose *out);
    void (*write)(void *self, const touch_answer *answer);
    /* Ticks that it has; 0: as long as is asked for. */
    uint64_t (*ticks)(void *self);
    void (*end)(void *self);
    void *self;
} touch_device;

/* touch_path.c: lines 'x y z' or 'x y z qx qy qz qw' of a file, '-': standard input. False: said on
 * stderr. `end` it in any case. */
bool touch_path_open(touch_device *out, const char *path);

/* touch_udp.c: 'udp:PORT' or 'udp:ADDRESS:PORT', as touch_udp_named says. */
bool touch_udp_named(const char *name);
bool touch_udp_open(touch_device *out, const char *name);

/* touch_own.c: goes around the model, into its surface and out again. */
ebpo_status touch_own_open(touch_device *out, ebpo_model *model, const ebpo_info *info, double rate,
                           double clear, ebpo_error *error);

#endif
