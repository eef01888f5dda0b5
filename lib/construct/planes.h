/* Declares functions for choosing the planes of an envelope: selections from candidates
 * (selections.c), a leaf's planes (leaf_planes.c), tests of faces against cells (triangle_cell.c),
 * a small convex hull (hull_directions.c), and winding numbers at a cell's corners
 * (corner_windings.c). Lengths and volumes are in cells: the side and the volume of the node's cell
 * are 1. */
#ifndef EBPO_CONSTRUCT_PLANES_H
#define EBPO_CONSTRUCT_PLANES_H

#include <stdint.h>

#include <ebpo/build.h>

#include "geometry/cells.h"
#include "geometry/polytope.h"

enum {
    /* maximum number of planes that a leaf, or a gray node deeper than the first levels, adds to
     * the planes of its parent */
    EBPO_PLANES_MAX = 32,
    /* maximum number of candidates of a node, if planes are chosen from the root down */
    EBPO_PLANES_CANDIDATES = 512,
    /* maximum number of planes of a node in a file, which stores this number in a byte; also the
     * maximum number of planes that the selections of the theses choose */
    EBPO_PLANES_STORED = 255
};

/* A needle is a long, thin portion of an envelope. If the envelope extends more than this distance
 * (in cells) beyond a plane, the plane is stored, even if it cuts off only a small volume. */
static const double ebpo_needle = 0.1;

/* A candidate for a plane of the envelope. */
typedef struct ebpo_candidate {
    uint32_t normal; /* bits 0-19 of a plane code, which give the normal n */
    /* upper bound of n . x over the points x of the solid in the cell, in cell coordinates (0 to 1)
     */
    double support;
    /* selections of the theses: distance by which the plane was moved away from its face, in the
     * model's unit */
    double moved;
} ebpo_candidate;

/* Input of a selection for a node. */
typedef struct ebpo_choice {
    const ebpo_candidate *candidates; /* [count] no two have the same normal */
    int count;                        /* number of candidates */
    /* random selection: [count] indices of the candidates, in the order of the node's faces or
     * children; NULL: the order of `candidates` */
    const int *order;
    int codes_max; /* maximum number of plane codes that the selection writes */
    /* greedy selection: volume of the solid's hull, which no candidate can remove; 0: not known */
    double hull_volume;
    /* greedy selection: a plane must remove at least the volume `epsilon`, or the envelope must
     * extend more than `needle_length` beyond the plane (0: only volume counts) */
    double epsilon, needle_length;
    int wanted; /* selections of the theses: number of candidates to choose */
    /* k-medoids selection: [3] size of the cell, in the model's unit; `normals`: the distance
     * between two normals */
    const double *cell_size;
    ebpo_normal_distance normals;
    uint64_t seed; /* selections with random choices: seed of this node */
} ebpo_choice;

/* A selection: takes planes from the candidates, clips `envelope` by these planes and writes their
 * codes, in any order. Returns the number of codes, or -1 when out of memory. If nodes are
 * processed from the root down, there are at most EBPO_PLANES_CANDIDATES candidates; if they are
 * processed from the leaves up, any number. CONTRIBUTING.md, "A new plane selection", describes how
 * to add a selection. */
