/* From a cell's coordinates to the model's: half-spaces and polygons. */
#ifndef EBPO_LEVELS_CELL_TO_MODEL_H
#define EBPO_LEVELS_CELL_TO_MODEL_H

#include <stdint.h>

#include "geometry/cell.h"
#include "geometry/polytope.h"

/* The code's half-space 4096 (n . xi) <= d as out[0..2] . p <= out[3] with a unit normal (to 4
 * ulps): every real point p of the cell that satisfies the code satisfies this, and also when the
 * left side is evaluated in doubles in any order, for double p. The offset is larger than need be
 * by about 1e-14 of the cell's coordinates. */
void ebpo_plane_to_world(const ebpo_box *box, ebpo_cell cell, const int32_t n[3], int32_t d,
                         double out[4]);

/* Vertices of the polytope, rounded; those on the cell's walls get the walls' own coordinates, so
 * that neighbours agree to the last bit. */
void ebpo_polytope_to_world(const ebpo_polytope *p, const ebpo_box *box, ebpo_cell cell,
                            double (*out)[3]);

#endif
