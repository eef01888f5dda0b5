/* Finds the faces of the first operand (the base) that other operands may change. */
#ifndef EBPO_BOOLEAN_BASE_FACES_H
#define EBPO_BOOLEAN_BASE_FACES_H

#include "extras/boolean/boolean.h"

typedef struct ebpo_base_face {
    uint32_t file_face;  /* index in the file */
    uint32_t source;     /* source index, which results give for the face */
    double corner[3][3]; /* posed */
} ebpo_base_face;

/* Finds the faces of operand 0 that may not be outside all other operands of the expression at
 * their poses, and some faces near them. *out is in the order of the file. Reads only the subtrees
 * near the other operands. The caller frees *out, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_base_faces_find(const ebpo_boolean *b, ebpo_base_face **out,
                                               uint64_t *count, ebpo_error *error);

#endif
