/* Finds the boundary edges of a mesh, which only one face uses, and the closed chains that these
 * edges form: the borders of holes. */
#ifndef EBPO_MESH_BOUNDARY_H
#define EBPO_MESH_BOUNDARY_H

#include "mesh/adjacency.h"

/* A boundary edge, in the direction in which its face uses it. */
typedef struct ebpo_boundary_edge {
    /* from << 32 | source index of `to`: edges that start at one vertex are consecutive, and
     * results do not depend on the order of the mesh */
    uint64_t key;
    uint32_t from, to, face;
} ebpo_boundary_edge;

typedef struct ebpo_boundary {
    ebpo_boundary_edge *edges;
    uint64_t count, capacity;
    ebpo_workspace *workspace; /* workspace of the mesh; set by the first call that adds edges */
} ebpo_boundary;

/* Appends an edge. Returns false when out of memory. */
bool ebpo_boundary_add(ebpo_boundary *boundary, const ebpo_mesh *mesh, uint32_t from, uint32_t to,
                       uint32_t face);
/* Moves several lists into one empty list and frees them. */
EBPO_MUST_USE ebpo_status ebpo_boundary_join(ebpo_boundary *boundary, ebpo_boundary *lists,
                                             unsigned count, const ebpo_mesh *mesh,
                                             ebpo_error *error);
void ebpo_boundary_free(ebpo_boundary *boundary);

/* Simple closed chains (no repeated vertex, at least three edges). Loop i consists of
 * vertex[first[i] .. first[i + 1]). */
typedef struct ebpo_loops {
    uint64_t count;
    uint64_t *first;  /* [count + 1] */
    uint32_t *vertex; /* indices in the current mesh */
    uint64_t *start;  /* [count] first edge of the walk that found the loop: source indices from <<
                         32 | to */
    /* number of loops that were removed from chains that are not closed; these loops come first */
    uint64_t on_paths;
    /* number of chains that are not closed: where their last edge arrives, every departing edge
     * already continues another edge */
    uint64_t open_chains;
    ebpo_workspace *workspace; /* workspace of the mesh; owns all arrays */
} ebpo_loops;

/* Sorts the edges, and joins them to chains. If several boundaries pass one vertex, each boundary
 * continues around its fan of faces (faces joined across edges at the vertex), so that fans stay
 * separate. A chain that nevertheless returns to a vertex is split at this vertex. The result
 * depends only on the mesh in the source's order. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_boundary_loops(ebpo_loops *out, ebpo_boundary *boundary,
                                              const ebpo_stars *stars, const ebpo_mesh *mesh,
                                              unsigned threads, ebpo_error *error);
void ebpo_loops_free(ebpo_loops *loops);

/* Computes for each loop the number of triangles of all loops that precede it in the source's
 * order. A loop of n edges has n - 2 triangles. *triangles: [count], owned by the mesh's workspace.
 */
EBPO_MUST_USE ebpo_status ebpo_loops_rank(uint64_t **triangles, const ebpo_loops *loops,
                                          const ebpo_mesh *mesh, unsigned threads,
                                          ebpo_error *error);

#endif
