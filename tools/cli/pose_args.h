/* Parses a pose, in the same form for every command. */
#ifndef EBPO_TOOLS_POSE_ARGS_H
#define EBPO_TOOLS_POSE_ARGS_H

#include <ebpo/pose.h>
#include <stdbool.h>

/* For help texts. */
#define POSE_FORM "X Y Z [QX QY QZ QW [SCALE]]"

/* Reads a pose. The text has the form POSE_FORM, with a quaternion of any length except 0. It may
 * also be a matrix (rotation and translation) of three rows and four columns, row by row, and
 * optionally a scale. Blanks or commas separate the numbers. If the text omits the rotation or the
 * scale, this member of *out stays unchanged. Returns false for other text. */
bool pose_read(const char *text, ebpo_pose *out);

#endif
