/* Final numbers of faces and vertices: in the order in which the leaves list them first. */
#ifndef EBPO_CONSTRUCT_FACE_NUMBERS_H
#define EBPO_CONSTRUCT_FACE_NUMBERS_H

#include "construct/builder.h"

/* Numbers a piece's fresh faces. */
ebpo_status ebpo_build_number(ebpo_builder *b, ebpo_branch *s, ebpo_error *error);
/* The mesh in its final order. */
ebpo_status ebpo_build_mesh(ebpo_builder *b, ebpo_mesh *mesh, ebpo_tree *out, ebpo_error *error);

#endif
