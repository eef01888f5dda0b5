/* What a cell and the half-spaces of its envelope tell of a point: bounds that are certain. */
#ifndef EBPO_QUERY_NODE_BOUNDS_H
#define EBPO_QUERY_NODE_BOUNDS_H

#include "geometry/cells.h"

/* Length of the cell's diagonal, rounded up so that it bounds the distance of any point of the cell
 * to a face that the node lists. */
double ebpo_cell_diagonal(const ebpo_box *box, ebpo_cell cell);

/* True when p is certainly outside one of the half-spaces of a cell. */
bool ebpo_outside_planes(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes, uint32_t count,
                         const double p[3]);

/* Certain lower bound of the distance of p to the cell cut by the half-spaces: some bound is enough
 * that is beyond `enough`. And upper bound of the distance to the farthest point of the cell. */
double ebpo_envelope_distance(const ebpo_box *box, ebpo_cell cell, const uint32_t *codes,
                              uint32_t count, const double p[3], double enough);
double ebpo_cell_far(const ebpo_box *box, ebpo_cell cell, const double p[3]);

#endif
