/* Interface of haptic devices: a driver gives the position in each haptic step and takes the
 * feedback. A new driver is a file with these five functions, and a line in cmd_haptic.c. */
#ifndef EBPO_TOOLS_HAPTIC_DEVICE_H
#define EBPO_TOOLS_HAPTIC_DEVICE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ebpo/haptic.h>

typedef struct haptic_pose {
    double position[3];
    double rotation[4]; /* a unit quaternion x, y, z, w; 0 0 0 1: not rotated */
    bool lifted;        /* the pen of the device does not paint */
    double pressure;    /* of a stylus, above 0 to 1; 0: the force sets the pressure */
} haptic_pose;

/* Feedback for a device. Only a probe sets lo, hi, rgb and `where`; only other tools set the
 * force and torque. */
typedef struct haptic_result {
    haptic_pose proxy; /* the pose of the tool on the surface, see ebpo_haptic_ball_result */
    double force[3], torque[3], normal[3];
    double touch[3]; /* in contact: a point of the tool or of the surface, where they touch */
    double depth;    /* as in ebpo_haptic_ball_result; for a probe its distance, which may be NAN */
    double lo, hi;   /* bounds of the distance */
    uint64_t face, instance; /* as in ebpo_haptic_ball_result */
    uint32_t flags;
    uint8_t rgb[3]; /* colour of the distance */
    uint8_t where;  /* an ebpo_where */
} haptic_result;

typedef struct haptic_device {
    /* Waits at most `seconds` for the first position. Returns false after an error, reported on
     * stderr. */
    bool (*begin)(void *self, double seconds, haptic_pose *first);
    /* Sets *out to the pose in a haptic step, 0, 1, ...; never waits. Returns false if the device
     * has ended. */
    bool (*read)(void *self, uint64_t step, haptic_pose *out);
    /* Takes the feedback of the step. NULL: the device has no feedback. */
    void (*write)(void *self, const haptic_result *result);
    /* Ends the device, and frees `self`. */
    void (*end)(void *self);
    void *self; /* the first argument of these functions */
    /* Number of steps of the device; 0: the device has steps for any time. */
    uint64_t step_count;
} haptic_device;

/* haptic_path.c: reads a line 'x y z', 'x y z qx qy qz qw' or 'x y z qx qy qz qw pressure' of
 * `length` bytes, which ends with a zero byte. Pressure 0: the pen is lifted. Returns the number of
 * numbers, 3, 7 or 8; 0: an empty line or a comment; -1: other text, such as numbers that are not
 * finite. */
int haptic_pose_read(const char *line, size_t length, haptic_pose *out);

/* haptic_path.c: opens a file of such lines; '-': standard input. Returns false after an error,
 * reported on stderr. Call `end` in any case. */
bool haptic_path_open(haptic_device *out, const char *path);

/* haptic_udp.c: haptic_udp_named returns true for valid names 'udp:PORT' and 'udp:ADDRESS:PORT',
 * and false for NULL.
 * haptic_udp_open opens the device `name`. */
bool haptic_udp_named(const char *name);
bool haptic_udp_open(haptic_device *out, const char *name);

/* haptic_spacenav.c: opens a 3D mouse, whose daemon spacenavd runs. The tool begins in front of the
 * box of the model or scene (low corner, size), `clearance` away. rate, clearance: as in
 * haptic_builtin_open. Returns false after an error, reported on stderr. */
bool haptic_spacenav_open(haptic_device *out, const double low[3], const double size[3],
                          double rate, double clearance);

/* haptic_path_builtin.c: opens a built-in device that moves around the model, into its surface and
 * out of it. rate: steps per second. clearance: radius of the tool. The path keeps this additional
 * distance from the surface, so that the tool is not always in contact. */
ebpo_status haptic_builtin_open(haptic_device *out, ebpo_model *model, const ebpo_info *info,
                                double rate, double clearance, ebpo_error *error);

#endif
