/* Reads the colours of faces from a file's attributes, for drawing. */
#ifndef EBPO_FORMAT_FACE_COLOURS_H
#define EBPO_FORMAT_FACE_COLOURS_H

#include "format/chunks.h"
#include "mesh/attributes.h"

/* The columns of a file's colours; ebpo_face_colours_free frees them. */
typedef struct ebpo_face_colours {
    ebpo_attributes *arrays; /* the file's attribute arrays; arrays without colours have an empty
                                `element`, so that ebpo_pick_attributes skips them */
    ebpo_colour_column column[EBPO_COLOUR_CHANNELS];
    const char *element; /* "vertex" or "face"; NULL: the file has no colours */
} ebpo_face_colours;

/* Finds the colours of vertices. Finds the colours of faces instead if only faces have colours, or
 * if faces have colours and all vertices have the same colour. */
EBPO_MUST_USE ebpo_status ebpo_face_colours_find(const ebpo_file *file, ebpo_face_colours *out,
                                                 ebpo_error *error);
void ebpo_face_colours_free(ebpo_face_colours *colours);

/* Reads the colours of the corners of `count` faces into out[count][3][3]: red, green and blue.
 * `vertices`: [count][3] vertices of the faces. The file must have colours. Call this function only
 * once for each `colours`, which keeps the values. */
EBPO_MUST_USE ebpo_status ebpo_face_colours_read(ebpo_face_colours *colours, ebpo_chunks *chunks,
                                                 const uint32_t *faces, const uint32_t *vertices,
                                                 uint64_t count, uint8_t *out, ebpo_error *error);

#endif
