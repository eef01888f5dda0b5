/* The support of the solid in a gray node's cell, and bounds of runs of vertices along the curve
 * (supports.c). */
#ifndef EBPO_CONSTRUCT_SUPPORTS_H
#define EBPO_CONSTRUCT_SUPPORTS_H

#include "construct/builder.h"
#include "construct/sweep.h"

/* --- runs of vertices --- */

/* The vertices in a cell. */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
void ebpo_bounds_free(ebpo_bounds *bounds);

/* --- the support of the solid: over vertices, crossings of cell faces, and inside corners --- */

typedef struct ebpo_supports {
    const ebpo_builder *b;
    ebpo_workspace *workspace; /* the builder's, since something was gathered */
    ebpo_cell cell;
    /* four points: cell coordinates, and what rounding may add to a support (see sweep.h) */
    double (*point)[4][4];
    uint64_t count, capacity; /* points; fours */
    const ebpo_sweep *sweep;
    uint16_t *place; /* by hash: 1 + number of the point; most come several times. */
    uint64_t place_capacity, place_count; /* a power of two */
    /* of each stretch of points: least and greatest coordinates, greatest slack */
    double (*box)[7];
    uint64_t box_capacity;
    /* vertices that are not among the points: searched by way of their bounds */
    uint64_t begin, end;
} ebpo_supports;

/* Gathers the points of a node. False: out of memory. */
bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding);

/* An upper bound of n . xi, exact but for roundings that ebpo_plane_code_offset allows for; a
 * search that has reached `enough` ends there. `where` is the point that reaches it, in cell
 * coordinates. -1e300 when there are no points. */
double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3]);

/* The same, with points of the solid that were found before: the search among vertices begins with
 * the best of them. */
double ebpo_supports_find_from(const ebpo_supports *s, const int32_t n[3], double enough,
                               const double (*known)[3], int known_count, double where[3]);

void ebpo_supports_free(ebpo_supports *s);

#endif
