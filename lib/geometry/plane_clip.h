/* Polytopes cut by plane codes. */
#ifndef EBPO_GEOMETRY_PLANE_CLIP_H
#define EBPO_GEOMETRY_PLANE_CLIP_H

#include "geometry/plane_code.h"
#include "geometry/polytope.h"

/* n as a direction of length about 1 and the matching offset, for ebpo_polytope_clip. */
static inline double ebpo_plane_as_double(const int32_t n[3], int64_t d, double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = (double)n[k] * (1.0 / 511);
    return (double)d * (1.0 / (511.0 * 4096));
}

/* Cuts the envelope by plane codes of its own cell; a face's tag is the place of its code. */
void ebpo_planes_cut(ebpo_polytope *envelope, const uint32_t *codes, uint64_t count);

#endif
