/* Describes where a surface with holes has its inside, for envelopes that contain the inside.
 *
 * A point is inside if its winding number w satisfies the rule with the threshold 1/2. With the
 * integer winding number k of faces and caps (geometry/cap_tree.h), w = k + w_D. Where |w_D| < 1/2,
 * the rule gives the same result for w and for k, as in a solid. The cells in which |w_D| may be
 * 1/2 or more are the cap cells: a thin layer around the caps. They are found once, level by level,
 * until the number of tests reaches a limit that grows with the length of the border. A cell is a
 * cap cell as a whole if the list of groups of caps near it is too long, so the work is limited for
 * caps that overlap.
 *
 * So the inside is a part of the union of the cap cells and of the solid that faces and caps bound
 * outside the cap cells. The boundary of this union consists of faces and of sides of cap cells.
 * An envelope contains the inside if it contains the faces in its cell, the corners of cap cells,
 * and the corners of its own cell that are inside by the rule for k. */
#ifndef EBPO_CONSTRUCT_CAPPED_H
#define EBPO_CONSTRUCT_CAPPED_H

#include "construct/builder.h"
#include "geometry/cap_tree.h"

typedef struct ebpo_capped ebpo_capped;

/* Finds the cap cells of a surface with these loops. Sets b->capped. Reports progress as the stage
 * "border". Returns EBPO_E_MEMORY, EBPO_E_LIMIT, EBPO_E_CANCELLED. */
EBPO_MUST_USE ebpo_status ebpo_capped_make(ebpo_builder *b, const ebpo_border_loops *loops,
                                           ebpo_error *error);
void ebpo_capped_free(ebpo_capped *capped); /* accepts NULL */

/* Adds the crossings of caps along the edges of a cell to the cell's corner differences. */
void ebpo_cap_corners(const ebpo_cap_tree *caps, const ebpo_box *box, ebpo_cell cell,
                      int32_t delta[8]);
/* Does the same with the caps of a builder. Fast for a cell that is away from all cap cells. */
void ebpo_capped_add_corners(const ebpo_capped *capped, ebpo_cell cell, int32_t delta[8]);

/* Describes how a cell and the cap cells overlap. */
typedef enum ebpo_cap_overlap {
    EBPO_CAP_NONE,
    EBPO_CAP_PART,
    EBPO_CAP_WHOLE /* a cap cell contains the cell */
} ebpo_cap_overlap;
ebpo_cap_overlap ebpo_capped_overlap(const ebpo_capped *capped, ebpo_cell cell);

/* Returns false if all points of a cell without faces are certainly outside. `winding`: k at the
 * cell's lowest corner. */
bool ebpo_capped_may_hold(const ebpo_capped *capped, ebpo_cell cell, int32_t winding);

/* Lists the cap cells in a cell of overlap EBPO_CAP_PART, not smaller than three levels below the
 * cell: smaller ones are replaced by their ancestors of this level. Calls add(context, x) for each
 * of their corners, in coordinates of the cell. Returns false if a call did. */
bool ebpo_capped_corners(const ebpo_capped *capped, ebpo_cell cell,
                         bool (*add)(void *context, const double x[3]), void *context);

#endif
