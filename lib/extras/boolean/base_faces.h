/* Finds the faces of the first operand (the base) that other operands may change. */
#ifndef EBPO_BOOLEAN_BASE_FACES_H
#define EBPO_BOOLEAN_BASE_FACES_H

#include "extras/boolean/boolean.h"

typedef struct ebpo_base_face {
    uint32_t file_face;  /* index in the file */
    uint32_t source;     /* source index, which results give for the face */
    double corner[3][3]; /* posed */
} ebpo_base_face;

typedef struct ebpo_base_faces {
    ebpo_base_face *face; /* in the order of the file */
    uint64_t count;
    /* For each face of the file that is not in `face`, a bit: 0 if the face has the state of the
     * faces outside all other operands (it stays or is removed), 1 if it has the other state. NULL:
     * all are 0. */
    uint64_t *differs;
} ebpo_base_faces;

/* Finds the faces of operand 0 that may intersect other operands of the expression at their poses,
 * the faces that are reversed in the result, and some faces near them. base: bit 0, and the bits of
 * operands that are equal to operand 0. Reads only the subtrees near the other operands, and those
 * with bits in `differs`. Call ebpo_base_faces_free in any case. */
EBPO_MUST_USE ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, uint64_t base,
                                               const ebpo_progress *progress, ebpo_base_faces *out,
                                               ebpo_error *error);

void ebpo_base_faces_free(ebpo_base_faces *faces);

#endif
