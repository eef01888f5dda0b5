/* Which faces meet at which vertex, and what that says about edges. */
#ifndef EBPO_MESH_STARS_H
#define EBPO_MESH_STARS_H

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

#endif
