/* Inside of a mesh with holes, by its generalized winding number. */
#ifndef EBPO_QUERY_HOLES_H
#define EBPO_QUERY_HOLES_H

#include <ebpo/query.h>

#include "geometry/cells.h"
#include "query/accel.h"
#include "query/cap_tree.h"

/* The border of a surface that is all in memory, and the rule. Any thread. */
typedef struct ebpo_holes {
    ebpo_cap_tree caps;
    ebpo_cap_rule rule;
    double low[3], high[3]; /* the faces are between these corners */
    _Atomic uint64_t ties;  /* number of decisions that were ties */
    /* set by ebpo_holes_attach */
    const ebpo_accel *whole;
    ebpo_locator locator;
    /* What is known of the octree's cells, found by the first query of each (hole_cells.c): cells
     * of the grid of `whole`, then children of groups; and leaves. NULL: unused. */
    _Atomic uint8_t *cell, *leaf;
    _Atomic int32_t *leaf_winding; /* of mesh and caps at the lowest corner, shifted */
    uint64_t cell_count, leaf_count;
} ebpo_holes;

/* Finds the border of a mesh, whose faces are in the box of `info`. */
EBPO_MUST_USE ebpo_status ebpo_holes_make(ebpo_holes **out, const ebpo_mesh *mesh,
                                          const ebpo_info *info, double threshold, unsigned threads,
                                          ebpo_error *error);
/* Prepares queries; `whole` and `locator` are the model's. Without memory, queries are slow. */
void ebpo_holes_attach(ebpo_holes *holes, const ebpo_accel *whole, const ebpo_locator *locator);
void ebpo_holes_free(ebpo_holes *holes); /* accepts NULL */
uint64_t ebpo_holes_bytes(const ebpo_holes *holes);

/* Finds the winding number of mesh and caps at a finite point, shifted. Returns false if p is on a
 * face; the number is then set only if `on_faces_too`. */
bool ebpo_holes_crossings(const ebpo_holes *holes, const double p[3], bool on_faces_too,
                          int32_t *winding);

/* Classifies a finite point. */
ebpo_where ebpo_holes_where(ebpo_holes *holes, const double p[3]);
/* Bounds the winding number of a finite point with an error of at most width / 2, if doubles
 * suffice. Returns false on a face. */
bool ebpo_holes_winding(const ebpo_holes *holes, const double p[3], double width,
                        ebpo_bounded *out);

/* What a point's cell decides. */
typedef enum ebpo_cell_decision {
    EBPO_CELL_UNKNOWN, /* not examined yet */
    EBPO_CELL_OUT,
    EBPO_CELL_IN,
    EBPO_CELL_FAR, /* a leaf far from the border: as in a solid */
    EBPO_CELL_NEAR /* nothing */
} ebpo_cell_decision;

typedef struct ebpo_holes_cell {
    ebpo_cell_decision decision;
    /* EBPO_CELL_FAR: the leaf, its level, the winding number at its lowest corner, and the shifted
     * position of the point */
    uint32_t leaf;
    int level;
    int32_t winding;
    ebpo_position position;
} ebpo_holes_cell;

void ebpo_holes_find_cell(ebpo_holes *holes, const double p[3], ebpo_holes_cell *out);

#endif
