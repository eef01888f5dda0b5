/* Looks up the posed faces of pairs by their indices in the file, and computes the intersections of
 * crossing faces. */
#ifndef EBPO_COLLIDE_PAIR_FACES_H
#define EBPO_COLLIDE_PAIR_FACES_H

#include "extras/collide/collider.h"
#include "query/accel.h"
#include "query/query_model.h"

/* Returns an array that gives, for the local index of each face of a subtree, the face's slot (its
 * position in the blocks). In a model that is entirely in memory (a whole model, which is a single
 * subtree) the local index is the index in the file. Returns NULL if memory is short. The caller
 * frees the array. */
uint32_t *ebpo_face_slots(const ebpo_accel *subtree);

/* The look-up of single faces by their indices in the file, for one thread at a time. Faces of a
 * whole model are read from the model's blocks, faces of a partly loaded model through the model's
 * cache of chunks. */
typedef struct ebpo_faces_by_number {
    const ebpo_model *model;
    const uint32_t *slots;           /* whole model: result of ebpo_face_slots; otherwise NULL */
    ebpo_held_chunk faces, vertices; /* partly loaded model: the chunks that were used last */
} ebpo_faces_by_number;

/* Begins the look-up. model, slots: as in the struct; both must live as long as `f`. */
void ebpo_faces_by_number_begin(ebpo_faces_by_number *f, const ebpo_model *model,
                                const uint32_t *slots);
/* Sets `out` to the corners of a face, exactly as in the file. Fails with the errors of reading. */
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_get(ebpo_faces_by_number *f, uint64_t face,
                                                   double out[3][3], ebpo_error *error);
/* For a partly loaded model: sets `out` to the vertex indices of a face, as in the file. */
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_corners(ebpo_faces_by_number *f, uint64_t face,
                                                       uint32_t out[3], ebpo_error *error);
/* For a partly loaded model: sets `out` to the coordinates of a vertex, as in the file. */
EBPO_MUST_USE ebpo_status ebpo_faces_by_number_vertex(ebpo_faces_by_number *f, uint64_t vertex,
                                                      double out[3], ebpo_error *error);
/* Releases the chunks that `f` holds; a zero struct is allowed. */
void ebpo_faces_by_number_end(ebpo_faces_by_number *f);

/* The corners of a pair's faces. Index [0]: the face of the caller's A; [1]: the face of B. */
typedef struct ebpo_posed_pair {
    double unposed[2][3][3]; /* as in the files */
    double corner[2][3][3];  /* at the poses */
} ebpo_posed_pair;

/* The look-up of the faces of a query's pairs. */
typedef struct ebpo_pair_faces {
    const ebpo_collision *collision; /* the query */
    ebpo_faces_by_number side[2];    /* faces of the caller's A and B */
} ebpo_pair_faces;

/* Prepares the look-up of faces. The caller must call ebpo_pair_faces_end, even after a failure;
 * ebpo_pair_faces_end also accepts a zero struct. */
EBPO_MUST_USE ebpo_status ebpo_pair_faces_begin(ebpo_pair_faces *f, const ebpo_collision *collision,
                                                ebpo_error *error);
void ebpo_pair_faces_end(ebpo_pair_faces *f);

/* Looks up the faces of a pair and poses them. Fails with the errors of reading. */
EBPO_MUST_USE ebpo_status ebpo_pose_pair(ebpo_pair_faces *f, const ebpo_face_pair *pair,
                                         ebpo_posed_pair *out, ebpo_error *error);

/* Returns the greatest number of crossing pairs for which the memory of ebpo_collide_polylines is
 * sufficient. */
uint64_t ebpo_contact_lines_max(const ebpo_collider *collider);

/* Computes the common segment of a pair of kind EBPO_PAIR_CROSSING, whose faces are `faces`. */
void ebpo_contact_of(const ebpo_posed_pair *faces, const ebpo_face_pair *pair,
                     ebpo_contact_segment *out);

#endif
