/* Which octants of a cell a face may touch. */
#ifndef EBPO_CONSTRUCT_OCTANTS_H
#define EBPO_CONSTRUCT_OCTANTS_H

#include "construct/planes.h"

/* Bit i set: the face may touch the closed octant i of the cell, which it is known to touch
 * (conservatively). An octant that the face touches is never missing. */
unsigned ebpo_octants_touched(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face);

#endif
