/* Winding numbers at the corners of cells. */
#ifndef EBPO_CONSTRUCT_CORNER_WINDINGS_H
#define EBPO_CONSTRUCT_CORNER_WINDINGS_H

#include "construct/builder.h"

/* Of all branches, before the pieces are partitioned. */
ebpo_status ebpo_build_corner_windings(ebpo_builder *b, ebpo_error *error);
/* Winding number at corner 0 of each child minus that of the parent's, from the children's corner
 * differences. */
void ebpo_child_windings(const ebpo_builder *b, const ebpo_branch *s, uint32_t child,
                         int32_t offset[8]);
/* The corner differences of a cell from the branch's faces that touch it: list[places[i]], or with
 * NULL the first `count` of the list. Long lists are processed EBPO_CORNER_FACES at a time, so
 * `capacity` needs the lesser of that and `count`. */
enum { EBPO_CORNER_FACES = 1 << 14 };
void ebpo_branch_corners(const ebpo_builder *b, const ebpo_branch *s, ebpo_cell cell,
                         const uint32_t *places, uint64_t count, ebpo_triangle *capacity,
                         int32_t delta[8]);
/* A gray node's own corner differences from its children's. Crossings along any way between two
 * corners agree when the mesh balances: false when they do not. */
bool ebpo_gather_delta(const ebpo_builder *b, const ebpo_branch *s, uint32_t child,
                       int32_t delta[8]);
/* Bit i is set when corner i is inside by the builder's rule. */
unsigned ebpo_inside_corners(const ebpo_builder *b, int32_t winding, const int32_t delta[8]);

#endif
