/* Computes the support of the solid in a gray node's cell: the greatest n . x over the points x of
 * the solid in the cell, for a direction n. Also makes boxes around ranges of vertices along the
 * Morton curve. */
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

/* The points of a node: the support is the maximum of n . x over these points. There are three
 * kinds: the vertices in the cell, the points at which cell faces cut the faces of the mesh, and
 * the corners of the cell that are inside the solid. */
typedef struct ebpo_supports {
    const ebpo_builder *b;
    ebpo_workspace *workspace; /* the builder's workspace, set at the first use */
    ebpo_cell cell;
    /* [group of four points] four x, four y and four z in cell coordinates, and upper bounds of the
     * rounding errors of the four n . x (ebpo_sweep_points) */
    double (*point)[4][4];
    uint64_t count, capacity; /* number of points; number of elements for which `point` has space */
    const ebpo_sweep *sweep;  /* kernels for this processor */
    /* hash table that finds equal points: 1 + index of the point; 0: empty slot */
    uint16_t *table;
    uint64_t table_capacity;
    uint64_t table_size; /* size of the table, a power of two */
    /* [stretch of 32 points] three least and three greatest coordinates, and the greatest error
     * bound (ebpo_sweep_points) */
    double (*box)[7];
    uint64_t box_capacity;
    /* if there are many vertices in the cell, they are not in `point`; their range is begin .. end
     * - 1, which is searched by the boxes of b->bounds. Otherwise the range is empty */
    uint64_t begin, end;
} ebpo_supports;

/* Gathers the points of a node. `winding`: winding number at the cell's lowest corner. Returns
 * false when out of memory. */
bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding);

/* Returns the support: the maximum of n . x over the solid in the cell, except for rounding errors,
 * for which ebpo_plane_code_offset has a margin. The search may end early when it has found a value
 * of at least `enough`. Sets `where` to the point with the returned value, in cell coordinates.
 * Returns -1e300 if there are no points. */
double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3]);

/* Does the same as ebpo_supports_find in less time, because the search begins with the greatest
 * value of some known points of the solid. `known`: [known_count] these points, in cell
 * coordinates. */
double ebpo_supports_find_from(const ebpo_supports *s, const int32_t n[3], double enough,
                               const double (*known)[3], int known_count, double where[3]);

void ebpo_supports_free(ebpo_supports *s);

#endif
