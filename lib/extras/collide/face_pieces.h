/* Computes the pieces of a face that other faces cut, exactly: a point of each, in fractions, on
 * none of the cuts. One thread. */
#ifndef EBPO_COLLIDE_FACE_PIECES_H
#define EBPO_COLLIDE_FACE_PIECES_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>

/* A cut in the view along an axis: p[0] <= p[1]. */
typedef struct ebpo_face_cut {
    mpq_t p[2], q[2], slope; /* slope: dq / dp, for cuts with p[0] < p[1] */
} ebpo_face_cut;

/* Another face with an area in the same plane. */
typedef struct ebpo_flat_face {
    double corner[3][3];
    int model;
    bool same_way; /* its normal has the direction of the face's normal */
} ebpo_flat_face;

/* The bounds of a piece in a strip between two neighbouring events, at the strip's right end. */
typedef struct ebpo_piece_end {
    mpq_t low, high;
} ebpo_piece_end;

/* State of one face; arrays are reused for the next. Zero at first. */
typedef struct ebpo_face_cuts {
    double corner[3][3];
    int axis, u, v;          /* the view is along `axis`: p is coordinate u, q coordinate v */
    int turn;                /* orientation of the corners in this view */
    mpq_t normal[3], offset; /* normal . x = offset */
    mpq_t scratch[8];
    bool made, no_memory;
    bool all_cuts; /* includes cuts that only touch the face's border */
    bool has_target;
    mpq_t target[2]; /* point for which pieces are distinguished */
    ebpo_face_cut *cut;
    uint64_t cuts, cuts_made, cut_capacity;
    mpq_t *event; /* values of p between which no cut begins, ends or crosses */
    uint64_t events, events_made, event_capacity;
    mpq_t (*vertex)[2]; /* with all_cuts: ends of cuts and their intersections */
    uint64_t vertices, vertices_made, vertex_capacity;
    ebpo_flat_face *flat;
    uint64_t flats, flat_capacity;
    mpq_t *value; /* values of q, at three positions, for each cut */
    uint64_t values_made, value_capacity;
    uint32_t *order;
    uint64_t order_capacity;
    ebpo_piece_end *end[2]; /* of this strip and the one before */
    uint64_t ends[2], ends_made[2], end_capacity[2];
} ebpo_face_cuts;

/* Begins a face with an area. */
void ebpo_face_cuts_begin(ebpo_face_cuts *f, const double corner[3][3], bool all_cuts);
/* Adds another face, of model 0 or 1. */
void ebpo_face_cuts_add(ebpo_face_cuts *f, const double other[3][3], int model);
/* Sets a target; needs all cuts. Returns false if x is not on the face. Otherwise each piece says
 * if it contains x. */
bool ebpo_face_cuts_target(ebpo_face_cuts *f, const mpq_t x[3]);
void ebpo_face_cuts_free(ebpo_face_cuts *f);

/* --- pieces --- */

/* Surroundings of a piece's point. */
typedef struct ebpo_piece {
    const mpq_t *x; /* [3] */
    /* For each model: faces of it in the face's plane at the point (not the face itself), and their
     * share of the winding number behind the face less the one in front, where its normal points
     * to. */
    bool covered[2];
    int32_t jump[2];
    bool at_target; /* the target is in the piece or on its border */
} ebpo_piece;

typedef ebpo_status (*ebpo_piece_fn)(void *user, const ebpo_piece *piece, ebpo_error *error);

/* Calls `visit` for a point of each piece; some pieces (with all cuts, all pieces) may have several
 * points. Fails with EBPO_E_MEMORY and the errors of `visit`. */
EBPO_MUST_USE ebpo_status ebpo_face_pieces_visit(ebpo_face_cuts *f, ebpo_piece_fn visit, void *user,
                                                 ebpo_error *error);
/* With all cuts: visits the corners, ends of cuts and intersections of two, on the closed face;
 * some repeatedly. Uses up the state. */
typedef ebpo_status (*ebpo_vertex_fn)(void *user, const mpq_t x[3], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_face_pieces_vertices(ebpo_face_cuts *f, ebpo_vertex_fn visit,
                                                    void *user, ebpo_error *error);

#endif
