/* Single-precision filters for the eight faces of a block, for each instruction set. */
#ifndef EBPO_TESTS_FILTER_FACES_H
#define EBPO_TESTS_FILTER_FACES_H

#include "query/query_kernels.h"

typedef struct face_filters {
    /* Computes bounds of the distances to a point, in the frame. */
    void (*near)(const ebpo_accel *s, uint32_t block, const ebpo_probe *probe,
                 float low[EBPO_BLOCK], float high[EBPO_BLOCK]);
    /* For an accel of floats: turns of faces around the line of the segment, one bit for each face
     * that turns left, right, or may do either; the line misses the other faces. */
    void (*turns)(const ebpo_accel *s, uint32_t block, const ebpo_axis_segment *segment,
                  unsigned *left, unsigned *right, unsigned *open);
} face_filters;

extern const face_filters face_filters_base, face_filters_avx2;

#endif
