/* Boundary edges (used once) and the closed chains that they form: holes. */
#ifndef EBPO_MESH_BOUNDARY_H
#define EBPO_MESH_BOUNDARY_H

#include "mesh/adjacency.h"

/* A boundary edge in the direction in which its only face uses it. */
typedef struct ebpo_boundary_edge {
    /* from << 32 | the source's number of to: what is near is together, and what is decided does
     * not depend on the mesh's order */
    uint64_t key;
    uint32_t from, to, face;
} ebpo_boundary_edge;

typedef struct ebpo_boundary {
    ebpo_boundary_edge *edges;
    uint64_t count, capacity;
    ebpo_workspace *workspace; /* the mesh's, since something was added */
} ebpo_boundary;

/* Appends; false when memory is short. */
bool ebpo_boundary_add(ebpo_boundary *boundary, const ebpo_mesh *mesh, uint32_t from, uint32_t to,
                       uint32_t face);
/* Puts several lists, which it frees, into one, which is empty. */
EBPO_MUST_USE ebpo_status ebpo_boundary_join(ebpo_boundary *boundary, ebpo_boundary *lists,
                                             unsigned count, const ebpo_mesh *mesh,
                                             ebpo_error *error);
void ebpo_boundary_free(ebpo_boundary *boundary);

/* Simple closed chains (no vertex twice, at least three edges). Loop i runs over vertex[first[i] ..
 * first[i + 1]). */
typedef struct ebpo_loops {
    uint64_t count;
    uint64_t *first;  /* [count + 1] */
    uint32_t *vertex; /* of the mesh as it is */
    uint64_t *start;  /* [count] key of the edge its walk began at, in the source's numbers */
    /* loops taken off chains that do not close as a whole: these come first */
    uint64_t on_paths;
    /* what cannot be closed: edges whose directions do not continue one another */
    uint64_t open_chains;
    ebpo_workspace *workspace; /* the mesh's, of all arrays */
} ebpo_loops;

/* Chains the edges (which are sorted by the way). Where several boundaries pass a vertex, each
 * continues around the fan of faces it belongs to, so that fans do not get tied together; a chain
 * that still comes back to a vertex is split there. The result depends on the mesh as it was in the
 * source only. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_boundary_loops(ebpo_loops *out, ebpo_boundary *boundary,
                                              const ebpo_stars *stars, const ebpo_mesh *mesh,
                                              unsigned threads, ebpo_error *error);
void ebpo_loops_free(ebpo_loops *loops);

/* As if the mesh were in the source's order: how many triangles the loops before each one get, n -
 * 2 a loop. [count], the mesh's workspace owns it. */
EBPO_MUST_USE ebpo_status ebpo_loops_rank(uint64_t **triangles, const ebpo_loops *loops,
                                          const ebpo_mesh *mesh, unsigned threads,
                                          ebpo_error *error);

#endif
