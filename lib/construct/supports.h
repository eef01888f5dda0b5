/* Computes the support of the solid in a gray node's cell (the greatest n . x for a direction n),
 * and bounds of runs of vertices along the curve (supports.c). */
#ifndef EBPO_CONSTRUCT_SUPPORTS_H
#define EBPO_CONSTRUCT_SUPPORTS_H

#include "construct/builder.h"
#include "construct/sweep.h"

/* --- runs of vertices --- */

/* Finds the range of vertices in a cell. */
void ebpo_build_vertex_range(const ebpo_builder *b, ebpo_cell cell, uint64_t *begin, uint64_t *end);

ebpo_status ebpo_bounds_make(ebpo_builder *b, ebpo_error *error);
void ebpo_bounds_free(ebpo_bounds *bounds);

/* --- the support of the solid: over vertices, crossings of cell faces, and inside corners --- */

typedef struct ebpo_supports {
    const ebpo_builder *b;
    ebpo_workspace *workspace; /* the builder's workspace, set at the first use */
    ebpo_cell cell;
    /* four points: cell coordinates, and a bound of the rounding error of a support (see sweep.h)
     */
    double (*point)[4][4];
    uint64_t count, capacity; /* number of points; number of fours */
    const ebpo_sweep *sweep;
    uint16_t *table; /* hash table: 1 + index of the point, as most points occur several times */
    uint64_t table_capacity;
    uint64_t table_size; /* size of the table, a power of two */
    /* for each stretch of points: least and greatest coordinates, greatest slack */
    double (*box)[7];
    uint64_t box_capacity;
    /* range of vertices that are not among the points; they are searched by their bounds */
    uint64_t begin, end;
} ebpo_supports;

/* Gathers the points of a node. Returns false when out of memory. */
bool ebpo_supports_gather(ebpo_supports *s, const ebpo_builder *b, const ebpo_branch *branch,
                          const ebpo_build_detail *detail, ebpo_cell cell, int32_t winding);

/* Returns an upper bound of n . xi over the solid in the cell. The bound is exact except for
 * rounding errors, for which ebpo_plane_code_offset has a margin. The search ends when it reaches
 * `enough`. `where` is the point of the maximum, in cell coordinates. Returns -1e300 when there are
 * no points. */
double ebpo_supports_find(const ebpo_supports *s, const int32_t n[3], double enough,
                          double where[3]);

/* Does the same as ebpo_supports_find with known points of the solid. The search among vertices
 * begins with the greatest value of the known points. */
double ebpo_supports_find_from(const ebpo_supports *s, const int32_t n[3], double enough,
                               const double (*known)[3], int known_count, double where[3]);

void ebpo_supports_free(ebpo_supports *s);

#endif
