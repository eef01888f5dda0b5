/* Which faces meet at which vertex, and what that says about edges. */
#ifndef EBPO_MESH_ADJACENCY_H
#define EBPO_MESH_ADJACENCY_H

#include "mesh/mesh_parts.h"

/* Compressed rows: the faces at vertex v are face[first[v] .. first[v + 1]), each once, in no
 * particular order. 12 bytes a face and 8 bytes a vertex. */
typedef struct ebpo_stars {
    uint64_t *first; /* [vertex_count + 1] */
    uint32_t *face;
    ebpo_workspace *workspace; /* the mesh's, of both */
} ebpo_stars;

/* Checks every index first (EBPO_E_FORMAT naming the lowest bad face). `out` is cleared on failure.
 */
EBPO_MUST_USE ebpo_status ebpo_stars_build(ebpo_stars *out, const ebpo_mesh *mesh, unsigned threads,
                                           const ebpo_progress *progress, ebpo_error *error);
void ebpo_stars_free(ebpo_stars *stars);

static inline uint64_t ebpo_stars_degree(const ebpo_stars *stars, uint32_t v)
{
    return stars->first[v + (uint64_t)1] - stars->first[v];
}

/* One use of an edge at a vertex by one face. */
typedef struct ebpo_link {
    uint64_t key; /* neighbour << 32 | face */
    /* number of the face within the star; EBPO_NO_INDEX for a face that names a vertex twice */
    uint32_t entry;
    uint8_t out;    /* 1: the face runs from the vertex to the neighbour */
    uint8_t corner; /* the edge is the face's corner .. corner + 1 */
} ebpo_link;

static inline uint32_t ebpo_link_neighbour(const ebpo_link *link)
{
    return (uint32_t)(link->key >> 32);
}
static inline uint32_t ebpo_link_face(const ebpo_link *link) { return (uint32_t)link->key; }

/* Scratch for one thread; zero it to begin with. */
typedef struct ebpo_star {
    ebpo_link *links; /* sorted by neighbour, then by face: each edge at the vertex is one run */
    uint64_t count;
    uint64_t faces; /* entries: faces that name no vertex twice */
    uint64_t capacity;
    ebpo_workspace *workspace; /* the mesh's, since something was gathered */
} ebpo_star;

/* Gathers the edge uses at vertex v. False when memory is short. */
bool ebpo_star_gather(ebpo_star *star, const ebpo_stars *stars, const ebpo_mesh *mesh, uint32_t v);
void ebpo_star_free(ebpo_star *star);

/* One past the last link of the run (edge) that begins at `begin`. */
static inline uint64_t ebpo_star_run_end(const ebpo_star *star, uint64_t begin)
{
    uint32_t neighbour = ebpo_link_neighbour(&star->links[begin]);
    uint64_t end = begin + 1;
    while (end < star->count && ebpo_link_neighbour(&star->links[end]) == neighbour)
        end++;
    return end;
}

/* First link of the run to `neighbour`; star->count when there is none. */
uint64_t ebpo_star_find(const ebpo_star *star, uint32_t neighbour);

/* Faces of the same three vertices. They meet at their lowest vertex. */

typedef struct ebpo_same_face {
    uint64_t corners; /* the two greater ones: lesser << 32 | greater */
    uint32_t source;  /* number in the source */
    uint32_t face;
} ebpo_same_face;

/* Scratch for one thread; zero it to begin with. */
typedef struct ebpo_same_faces {
    ebpo_same_face *item; /* equal ones are neighbours, the first of the source first */
    uint64_t count;
    uint64_t capacity;
    ebpo_workspace *workspace; /* the mesh's, since something was gathered */
} ebpo_same_faces;

/* The faces of three distinct vertices of which v is the lowest. False when memory is short. */
bool ebpo_same_faces_gather(ebpo_same_faces *out, const ebpo_stars *stars, const ebpo_mesh *mesh,
                            uint32_t v);
void ebpo_same_faces_free(ebpo_same_faces *faces);

/* Item i is of the same vertices as the one before. */
static inline bool ebpo_same_faces_repeats(const ebpo_same_faces *faces, uint64_t i)
{
    return i > 0 && faces->item[i].corners == faces->item[i - 1].corners;
}

/* The faces at one edge: by their patches, or in their order around it. */

typedef struct ebpo_edge_face {
    uint64_t patch; /* shifted by 1; the lowest bit is the caller's */
    uint32_t face;
    uint8_t out; /* 1: the face runs from the edge's first vertex to the other one */

    /* set while faces are put in order: the third corner, and the quarter of the turn from the
     * first face: 0 beside it, 1 before the half, 2 at the half, 3 beyond */
    uint8_t quarter;
    bool layered;    /* it is in one plane with the face before it */
    bool reversed;   /* of faces in one plane, those of greater numbers come first */
    uint64_t source; /* its number in the source */
    double at[3];
} ebpo_edge_face;

/* Zero it to begin with; `face` is freed by free(). */
typedef struct ebpo_edge_faces {
    ebpo_edge_face *face;
    uint64_t count, capacity;
} ebpo_edge_faces;

/* False when memory is short. */
bool ebpo_edge_faces_add(ebpo_edge_faces *e, uint32_t face, uint8_t out, uint64_t patch);

/* Puts faces of one patch together. */
void ebpo_edge_faces_sort(ebpo_edge_faces *e);

/* Puts the faces in their order around the edge from vertex v to w, exactly, beginning anywhere.
 * Faces in one plane are taken for layers above each other, by their numbers in the source: in the
 * same order at every edge that they have in common. False where a face has no area. */
bool ebpo_edge_faces_turn(ebpo_edge_faces *e, const ebpo_mesh *mesh, uint32_t v, uint32_t w);

/* Returns whether the faces, put in that order, run along the edge and against it by turns, with
 * those in one plane in any order. */
bool ebpo_edge_faces_alternate(const ebpo_edge_faces *e);

#endif
