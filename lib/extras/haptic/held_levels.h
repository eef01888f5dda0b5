/* The first levels of a model's octree, kept for haptic steps: certain bounds without reading a
 * file. */
#ifndef EBPO_HAPTIC_HELD_LEVELS_H
#define EBPO_HAPTIC_HELD_LEVELS_H

#include <ebpo/query.h>

/* What roundings add to a length from a place to another, as a share of it: a few units in the last
 * place. From afar that is more than `slack`. */
#define EBPO_LENGTH_SLACK 0x1p-48

typedef struct ebpo_held_node {
    double low[3], high[3];
    uint32_t children; /* the first of eight; EBPO_NO_CHILDREN */
    int32_t winding;   /* of a cell without faces */
    bool has_faces;    /* one or more, within `slack` of the cell */
} ebpo_held_node;

typedef struct ebpo_held_levels {
    ebpo_held_node *node; /* [count] the first is the root */
    uint64_t count;
    double slack; /* what roundings of the model's coordinates may add up to */
} ebpo_held_levels;

/* As many levels as have at most 2^17 nodes, 6 or fewer below the root. */
EBPO_MUST_USE ebpo_status ebpo_held_levels_read(const ebpo_file *file, ebpo_held_levels *out,
                                                ebpo_error *error);
void ebpo_held_levels_free(ebpo_held_levels *levels);

/* The distance to the nearest face is from *lo to *hi. At most so many nodes are looked at. */
void ebpo_held_levels_bound(const ebpo_held_levels *levels, const double p[3], int visits,
                            double *lo, double *hi);

/* True: p lies in a cell without faces, of this winding number; or outside of all cells. */
bool ebpo_held_levels_winding(const ebpo_held_levels *levels, const double p[3], int32_t *winding);

#endif
