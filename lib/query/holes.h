/* Inside of a mesh with holes, by its generalized winding number. */
#ifndef EBPO_QUERY_HOLES_H
#define EBPO_QUERY_HOLES_H

#include "query/cap_tree.h"
#include "query/query_model.h"

/* The border of a surface that is all in memory, and the rule. Any thread. */
struct ebpo_holes {
    ebpo_cap_tree caps;
    ebpo_cap_rule rule;
    double low[3], high[3];  /* the faces are between these corners */
    _Atomic uint64_t ties;   /* number of decisions that were ties */
};

/* Finds the border of a mesh, whose faces are in `box`. */
EBPO_MUST_USE ebpo_status ebpo_holes_make(ebpo_holes **out, const ebpo_mesh *mesh,
                                          const ebpo_info *info, double threshold,
                                          unsigned threads, ebpo_error *error);
void ebpo_holes_free(ebpo_holes *holes); /* accepts NULL */
uint64_t ebpo_holes_bytes(const ebpo_holes *holes);

/* Classifies a finite point; winding is 1 inside, else 0. The model has holes. */
void ebpo_holes_inside(const ebpo_model *model, const double p[3], ebpo_inside_result *out);
/* Bounds the winding number of a finite point with an error of at most width / 2, if doubles
 * suffice. Returns false on a face. */
bool ebpo_holes_winding(const ebpo_model *model, const double p[3], double width,
                        ebpo_bounded *out);

#endif
