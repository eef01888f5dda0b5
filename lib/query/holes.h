/* Inside of a mesh with holes, by its generalized winding number. */
#ifndef EBPO_QUERY_HOLES_H
#define EBPO_QUERY_HOLES_H

#include "query/cap_tree.h"
#include "query/query_model.h"

/* The border of a surface that is all in memory, and the rule. Any thread. */
struct ebpo_holes {
    ebpo_cap_tree caps;
    ebpo_cap_rule rule;
    double low[3], high[3]; /* the faces are between these corners */
    _Atomic uint64_t ties;  /* number of decisions that were ties */
    /* What is known of the octree's cells, found by the first query of each (hole_cells.c): cells
     * of the grid of `whole`, then children of groups; and leaves. NULL: unused. */
    _Atomic uint8_t *cell, *leaf;
    _Atomic int32_t *leaf_winding; /* of mesh and caps at the lowest corner, shifted */
    uint64_t cell_count, leaf_count;
};

/* Finds the border of a mesh, whose faces are in `box`. */
EBPO_MUST_USE ebpo_status ebpo_holes_make(ebpo_holes **out, const ebpo_mesh *mesh,
                                          const ebpo_info *info, double threshold, unsigned threads,
                                          ebpo_error *error);
void ebpo_holes_free(ebpo_holes *holes); /* accepts NULL */
uint64_t ebpo_holes_bytes(const ebpo_holes *holes);

/* Prepares fast queries of a model with holes, whose `whole` has been made. Without memory, queries
 * are slow. */
void ebpo_holes_attach(ebpo_holes *holes, const ebpo_accel *whole);

/* Finds the winding number of mesh and caps at a finite point, shifted. Returns false if p is on a
 * face; the number is then set only if `on_faces_too`. */
bool ebpo_holes_crossings(const ebpo_model *model, const double p[3], bool on_faces_too,
                          int32_t *winding);

/* Classifies a point by its cell. Sets *done to false if that is not possible. */
EBPO_MUST_USE ebpo_status ebpo_holes_by_cell(ebpo_context *context, const double p[3],
                                             ebpo_inside_result *out, bool *done,
                                             ebpo_error *error);

/* Classifies a finite point; winding is 1 inside, else 0. The model has holes. */
EBPO_MUST_USE ebpo_status ebpo_holes_inside(ebpo_context *context, const double p[3],
                                            ebpo_inside_result *out, ebpo_error *error);
/* Bounds the winding number of a finite point with an error of at most width / 2, if doubles
 * suffice. Returns false on a face. */
bool ebpo_holes_winding(const ebpo_model *model, const double p[3], double width,
                        ebpo_bounded *out);

#endif
