/* The corners of a row become triangles of the mesh. */
#ifndef EBPO_MESH_PLY_FACES_H
#define EBPO_MESH_PLY_FACES_H

#include "mesh/ply_state.h"

/* In the corners of a strip row: a new strip begins. No vertex has this number. */
#define PLY_RESTART UINT32_MAX

/* Forgets the corners read, and makes room for `count` more. */
ebpo_status ebpo_ply_reserve_corners(ply_parser *p, uint64_t count);
/* A vertex number that does not exist. `row` is the face's number. */
ebpo_status ebpo_ply_fail_index(const ply_parser *p, const ply_element *element, uint64_t row,
                                int64_t index);

/* The corners read make a face or a strip: adds its triangles to the mesh. */
ebpo_status ebpo_ply_add_polygon(ply_parser *p, uint64_t row);
ebpo_status ebpo_ply_add_strip(ply_parser *p, uint64_t row);

#endif
