/* Corners of single faces by their numbers in the file: of a whole model from its blocks, of one in
 * parts through its cache of chunks. One thread. */
#ifndef EBPO_COLLIDE_FACES_BY_NUMBER_H
#define EBPO_COLLIDE_FACES_BY_NUMBER_H

#include "query/query_model.h"

typedef struct ebpo_faces_by_number {
    const ebpo_model *model;
    const uint32_t *slots;           /* of a whole model: face_slots.h; else NULL */
    ebpo_held_chunk faces, vertices; /* where the last ones were */
} ebpo_faces_by_number;

void ebpo_faces_by_number_begin(ebpo_faces_by_number *f, const ebpo_model *model,
                                const uint32_t *slots);
/* As in the file, exactly. The errors of reading. */
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_get(ebpo_faces_by_number *f, uint64_t face,
                                                   double out[3][3], ebpo_error *error);
/* Of a model in parts: a face's vertices, and a vertex, as in the file. */
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_corners(ebpo_faces_by_number *f, uint64_t face,
                                                       uint32_t out[3], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_vertex(ebpo_faces_by_number *f, uint64_t vertex,
                                                      double out[3], ebpo_error *error);
/* Lets go of what it holds; zero is fine. */
void ebpo_faces_by_number_end(ebpo_faces_by_number *f);

#endif
