/* A pose as text, the same for every command. */
#ifndef EBPO_TOOLS_POSE_ARGS_H
#define EBPO_TOOLS_POSE_ARGS_H

#include <ebpo/pose.h>
#include <stdbool.h>

/* For help texts. */
#define POSE_FORM "X Y Z [QX QY QZ QW [SCALE]]"

/* POSE_FORM, the quaternion of any length but 0; or twelve numbers, the rows of a matrix of three
 * rows and four columns, a rotation and what it is moved by, and perhaps a scale. Blanks or commas
 * stand between. What the text does not say stays as it is in *out. False: it is none of these. */
bool pose_read(const char *text, ebpo_pose *out);

#endif
