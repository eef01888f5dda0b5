/* Which columns of a mesh's attributes are colours, and these as bytes, a value at a time. */
#ifndef EBPO_MESH_COLOUR_COLUMNS_H
#define EBPO_MESH_COLOUR_COLUMNS_H

#include "mesh/attributes.h"

enum { EBPO_COLOUR_CHANNELS = 4 }; /* red, green, blue; alpha is there or not */

/* A column of an array of numbers; `of` NULL: there is none. */
typedef struct ebpo_colour_column {
    const ebpo_attribute *of;
    uint32_t column;
} ebpo_colour_column;

/* Of "vertex" or "face"; false: there is no red, green and blue. `in` NULL has none. */
bool ebpo_colour_columns(const ebpo_attributes *in, const char *element,
                         ebpo_colour_column out[EBPO_COLOUR_CHANNELS]);

/* As ebpo_mesh_colours says. The row must be there. */
uint8_t ebpo_colour_byte(const ebpo_colour_column *column, uint64_t row);

/* Whether vertices or faces have colours. */
bool ebpo_attributes_coloured(const ebpo_attributes *in);

#endif
