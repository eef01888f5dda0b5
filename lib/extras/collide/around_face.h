/* Finds, exactly, which sides of a posed face are in the interior of each of two models. Other
 * faces cut the face into pieces (face_pieces.h), and each piece has separate results. An
 * ebpo_two_models may be used by one thread at a time. */
#ifndef EBPO_COLLIDE_AROUND_FACE_H
#define EBPO_COLLIDE_AROUND_FACE_H

#include "extras/collide/pair_faces.h"
#include "extras/collide/face_pieces.h"
#include "extras/collide/posed_solid.h"

/* Both models of a query, in the query's order. */
typedef struct ebpo_two_models {
    ebpo_posed_solid model[2];
    ebpo_context *context[2];       /* contexts for queries of the models */
    ebpo_faces_by_number *faces[2]; /* the look-up of single faces */
    bool solid[2];                  /* false: the model is a surface, which has no interior */
    ebpo_rule rule[2];              /* which winding numbers are inside the solid */
    ebpo_face_cuts pieces;          /* cuts of the examined face */
    ebpo_face_cuts others;          /* cuts of another face, which contains a vertex of the examined
                                     * face's pieces */
} ebpo_two_models;

/* Prepares both models of the query lookup->collision. `two` reads faces through `lookup`, which
 * must live longer. Fails with the errors of ebpo_posed_solid_make and ebpo_context_new. */
EBPO_MUST_USE ebpo_status ebpo_two_models_begin(ebpo_two_models *two, ebpo_pair_faces *lookup,
                                                ebpo_error *error);
/* Releases the memory of loaded subtrees. The next query loads them again. */
void ebpo_two_models_let_go(ebpo_two_models *two);
/* Returns the number of subtrees that `two` has loaded. */
uint64_t ebpo_two_models_loads(const ebpo_two_models *two);
/* Frees the members of `two`; a zero struct is allowed. */
void ebpo_two_models_end(ebpo_two_models *two);

/* Sides of a face: its normal points to the front. */
enum { EBPO_SIDE_FRONT = 1, EBPO_SIDE_BACK = 2, EBPO_SIDE_BOTH = 3 };

/* The sides of a piece of a face. */
typedef struct ebpo_around {
    /* [model] bits of the sides of the piece that are in the interior of the solid. For a surface:
     * EBPO_SIDE_BOTH if the surface contains the piece, otherwise 0. */
    unsigned in[2];
} ebpo_around;

/* Called for each piece. Returns false to stop; ebpo_visit_around_face then returns EBPO_OK. */
typedef bool (*ebpo_around_fn)(void *user, const ebpo_around *around);

/* Sets `out` to the posed corners of a face of model m (0 or 1). face: the face's index in the
 * file. *has_area is false if the corners are on one line. */
EBPO_MUST_USE ebpo_status ebpo_two_models_face(const ebpo_two_models *two, int m, uint64_t face,
                                               double out[3][3], bool *has_area, ebpo_error *error);

/* Visits every piece of a face of model m. face: the face's index in the file. A face without area
 * has no pieces. */
EBPO_MUST_USE ebpo_status ebpo_visit_around_face(ebpo_two_models *two, int m, uint64_t face,
                                                 ebpo_around_fn visit, void *user,
                                                 ebpo_error *error);

/* Sets *has to true if the face of model m has a point that belongs to both models. A solid
 * includes its boundary. */
EBPO_MUST_USE ebpo_status ebpo_face_has_common_point(ebpo_two_models *two, int m, uint64_t face,
                                                     bool *has, ebpo_error *error);

#endif
