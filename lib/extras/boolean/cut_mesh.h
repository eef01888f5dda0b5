/* Cuts the listed faces of all operands (face_list.h) into triangles along all their intersections,
 * and finds the triangles that bound the result of the expression. */
#ifndef EBPO_BOOLEAN_CUT_MESH_H
#define EBPO_BOOLEAN_CUT_MESH_H

#include "extras/boolean/face_cut.h"

/* Triangles in the order of their faces. Two triangles have at most a common vertex or a common
 * edge. Vertices are numbered: first the corners of the list of faces, then the points of `set`. */
typedef struct ebpo_cut_mesh {
    ebpo_face_list *faces;
    int unit;                /* coordinates of the faces are multiples of 2^unit */
    ebpo_point_set set;      /* points whose coordinates are not doubles */
    uint32_t (*triangle)[3]; /* [count] vertices */
    uint32_t *face;          /* [count] the listed face from which the triangle was cut */
    uint64_t count, triangle_capacity, face_capacity;
    ebpo_cover *cover; /* faces that cover triangles in their plane; sorted by triangle */
    uint64_t covers, cover_capacity;
    uint64_t faces_cut; /* faces of more than one triangle */
} ebpo_cut_mesh;

/* Cuts the faces along their intersections with their partners (face_list.h). Adds new points to
 * the corners of the list if their coordinates are doubles, else to out->set. Must be freed, also
 * after a failure. */
EBPO_MUST_USE ebpo_status ebpo_cut_mesh_make(ebpo_cut_mesh *out, ebpo_face_list *faces,
                                             const ebpo_progress *progress, ebpo_error *error);
void ebpo_cut_mesh_free(ebpo_cut_mesh *cut);

static inline uint64_t ebpo_cut_mesh_vertices(const ebpo_cut_mesh *cut)
{
    return cut->faces->corners.count + cut->set.count;
}

/* Sets `out` to coordinate k of a vertex. */
void ebpo_cut_mesh_coordinate(const ebpo_cut_mesh *cut, uint32_t vertex, int k, mpq_t out);

/* Finds the triangles that bound the result. (*sign)[i] is 1 if triangle i bounds the result, -1 if
 * the reversed triangle does, and 0 if neither does. *patches: number of connected sets of
 * triangles that were classified (cut_patches.c). The caller frees *sign. */
EBPO_MUST_USE ebpo_status ebpo_cut_mesh_classify(const ebpo_cut_mesh *cut,
                                                 const ebpo_progress *progress, int8_t **sign,
                                                 uint64_t *patches, ebpo_error *error);

#endif
