/* Simplifies the triangles of a patch while the patch is built, and bounds the distance between two
 * surfaces. A patch is a coarse surface for the part of the model in a cell
 * (format-spec/surface.md). */
#ifndef EBPO_CONSTRUCT_SIMPLIFY_H
#define EBPO_CONSTRUCT_SIMPLIFY_H

#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>

#include "core/error.h"

typedef struct ebpo_patch_vertex {
    double at[3]; /* position */
    /* sum of the normals of faces; the length of each normal is twice the face's area */
    double normal[3];
    double colour[3], weight; /* sum of weighted colours; sum of the weights */
    /* least and greatest index of the faces of the model that use the vertices which this vertex
     * replaces */
    uint64_t lowest, highest;
    uint64_t key; /* surface.c: key of the vertex's cell, or of the model's vertex */
    bool fixed;   /* the vertex is on the border of the patch and does not move */
} ebpo_patch_vertex;

/* The triangles of a patch. Neighbours in the array should be neighbours in space. */
typedef struct ebpo_patch_mesh {
    uint64_t vertex_count, triangle_count, vertex_capacity, triangle_capacity;
    ebpo_patch_vertex *vertex;
    uint32_t *triangle; /* [triangle_count][3] */
} ebpo_patch_mesh;

void ebpo_patch_mesh_free(ebpo_patch_mesh *mesh);

/* Collapses edges until at most `target` triangles remain and each further collapse would change
 * the surface by more than about `fine`, or until every further collapse would change it by more
 * than about 16 * fine, flip a triangle or change the topology. Fixed vertices remain at their
 * positions. Removes unused vertices that are not fixed. Returns EBPO_E_MEMORY, and EBPO_E_LIMIT
 * for more than 2^32 / 3 triangles; then nothing changes. Any thread. Source: Garland and Heckbert,
 * Surface simplification using quadric error metrics, 1997. */
EBPO_MUST_USE ebpo_status ebpo_simplify(ebpo_patch_mesh *mesh, uint64_t target, double fine,
                                        ebpo_error *error);

/* Sets *out to an upper bound of the greatest distance of a point of `a` from `b`. `b` must have
 * triangles, at most UINT32_MAX / 3. The function improves the bound until one of these conditions
 * is true: the bound is at most `known`; it exceeds the distance by at most 5 %; it exceeds the
 * distance by at most `fine`; the number of steps reaches a limit, which is proportional to the
 * number of triangles. All distances have the unit of the coordinates. The caller adds the rounding
 * error, about 2^-45 of the greatest coordinate. Returns EBPO_E_MEMORY. Any thread. */
EBPO_MUST_USE ebpo_status ebpo_bound_distance(const ebpo_patch_mesh *a, const ebpo_patch_mesh *b,
                                              double fine, double known, double *out,
                                              ebpo_error *error);

#endif
