/* Finds the border of a mesh: the edges that faces do not use equally often in both directions
 * (unbalanced edges), as closed directed loops with weights. */
#ifndef EBPO_MESH_BORDER_H
#define EBPO_MESH_BORDER_H

#include <ebpo/mesh.h>

/* Simple closed loops (no repeated vertex, at least three edges). Loop i consists of
 * vertex[first[i] .. first[i + 1]). For each directed edge, let n be the number of its uses by
 * faces in this direction, and m the number of its uses in the opposite direction. The weights of
 * the loops that contain the edge have the sum n - m. */
typedef struct ebpo_border {
    uint64_t loop_count;
    uint64_t edge_count; /* number of unbalanced edges of the mesh */
    uint64_t *first;     /* [loop_count + 1] */
    uint32_t *vertex;    /* indices in the current mesh */
    uint32_t *weight;    /* [loop_count] at least 1 */
    uint64_t loop_capacity, weight_capacity, vertex_capacity;
    ebpo_workspace *workspace; /* workspace of the mesh; owns all arrays */
} ebpo_border;

/* Finds the border of any mesh. A mesh without unbalanced edges has no loops. The result depends
 * only on the mesh in the source's order. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_border_find(ebpo_border *out, const ebpo_mesh *mesh,
                                           unsigned threads, ebpo_error *error);
void ebpo_border_free(ebpo_border *border);

/* Returns the number of triangles that close all loops (geometry/cap_triangles.h). Each triangle
 * counts once, for a loop of any weight. */
static inline uint64_t ebpo_border_cap_count(const ebpo_border *border)
{
    return border->loop_count ? border->first[border->loop_count] - 2 * border->loop_count : 0;
}

#endif
