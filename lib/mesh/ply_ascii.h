/* The body of an ascii PLY file. */
#ifndef EBPO_MESH_PLY_ASCII_H
#define EBPO_MESH_PLY_ASCII_H

#include "mesh/ply_state.h"

/* Reads all rows of an element, from p->at to behind its last row; with `store` false it only steps
 * over them. */
ebpo_status ebpo_ply_ascii_element(ply_parser *p, const ply_element *element, bool store);

/* Steps over blanks behind the last row: true where more text follows. */
bool ebpo_ply_ascii_more(ply_parser *p);

#endif
