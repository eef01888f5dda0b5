/* Finds the faces of the first operand that other operands may change. */
#ifndef EBPO_BOOLEAN_BASE_FACES_H
#define EBPO_BOOLEAN_BASE_FACES_H

#include "extras/boolean/boolean.h"

typedef struct ebpo_base_face {
    uint32_t number; /* in the file */
    uint32_t source; /* as callers get it */
    double corner[3][3];
} ebpo_base_face;

/* Finds the faces of operand 0 that intersect the box of all other operands that the expression
 * uses, at their poses, in the order of the file. Reads only the subtrees there. The caller frees
 * *out, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, ebpo_base_face **out,
                                               uint64_t *count, ebpo_error *error);

#endif
