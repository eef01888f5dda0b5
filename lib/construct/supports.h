/* Computes the support of the solid in a gray node's cell (the greatest n . x for a direction n),
 * and boxes around ranges of vertices along the curve. */
#ifndef EBPO_CONSTRUCT_SUPPORTS_H
#define EBPO_CONSTRUCT_SUPPORTS_H

#include "construct/builder.h"
#include "construct/sweep.h"

/* --- ranges of vertices --- */

/* Finds the range of vertices in a cell: begin .. end - 1. */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

/* Makes b->bounds. */
ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
void ebpo_bounds_free(ebpo_bounds *bounds);

/* --- the support of the solid --- */

/* The points over which the support is the maximum: vertices, crossings of the mesh with cell
 * faces, and corners of the cell that are inside the solid. */
typedef struct ebpo_supports {
    const ebpo_builder *b;
    ebpo_workspace *workspace; /* the builder's workspace, set at the first use */
    ebpo_cell cell;
    /* [four] cell coordinates of four points, and bounds of the rounding error of their n . x (as
     * ebpo_sweep_points) */
    double (*point)[4][4];
    uint64_t count, capacity; /* number of points; number of fours */
    const ebpo_sweep *sweep;
    uint16_t *table; /* hash table: 1 + index of the point, as most points occur several times */
    uint64_t table_capacity;
    uint64_t table_size; /* size of the table, a power of two */
    /* [stretch] least and greatest coordinates, greatest error (as ebpo_sweep_points) */
    double (*box)[7];
    uint64_t box_capacity;
    /* range of vertices that are not among the points, as they are many; they are searched by the
     * boxes of b->bounds */
    uint64_t begin, end;
} ebpo_supports;

/* Gathers the points of a node. Returns false when out of memory. */
bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding);

/* Returns the support: the maximum of n . xi over the solid in the cell, except for rounding
 * errors, for which ebpo_plane_code_offset has a margin. The search ends when it reaches `enough`.
 * Sets `where` to the point of the maximum, in cell coordinates. Returns -1e300 if there are no
 * points. */
double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3]);

/* Returns the same value as ebpo_supports_find. The search is faster, because it begins with the
 * greatest value of some known points of the solid. */
double ebpo_supports_find_from(const ebpo_supports *s, const int32_t n[3], double enough,
                               const double (*known)[3], int known_count, double where[3]);

void ebpo_supports_free(ebpo_supports *s);

#endif
