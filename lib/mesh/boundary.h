/* Finds boundary edges (used by one face) and the closed chains that they form: holes. */
#ifndef EBPO_MESH_BOUNDARY_H
#define EBPO_MESH_BOUNDARY_H

#include "mesh/adjacency.h"

/* A boundary edge, in the direction in which its face uses it. */
typedef struct ebpo_boundary_edge {
    /* from << 32 | the source index of to: keeps edges of one vertex together, and makes decisions
     * independent of the mesh's order */
    uint64_t key;
    uint32_t from, to, face;
} ebpo_boundary_edge;

typedef struct ebpo_boundary {
    ebpo_boundary_edge *edges;
    uint64_t count, capacity;
    ebpo_workspace *workspace; /* the mesh's, once something was added */
} ebpo_boundary;

/* Appends an edge. Returns false when memory is short. */
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
    uint64_t *start;  /* [count] key of the first edge of its walk, in source indices */
    /* number of loops that were removed from chains that are not closed; these loops come first */
    uint64_t on_paths;
    /* number of chains that cannot be closed, because the directions of their edges do not continue
     * one another */
    uint64_t open_chains;
    ebpo_workspace *workspace; /* the mesh's; owns all arrays */
} ebpo_loops;

/* Chains the edges, and sorts them. Where several boundaries pass a vertex, each continues around
 * its own fan of faces, so that fans stay separate. A chain that still returns to a vertex is split
 * there. The result depends only on the mesh in the source's order. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_boundary_loops(ebpo_loops *out, ebpo_boundary *boundary,
                                              const ebpo_stars *stars, const ebpo_mesh *mesh,
                                              unsigned threads, ebpo_error *error);
void ebpo_loops_free(ebpo_loops *loops);

/* Computes, in the source's order, the number of triangles of all loops before each one (n - 2 for
 * each loop). *triangles: [count], owned by the mesh's workspace. */
EBPO_MUST_USE ebpo_status ebpo_loops_rank(uint64_t **triangles, const ebpo_loops *loops,
                                          const ebpo_mesh *mesh, unsigned threads,
                                          ebpo_error *error);

#endif
