/* Keeps the first levels of a model's octree in memory, so that haptic steps get guaranteed bounds
 * without reading a file. */
#ifndef EBPO_HAPTIC_HELD_LEVELS_H
#define EBPO_HAPTIC_HELD_LEVELS_H

#include <ebpo/query.h>

/* Greatest relative rounding error of a length between two points (some units in the last place).
 */
#define EBPO_LENGTH_SLACK 0x1p-48

typedef struct ebpo_held_node {
    double low[3], high[3];
    uint32_t children;   /* index of the first of eight children, or EBPO_NO_CHILDREN */
    int32_t winding;     /* winding number of a cell without faces */
    bool has_faces;      /* there are faces within `slack` of the cell, unless may_lack_faces */
    bool may_lack_faces; /* a leaf or pruned node of a surface with holes */
} ebpo_held_node;

typedef struct ebpo_held_levels {
    ebpo_held_node *node; /* [count] node[0] is the root */
    uint64_t count;
    double slack; /* bound of the rounding of the model's coordinates */
} ebpo_held_levels;

/* Reads the root and the levels below it: the greatest number of levels, 6 at most, that have at
 * most `most` nodes in total. */
EBPO_MUST_USE ebpo_status ebpo_held_levels_read(const ebpo_file *file, uint64_t most,
                                                ebpo_held_levels *out, ebpo_error *error);
void ebpo_held_levels_free(ebpo_held_levels *levels);

/* Bounds the distance of p from the nearest face by *lo and *hi. Visits the children of at most
 * `visits` nodes; the bounds are wider if `visits` is smaller. */
void ebpo_held_levels_bound(const ebpo_held_levels *levels, const double p[3], int visits,
                            double *lo, double *hi);

/* Returns true and sets *winding if all points within `margin` (0 or more) of p are in one cell
 * without faces, or outside the root cell, where the winding number is 0. */
bool ebpo_held_levels_winding(const ebpo_held_levels *levels, const double p[3], double margin,
                              int32_t *winding);

#endif
