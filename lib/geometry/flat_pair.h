/* Pairs of faces in one plane, and those of which one has no area: a part of ebpo_triangle_pair. */
#ifndef EBPO_GEOMETRY_FLAT_PAIR_H
#define EBPO_GEOMETRY_FLAT_PAIR_H

#include <ebpo/pair.h>

/* One face has no area, or both are in one plane. */
ebpo_pair_kind ebpo_flat_pair(const double a[3][3], const double b[3][3]);

#endif
