/* Choosing the planes of an envelope: candidates and selections (selections.c), a leaf's planes
 * (leaf_planes.c), faces against cells (triangle_cell.c), the small hull (hull_directions.c), and
 * winding numbers at a cell's corners (corner_windings.c). */
#ifndef EBPO_CONSTRUCT_PLANES_H
#define EBPO_CONSTRUCT_PLANES_H

#include <stdint.h>

#include <ebpo/build.h>

#include "geometry/cells.h"
#include "geometry/polytope.h"

enum {
    /* a leaf, and a gray node below the first levels, adds at most this many to its parent's */
    EBPO_PLANES_MAX = 32,
    EBPO_PLANES_CANDIDATES = 512, /* and chooses among at most so many */
    /* the theses' selections, which start from the cell, choose no more: a byte counts them */
    EBPO_PLANES_STORED = 255
};

/* What reaches this far beyond a candidate plane, in cells, is cut off even when it has no volume.
 */
static const double ebpo_needle = 0.1;

/* A candidate: a normal (bits 0-19 of a plane code) and the support of the solid in the cell in
 * that direction: an upper bound of n . xi over it, in cell coordinates. `moved`: how far from its
 * face's plane that is, in the model's unit; the theses' selections only. */
typedef struct ebpo_candidate {
    uint32_t normal;
    double support, moved;
} ebpo_candidate;

/* What a selection is told of a node. */
typedef struct ebpo_choice {
    const ebpo_candidate *candidates; /* normals differ */
    int count, most;                  /* candidates; codes that may be taken */
    /* inherit: volume that no candidate can remove, in cells (0: not known) */
    double core;
    /* inherit: a plane removes at least this share of the cell, or cuts off what reaches farther
     * beyond it, in cells (0: whatever reaches) */
    double epsilon, reach;
    int wanted;              /* the theses': so many of the candidates */
    const double *cell_size; /* [3] cell coordinates to the model's unit */
    ebpo_normal_distance normals;
    uint64_t seed; /* of this node */
} ebpo_choice;

/* A selection: takes planes from the candidates, clips `envelope` by them and writes their codes;
 * returns how many, -1: out of memory. Adding one: CONTRIBUTING.md, "A new plane selection". Codes
 * may come in any order; the count of candidates is at most EBPO_PLANES_CANDIDATES from the root
 * down, anything from the leaves up. */
typedef int (*ebpo_select_fn)(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* With from_leaves (ebpo_selection_describe) nodes come after their children, each from its cell
 * alone (EBP 2017, 3.4.1); else from the root down, each from its parent's envelope. NULL for what
 * is none. */
ebpo_select_fn ebpo_selection_function(ebpo_selection selection);

/* Greedy by removed volume, lazily re-evaluated, until the gain falls below epsilon * cell volume.
 */
int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* How many of `count` candidates: `percent` of them, rounded up (EBP 2017, equation 5); or, with
 * k_root > 0, BP's K: k_root / 2^level, halved on while it is not below `count` (2008, 3.5.1); all
 * of them where that is below 1 to begin with (as there). EBPO_PLANES_STORED where it would be
 * more: what cannot be stored must not be chosen, or the clusters of what is stored are not the
 * best ones. */
int ebpo_selection_wanted(int count, int level, double percent, double k_root);

/* Every candidate that may remove 0.03 % of the cell or more, deepest cut first, then needles:
 * nearly the tightest envelope, and with few candidates the cheapest to find. */
int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, int most,
                    uint32_t *codes);

/* A face as its three corners, in the model's coordinates. */
typedef struct ebpo_triangle {
    double corner[3][3];
} ebpo_triangle;

/* Points of face ∩ cell's extreme points in cell coordinates (polygon corners, at most 9), and an
 * error bound: the exact intersection lies within `*slack` (cell units, each axis) of the polygon's
 * hull. Returns the number of points; 0 when they do not meet. The cell is widened by the slack
 * before clipping, so that a face touching the closed cell always gives points. */
int ebpo_clip_triangle(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                       double points[9][3], double *slack);

/* True when the face certainly does not touch the closed cell; errs on the side of "may touch". */
bool ebpo_triangle_misses_cell(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face);

/* Normal part of the plane code for a face, in cell coordinates of this root box; false for a face
 * without area. */
bool ebpo_face_normal_code(const ebpo_box *box, const ebpo_triangle *face, uint32_t *normal);

/* Winding numbers of the cell's eight corners (bit 0 x, bit 1 y, bit 2 z; shifted, see
 * ebpo_axis_crossing) minus that of corner 0. `faces` must hold every face that touches the closed
 * cell. Exact. */
void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, int32_t delta[8]);

/* A leaf's own planes from its faces: on entry `envelope` is the parent's envelope cut to this
 * cell, on return the leaf's. `inside_corners`: bit i set when corner i lies in the solid;
 * `epsilon` > 0: greedy selection, for planes that will be stored; 0: ebpo_select_all, for planes
 * that are derived and cost no byte. Writes at most EBPO_PLANES_MAX codes and returns how many. EBP
 * 2017, section 3.4. */
int ebpo_leaf_planes(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                     uint64_t count, unsigned inside_corners, double epsilon,
                     ebpo_polytope *envelope, uint32_t codes[EBPO_PLANES_MAX]);

/* --- a small convex hull, for directions only: errors cost volume, never containment --- */

enum { EBPO_HULL_POINTS = 8192, EBPO_HULL_FACETS = 2048 };

typedef struct ebpo_hull_facet {
    uint16_t corner[3]; /* of the points, counter-clockwise seen from outside */
    double n[3], d;     /* unit normal outward: n . x <= d for the hull */
    double area;
} ebpo_hull_facet;

/* Triangles of the hull of points [count], at most EBPO_HULL_POINTS of them, of the order of 1;
 * returns how many, 0 when the points lie (nearly) in a plane. `facets` has room for `capacity`; a
 * hull of n points has 2 n - 4, but rounding may make more of them, and what does not fit is left
 * out. Points nearer than `tolerance` (1e-9 at least, or rounding makes facets) to the hull found
 * so far are left out. */
int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity);

/* For qsort: largest first; facets of equal area by their corners, so that the order is the same
 * everywhere. */
int ebpo_hull_by_area(const void *a, const void *b);

#endif
