/* Chooses the planes of an envelope: candidates and selections (selections.c), a leaf's planes
 * (leaf_planes.c), faces against cells (triangle_cell.c), the small hull (hull_directions.c), and
 * winding numbers at a cell's corners (corner_windings.c). */
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
    /* maximum number of planes that the selections of the theses choose, which start from the
     * cell: a byte counts the planes */
    EBPO_PLANES_STORED = 255
};

/* Parts of a solid that extend this far beyond a candidate plane, in cells, are cut off even
 * without volume. */
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
    /* random: [count] the candidates in the node's order, that of its faces or of its children;
     * NULL: as they are */
    const int *order;
    int most; /* maximum number of codes */
    /* inherit: volume that no candidate can remove, in cells (0: not known) */
    double core;
    double epsilon; /* inherit: a plane must remove at least this share of the cell, */
    /* or cut off a part that extends beyond the plane by more than this, in cells (0: any part) */
    double reach;
    int wanted;              /* selections of the theses: number of candidates to choose */
    const double *cell_size; /* [3] cell coordinates to the model's unit */
    ebpo_normal_distance normals;
    uint64_t seed; /* seed of this node */
} ebpo_choice;

/* A selection: takes planes from the candidates, clips `envelope` by them and writes their codes;
 * returns their number, or -1 when out of memory. Adding one: CONTRIBUTING.md, "A new plane
 * selection". Codes may come in any order. From the root down, there are at most
 * EBPO_PLANES_CANDIDATES candidates; from the leaves up any number. */
typedef int (*ebpo_select_fn)(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns the function of a selection, NULL if invalid. If from_leaves is true
 * (ebpo_selection_describe), a node comes after its children and its selection starts from its cell
 * (EBP 2017, 3.4.1). Otherwise nodes come from the root down, and the selection of a node starts
 * from its parent's envelope. */
ebpo_select_fn ebpo_selection_function(ebpo_selection selection);

/* Sets chosen[i] for the candidates that a selection of the theses takes, whatever they cut.
 * Candidates may have equal normals. Returns false when out of memory. */
bool ebpo_choose_candidates(ebpo_selection selection, const ebpo_choice *choice, bool *chosen);

/* Selects greedily by removed volume, lazily re-evaluated, until the gain falls below epsilon *
 * cell volume. */
int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns how many of `count` candidates the theses choose: `percent` of the candidates, rounded up
 * (EBP 2017, equation 5). With k_root > 0, it is K of BP (2008, 3.5.1): k_root / 2^level, halved
 * until K is below `count`; as in BP, all candidates if k_root / 2^level is below 1. */
int ebpo_selection_requested(int count, int level, double percent, double k_root);

/* Returns the same number, but at most EBPO_PLANES_STORED: more planes cannot be stored, and
 * clusters for more planes would not be the best clusters for the stored planes. */
int ebpo_selection_wanted(int count, int level, double percent, double k_root);

/* Selects every candidate that may remove 0.03 % of the cell or more, deepest cut first, then
 * needles: nearly the tightest envelope, and with few candidates the fastest to find. */
int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count, int most,
                    uint32_t *codes);

/* A face as its three corners, in the model's coordinates. */
typedef struct ebpo_triangle {
    double corner[3][3];
} ebpo_triangle;

/* Returns the number of extreme points of face ∩ cell in cell coordinates (polygon corners, at most
 * 9), and an error bound: the exact intersection is within `*slack` (cell units, each axis) of the
 * polygon's hull. Returns 0 when they do not
 * intersect. The cell is enlarged by the slack before clipping, so
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
 * cell, on return the leaf's. `inside_corners`: bit i set when corner i is in the solid; `epsilon`
 * > 0: greedy selection, for planes that will be stored; 0: ebpo_select_all, for planes that are
 * derived and cost no byte. Writes at most EBPO_PLANES_MAX codes and returns their number. EBP
 * 2017, section 3.3.4. */
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

/* Computes triangles of the hull of points [count], at most EBPO_HULL_POINTS of them, of the order
 * of 1; returns their number, 0 when the points are (nearly) in a plane. `facets` has space for
 * `capacity`; a hull of n points has 2 n - 4, but rounding may make more, and further ones are
 * omitted. Points nearer than `tolerance` (at least 1e-9, or rounding makes facets) to the hull
 * found so far are omitted. */
int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity);

/* Compares for qsort: largest first; facets of equal area by their corners, so that the order is
 * the same on all machines. */
int ebpo_hull_by_area(const void *a, const void *b);

#endif
