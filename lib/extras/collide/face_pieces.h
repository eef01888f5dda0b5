/* Computes the pieces of a face that other faces cut. Exact: for each piece a point, in fractions,
 * that is on no cut. One thread. */
#ifndef EBPO_COLLIDE_FACE_PIECES_H
#define EBPO_COLLIDE_FACE_PIECES_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>

/* A cut, seen along an axis: p[0] <= p[1]. */
typedef struct ebpo_face_cut {
    mpq_t p[2], q[2], slope; /* slope: dq / dp, for cuts with p[0] < p[1] */
} ebpo_face_cut;

/* Another face with an area in the same plane. */
typedef struct ebpo_flat_face {
    double corner[3][3];
    int model;
    bool same_direction; /* its normal and the normal of the cut face have the same direction */
} ebpo_flat_face;

/* Bounds of a piece at the right end of a strip. A strip is the part of the view between two
 * neighbouring events. */
typedef struct ebpo_piece_end {
    mpq_t low, high;
} ebpo_piece_end;

/* State of one face; arrays are reused for the next. Zero at first. */
typedef struct ebpo_face_cuts {
    double corner[3][3];
    int axis, u, v;          /* the view is along `axis`: p is coordinate u, q coordinate v */
    int turn;                /* orientation of the corners in the view */
    mpq_t normal[3], offset; /* the face's plane: normal . x = offset */
    mpq_t scratch[8];
    bool made, no_memory;
    bool all_cuts; /* includes cuts that only touch the face's border */
    bool has_target;
    mpq_t target[2]; /* the point that pieces are tested to contain */
    ebpo_face_cut *cut;
    uint64_t cuts, cuts_made, cut_capacity;
    mpq_t *event; /* values of p between which no cut begins, ends or crosses */
    uint64_t events, events_made, event_capacity;
    mpq_t (*vertex)[2]; /* with all_cuts: ends of cuts and their intersections */
    uint64_t vertices, vertices_made, vertex_capacity;
    ebpo_flat_face *flat;
    uint64_t flats, flat_capacity;
    mpq_t *value; /* three values of q for each cut, at three positions */
    uint64_t values_made, value_capacity;
    uint32_t *order;
    uint64_t order_capacity;
    ebpo_piece_end *end[2]; /* of the current strip and the previous one */
    uint64_t ends[2], ends_made[2], end_capacity[2];
} ebpo_face_cuts;

/* Begins a new face, which must have an area. */
void ebpo_face_cuts_begin(ebpo_face_cuts *f, const double corner[3][3], bool all_cuts);
/* Adds another face, of model 0 or 1. */
void ebpo_face_cuts_add(ebpo_face_cuts *f, const double other[3][3], int model);
/* Sets a target; needs all_cuts. Returns false if x is not on the face. Otherwise at_target is set
 * for each piece that is visited later. */
bool ebpo_face_cuts_target(ebpo_face_cuts *f, const mpq_t x[3]);
void ebpo_face_cuts_free(ebpo_face_cuts *f);

/* --- pieces --- */

/* A point of a piece, and what is around it. */
typedef struct ebpo_piece {
    const mpq_t *x; /* [3] the point */
    /* The model's other faces that are in the face's plane at the point. `covered`: there is at
     * least one. `jump`: their contribution to the winding number behind the face, minus their
     * contribution in front (the normal points to the front). */
    bool covered[2];
    int32_t jump[2];
    bool at_target; /* the target is in the piece or on its border */
} ebpo_piece;

typedef ebpo_status (*ebpo_piece_fn)(void *user, const ebpo_piece *piece, ebpo_error *error);

/* Calls `visit` for a point of each piece; some pieces are visited at several points (with
 * all_cuts, any piece may be). Fails with EBPO_E_MEMORY and the errors of `visit`. */
EBPO_MUST_USE ebpo_status ebpo_face_pieces_visit(ebpo_face_cuts *f, ebpo_piece_fn visit, void *user,
                                                 ebpo_error *error);
/* Needs all_cuts. Visits the points of the closed face that are corners, ends of cuts or
 * intersections of two cuts; some of them repeatedly. Afterwards `f` must not be used until the
 * next begin. */
typedef ebpo_status (*ebpo_vertex_fn)(void *user, const mpq_t x[3], ebpo_error *error);
EBPO_MUST_USE ebpo_status ebpo_face_pieces_vertices(ebpo_face_cuts *f, ebpo_vertex_fn visit,
                                                    void *user, ebpo_error *error);

#endif
