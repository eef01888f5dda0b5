/* Declares what the searches for error bounds share (error_bound.c, level_error_bound.c). An error
 * bound is an upper bound of the distance by which an envelope extends beyond the model. The
 * envelope of a node is a convex polyhedron that contains the part of the solid in the node's cell.
 * Gray nodes have children, and leaves list faces. This header declares the frame of a node (its
 * cell with a unit of length), fragments (the convex parts into which an envelope is cut), the
 * trees of files, and the state of a search. */
#ifndef EBPO_DERIVE_FRAGMENTS_H
#define EBPO_DERIVE_FRAGMENTS_H

#include <ebpo/query.h>

#include "geometry/cells.h"
#include "geometry/cursor.h"
#include "geometry/polytope.h"
#include "levels/lod.h"

/* The frame of a node: its cell, and a unit of length, which is a power of two near the cell's
 * longest side. In this unit, lengths neither overflow nor underflow. */
typedef struct ebpo_cell_frame {
    ebpo_cell cell;
    int exponent; /* the unit is 2^exponent in the model's unit */
    /* two factors with the product 2^-exponent, because the product may overflow */
    double factor[2];
    double low[3], high[3], size[3]; /* box of the cell, in the model's unit */
    double side[3];                  /* sides of the cell, in the frame's unit */
    /* bound of the rounding error of points and distances, in the frame's unit */
    double grain;
} ebpo_cell_frame;

void ebpo_cell_frame_make(ebpo_cell_frame *out, const ebpo_box *box, ebpo_cell cell);

/* Converts cell coordinates to the model's coordinates, with a rounding error below f->grain. */
void ebpo_cell_frame_point(const ebpo_cell_frame *f, const double xi[3], double out[3]);

/* Convert a length of the model to the frame's unit, and back (rounded up). INFINITY is not
 * changed. */
double ebpo_cell_frame_length(const ebpo_cell_frame *f, double length);
double ebpo_cell_frame_model_length(const ebpo_cell_frame *f, double length);

/* Returns an upper bound of the distance of two points. Points are in cell coordinates, the
 * distance is in the frame's unit. */
double ebpo_cell_frame_apart(const ebpo_cell_frame *f, const double a[3], const double b[3]);

/* Returns an upper bound of the distance between any point of a cell and a face that touches the
 * cell. The face may miss the cell by a rounding error (format-spec, section 7). The cell is
 * `levels` levels below the frame's cell. */
double ebpo_cell_frame_diagonal(const ebpo_cell_frame *f, int levels);

/* Returns an upper bound of the distance of a point (in cell coordinates) to a triangle of the
 * model, in the frame's unit. */
double ebpo_cell_frame_distance(const ebpo_cell_frame *f, const double xi[3],
                                const double triangle[3][3]);

/* Fragments of an envelope are convex polytopes in the cell coordinates of the node (0 to 1 on each
 * axis of the cell). Together they cover the envelope. After a cut, both parts extend a little
 * beyond the cut. */

/* Both parts extend beyond a cut by this width, in cell coordinates. If the normal of the cut has a
 * length of at least 1/sqrt(3), this width is more than the tolerance of ebpo_polytope_clip. */
#define EBPO_CUT_SLACK 4e-10

/* The box of a polytope, in cell coordinates. */
typedef struct ebpo_extent {
    double min[3], max[3];
} ebpo_extent;

void ebpo_extent_of(const ebpo_polytope *p, ebpo_extent *out);

/* If one of the two parts of a cut would be at most this wide, the fragment is not cut. The width
 * is less than a quarter of the smallest fragment that is cut, and more than the width of 1e-7 that
 * ebpo_polytope_clip refuses. */
#define EBPO_CUT_THIN 1.2e-7

/* --- trees: the levels of a file, with the faces of leaves ---
 *
 * A search reads two trees: the tree whose envelopes are bounded, and the tree of the whole model,
 * which determines the solid. Both trees may be the same tree. */

/* Reads all levels of a file. Fails with EBPO_E_ABSENT if the file has no mesh or is a subset. The
 * caller frees the result by ebpo_lod_model_free. */
EBPO_MUST_USE ebpo_status ebpo_tree_read_whole(ebpo_lod_model *out, const ebpo_file *file,
                                               unsigned threads, ebpo_error *error);

/* Finds the node of `cell`; returns false if there is none. */
bool ebpo_tree_find(const ebpo_lod_model *tree, ebpo_cell cell, ebpo_node *out);

/* Finds the node as ebpo_tree_find does. Also returns half-spaces in the coordinates of `cell`: the
 * half-spaces of the node's ancestors and, with `include_node`, the half-spaces that the file
 * stores for the node. */
bool ebpo_tree_bounds(const ebpo_lod_model *tree, ebpo_cell cell, bool include_node, ebpo_node *out,
                      ebpo_half_spaces *half_spaces);

/* Adds the half-spaces that ebpo_lod_level derives for a leaf of a file without stored leaf planes.
 */
