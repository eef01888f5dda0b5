/* Functions that choose the planes of an envelope: selections from candidates (selections.c), a
 * leaf's planes (leaf_planes.c), tests of faces against cells (triangle_cell.c), a small convex
 * hull (hull_directions.c), and winding numbers at a cell's corners (corner_windings.c). */
#ifndef EBPO_CONSTRUCT_PLANES_H
#define EBPO_CONSTRUCT_PLANES_H

#include <stdint.h>

#include <ebpo/build.h>

#include "geometry/cells.h"
#include "geometry/polytope.h"

enum {
    /* maximum number of planes that a leaf, or a gray node below the first levels, adds to the
     * planes of its parent */
    EBPO_PLANES_MAX = 32,
    EBPO_PLANES_CANDIDATES = 512, /* maximum number of candidates of such a node */
    /* maximum number of planes that the selections of the theses choose, which start from the cell;
     * files store the number in a byte */
    EBPO_PLANES_STORED = 255
};

/* A plane that cuts off a part of the envelope is stored if the part extends at least this far
 * beyond the plane, in cells, however small its volume is. */
static const double ebpo_needle = 0.1;

/* A candidate for a plane of the envelope. */
typedef struct ebpo_candidate {
    uint32_t normal; /* bits 0-19 of a plane code */
    /* upper bound of n . xi over the solid in the cell, in cell coordinates */
    double support;
    /* distance of the candidate from the plane of its face, in the model's unit; only for the
     * selections of the theses */
    double moved;
} ebpo_candidate;

/* Input of a selection for a node. */
typedef struct ebpo_choice {
    const ebpo_candidate *candidates; /* [count] no two have the same normal */
    int count;                        /* number of candidates */
    /* for the random selection: [count] indices of the candidates, in the order of the node's faces
     * or children; NULL: in the order of the array */
    const int *order;
    int most; /* maximum number of codes */
    /* greedy selection: volume that no candidate can remove, in cells (0: not known) */
    double core;
    /* greedy selection: a plane must remove at least `epsilon` of the cell's volume, or cut off a
     * part that extends more than `reach` cells beyond the plane (0: only volume counts) */
    double epsilon, reach;
    int wanted;              /* selections of the theses: number of candidates to choose */
    const double *cell_size; /* [3] cell coordinates to the model's unit */
    ebpo_normal_distance normals;
    uint64_t seed; /* seed of this node */
} ebpo_choice;

/* A selection: takes planes from the candidates, clips `envelope` by these planes and writes their
 * codes. Returns the number of codes, or -1 when out of memory. CONTRIBUTING.md, "A new plane
 * selection", describes how to add a selection. Codes may come in any order. From the root down,
 * there are at most EBPO_PLANES_CANDIDATES candidates; from the leaves up any number. */
typedef int (*ebpo_select_fn)(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns the function of a selection, NULL if invalid. If from_leaves is true
 * (ebpo_selection_describe), a node comes after its children and its selection starts from its cell
 * (EBP 2017, 3.4.1). Otherwise nodes come from the root down, and the selection of a node starts
 * from its parent's envelope. */
ebpo_select_fn ebpo_selection_function(ebpo_selection selection);

/* Sets chosen[i] for the candidates that a selection of the theses takes, whatever they cut.
 * Candidates may have equal normals. Returns false when out of memory. */
bool ebpo_choose_candidates(ebpo_selection selection, const ebpo_choice *choice, bool *chosen);

/* Selects, again and again, the plane that removes the most volume, until the gain falls below
 * epsilon * cell volume. Gains are evaluated lazily. */
int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns how many of `count` candidates the theses choose: `percent` of the candidates, rounded up
 * (EBP 2017, equation 5). With k_root > 0, the number is K of BP (2008, 3.5.1): k_root / 2^level,
 * halved until K is below `count`. As in BP, all candidates are chosen if k_root / 2^level is below
 * 1. */
int ebpo_selection_requested(int count, int level, double percent, double k_root);

/* Returns the same number, but at most EBPO_PLANES_STORED: more planes cannot be stored, and
 * clusters for more planes would not be the best clusters for the stored planes. */
int ebpo_selection_wanted(int count, int level, double percent, double k_root);

/* Selects every candidate that may remove 0.03 % of the cell or more, deepest cut first, then
 * planes that cut off needles (selections.c). The result is nearly the tightest envelope, and
 * with few candidates this selection takes the least time. */
int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, int most,
                    uint32_t *codes);

/* A face as its three corners, in the model's coordinates. */
typedef struct ebpo_triangle {
    double corner[3][3];
} ebpo_triangle;

/* Computes the polygon face ∩ cell: its corners, at most 9, in cell coordinates. Returns their
 * number, 0 when face and cell do not intersect. The exact intersection is within `*slack` (cell
 * units, each axis) of the polygon's hull. The cell is enlarged by the slack before clipping, so
 * that a face touching the closed cell always gives points. */
int ebpo_clip_triangle(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                       double points[9][3], double *slack);

/* Returns true when the face certainly does not touch the closed cell; conservative. */
bool ebpo_triangle_misses_cell(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face);

/* Computes the normal part of the plane code for a face, in cell coordinates of this root box;
 * returns false for a face without area. */
bool ebpo_face_normal_code(const ebpo_box *box, const ebpo_triangle *face, uint32_t *normal);

/* Computes the winding numbers of the cell's eight corners (bit 0 x, bit 1 y, bit 2 z; shifted, see
 * ebpo_axis_crossing) minus that of corner 0. `faces` must contain every face that touches the
 * closed cell. Exact. */
void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, int32_t delta[8]);

/* Computes a leaf's planes from its faces: on entry `envelope` is the parent's envelope cut to this
 * cell, on return the leaf's. `inside_corners`: bit i is set when corner i is in the solid. With
 * `epsilon` > 0, the selection is greedy, for planes that will be stored. With 0, it is
 * ebpo_select_all, for planes that readers derive and that need no storage. Writes at most
 * EBPO_PLANES_MAX codes and returns their number. EBP 2017, section 3.3.4. */
int ebpo_leaf_planes(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                     uint64_t count, unsigned inside_corners, double epsilon,
                     ebpo_polytope *envelope, uint32_t codes[EBPO_PLANES_MAX]);

/* --- a small convex hull, for directions only: errors cost volume, never containment --- */

enum { EBPO_HULL_POINTS = 8192, EBPO_HULL_FACETS = 2048 };

typedef struct ebpo_hull_facet {
    uint16_t corner[3]; /* indices of points, counter-clockwise seen from outside */
    double n[3], d;     /* unit normal outward: n . x <= d for the hull */
    double area;
} ebpo_hull_facet;

/* Computes the triangular facets of the hull of `count` points, at most EBPO_HULL_POINTS, with
 * coordinates of the order of 1. Returns the number of facets, 0 when the points are (nearly) in a
 * plane. `facets` has space for `capacity` facets; more are omitted. A hull of n points has 2 n - 4
 * facets, but rounding may make more. Points nearer than `tolerance` to the hull found so far are
 * omitted; a tolerance below 1e-9 makes facets of rounding errors. */
int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity);

/* Compares for qsort: largest first; facets of equal area by their corners, so that the order is
 * the same on all machines. */
int ebpo_hull_by_area(const void *a, const void *b);

#endif
