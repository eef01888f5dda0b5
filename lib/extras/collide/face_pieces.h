/* The pieces of a face that has been cut by others, exact: a point of each, in fractions, on none
 * of the cuts. docs/develop/collision.md, "Relation of two models". One thread. */
#ifndef EBPO_COLLIDE_FACE_PIECES_H
#define EBPO_COLLIDE_FACE_PIECES_H

#include <ebpo/base.h>

#include "extras/collide/face_cuts.h"

/* Around a piece's point. */
typedef struct ebpo_piece {
    const mpq_t *x; /* [3] */
    /* Of each model: faces of it that lie there in the face's plane (not the face itself), and the
     * winding number behind the face less that before it, where its normal points to: by these. */
    bool covered[2];
    int32_t jump[2];
    bool at_target; /* the target is in the piece or on its border */
} ebpo_piece;

typedef ebpo_status (*ebpo_piece_fn)(void *user, const ebpo_piece *piece, ebpo_error *error);

/* Calls for a point of each piece; of some pieces (with all cuts of all) for several.
 * EBPO_E_MEMORY, and what `visit` returns. */
EBPO_MUST_USE ebpo_status ebpo_face_pieces_visit(ebpo_face_cuts *f, ebpo_piece_fn visit, void *user,
                                                 ebpo_error *error);
/* With all cuts: the corners, ends of cuts and where two meet, on the closed face; some of them
 * more than once. It is used up. */
typedef ebpo_status (*ebpo_vertex_fn)(void *user, const mpq_t x[3], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_face_pieces_vertices(ebpo_face_cuts *f, ebpo_vertex_fn visit,
                                                    void *user, ebpo_error *error);

#endif
