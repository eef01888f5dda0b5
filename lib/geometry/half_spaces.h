/* What bounds a node's envelope beside its cell: the half-spaces of its ancestors and its own, as
 * exact integers in the coordinates of its cell. */
#ifndef EBPO_GEOMETRY_HALF_SPACES_H
#define EBPO_GEOMETRY_HALF_SPACES_H

#include <ebpo/file.h>

#include "geometry/polytope.h"

/* 4096 (n . xi) <= d */
typedef struct ebpo_half_space {
    int32_t n[3];
    int64_t d;
} ebpo_half_space;

enum { EBPO_HALF_SPACES_MAX = EBPO_LEVELS_MAX * 256 }; /* plane counts are bytes */

/* Half-spaces that keep the whole cell are left out. */
typedef struct ebpo_half_spaces {
    int count;
    ebpo_half_space at[EBPO_HALF_SPACES_MAX];
} ebpo_half_spaces;

/* Adds planes of the cell at hand. */
void ebpo_half_spaces_add(ebpo_half_spaces *spaces, const uint32_t *codes, uint64_t count);

/* From the cell to its child. */
void ebpo_half_spaces_to_child(ebpo_half_spaces *spaces, unsigned octant);

/* The cell cut by the half-spaces, each moved outwards by `slack` (in the units of n / 511, about
 * cells). */
void ebpo_half_spaces_cut(const ebpo_half_spaces *spaces, double slack, ebpo_polytope *out);

#endif