typedef int (*ebpo_select_fn)(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns the function of a selection, or NULL if `selection` is not a value of ebpo_selection. If
 * ebpo_selection_traits.from_leaves is true, a node is processed after its children, and `envelope`
 * is first the node's cell (EBP 2017, 3.4.1). If it is false, a node is processed after its parent,
 * and `envelope` is first the parent's envelope, cut to the cell. */
ebpo_select_fn ebpo_selection_function(ebpo_selection selection);

/* Sets chosen[i] to true if a selection of the theses takes candidate i, and to false otherwise.
 * The selection may take planes that cut nothing off. Candidates may have equal normals. Returns
 * false when out of memory. */
bool ebpo_choose_candidates(ebpo_selection selection, const ebpo_choice *choice, bool *chosen);

/* Selects, again and again, the plane that removes the most volume, until this volume is below
 * `epsilon`. Then selects planes that cut off needles. Returns the number of codes. */
int ebpo_select_greedy(ebpo_polytope *envelope, const ebpo_choice *choice, uint32_t *codes);

/* Returns how many of `count` candidates the theses choose: `percent` of them, rounded up (EBP
 * 2017, equation 5). If k_root > 0, the result is K of BP 2008, 3.5.1: k_root / 2^level, halved
 * until it is below `count`. As in BP 2008, all candidates are chosen if k_root / 2^level is below
 * 1. */
int ebpo_selection_requested(int count, int level, double percent, double k_root);

/* Returns the smaller of ebpo_selection_requested and EBPO_PLANES_STORED. A selection by clusters
 * must make no more clusters than planes can be stored: with more clusters, the stored planes would
 * not be the best ones. */
int ebpo_selection_wanted(int count, int level, double percent, double k_root);

/* Selects every candidate that may remove 0.03 % of the cell or more, the greatest volume first.
 * Then selects planes that cut off needles. Selects at most `codes_max` planes. The result is
 * nearly the tightest envelope. With few candidates, this selection takes the least time. Returns
 * the number of codes. */
int ebpo_select_all(ebpo_polytope *envelope, const ebpo_candidate *candidates, int count,
                    int codes_max, uint32_t *codes);

/* A face as its three corners, in the model's coordinates. */
typedef struct ebpo_triangle {
    double corner[3][3];
} ebpo_triangle;

/* Computes the corners, at most 9, of the polygon face ∩ cell, in cell coordinates. Returns their
 * number; 0 if face and cell do not intersect. On each axis, the distance of the exact intersection
 * from the polygon is at most *slack. The cell is enlarged by the slack before clipping, so that a
 * face that touches the closed cell always gives points. */
int ebpo_clip_triangle(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *face,
                       double points[9][3], double *slack);

/* Computes the normal of a face as bits 0 to 19 of a plane code, in coordinates of cells of this
 * root box. Returns false for a face without area. */
bool ebpo_face_normal_code(const ebpo_box *box, const ebpo_triangle *face, uint32_t *normal);

/* Computes the corner differences of a cell, exactly: the winding numbers at its eight corners
 * minus the winding number at corner 0. Bits 0, 1 and 2 of a corner's index are its position along
 * x, y and z. The corners are shifted by an infinitely small amount, as in ebpo_axis_crossing.
 * `faces` must contain every face that touches the closed cell. */
void ebpo_corner_windings(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                          uint64_t count, int32_t delta[8]);

/* Computes a leaf's planes from its faces (EBP 2017, 3.3.4). On entry, `envelope` is the parent's
 * envelope cut to the leaf's cell; on return, it is the leaf's envelope. `inside_corners`: bit i is
 * set if corner i is in the solid. If `epsilon` > 0, ebpo_select_greedy selects the planes, which
 * will be stored. If `epsilon` is 0, ebpo_select_all selects the planes; readers derive the same
 * planes, so they are not stored. Writes at most EBPO_PLANES_MAX codes, and returns their number.
 */
int ebpo_leaf_planes(const ebpo_box *box, ebpo_cell cell, const ebpo_triangle *faces,
                     uint64_t count, unsigned inside_corners, double epsilon,
                     ebpo_polytope *envelope, uint32_t codes[EBPO_PLANES_MAX]);

/* --- a small convex hull, for directions only: an error may enlarge an envelope, but the envelope
 * still contains the solid --- */

enum { EBPO_HULL_POINTS = 8192, EBPO_HULL_FACETS = 2048 };

typedef struct ebpo_hull_facet {
    uint16_t corner[3]; /* indices of points, counter-clockwise seen from outside */
    /* outward unit normal n, and offset d: n . x <= d for all points x of the hull */
    double n[3], d;
    double area;
} ebpo_hull_facet;

/* Computes the triangular facets of the hull of `count` points, at most EBPO_HULL_POINTS, with
 * coordinates of about 1. Returns the number of facets; 0 if the points are nearly in a plane. At
 * most `capacity` facets are made. (A hull of n points has at most 2 n - 4 facets, but rounding
 * errors may add some.) Points that are outside the hull found so far by less than `tolerance` are
 * omitted. With a tolerance below 1e-9, rounding errors would make additional facets. */
int ebpo_hull_facets(const double (*points)[3], int count, double tolerance,
                     ebpo_hull_facet *facets, int capacity);

/* Compares two facets for qsort: the facet with the larger area comes first. Facets of equal area
 * are ordered by their corners, so that the order is the same on all machines. */
int ebpo_hull_by_area(const void *a, const void *b);

#endif
