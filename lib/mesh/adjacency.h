/* Finds the faces at vertices and edges. The star of a vertex is the set of faces at the vertex; a
 * patch is a set of faces joined across edges. */
#ifndef EBPO_MESH_ADJACENCY_H
#define EBPO_MESH_ADJACENCY_H

#include "mesh/mesh_parts.h"

/* The stars of all vertices: the faces at vertex v are face[first[v] .. first[v + 1]), each once,
 * in any order. The arrays take 12 bytes for each face and 8 bytes for each vertex. */
typedef struct ebpo_stars {
    uint64_t *first; /* [vertex_count + 1] */
    uint32_t *face;
    ebpo_workspace *workspace; /* workspace of the mesh; owns both arrays */
} ebpo_stars;

/* Builds the stars. Checks every vertex index first; the message of EBPO_E_FORMAT names the lowest
 * face with an invalid index. `out` is cleared on failure. */
EBPO_MUST_USE ebpo_status ebpo_stars_build(ebpo_stars *out, const ebpo_mesh *mesh, unsigned threads,
                                           const ebpo_progress *progress, ebpo_error *error);
void ebpo_stars_free(ebpo_stars *stars);

/* Returns the number of faces in the star of v. */
static inline uint64_t ebpo_stars_degree(const ebpo_stars *stars, uint32_t v)
{
    return stars->first[v + (uint64_t)1] - stars->first[v];
}

/* One use of an edge at a vertex by one face. */
typedef struct ebpo_link {
    uint64_t key; /* neighbour << 32 | face */
    /* index of the face among the faces of the star that repeat no vertex; EBPO_NO_INDEX for a face
     * that repeats a vertex */
    uint32_t entry;
    uint8_t out;    /* 1: the face runs from the vertex to the neighbour */
    uint8_t corner; /* the edge runs from this corner of the face to the next corner */
} ebpo_link;

static inline uint32_t ebpo_link_neighbour(const ebpo_link *link)
{
    return (uint32_t)(link->key >> 32);
}
static inline uint32_t ebpo_link_face(const ebpo_link *link) { return (uint32_t)link->key; }

/* Scratch memory of one thread; initialise it with zeros. */
typedef struct ebpo_star {
    ebpo_link *links; /* sorted by neighbour, then by face: each edge at the vertex is one run */
    uint64_t count;
    uint64_t faces; /* number of faces that repeat no vertex */
    uint64_t capacity;
    ebpo_workspace *workspace; /* workspace of the mesh; set by the first call that gathers */
} ebpo_star;

/* Gathers the links of all edges at vertex v. Returns false when out of memory. */
bool ebpo_star_gather(ebpo_star *star, const ebpo_stars *stars, const ebpo_mesh *mesh, uint32_t v);
void ebpo_star_free(ebpo_star *star);

/* Returns the index after the last link of the run (edge) that begins at `begin`. */
static inline uint64_t ebpo_star_run_end(const ebpo_star *star, uint64_t begin)
{
    uint32_t neighbour = ebpo_link_neighbour(&star->links[begin]);
    uint64_t end = begin + 1;
    while (end < star->count && ebpo_link_neighbour(&star->links[end]) == neighbour)
        end++;
    return end;
}

/* Returns the first link of the run to `neighbour`, or star->count when there is none. */
uint64_t ebpo_star_find(const ebpo_star *star, uint32_t neighbour);

/* An item in the search for faces with the same three vertices. Such faces are found at their
 * lowest vertex. */

typedef struct ebpo_same_face {
    uint64_t corners; /* the two greater vertices: lesser << 32 | greater */
    uint32_t source;  /* index in the source */
    uint32_t face;
} ebpo_same_face;

/* Scratch memory of one thread; initialise it with zeros. */
typedef struct ebpo_same_faces {
    ebpo_same_face *item; /* equal faces are adjacent, in the order of the source */
    uint64_t count;
    uint64_t capacity;
    ebpo_workspace *workspace; /* workspace of the mesh; set by the first call that gathers */
} ebpo_same_faces;

/* Gathers the faces that have three distinct vertices of which v is the lowest. Returns false when
 * out of memory. */
bool ebpo_same_faces_gather(ebpo_same_faces *out, const ebpo_stars *stars, const ebpo_mesh *mesh,
                            uint32_t v);
void ebpo_same_faces_free(ebpo_same_faces *faces);

/* Returns true if item i has the same vertices as item i - 1. */
static inline bool ebpo_same_faces_repeats(const ebpo_same_faces *faces, uint64_t i)
{
    return i > 0 && faces->item[i].corners == faces->item[i - 1].corners;
}

/* The faces at one edge, sorted by patch or by angle around the edge. */

typedef struct ebpo_edge_face {
    uint64_t patch; /* index of the patch, shifted left by 1; the caller uses the lowest bit */
    uint32_t face;
    uint8_t out; /* 1: the face runs from the edge's first vertex to the second vertex */

    /* ebpo_edge_faces_turn sets the fields from `quarter` to `at`. `quarter` classifies the angle
     * around the edge from the face that was face[0] before sorting. 0: zero; 1: less than a half
     * turn; 2: a half turn; 3: more than a half turn */
    uint8_t quarter;
    bool layered;    /* the face has the same angle as the previous face of the sorted list */
    bool reversed;   /* true: coplanar faces are sorted by descending source index */
    uint64_t source; /* index in the source */
    double at[3];    /* position of the corner that is not on the edge */
} ebpo_edge_face;

/* A list of faces at an edge. Initialise the struct with zeros; free `face` with free(). */
typedef struct ebpo_edge_faces {
    ebpo_edge_face *face;
    uint64_t count, capacity;
} ebpo_edge_faces;

/* Adds a face. Returns false when out of memory. */
bool ebpo_edge_faces_add(ebpo_edge_faces *e, uint32_t face, uint8_t out, uint64_t patch);

/* Sorts the faces by patch. */
void ebpo_edge_faces_sort(ebpo_edge_faces *e);

/* Sorts the faces by angle around the edge from vertex v to w, exactly, beginning at the angle of
 * face[0]. Coplanar faces are treated as layers in the order of their source indices, so the layers
 * have the same order at every edge that they share. Returns false if a face has no area. */
bool ebpo_edge_faces_turn(ebpo_edge_faces *e, const ebpo_mesh *mesh, uint32_t v, uint32_t w);

/* Returns true if the sorted faces use the edge alternately in one and the other direction;
 * coplanar faces may be in any order. */
bool ebpo_edge_faces_alternate(const ebpo_edge_faces *e);

#endif
