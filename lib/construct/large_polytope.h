/* A convex polytope with any number of faces, for envelopes of the theses, which may have thousands
 * of planes. (ebpo_polytope has at most the 255 planes that a file stores for a node.) */
#ifndef EBPO_CONSTRUCT_LARGE_POLYTOPE_H
#define EBPO_CONSTRUCT_LARGE_POLYTOPE_H

#include <stdbool.h>
#include <stdint.h>

#include "geometry/polytope.h"

/* The faces of a polytope as loops of vertices, as in ebpo_polytope. */
typedef struct ebpo_large_shape {
    double (*vertex)[3];
    uint32_t *corner; /* vertices of the faces, one face after the other */
    uint64_t *first;  /* [face_count + 1] index of the face's first corner in `corner` */
    int32_t *tag;     /* [face_count] the tag of the plane that made the face (ebpo_polytope) */
    uint64_t vertex_count, corner_count, face_count;
    uint64_t vertex_capacity, corner_capacity, first_capacity, tag_capacity;
} ebpo_large_shape;

typedef struct ebpo_large_polytope {
    ebpo_large_shape now, next; /* now: the polytope; next: the result of the current cut */
    double *distance;           /* [vertex of now] signed distance from the cutting plane */
    uint32_t *next_index;       /* [vertex of now] index in `next`, if the vertex is kept */
    /* [vertex of next] the vertex that follows this one in the cap, the new face in the cutting
     * plane */
    uint32_t *cap;
    bool *on;                     /* [vertex of next] the vertex is on the cutting plane */
    struct ebpo_large_edge *edge; /* hash table of the cut edges */
    struct ebpo_large_rim {
        uint32_t from, to; /* vertices of next */
    } * rim;               /* edges of kept faces on the cutting plane */
    uint64_t rims, distance_capacity, next_index_capacity, cap_capacity, on_capacity, edge_capacity,
        rim_capacity;
    uint64_t edge_slots; /* size of the hash table, a power of two */
    /* at least one vertex of `now` is on the plane, so an edge of `rim` may be between two kept
     * faces */
    bool touched;
    bool no_memory; /* a call failed for lack of memory */
} ebpo_large_polytope;

/* Sets `p` to the unit cube. Before the first call, all bytes of `p` must be zero. Returns false
 * when out of memory. */
bool ebpo_large_cube(ebpo_large_polytope *p);

/* Cuts off all points with n . x > d; the new face gets the tag. Returns the same values as
 * ebpo_polytope_clip; when out of memory, sets p->no_memory and returns EBPO_CLIP_REFUSED. */
ebpo_clip ebpo_large_clip(ebpo_large_polytope *p, const double n[3], double d, int32_t tag);

/* Returns the volume in cells. */
double ebpo_large_volume(const ebpo_large_polytope *p);

void ebpo_large_free(ebpo_large_polytope *p);

#endif
