/* Faces of the same three vertices. They meet at their lowest vertex. */
#ifndef EBPO_MESH_SAME_FACES_H
#define EBPO_MESH_SAME_FACES_H

#include "mesh/stars.h"

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

#endif
