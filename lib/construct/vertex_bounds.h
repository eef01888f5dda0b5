/* Runs of vertices along the curve, and how far they reach in a direction. */
#ifndef EBPO_CONSTRUCT_VERTEX_BOUNDS_H
#define EBPO_CONSTRUCT_VERTEX_BOUNDS_H

#include "construct/builder.h"

/* The vertices in a cell. */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
/* Greatest n . xi over vertices [begin, end), in coordinates of the cell that holds them, and
 * `least`; `*at`: the vertex, or EBPO_NO_VERTEX when `least` is the greatest. */
double ebpo_bounds_support(const ebpo_builder *b, ebpo_cell cell, const double n[3], uint64_t begin,
                           uint64_t end, double least, uint64_t *at);
void ebpo_bounds_free(ebpo_bounds *bounds);

#endif
