/* Faces of one mesh: what neighbours have in common by being neighbours is no meeting. */
#ifndef EBPO_COLLIDE_NEIGHBOURS_H
#define EBPO_COLLIDE_NEIGHBOURS_H

#include <ebpo/pair.h>

/* As ebpo_triangle_pair, but EBPO_PAIR_APART where the common points are the corner, or the edge
 * between corners, that both faces have (equal coordinates). Swapping changes nothing. */
ebpo_pair_kind ebpo_neighbours(const double a[3][3], const double b[3][3]);

#endif
