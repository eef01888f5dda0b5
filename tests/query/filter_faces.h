/* What filters in single precision say of the eight faces of a block, for each instruction set. */
#ifndef EBPO_TESTS_FILTER_FACES_H
#define EBPO_TESTS_FILTER_FACES_H

#include "query/query_kernels.h"

typedef struct face_filters {
    /* Bounds of the distances to a point, in the frame. */
    void (*near)(const ebpo_accel *s, uint32_t block, const ebpo_probe *probe,
                 float low[EBPO_BLOCK], float high[EBPO_BLOCK]);
    /* Of an accel of floats, how faces turn around the segment's line: a bit for each that turns
     * left, right, or may do either; the others pass it by. */
    void (*turns)(const ebpo_accel *s, uint32_t block, const ebpo_axis_segment *segment,
                  unsigned *left, unsigned *right, unsigned *open);
} face_filters;

extern const face_filters face_filters_base, face_filters_avx2;

#endif
