/* The faces of all operands at their poses, with one number for equal corners. */
#ifndef EBPO_BOOLEAN_FACE_LIST_H
#define EBPO_BOOLEAN_FACE_LIST_H

#include "extras/boolean/boolean.h"
#include "extras/collide/face_patches.h"

/* Faces of the operands, one operand after the other, in the order of the files. Equal operands
 * (same content, same pose) are listed once. */
typedef struct ebpo_face_list {
    const ebpo_boolean *boolean;
    ebpo_corner_ids corners;
    uint64_t given_corners; /* number of corners of faces; those after are added by cuts */
    uint32_t (*face)[3];    /* corners of each face; EBPO_NO_CORNER first: the face has no area */
    uint32_t count;
    uint32_t first[EBPO_BOOLEAN_OPERANDS_MAX + 1]; /* first face of each operand */
    /* see ebpo_boolean_find_equal; 0: the operand is not listed */
    uint64_t same[EBPO_BOOLEAN_OPERANDS_MAX];
    bool floats; /* the coordinates of all files are floats */
    /* Pairs of intersecting faces: the partners of face i are partner[begin[i]] to partner[begin[i
     * + 1] - 1], in ascending order. */
    uint64_t *begin;
    uint32_t *partner;
} ebpo_face_list;

#define EBPO_NO_CORNER UINT32_MAX

/* Reads the faces. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_face_list_read(ebpo_face_list *out, const ebpo_boolean *b,
                                              const ebpo_progress *progress, ebpo_error *error);

/* Finds the pairs of intersecting faces of different operands, and those of one operand that are
 * not just neighbours. */
EBPO_MUST_USE ebpo_status ebpo_face_list_find_pairs(ebpo_face_list *faces,
                                                    const ebpo_progress *progress,
                                                    ebpo_error *error);

void ebpo_face_list_free(ebpo_face_list *faces);

/* Returns the operand of a face. */
uint32_t ebpo_face_list_operand(const ebpo_face_list *faces, uint32_t face);

static inline const double *ebpo_face_list_corner(const ebpo_face_list *faces, uint32_t face, int i)
{
    return faces->corners.at[faces->face[face][i]];
}

#endif
