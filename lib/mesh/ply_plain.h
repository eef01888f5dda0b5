/* Rows of one size, on all cores. */
#ifndef EBPO_MESH_PLY_PLAIN_H
#define EBPO_MESH_PLY_PLAIN_H

#include "mesh/ply_state.h"

/* Reads the rows from p->at on as far as all have one size, and says how many these were: all
 * vertices or none; the faces before the first that is no triangle, or names a vertex that is not
 * there. The others, and what is wrong with them, are the row by row reader's. */
ebpo_status ebpo_ply_plain_vertices(ply_parser *p, const ply_element *element, bool swap,
                                    uint64_t *done);
ebpo_status ebpo_ply_plain_faces(ply_parser *p, const ply_element *element, bool swap,
                                 uint64_t *done);

#endif
