/* Computes the support of the solid in a gray node's cell (the greatest n . x over the solid in the
 * cell, for a direction n), and boxes around ranges of vertices along the Morton curve. */
#ifndef EBPO_CONSTRUCT_SUPPORTS_H
#define EBPO_CONSTRUCT_SUPPORTS_H

#include "construct/builder.h"
#include "construct/sweep.h"

/* --- ranges of vertices --- */

/* Finds the range of vertices in a cell: *begin .. *end - 1. */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

/* Makes b->bounds, the boxes around ranges of vertices. */
ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
void ebpo_bounds_free(ebpo_bounds *bounds);

/* --- the support of the solid --- */

/* The points of a node: the support is the maximum of n . x over them. They are the vertices in the
 * cell, the points where the mesh crosses cell faces, and the corners of the cell that are inside
 * the solid. */
typedef struct ebpo_supports {
    const ebpo_builder *b;
    ebpo_workspace *workspace; /* the builder's workspace, set at the first use */
    ebpo_cell cell;
    /* [four] cell coordinates of four points, and bounds of the rounding error of their n . x (as
     * ebpo_sweep_points) */
    double (*point)[4][4];
    uint64_t count, capacity; /* number of points; number of fours */
    const ebpo_sweep *sweep;  /* kernels for this processor */
    /* hash table, since most points occur several times: 1 + index of the point; 0: empty slot */
    uint16_t *table;
    uint64_t table_capacity;
    uint64_t table_size; /* size of the table, a power of two */
    /* [stretch of points] least and greatest coordinates, greatest error (as ebpo_sweep_points) */
    double (*box)[7];
    uint64_t box_capacity;
    /* if there are many vertices: their range, which is searched by the boxes of b->bounds (they
     * are not in `point`); otherwise an empty range */
    uint64_t begin, end;
} ebpo_supports;

/* Gathers the points of a node. `winding`: winding number at the cell's lowest corner. Returns
 * false when out of memory. */
bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding);

/* Returns the support: the maximum of n . xi over the solid in the cell, except for rounding
 * errors, for which ebpo_plane_code_offset has a margin. The search ends when the value reaches
 * `enough`. Sets `where` to the point of the maximum, in cell coordinates. Returns -1e300 if there
 * are no points. */
double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3]);

/* Returns the same value as ebpo_supports_find, in less time, because the search begins with the
 * greatest value of some known points of the solid, in cell coordinates. */
double ebpo_supports_find_from(const ebpo_supports *s, const int32_t n[3], double enough,
                               const double (*known)[3], int known_count, double where[3]);

void ebpo_supports_free(ebpo_supports *s);

#endif
