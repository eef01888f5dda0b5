/* The body of a binary PLY file, of either byte order. */
#ifndef EBPO_MESH_PLY_BINARY_H
#define EBPO_MESH_PLY_BINARY_H

#include "mesh/ply_state.h"

/* As ebpo_ply_ascii_element. */
ebpo_status ebpo_ply_binary_element(ply_parser *p, const ply_element *element, bool store);

#endif
