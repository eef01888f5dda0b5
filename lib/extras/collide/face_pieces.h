/* Computes the pieces into which other faces cut a face. Each piece is represented by an exact
 * point (with fractions as coordinates) that is on no cut. An ebpo_face_cuts may be used by one
 * thread at a time. */
#ifndef EBPO_COLLIDE_FACE_PIECES_H
#define EBPO_COLLIDE_FACE_PIECES_H

#include <gmp.h>
#include <stdbool.h>
#include <stdint.h>

#include <ebpo/base.h>

/* A cut: the segment in which another face intersects the cut face, projected along an axis to the
 * coordinates p and q. */
typedef struct ebpo_face_cut {
    mpq_t p[2], q[2]; /* both ends, p[0] <= p[1] */
    mpq_t slope;      /* dq / dp, for cuts with p[0] < p[1] */
} ebpo_face_cut;

/* Another face with an area, in the plane of the cut face. */
typedef struct ebpo_flat_face {
    double corner[3][3];
    int model;           /* 0 or 1: the model to which the face belongs */
    bool same_direction; /* its normal and the normal of the cut face have the same direction */
} ebpo_flat_face;

/* The interval of q that a piece has on the border between two strips. An event is a value of p at
 * which a cut begins, ends or crosses another cut. A strip is the part of the projection between
 * two neighbouring events. */
typedef struct ebpo_piece_border {
    mpq_t low, high;
} ebpo_piece_border;

/* The cuts of one face; its memory is reused for the next face. Zero before the first face. */
typedef struct ebpo_face_cuts {
    double corner[3][3];
    int axis, u, v;          /* the projection is along `axis`: p is coordinate u, q coordinate v */
    int turn;                /* orientation of the projected corners: 1 or -1 */
    mpq_t normal[3], offset; /* the face's plane: normal . x = offset */
    mpq_t scratch[8];        /* temporary values */
    bool made;               /* the GMP numbers of this struct are initialised */
    bool no_memory;          /* an allocation has failed since ebpo_face_cuts_begin */
    bool all_cuts;   /* also add cuts that only touch the face's border, and gather vertices */
    bool has_target; /* ebpo_piece.at_target is computed */
    mpq_t target[2]; /* p and q of the target (ebpo_face_cuts_target) */
    /* In each array, the first `..._made` items are initialised; the first `cuts`, `events`, ...
     * items are used for the current face. */
    ebpo_face_cut *cut; /* the edges of the face, then cuts by other faces */
    uint64_t cuts, cuts_made, cut_capacity;
    mpq_t *event; /* values of p; between two neighbouring values no cut begins, ends or crosses
                   * another cut */
    uint64_t events, events_made, event_capacity;
    mpq_t (*vertex)[2]; /* with all_cuts: p and q of the ends of cuts and of their intersections */
    uint64_t vertices, vertices_made, vertex_capacity;
    ebpo_flat_face *flat; /* other faces in the plane of the face */
    uint64_t flats, flat_capacity;
    mpq_t *value; /* three values of q for each cut, at three positions in a strip */
    uint64_t values_made, value_capacity;
    uint32_t *order; /* indices of the cuts of a strip, sorted by q */
    uint64_t order_capacity;
    ebpo_piece_border *border[2]; /* right borders of the parts of the current strip and of the
                                   * previous strip, alternately */
    uint64_t borders[2], borders_made[2], border_capacity[2];
} ebpo_face_cuts;

/* Begins a new face, which must have an area. all_cuts: as in ebpo_face_cuts. */
void ebpo_face_cuts_begin(ebpo_face_cuts *f, const double corner[3][3], bool all_cuts);
/* Adds the cut that the face `other` of model 0 or 1 makes. Does nothing if both faces do not
 * intersect, or if `other` has no area. */
void ebpo_face_cuts_add(ebpo_face_cuts *f, const double other[3][3], int model);
/* Sets the target, a point x: ebpo_piece.at_target reports which pieces contain the target. Needs
 * all_cuts. Returns false if x is not on the face. */
bool ebpo_face_cuts_target(ebpo_face_cuts *f, const mpq_t x[3]);
/* Frees the memory; a zero struct is allowed. */
void ebpo_face_cuts_free(ebpo_face_cuts *f);

/* --- pieces --- */

/* A point of a piece, and the contribution of other faces in the plane of the cut face to the
 * winding numbers at this point. */
typedef struct ebpo_piece {
    const mpq_t *x; /* [3] the point */
    /* [model] at least one other face of the model is in the plane and contains the point */
    bool covered[2];
    /* [model] the contribution of all these other faces to the winding number behind the cut face,
     * minus their contribution in front of the cut face (the normal points to the front) */
    int32_t jump[2];
    bool at_target; /* the target is in the piece or on its border */
} ebpo_piece;

/* Visits a piece. Returns an error to end the visits. */
typedef ebpo_status (*ebpo_piece_fn)(void *user, const ebpo_piece *piece, ebpo_error *error);

/* Calls `visit` for a point of each piece. A piece may be visited at several points, and with
 * all_cuts it is visited in each strip. Fails with EBPO_E_MEMORY and the errors of `visit`. */
EBPO_MUST_USE ebpo_status ebpo_face_pieces_visit(ebpo_face_cuts *f, ebpo_piece_fn visit, void *user,
                                                 ebpo_error *error);
/* Visits a vertex. Returns an error to end the visits. */
typedef ebpo_status (*ebpo_vertex_fn)(void *user, const mpq_t x[3], ebpo_error *error);
/* Visits the points of the face and of its border that are corners, ends of cuts or intersections
 * of two cuts (vertices); some vertices are visited repeatedly. Needs all_cuts. Afterwards `f` must
 * not be used until ebpo_face_cuts_begin. */
EBPO_MUST_USE ebpo_status ebpo_face_pieces_vertices(ebpo_face_cuts *f, ebpo_vertex_fn visit,
                                                    void *user, ebpo_error *error);

#endif
