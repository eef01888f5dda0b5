/* Coordinates in units of powers of two, one for each axis, in which volumes of meshes far from 1
 * neither overflow nor vanish: their signs and order are the same. */
#ifndef EBPO_MESH_MESH_FRAME_H
#define EBPO_MESH_MESH_FRAME_H

#include <math.h>

#include "mesh/mesh_parts.h"

/* Squares and cubes of what lies between 2^-256 and 2^256 are far from overflow and underflow. */
enum { EBPO_EXPONENT_MAX = 256 };

static inline bool ebpo_exponent_is_far(int exponent)
{
    return exponent > EBPO_EXPONENT_MAX || exponent < -EBPO_EXPONENT_MAX;
}

typedef struct ebpo_mesh_frame {
    bool scaled; /* else coordinates are as they are */
    int exponent[3];
} ebpo_mesh_frame;

/* By the corners of all faces. */
ebpo_mesh_frame ebpo_mesh_frame_of(const ebpo_mesh *mesh);

static inline void ebpo_frame_position(const ebpo_mesh_frame *frame, const ebpo_mesh *mesh,
                                       uint64_t vertex, double out[3])
{
    ebpo_mesh_position(mesh, vertex, out);
    if (frame->scaled)
        for (int k = 0; k < 3; k++)
            out[k] = ldexp(out[k], -frame->exponent[k]);
}

#endif
