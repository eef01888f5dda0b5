/* The pieces that bound.c searches: a stack, and how a piece is cut. */
#ifndef EBPO_DERIVE_FRAGMENTS_H
#define EBPO_DERIVE_FRAGMENTS_H

#include "derive/bounder.h"

#define EBPO_FRAGMENT_LEAST 1e-6 /* pieces are not cut below this, in sides of the cell */

typedef enum ebpo_fragment_kind {
    EBPO_FRAGMENT_GRAY, /* the part in a gray node's cell */
    EBPO_FRAGMENT_LEAF, /* within a leaf's: its faces that may meet the piece are known */
    /* in a white cell, or cut off from all faces, or of a surface, which has no inside */
    EBPO_FRAGMENT_OUTSIDE
} ebpo_fragment_kind;

struct ebpo_fragment {
    ebpo_fragment_kind kind;
    double upper;
    ebpo_node node; /* GRAY, LEAF */
    int levels;     /* GRAY, LEAF: of the cell below the node's */
    /* GRAY, LEAF: every point of the piece is at most so far from that cell */
    double beyond;
    uint64_t face_first, face_count; /* LEAF */
    ebpo_polytope p;
};

/* What is known of a piece. */
typedef struct ebpo_fragment_measure {
    double centre[3], reach; /* all of the piece is within reach of the centre */
    double distance;         /* of the centre; negative inside */
    double upper;
    double face[3][3]; /* the nearest one, in the model's unit */
} ebpo_fragment_measure;

/* The new piece is valid until the next call. Its polytope is not set. */
EBPO_MUST_USE ebpo_status ebpo_fragment_push(ebpo_bounder *b, ebpo_fragment_kind kind,
                                             const ebpo_fragment *parent, ebpo_fragment **out);

/* A leaf's faces, as the first ones of its piece. */
EBPO_MUST_USE ebpo_status ebpo_fragment_leaf_faces(ebpo_bounder *b, ebpo_fragment *fragment,
                                                   const ebpo_node *leaf);

/* Puts the parts of a piece, which is no longer on the stack, there, or decides them. */
EBPO_MUST_USE ebpo_status ebpo_fragment_cut(ebpo_bounder *b, const ebpo_fragment *fragment,
                                            const ebpo_fragment_measure *l);

/* Nothing of some piece reaches farther than `upper`. */
static inline void ebpo_bound_raise(ebpo_bounder *b, double upper)
{
    b->hi = b->hi < upper ? upper : b->hi;
}

#endif
