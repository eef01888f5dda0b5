/* What a PLY file to be written is made of: the properties of a mesh and of its attributes, in the
 * order of the header that they were read with, or in their own. */
#ifndef EBPO_MESH_PLY_LAYOUT_H
#define EBPO_MESH_PLY_LAYOUT_H

#include <stdio.h>

#include "mesh/attributes.h"
#include "mesh/ply_header.h"

typedef struct ply_out_property {
    ply_role role;      /* of positions and corners; else an attribute's: */
    uint32_t attribute; /* which array */
    uint32_t column;
    ply_type type, count_type; /* of positions: as they are written */
} ply_out_property;

typedef struct ply_out_element {
    ply_kind kind;
    uint64_t rows, first, properties; /* in ply_layout.property */
} ply_out_element;

typedef struct ply_layout {
    ply_out_element *element;
    uint64_t elements, element_capacity;
    ply_out_property *property;
    uint64_t properties, property_capacity;
    char *header; /* malloc's, `header_bytes` of it */
    size_t header_bytes;
} ply_layout;

/* `mesh` has been checked. */
EBPO_MUST_USE ebpo_status ebpo_ply_layout_make(ply_layout *out, const ebpo_mesh *mesh,
                                               ebpo_error *error);
void ebpo_ply_layout_free(ply_layout *layout);

#endif
