/* The pieces that bound.c searches: a stack, and how a piece is cut. */
#ifndef EBPO_DEVIATION_PIECES_H
#define EBPO_DEVIATION_PIECES_H

#include "deviation/bound.h"

#define EBPO_PIECE_LEAST 1e-6 /* pieces are not cut below this, in sides of the cell */

typedef enum ebpo_piece_kind {
    EBPO_PIECE_GRAY, /* the part in a gray node's cell */
    EBPO_PIECE_LEAF, /* within a leaf's: its faces that may meet the piece are known */
    /* in a white cell, or cut off from all faces, or of a surface, which has no inside */
    EBPO_PIECE_OUT
} ebpo_piece_kind;

struct ebpo_piece {
    ebpo_piece_kind kind;
    double upper;
    ebpo_tree_place place; /* GRAY, LEAF */
    int levels;            /* GRAY, LEAF: of the cell below the node's */
    /* GRAY, LEAF: every point of the piece is at most so far from that cell */
    double beyond;
    uint64_t face_first, face_count; /* LEAF */
    ebpo_polytope p;
};

/* What is known of a piece. */
typedef struct ebpo_look {
    double centre[3], reach; /* all of the piece is within reach of the centre */
    double distance;         /* of the centre; negative inside */
    double upper;
    double face[3][3]; /* the nearest one, in the model's unit */
} ebpo_look;

/* The new piece is valid until the next call. Its polytope is not set. */
EBPO_MUST_USE ebpo_status ebpo_piece_push(ebpo_bounder *b, ebpo_piece_kind kind,
                                          const ebpo_piece *parent, ebpo_piece **out);

/* A leaf's faces, as the first ones of its piece. */
EBPO_MUST_USE ebpo_status ebpo_piece_leaf_faces(ebpo_bounder *b, ebpo_piece *piece,
                                                const ebpo_tree_place *leaf);

/* Puts the parts of a piece, which is no longer on the stack, there, or settles them. */
EBPO_MUST_USE ebpo_status ebpo_piece_cut(ebpo_bounder *b, const ebpo_piece *piece,
                                         const ebpo_look *l);

/* Nothing of some piece reaches farther than `upper`. */
static inline void ebpo_bound_settle(ebpo_bounder *b, double upper)
{
    b->hi = b->hi < upper ? upper : b->hi;
}

#endif