EBPO_MUST_USE ebpo_status ebpo_tree_derive(const ebpo_lod_model *tree, const ebpo_node *leaf,
                                           ebpo_leaf_scratch *scratch,
                                           ebpo_half_spaces *half_spaces, ebpo_error *error);

/* --- state of one thread that bounds the error of an envelope --- */

typedef struct ebpo_fragment ebpo_fragment;

typedef struct ebpo_bounder {
    const ebpo_lod_model *model_tree; /* tree of the whole model, which determines the solid */
    ebpo_context *context;            /* context for distance queries of the same model */
    ebpo_leaf_scratch scratch;
    ebpo_half_spaces half_spaces; /* half-spaces of the envelope, in cell coordinates */
    ebpo_fragment *fragments;     /* a stack: fragments that are still to be examined */
    uint64_t fragment_capacity, fragment_count;
    /* a stack: the faces of the fragments within leaves, in the model's unit */
    double (*faces)[3][3];
    uint64_t face_capacity, face_count;
    /* The following members are for the search for the current node; lengths are in the frame's
     * unit. */
    ebpo_cell_frame frame;
    double target;      /* fragments with an upper bound of at most this are not examined further */
    double quit;        /* the search stops when `lo` is larger than this */
    double ratio;       /* `target` is at least `ratio` times `lo` */
    double lo, hi;      /* bounds found so far */
    double location[3]; /* point of the envelope whose distance gave `lo`, in the model's
                           coordinates */
    double inner[3];    /* a point near the envelope's middle, in cell coordinates */
    uint64_t queries;   /* number of distance queries for the current node */
    ebpo_error *error;
} ebpo_bounder;

/* --- the fragments that error_bound.c searches: a stack, and how a fragment is cut --- */

/* Fragments below this size, in the frame's unit, are not cut. */
#define EBPO_FRAGMENT_LEAST 1e-6

typedef enum ebpo_fragment_kind {
    EBPO_FRAGMENT_GRAY, /* the fragment is the whole part of the envelope in a gray node's cell */
    /* the fragment is in a leaf's cell, and lists those faces of the leaf that may intersect it */
    EBPO_FRAGMENT_LEAF,
    /* the fragment is outside the solid: in a white cell, or cut off from all faces. If the model
     * is a surface, which has no inside, also any other fragment without faces */
    EBPO_FRAGMENT_OUTSIDE
} ebpo_fragment_kind;

struct ebpo_fragment {
    ebpo_fragment_kind kind;
    double upper;   /* upper bound of the distance of the fragment's points */
    ebpo_node node; /* GRAY, LEAF: the node of the model's tree in whose cell the fragment is */
    int levels;     /* GRAY, LEAF: the number of levels of `node` below the node of the envelope */
    /* GRAY, LEAF: bound of the distance of the fragment's points from the cell of `node` */
    double beyond;
    uint64_t face_first, face_count; /* LEAF: the listed faces, in the stack of faces */
    ebpo_polytope p;
};

/* Measures of a fragment. */
typedef struct ebpo_fragment_measure {
    double centre[3], radius; /* every point of the fragment is within `radius` of the centre */
    double distance;          /* distance of the centre; negative inside */
    double upper;             /* upper bound of the distance of the fragment's points */
    double face[3][3];        /* the face nearest to the centre, in the model's unit */
} ebpo_fragment_measure;

/* Returns the kind of a fragment in the cell of a node of the model's tree that is not black. A
 * leaf without faces, which may be in a surface with holes, is like a white node: its points may be
 * far from all faces. */
ebpo_fragment_kind ebpo_fragment_kind_in(const ebpo_bounder *b, const ebpo_node *node);

/* Pushes a fragment onto the stack. The fragment gets the bounds of `parent`, the fragment from
 * which it was cut (NULL: no bounds). *out is valid until the next call; its polytope is not set.
 */
EBPO_MUST_USE ebpo_status ebpo_fragment_push(ebpo_bounder *b, ebpo_fragment_kind kind,
                                             const ebpo_fragment *parent, ebpo_fragment **out);

/* Sets the faces of a new fragment to all faces of its leaf. */
EBPO_MUST_USE ebpo_status ebpo_fragment_leaf_faces(ebpo_bounder *b, ebpo_fragment *fragment,
                                                   const ebpo_node *leaf);

/* Cuts a fragment, which the caller has popped from the stack, and pushes the parts. If no cut is
 * needed, the upper bound of the search becomes at least the fragment's upper bound. */
EBPO_MUST_USE ebpo_status ebpo_fragment_cut(ebpo_bounder *b, const ebpo_fragment *fragment,
                                            const ebpo_fragment_measure *measure);

/* Raises the upper bound of the search to `upper` if it is lower. `upper` is the upper bound of a
 * fragment that is not examined further. */
static inline void ebpo_bound_raise(ebpo_bounder *b, double upper)
{
    b->hi = b->hi < upper ? upper : b->hi;
}

#endif
