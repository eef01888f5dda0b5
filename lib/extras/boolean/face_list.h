/* Lists the faces of the operands that are cut, and their neighbours. Equal corners of listed faces
 * get one number. Faces that are not listed stay in the files. Each of them belongs to a component
 * of whole faces (operand_mesh.h), of which at least one face is listed. */
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
    uint64_t
        given_corners; /* number of corners before the faces are cut; cuts add corners after them */
    uint8_t *negative_zeros; /* for each given corner: a bit for each coordinate that is -0 */
    uint64_t negative_zeros_capacity;
    uint32_t (*face)[3]; /* corners of each face; EBPO_NO_CORNER first: the face has no area */
    uint32_t *file_face; /* index of each face in the file of its operand */
    uint32_t count;
    uint64_t face_capacity, file_face_capacity;
    uint32_t first[EBPO_BOOLEAN_OPERANDS_MAX + 1]; /* first face of each operand */
    /* [operand] a bit for each operand that is equal to this operand, and the bit of this operand;
     * 0: the operand is not listed (ebpo_boolean_find_equal) */
    uint64_t equal[EBPO_BOOLEAN_OPERANDS_MAX];
    ebpo_whole_faces whole[EBPO_BOOLEAN_OPERANDS_MAX]; /* [operand] */
    /* changed_only: the result gives only the changes of operand 0, the *base*. Then all faces of
     * the base near the surfaces of other operands are listed, and no face of the base counts as
     * whole. keeps_base: the base's faces outside all other operands bound the result; if false,
     * none of them does. base_differs: for each other face of the base that is not listed, a bit
     * that is 1 if the face bounds the result and keeps_base is false, or the reverse; NULL: all
     * bits are 0. */
    bool changed_only, keeps_base;
    uint64_t *base_differs;
    uint32_t *base_source;   /* for each listed face of the base: its source index */
    ebpo_operand_pair *pair; /* intersecting pairs; freed when the partners are listed */
    /* The partners of face i, which intersect it and have an area, are partner[begin[i]] to
     * partner[begin[i + 1] - 1], in ascending order. */
    uint64_t *begin;
    uint32_t *partner;
    uint64_t pairs, pair_capacity;
} ebpo_face_list;

#define EBPO_NO_CORNER UINT32_MAX

/* Makes the list. First finds the pairs of intersecting faces of different operands, and the pairs
 * of faces of one operand that intersect in more than a common corner or edge. Then reads one
 * operand after the other. If `changed_only`, self-intersections of the base are not searched. Must
 * be freed, also after a failure. */
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
    return component ? component[faces->file_face[face]] : EBPO_NO_COMPONENT;
}

/* Returns true if `changed_only` is set and the operand is the base. */
static inline bool ebpo_face_list_is_base(const ebpo_face_list *faces, uint32_t operand)
{
    return faces->changed_only && operand == 0;
}

static inline const double *ebpo_face_list_corner(const ebpo_face_list *faces, uint32_t face, int i)
{
    return faces->corners.at[faces->face[face][i]];
}

#endif
