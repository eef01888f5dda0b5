/* The faces of the operands that are cut, and the faces beside them, with one number for equal
 * corners. The other faces stay in the files: components of whole faces (operand_mesh.h) represent
 * them. */
#ifndef EBPO_BOOLEAN_FACE_LIST_H
#define EBPO_BOOLEAN_FACE_LIST_H

#include "extras/boolean/operand_mesh.h"
#include "extras/collide/face_patches.h"

/* Two intersecting faces, as operands and indices in their files. */
typedef struct ebpo_operand_pair {
    uint32_t face[2];
    uint8_t operand[2];
} ebpo_operand_pair;

/* Listed faces, one operand after the other, in the order of the files. Equal operands (same
 * content, same pose) are listed once. */
typedef struct ebpo_face_list {
    const ebpo_boolean *boolean;
    ebpo_workspace *workspace; /* NULL: malloc */
    ebpo_corner_ids corners;
    uint64_t given_corners; /* number of corners of faces; cuts add the corners after them */
    uint8_t *minus;         /* for each given corner: a bit for each coordinate that is -0 */
    uint64_t minus_capacity;
    uint32_t (*face)[3]; /* corners of each face; EBPO_NO_CORNER first: the face has no area */
    uint32_t *number;    /* the face's index in its operand's file */
    uint32_t count;
    uint64_t face_capacity, number_capacity;
    uint32_t first[EBPO_BOOLEAN_OPERANDS_MAX + 1]; /* first face of each operand */
    /* [operand] a bit for each operand that is equal to this one, itself included; 0: the operand
     * is not listed (ebpo_boolean_find_equal) */
    uint64_t same[EBPO_BOOLEAN_OPERANDS_MAX];
    ebpo_whole_faces whole[EBPO_BOOLEAN_OPERANDS_MAX];
    /* Only changes are wanted. Then operand 0 is the *base*: all its faces near other operands are
     * listed, and none is whole. The other faces of the base are in the result if `keeps_base`. */
    bool changed_only, keeps_base;
    uint32_t *base_source; /* for each listed face of the base: its index for callers */
    /* First all intersecting pairs, then only the pairs of faces with an area. The partners of face
     * i are partner[begin[i]] to partner[begin[i + 1] - 1], in ascending order. */
    ebpo_operand_pair *pair;
    uint64_t pairs, pair_capacity;
    uint64_t *begin;
    uint32_t *partner;
} ebpo_face_list;

#define EBPO_NO_CORNER UINT32_MAX

/* Makes the list (of changes, if `changed_only`): finds the pairs of intersecting faces of
 * different operands, and the pairs of faces of one operand that intersect in more than a common
 * corner or edge; then reads one operand after the other. Intersections of the base with itself are
 * not searched. Must be freed, also after a failure. */
EBPO_MUST_USE ebpo_status ebpo_face_list_make(ebpo_face_list *out, const ebpo_boolean *b,
                                              bool changed_only, ebpo_workspace *workspace,
                                              const ebpo_progress *progress, ebpo_error *error);

void ebpo_face_list_free(ebpo_face_list *faces);

/* Returns the operand of a face. */
uint32_t ebpo_face_list_operand(const ebpo_face_list *faces, uint32_t face);

/* Returns the component of a listed face; EBPO_NO_COMPONENT: the face is not whole. */
static inline uint32_t ebpo_face_list_component(const ebpo_face_list *faces, uint32_t operand,
                                                uint32_t face)
{
    const uint32_t *component = faces->whole[operand].component;
    return component ? component[faces->number[face]] : EBPO_NO_COMPONENT;
}

/* Returns true if the operand is the base of the wanted changes. */
static inline bool ebpo_face_list_is_base(const ebpo_face_list *faces, uint32_t operand)
{
    return faces->changed_only && operand == 0;
}

static inline const double *ebpo_face_list_corner(const ebpo_face_list *faces, uint32_t face, int i)
{
    return faces->corners.at[faces->face[face][i]];
}

#endif
