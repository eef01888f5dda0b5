/* Finds which models are on either side of the pieces of a posed face, for two models, exactly. One
 * thread. */
#ifndef EBPO_COLLIDE_AROUND_FACE_H
#define EBPO_COLLIDE_AROUND_FACE_H

#include "extras/collide/pair_faces.h"
#include "extras/collide/face_pieces.h"
#include "extras/collide/posed_solid.h"

/* Both models of a query, in the query's order. */
typedef struct ebpo_two_models {
    ebpo_posed_solid model[2];
    ebpo_context *context[2];
    ebpo_faces_by_number *faces[2];
    bool solid[2];
    ebpo_rule rule[2];
    ebpo_face_cuts pieces, /* cuts of the examined face */
        others;            /* cuts of faces around one of its vertices */
} ebpo_two_models;

/* Faces are looked up in `tables`, which must live longer than `two`. Fails with the errors of
 * posing and of contexts. */
EBPO_MUST_USE ebpo_status ebpo_two_models_begin(ebpo_two_models *two, ebpo_pair_faces *tables,
                                                ebpo_error *error);
/* Releases the memory of subtrees until the next query. */
void ebpo_two_models_release(ebpo_two_models *two);
/* Returns the number of subtrees that `two` has loaded. */
uint64_t ebpo_two_models_loads(const ebpo_two_models *two);
void ebpo_two_models_end(ebpo_two_models *two);

/* Sides of a face: in front, to which its normal points, and behind. */
enum { EBPO_SIDE_FRONT = 1, EBPO_SIDE_BACK = 2, EBPO_SIDE_BOTH = 3 };

/* A piece of a face. */
typedef struct ebpo_around {
    /* For each model: bits of the sides of the piece on which there is the model's interior. For a
     * surface: both sides if the surface contains the piece, else 0. */
    unsigned in[2];
} ebpo_around;

/* Returns false to stop the visits; the function that visits then succeeds. */
typedef bool (*ebpo_around_fn)(void *user, const ebpo_around *around);

/* Returns a face of model m at its pose. *has_area is false if the corners are on one line. */
EBPO_MUST_USE ebpo_status ebpo_two_models_face(const ebpo_two_models *two, int m, uint64_t face,
                                               double out[3][3], bool *has_area, ebpo_error *error);

/* Visits every piece of a face of model m; `face` is its number in the file. A face without area
 * has no pieces. */
EBPO_MUST_USE ebpo_status ebpo_visit_around_face(ebpo_two_models *two, int m, uint64_t face,
                                                 ebpo_around_fn visit, void *user,
                                                 ebpo_error *error);

/* Finds if a face of model m has a point that belongs to both models, as closed sets. */
EBPO_MUST_USE ebpo_status ebpo_face_has_common_point(ebpo_two_models *two, int m, uint64_t face,
                                                     bool *has, ebpo_error *error);

#endif
