/* Parses a pose, in the same form for every command. */
#ifndef EBPO_TOOLS_POSE_ARGS_H
#define EBPO_TOOLS_POSE_ARGS_H

#include <ebpo/pose.h>
#include <stdbool.h>

/* For help texts. */
#define POSE_FORM "X Y Z [QX QY QZ QW [SCALE]]"

/* Reads POSE_FORM, the quaternion of any length but 0; or twelve numbers, the rows of a 3x4 matrix
 * (rotation and translation), optionally followed by a scale. Blanks or commas separate them. Parts
 * of *out that the text omits stay unchanged. Returns false for other text. */
bool pose_read(const char *text, ebpo_pose *out);

#endif
