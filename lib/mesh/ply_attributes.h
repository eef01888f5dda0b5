/* Properties beyond positions and corners, on their way into a mesh's attributes. What is here does
 * nothing when they are not read (ply_parser.lost is NULL). */
#ifndef EBPO_MESH_PLY_ATTRIBUTES_H
#define EBPO_MESH_PLY_ATTRIBUTES_H

#include "mesh/ply_state.h"

/* Arrays for the header's properties, with room for the rows that it states. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_plan(ply_parser *p);
/* After the last row: what was read becomes the mesh's, with the header where that says more than
 * the mesh does. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_end(ply_parser *p);

/* Room for so many faces in all. */
EBPO_MUST_USE ebpo_status ebpo_ply_attributes_reserve(ply_parser *p, uint64_t faces);

static inline bool ebpo_ply_is_attribute(const ply_property *property)
{
    return property->attribute >= 0;
}

/* The bits of a value, in its low bytes, become that of a row. Rows of different numbers: from any
 * threads. */
void ebpo_ply_put_value(const ply_parser *p, const ply_property *property, uint64_t row,
                        uint64_t bits);

/* A list for `row`, behind those of the rows before: *items is where its `count` items go. */
EBPO_MUST_USE ebpo_status ebpo_ply_put_list(ply_parser *p, const ply_property *property,
                                            uint64_t row, uint64_t count, uint8_t **items);

/* The bits of a value in text; where it is none of its type, the whole property is lost. */
uint64_t ebpo_ply_text_bits(ply_parser *p, const ply_property *property, ply_word token,
                            uint64_t row);
/* Stores bits at `at`. */
void ebpo_ply_store_bits(uint8_t *at, unsigned bytes, uint64_t bits);

/* Face `row` was one of a polygon: the faces up to the last have the same values. */
EBPO_MUST_USE ebpo_status ebpo_ply_repeat_face(ply_parser *p, uint64_t row);

/* Faces from `first` on are no rows of the element of faces: they have zeros and empty lists. There
 * is room for them. */
void ebpo_ply_blank_faces(ply_parser *p, uint64_t first);

#endif
